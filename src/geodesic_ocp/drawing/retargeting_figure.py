"""The figure of a retargeting: person and robot at some instants, hand and joints over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.analysis_figure import (
    Names,
    draw_hand_path,
    shade_segments,
    widest_columns,
    widest_of_thirds,
)
from geodesic_ocp.drawing.arm_shapes import Postures
from geodesic_ocp.drawing.arm_strip import StripArm, draw_arm_strip
from geodesic_ocp.drawing.best_view import best_view
from geodesic_ocp.drawing.camera import Camera
from geodesic_ocp.drawing.styles import BASELINE, OBSERVED, PREDICTED, new_figure
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.retargeting.paired_arm import PoseMapping
from geodesic_ocp.retargeting.result import METHODS, Retargeting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase

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


_STRIP = 1.7  # height of a strip of arms, relative to a panel's
_LONG = 12  # letters of an axis label beside a panel
_TICKS: dict[str, Any] = {"color": "#1b3a5c", "markersize": 9, "clip_on": False}


def draw_overview(
    figure: FigureBase,
    time: Array,
    segments: Sequence[tuple[int, int]],
    hands: tuple[Array, Array],
    joints: Sequence[tuple[str, Array, Array]],
    names: Names,
    other: str,
    ticks: Array,
    strips: Sequence[Callable[[Axes], object]],
) -> None:
    """Draw hand and joints over time in panels, and the path of the hand beside them.

    Args:
        time: time of the samples (k,) [s].
        segments: (start, stop) samples of the segments, whose time spans are shaded.
        hands: positions (k, 3) [m] of the observed and the predicted hand.
        joints: label, observed (k,) and predicted (k,) values of each joint.
        names: labels of the observed and the predicted hand.
        other: label of the joints drawn beside the predicted ones.
        ticks: times [s] marked on the upper edge.
        strips: each draws arms into axes of its own, above the panels.
    """
    columns = widest_columns(hands[0], 2)
    rows = [(f"hand {'xyz'[axis]}\n[m]", hands[0][:, axis], hands[1][:, axis]) for axis in columns]
    rows += joints
    above = len(strips)
    heights = [_STRIP] * above + [1.0] * len(rows)
    grid = figure.add_gridspec(len(heights), 2, width_ratios=(1.5, 1.0), height_ratios=heights)
    panels: list[Axes] = []
    for row, (label, observed, predicted) in enumerate(rows):
        axes = figure.add_subplot(grid[above + row, 0], sharex=panels[0] if panels else None)
        shade_segments(axes, time, segments)
        first, look = (names[0], OBSERVED) if row < len(columns) else (other, BASELINE)
        axes.plot(time, observed, **look, label=first)
        axes.plot(time, predicted, **PREDICTED, label=names[1])
        long = max(map(len, label.splitlines())) > _LONG
        axes.set_ylabel(label, fontsize="small" if long else None)
        axes.label_outer()
        panels.append(axes)
    top = panels[0].get_xaxis_transform()
    panels[0].plot(ticks, np.ones(ticks.size), "|", transform=top, **_TICKS)
    panels[-1].set_xlabel("time [s]")
    figure.align_ylabels(panels)

    path = figure.add_subplot(grid[above:, 1])
    draw_hand_path(path, *hands, segments, names)
    shown = dict(zip(*path.get_legend_handles_labels()[::-1], strict=True))
    shown |= dict(zip(*panels[-1].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=len(shown))
    for row, draw in enumerate(strips):
        draw(figure.add_subplot(grid[row, :]))


def retargeting_figure(retargeting: Retargeting) -> Figure:
    """Draw person and robot at some instants, the hand and three joints over time, and its path.

    Crosses beside the robot mark where the person's hand is, mapped to the robot. Both are seen
    from the same side, the person in a mirror if left and right are exchanged, unless the
    alignments turn what is up.
    The person's hand, mapped to the robot, is drawn beside the robot's. Time spans of the robot's
    synergies are shaded; marks on the upper edge are the starts of the person's synergies. The
    robot's joints are drawn beside those of inverse kinematics.
    """
    count = len(retargeting.arms)
    figure = new_figure(11.0, 12.0 * count)
    parts = figure.subfigures(count, 1, squeeze=False)[:, 0]
    for arm, part in zip(retargeting.arms, parts, strict=True):
        time = arm.motion.time
        joints = []
        for joint in widest_of_thirds(arm.motion.q):
            name = arm.robot.joint_names[joint]
            unit = arm.robot.units[joint]
            label = f"{name.removesuffix('_joint').removeprefix('panda_')}\n[{unit}]"
            joints.append((label, arm.tracked.q[:, joint], arm.motion.q[:, joint]))
        draw_overview(
            part,
            time=time,
            segments=[(group.start, group.stop) for group in arm.groups],
            hands=(arm.target_poses[1], arm.robot.hand_pose(arm.motion.q)[1]),
            joints=joints,
            names=("person's hand, mapped", METHODS["synergies"]),
            other=METHODS["ik"],
            ticks=time[[synergy.start for synergy in arm.analysis.synergies]],
            strips=retargeting_strips(arm),
        )
        part.suptitle(f"{arm.title}: {len(arm.groups)} synergies of {len(arm.analysis.synergies)}")
    return figure
