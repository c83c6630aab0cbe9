"""A figure of an alignment: stick figures of the robot and of a person's arm in some postures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.new_figure import new_figure
from geodesic_ocp.figures.styles import OBSERVED, PREDICTED
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.stick_figure import stick_figure
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.poses.nearest_poses import nearest_poses, search_range

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Flexion of shoulder and elbow [rad], the first and the fourth joint of a human arm.
_POSTURES = {
    "hanging": (0.0, 0.2),
    "elbow bent": (0.2, 1.6),
    "reaching forward": (1.2, 0.4),
}
_VIEWS = {"seen from behind": (0, "right"), "seen from the right": (1, "forward")}
_STARTS, _STEPS = 30, 60
_ARROW = 0.22  # length of arrows, relative to the arm's
_FINGERS, _ACROSS = "#b2432f", "#3f7f5f"


def alignment_figure(robot: Model, aligned: Alignment, person: Model) -> Figure:
    """Stick figures of a robot with the hand where that of a person's arm is, in three postures.

    Everything is in the person's axes and relative to the shoulder [m]; the person's arm has the
    length of the robot's. Arrows show where the fingers point, and what points to the right when
    the arm hangs down.

    Args:
        robot: the arm.
        aligned: its alignment.
        person: a `human_arm` of the same side.
    """
    q = np.zeros((len(_POSTURES), person.dof))
    q[:, [0, 3]] = list(_POSTURES.values())
    scale = aligned.length / person.reach
    rotations, positions = person.hand_pose(q)
    turned, placed = aligned.to_robot(rotations, positions, scale=scale)
    lower, upper = search_range(robot)
    random = np.random.default_rng(0).uniform(lower, upper, (_STARTS, robot.dof))
    random[0] = np.clip(0.0, lower, upper)
    starts = np.repeat(random[None], len(q), axis=0)
    found = nearest_poses(robot, turned, placed, starts, _STEPS)
    base, shoulder = np.asarray(aligned.base), np.asarray(aligned.shoulder)
    figure = new_figure(9.0, 6.2)
    panels = figure.subplots(len(_VIEWS), len(q), sharex=True, sharey=True, squeeze=False)
    for column, posture in enumerate(_POSTURES):
        links = (stick_figure(robot, found.q[column])[0] - shoulder) @ base
        reached, _ = robot.hand_pose(found.q[column])
        arrows = base.T @ reached @ np.asarray(aligned.hand).T
        hand = (robot.hand_pose(found.q[column])[1] - shoulder) @ base
        marks = _marks(robot, aligned, found.q[column])
        for row, (view, (axis, name)) in enumerate(_VIEWS.items()):
            axes = panels[row][column]
            human = scale * stick_figure(person, q[column])[0]
            _draw_links(axes, human, axis, {**PREDICTED, "linewidth": 2.0}, "person, scaled")
            _draw_links(axes, links, axis, {**OBSERVED, "linewidth": 3.0}, robot.name)
            for label, (point, marker) in marks.items():
                axes.plot(*point[[axis, 2]], marker, color="0.2", markersize=7, label=label)
            for arrow, colour in ((arrows[:, 2], _FINGERS), (arrows[:, 0], _ACROSS)):
                tip = hand + _ARROW * aligned.length * arrow
                _draw_arrow(axes, hand[[axis, 2]], tip[[axis, 2]], colour)
            axes.set_aspect("equal")
            axes.set_xlabel(f"{name} [m]")
            if column == 0:
                axes.set_ylabel(f"{view}\nup [m]")
        error = f"{found.distances[column]:.2g} m, {found.angles[column]:.2g} rad"
        exact = max(found.distances[column], found.angles[column]) < 1e-3
        panels[0][column].set_title(posture if exact else f"{posture}\nout of reach by {error}")
    handles, labels = panels[0][0].get_legend_handles_labels()
    for colour, label in ((_FINGERS, "fingers"), (_ACROSS, "right, when hanging")):
        handles += panels[0][0].plot([], [], color=colour, linewidth=2.0)
        labels.append(label)
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _marks(robot: Model, aligned: Alignment, q: Array) -> dict[str, tuple[Array, str]]:
    """Points in the person's axes, with their markers."""
    base, shoulder = np.asarray(aligned.base), np.asarray(aligned.shoulder)
    marks = {"shoulder": (np.zeros(3), "o"), "base": (-shoulder @ base, "s")}
    for label, joint, marker in (("elbow", aligned.elbow, "D"), ("wrist", aligned.wrist, "^")):
        if joint is not None and robot.pin.existFrame(joint):
            marks[label] = (robot.frame_pose(joint, q)[1] - shoulder) @ base, marker
    return marks


def _draw_links(axes: Axes, links: Array, axis: int, style: dict[str, Any], label: str) -> None:
    line = np.concatenate([links, np.full((len(links), 1, 3), np.nan)], axis=1).reshape(-1, 3)
    axes.plot(line[:, axis], line[:, 2], **style, label=label)


def _draw_arrow(axes: Axes, start: Array, end: Array, colour: str) -> None:
    style = {"arrowstyle": "-|>", "color": colour, "linewidth": 2.0}
    axes.annotate("", (end[0], end[1]), (start[0], start[1]), arrowprops=style)
    axes.update_datalim([end])
