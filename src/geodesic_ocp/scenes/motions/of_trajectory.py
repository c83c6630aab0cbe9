"""Trajectories of robots, to be looked at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.limits import JointLimits, joint_limits
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory
from geodesic_ocp.model.joint_axes import upward
from geodesic_ocp.model.model import Model
from geodesic_ocp.scenes.around.carried import upright
from geodesic_ocp.scenes.motions.joint_plots import (
    POSITIONS,
    TORQUES,
    VELOCITIES,
    hand_speed_plots,
    joint_plots,
)
from geodesic_ocp.scenes.motions.model_scene import model_scene
from geodesic_ocp.scenes.motions.of_motion import of_joints, viewed_from
from geodesic_ocp.scenes.motions.of_robots import robots_playback
from geodesic_ocp.scenes.motions.shown_samples import shown_samples
from geodesic_ocp.scenes.playback import Playback, Plot, Span
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion

SPEED_SHARES, TORQUE_SHARES = "joint speeds [% of limit]", "torques [% of limit]"


def trajectory_playback(
    trajectory: JointTrajectory,
    model: Model,
    *,
    limits: JointLimits | None = None,
    gravity: ArrayLike | None = None,
    title: str = "",
) -> Playback:
    """A model that follows a joint trajectory: joints, speeds, torques and the path of the hand.

    Speeds and torques are relative to their limits where those of all joints are known.

    Args:
        trajectory: with the model's joints, by their names; others are left out.
        model: that moves; it is turned so that z points upwards.
        limits: of the model's joints; those of `joint_limits` by default.
        gravity: acceleration of free fall in axes of the model's base (3,) [m/s^2]; the model's by
            default.
        title: of the playback; the model's name by default.

    Raises:
        ValueError: the trajectory lacks joints of the model, or has a single sample or times that
            do not increase.
    """
    names = trajectory.joint_names
    motion = of_joints(
        Motion(trajectory.time, trajectory.positions, names, trajectory.velocities), model
    )
    columns = [names.index(name) for name in model.joint_names]
    for column, unit in zip(columns, model.units, strict=True):
        given = (trajectory.units or ("rad",) * len(names))[column]
        if given != unit:
            raise ValueError(f"joint {names[column]} is in {given}, but the model's is in {unit}")
    shown, thinned = shown_samples(motion.time)
    others = len(names) - model.dof
    notes = [f"{others} more joints given" if others else "", thinned]
    time, q = motion.time[shown], motion.q[shown]
    scene = model_scene(
        model, time, q, title=title, role="predicted", note="; ".join(filter(None, notes))
    )
    known = joint_limits(model) if limits is None else limits
    velocities = trajectory.velocities[shown][:, columns]
    plots = [
        *joint_plots(model, time, q, POSITIONS),
        *_shares(model, time, velocities, known.velocity, VELOCITIES, SPEED_SHARES),
    ]
    if trajectory.efforts is not None:
        efforts = trajectory.efforts[shown][:, columns]
        plots += torque_plots(model, time, efforts, known.torque)
    plots += hand_speed_plots(model, {"hand": (motion, "predicted")}, shown)
    up = upward(model)
    if gravity is not None and np.any(gravity):
        up = -np.asarray(gravity, dtype=float) / np.linalg.norm(gravity)
    scene = upright(scene, up)
    return Playback(scene.title, (scene,), {}, tuple(plots), azimuth=viewed_from(model))


def torque_plots(model: Model, time: Array, torques: Array, limits: Array) -> tuple[Plot, ...]:
    """Plots of joint torques (k, n) [N m or N], relative to their limits (n,) if all are known."""
    return _shares(model, time, torques, limits, TORQUES, TORQUE_SHARES)


def _shares(
    model: Model,
    time: Array,
    values: Array,
    limits: Array,
    labels: Mapping[str, str],
    share: str,
) -> tuple[Plot, ...]:
    """Plots of magnitudes as shares of limits, or of the values where a limit is not known."""
    if not np.all(np.isfinite(limits)):
        return joint_plots(model, time, values, labels)
    percent = 100.0 * np.abs(values) / limits
    return joint_plots(model, time, percent, dict.fromkeys(labels, share), marks=(100.0,))


def planned_playback(
    planned: PlannedTrajectory, *, rate: float = 100.0, title: str = ""
) -> Playback:
    """The motion of all arms of a planned trajectory, and the times of the paths of each.

    The arms of one robot are in one pane; others have a pane each, in axes of their base, as a
    trajectory does not know where they stand.

    Args:
        planned: by `plan_trajectory`, or that of a retargeting.
        rate: of the samples [Hz].
        title: of the playback; the names of the robots by default.

    Raises:
        ValueError: the rate is not positive.
    """
    whole = planned.sampled(rate)
    parts, first = [], 0
    for number, arm in enumerate(planned.arms):
        own = slice(first, first + arm.robot.dof)
        first = own.stop
        trajectory = JointTrajectory(
            whole.time,
            whole.positions[:, own],
            whole.velocities[:, own],
            whole.accelerations[:, own],
            arm.robot.joint_names,
            arm.robot.units,
            None if whole.efforts is None else whole.efforts[:, own],
        )
        part = trajectory_playback(trajectory, arm.robot, limits=arm.limits, gravity=arm.gravity)
        parts.append(replace(part, spans={"paths": _path_spans(planned, number)}))
    robots = [arm.robot for arm in planned.arms]
    return robots_playback(robots, parts, title=title)


def _path_spans(planned: PlannedTrajectory, number: int) -> tuple[Span, ...]:
    """Spans of the paths of an arm, numbered from 1; of those on which it moves."""
    arm = planned.arms[number]
    edges = planned.robot_time(arm.edges)
    spans = []
    for index, (path, start, stop) in enumerate(
        zip(arm.paths, edges[:-1], edges[1:], strict=True), 1
    ):
        if path.length > 0.0:
            text = f"path {index} ({stop - start:.2f} s)"
            spans.append(Span(str(index), float(start), float(stop), text))
    return tuple(spans)
