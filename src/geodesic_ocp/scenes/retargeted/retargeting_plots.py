"""Curves of a retargeting over time: how far the hand is off, its speed, joints."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.overview import widest_of_thirds
from geodesic_ocp.model.look import Indices
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.scenes.motions.joint_plots import HAND_SPEED, short_name
from geodesic_ocp.scenes.playback import Curve, Plot
from geodesic_ocp.scenes.retargeted.robot_pane import BASELINE, TARGET
from geodesic_ocp.synergies.scores import hand_speeds

_SYNERGIES = "geodesic synergies"
_MILLIMETRES = 1000.0
_UNITS = {"rad": "joint angle [rad]", "m": "prismatic joint [m]"}


def retargeting_plots(
    retargeting: Retargeting,
    shown: Indices,
    *,
    start: float = 0.0,
    name: bool = False,
    number: int = 1,
) -> tuple[Plot, ...]:
    """Distance of the hand from the person's, its speed, joints, and shares of speed limits.

    Args:
        retargeting: result of `retarget`.
        shown: indices of the samples that are drawn.
        start: of the motion in the playback's time [s].
        name: whether titles name the robot, although there is only one.
        number: of the retargeting among those of robots of this name; titles say it from 2 on.
    """
    time = retargeting.motion.time
    several = name or len(retargeting.arms) > 1
    plots: list[Plot] = []
    names = [arm.robot.name for arm in retargeting.arms]
    for arm in retargeting.arms:
        alike = names.count(arm.robot.name) > 1
        title = (arm.title if alike else arm.robot.name) if several else ""
        title += f" ({number})" if number > 1 else ""
        plots += _of_arm(arm, time[shown] - time[0] + start, shown, title)
    return tuple(plots)


def _of_arm(arm: RetargetedArm, time: Array, shown: Indices, title: str) -> Iterator[Plot]:
    robot, motions = arm.robot, {_SYNERGIES: arm.motion, BASELINE: arm.tracked}

    def both(values: dict[str, Array]) -> tuple[Curve, ...]:
        roles = {_SYNERGIES: "predicted", BASELINE: "baseline"}
        return tuple(
            Curve(label, time, each[shown], roles[label])  # type: ignore[arg-type]
            for label, each in values.items()
        )

    wanted = arm.target_poses[1]
    off = {
        label: _MILLIMETRES * np.linalg.norm(robot.hand_pose(motion.q)[1] - wanted, axis=1)
        for label, motion in motions.items()
    }
    yield Plot("hand's distance [mm]", both(off), _joined(title, f"from the {TARGET}"))
    speed = np.linalg.norm(np.gradient(wanted, arm.motion.time, axis=0), axis=1)
    speeds = {label: hand_speeds(robot, motion) for label, motion in motions.items()}
    yield Plot(HAND_SPEED, (Curve(TARGET, time, speed[shown], "observed"), *both(speeds)), title)
    for joint in widest_of_thirds(arm.motion.q):
        angles = {label: motion.q[:, joint] for label, motion in motions.items()}
        name = short_name(robot.joint_names[joint])
        yield Plot(_UNITS[robot.units[joint]], both(angles), _joined(title, name))
    if arm.has_speed_limits:
        shares = {
            label: (np.abs(np.asarray(motion.velocity)) / arm.limits.velocity).max(axis=1)
            for label, motion in motions.items()
        }
        what = _joined(title, "largest share of the limits")
        yield Plot("joint speed / limit", both(shares), what, (1.0,), "limit")


def _joined(title: str, what: str) -> str:
    return f"{title}: {what}" if title else what
