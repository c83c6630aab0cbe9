"""Person and robot at the same instants, above each other, for the figure of a retargeting."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.drawing.arm_shapes import Postures
from geodesic_ocp.drawing.arm_strip import StripArm, draw_arm_strip
from geodesic_ocp.drawing.best_view import best_view
from geodesic_ocp.drawing.camera import Camera
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.retargeting.paired_arm import PoseMapping

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_INSTANTS = 6


def retargeting_strips(arm: RetargetedArm) -> list[Callable[[Axes], object]]:
    """Return functions that draw the person and the robot at evenly spaced samples.

    Both are seen from the same side, if the alignments leave what is up as it is; otherwise each
    is seen from where most is seen. The hand's target is a cross.
    """
    samples = np.linspace(0, len(arm.motion.time) - 1, _INSTANTS).round().astype(int)
    recorded = arm.analysis.motion
    model = arm.mapping.model
    person = Postures.of(model, recorded.q[samples])
    robot = Postures.of(arm.robot, arm.motion.q[samples])
    way = arm.robot.hand_pose(arm.motion.q)[1]
    view = best_view(robot)
    walk = model.hand_pose(recorded.q)[1]
    beside = _of_person(view, arm.mapping)
    if not np.allclose(beside.axes[1], view.axes[1]):  # lying
        beside = best_view(person)
    times = [recorded.time - recorded.time[0], arm.motion.time - arm.motion.time[0]]
    labels = [[f"{each:.1f} s" for each in time[samples]] for time in times]
    return [
        partial(
            draw_arm_strip,
            views=[beside],
            labels=labels[0],
            arms=[StripArm(person, "observed")],
            paths=[walk],
            title=f"{model.name}, {beside.side(person.forward)}",
        ),
        partial(
            draw_arm_strip,
            views=[view],
            labels=labels[1],
            arms=[StripArm(robot, "predicted")],
            paths=[way],
            targets=arm.target_poses[1][samples],
            title=f"{arm.name}, {view.side(robot.forward)}; crosses: the person's hand, mapped",
        ),
    ]


def _of_person(view: Camera, mapping: PoseMapping) -> Camera:
    """Return the view of a person from where a robot is seen, in a mirror if left is right."""
    source = np.asarray(mapping.source.base)
    target = np.asarray(mapping.target.base)
    mirror = np.diag([-1.0 if mapping.mirror else 1.0, 1.0, 1.0])  # in the person's axes
    from_robot = source @ mirror @ target.T
    towards = from_robot @ view.towards
    up = from_robot @ view.axes[1]
    return Camera(np.array([np.cross(up, towards), up, towards]).round(12))
