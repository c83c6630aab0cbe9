"""Alignments: robots beside a person in corresponding postures, as a scene and as a figure."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.actors import Actor, model_actor, rest_of_person
from geodesic_ocp.drawing.arm_shapes import (
    TINT,
    Postures,
    draw_shapes,
    outline_of_all,
    posture_shapes,
)
from geodesic_ocp.drawing.camera import Camera
from geodesic_ocp.drawing.model_scene import hand_frames, hand_trails
from geodesic_ocp.drawing.scene import Curve, FrameTrack, Playback, Plot, Scene, Span, Trail
from geodesic_ocp.drawing.styles import ROLES, mixed, new_figure
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.arm_alignment import Alignment
from geodesic_ocp.retargeting.reachability import nearest_poses, search_range

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Flexion of shoulder and elbow [rad], the first and the fourth joint of a human arm.
_POSTURES = {
    "hanging": (0.0, 0.2),
    "elbow bent": (0.2, 1.6),
    "reaching forward": (1.2, 0.4),
}
_STARTS = 30
_STEPS = 60


def _key_postures(person: Model) -> Array:
    """Return configurations (3, n) of a person's arm in the postures."""
    q = np.zeros((len(_POSTURES), person.dof))
    q[:, [0, 3]] = list(_POSTURES.values())
    return q


def _starts(robot: Model) -> Array:
    """Return configurations (30, n) from which poses are searched."""
    lower, upper = search_range(robot)
    starts = np.random.default_rng(0).uniform(lower, upper, (_STARTS, robot.dof))
    starts[0] = np.clip(0.0, lower, upper)
    return starts


# from one posture to the next [s], samples [Hz]
_SECONDS = 1.5
_RATE = 20.0
_TARGET = "person's hand, mapped"
_ROBOT = "robot's hand"
_SCALED = "scaled person's arm"


def alignment_playback(aligned: Alignment, robot: Model) -> Playback:
    """Return a person's arm that moves through some postures, and the robot's hand where the
    person's is.

    The robot is shown in the person's axes, its shoulder where the person's is. The person's arm,
    scaled to the length of the robot's, can be switched on beside it; so can the frames of the
    hands.

    Args:
        aligned: the alignment of the robot with a person.
        robot: the arm.
    """
    side = aligned.side or "right"
    person = human_arm(side)
    time, q = _postures(person)
    scale = aligned.length / person.reach
    rotations, positions = aligned.to_robot(*person.hand_pose(q), scale=scale)
    found = _followed(robot, rotations, positions)
    turn = np.asarray(aligned.base).T
    place = -turn @ np.asarray(aligned.shoulder)
    reached, at = robot.hand_pose(found)
    lines = {_TARGET: positions @ turn.T + place, _ROBOT: at @ turn.T + place}
    axes = {_TARGET: turn @ rotations, _ROBOT: turn @ reached}
    scenes = (
        Scene(
            "person",
            time,
            (model_actor(person, q, role="observed"), *rest_of_person(person)),
            hand_trails(person, q, "observed"),
            frames=hand_frames(person, q),
            note=person.name,
        ),
        Scene(
            robot.name,
            time,
            (
                model_actor(robot, found, rotation=turn, position=place),
                _scaled(person, q, scale),
            ),
            (
                Trail(_TARGET, lines[_TARGET], "observed", lines[_TARGET]),
                Trail(_ROBOT, lines[_ROBOT], "predicted", lines[_ROBOT]),
            ),
            frames=tuple(FrameTrack(name, axes[name], lines[name]) for name in lines),
            note=f"positions scaled by {scale:.3g}",
        ),
    )
    off = 1000.0 * np.linalg.norm(at - positions, axis=1)
    distance = Plot("hand's distance [mm]", (Curve(robot.name, time, off, "predicted"),))
    starts = np.arange(len(_POSTURES)) * _SECONDS
    edges = np.clip(np.append(starts - _SECONDS / 2.0, np.inf), 0.0, time[-1])
    spans = tuple(
        Span(name, float(start), float(stop))
        for name, (start, stop) in zip(_POSTURES, pairwise(edges), strict=True)
    )
    return Playback(
        f"alignment of {robot.name} with a person's {side} arm",
        scenes,
        {"posture": spans},
        (replace(distance, title=f"from the {_TARGET}"),),
        azimuth=-50.0 if side == "left" else 50.0,
        hidden=(*Playback.hidden, _SCALED),
    )


def _postures(person: Model) -> tuple[Array, Array]:
    """Return times (k,) [s], and configurations (k, n) that pause at each of the postures."""
    key = _key_postures(person)
    count = int(_SECONDS * _RATE)
    fraction = np.arange(count) / count
    eased = (fraction**2 * (3.0 - 2.0 * fraction))[:, None]
    moving = [a + eased * (b - a) for a, b in pairwise(key)]
    q = np.concatenate([*moving, key[-1:]])
    return np.arange(len(q)) / _RATE, q


def _followed(robot: Model, rotations: Array, positions: Array) -> Array:
    """Return configurations (k, n), each the nearest pose from the one before, from the best of
    all.
    """
    starts = _starts(robot)
    count = len(positions)
    best = np.zeros((count, robot.dof))
    least = np.inf
    for first in dict.fromkeys((count // 2, 0, count - 1)):
        q = np.zeros((count, robot.dof))
        errors = np.zeros(count)
        steps = [(first, starts)]
        steps += [(k, q[k - 1 : k]) for k in range(first + 1, count)]
        steps += [(k, q[k + 1 : k + 2]) for k in range(first - 1, -1, -1)]
        for k, begin in steps:  # each begins where the one before, which is its neighbour, ended
            pose = rotations[k : k + 1], positions[k : k + 1]
            found = nearest_poses(robot, *pose, begin[None], _STEPS)
            q[k] = found.q[0]
            errors[k] = max(found.distances[0], found.angles[0])
        if errors.max() < least:
            best = q
            least = float(errors.max())
    return best


def _scaled(person: Model, q: Array, scale: float) -> Actor:
    """Return the person's arm in the size of the robot's, with the shoulder at the origin."""
    actor = model_actor(person, q, name=_SCALED, role="observed", translucent=True, layer=_SCALED)
    return replace(
        actor,
        meshes=tuple(replace(mesh, vertices=scale * mesh.vertices) for mesh in actor.meshes),
        positions={link: scale * position for link, position in actor.positions.items()},
    )


# Columns of the person's axes, which are right, forward and up.
_VIEWS = {"seen from behind": (0, "right"), "seen from the right": (1, "forward")}
_MARGIN = 0.06  # [m], around everything
# width [inch], height over it, what is not panels [inch]
_PANEL = 2.5
_TALLEST = 1.6
_AROUND = 1.9
_STILL = 0.5  # how dark the outlines of what does not move are
# length relative to the arm's; share of it that is seen at least
_ARROW = 0.22
_END_ON = 0.25
_PERSON: dict[str, Any] = {"color": ROLES["observed"]["color"], "linewidth": 1.4, "zorder": 3.0}
_PERSON |= {"linestyle": (0, (3.5, 1.5))}
_MARK: dict[str, Any] = {"color": "0.15", "markeredgecolor": "white", "zorder": 4.0}
_FINGERS: dict[str, Any] = {"color": "0.05", "linewidth": 2.0, "markerfacecolor": "0.05"}
_RIGHT: dict[str, Any] = {"color": "0.05", "linewidth": 1.2, "markerfacecolor": "white"}


def alignment_figure(robot: Model, aligned: Alignment, person: Model) -> Figure:
    """Return a robot with the hand where that of a person's arm is, in three postures, from two
    sides.

    Everything is in the person's axes and relative to the shoulder [m]; the person's arm, an
    outline, has the length of the robot's. Arrows show where the fingers point, and what points to
    the right when the arm hangs down; a circle is one that points to the observer (with a dot) or
    away (with a cross).

    Args:
        robot: the arm.
        person: a `human_arm` of the same side.
    """
    q = _key_postures(person)
    scale = aligned.length / person.reach
    turned, placed = aligned.to_robot(*person.hand_pose(q), scale=scale)
    starts = np.repeat(_starts(robot)[None], len(q), axis=0)
    found = nearest_poses(robot, turned, placed, starts, _STEPS)
    base = np.asarray(aligned.base)
    shoulder = np.asarray(aligned.shoulder)
    bodies = Postures.of(robot, found.q)
    human = Postures.of(person, q)
    reached, hands = robot.hand_pose(found.q)
    arrows = _ARROW * aligned.length * (base.T @ reached @ np.asarray(aligned.hand).T)
    figure = new_figure(9.0, 6.9)
    figure.set_layout_engine("compressed")
    panels = figure.subplots(len(_VIEWS), len(q), sharex="row", sharey="row", squeeze=False)
    corners: list[Array] = []
    for row, (seen, (axis, name)) in enumerate(_VIEWS.items()):
        view = Camera.of_axes((axis, 2))
        of_robot = view.turned(base)
        shift = -of_robot.plane(shoulder)
        drawn = []
        for column in range(len(q)):
            axes = panels[row][column]
            shapes = posture_shapes(bodies, column, of_robot, ink=_STILL)
            moving = posture_shapes(bodies, column, of_robot, "predicted", still=False)
            # What does not move is pale and behind, so that the arm is seen from either side.
            draw_shapes(axes, [each.moved(shift) for each in shapes], 1.0)
            draw_shapes(axes, [each.moved(shift) for each in moving], 2.0)
            outline = scale * outline_of_all(human, column, view)
            axes.plot(*outline.T, **_PERSON, label="person, scaled")
            for label, (point, marker) in _marks(robot, aligned, found.q[column]).items():
                drawn.append(view.plane(point)[None])
                axes.plot(*drawn[-1].T, marker, markersize=7, linestyle="", label=label, **_MARK)
            hand = (hands[column] - shoulder) @ base
            for way, style in ((arrows[column, :, 2], _FINGERS), (arrows[column, :, 0], _RIGHT)):
                drawn.append(_draw_arrow(axes, view, hand, way, style))
            drawn += [outline, *(each + shift for shape in moving for each in shape.outlines)]
            axes.set_aspect("equal")
            axes.set_xlabel(f"{name} [m]")
        panels[row][0].set_ylabel(f"{seen}\nup [m]")
        corners.append(np.concatenate(drawn))
    half = _set_limits(panels, corners)
    figure.set_figheight(2.0 * _PANEL * min(half[1] / half[0], _TALLEST) + _AROUND)
    for axes, posture, *errors in zip(
        panels[0], _POSTURES, found.distances, found.angles, strict=True
    ):
        error = f"out of reach by {errors[0]:.2g} m, {errors[1]:.2g} rad"
        axes.set_title(posture)
        if max(errors) >= 1e-3:
            axes.set_title(f"{posture}\n{error}", fontsize="medium")
    _add_legend(figure, panels[0][0], robot.name)
    return figure


def _marks(robot: Model, aligned: Alignment, q: Array) -> dict[str, tuple[Array, str]]:
    """Return points in the person's axes, with their markers."""
    base = np.asarray(aligned.base)
    shoulder = np.asarray(aligned.shoulder)
    marks = {"shoulder": (np.zeros(3), "o"), "base": (-shoulder @ base, "s")}
    for label, joint, marker in (("elbow", aligned.elbow, "D"), ("wrist", aligned.wrist, "^")):
        if joint is not None and robot.pin.existFrame(joint):
            marks[label] = (robot.frame_pose(joint, q)[1] - shoulder) @ base, marker
    return marks


def _draw_arrow(axes: Axes, view: Camera, start: Array, way: Array, style: dict[str, Any]) -> Array:
    """Return an arrow, or a circle if it is seen end-on; returns its ends in the plane (2, 2)."""
    ends = view.plane(np.array([start, start + way]))
    if np.linalg.norm(ends[1] - ends[0]) < _END_ON * np.linalg.norm(way):
        circle = {"color": style["markerfacecolor"], "markeredgecolor": style["color"]}
        inside = "." if view.depth(way) > 0.0 else "x"
        other = "white" if style is _FINGERS else style["color"]
        axes.plot(*ends[0], "o", markersize=9, zorder=5.0, **circle)
        axes.plot(*ends[0], inside, markersize=5, zorder=5.1, color=other)
        return ends
    arrow = {"arrowstyle": "-|>", "mutation_scale": 14, "shrinkA": 0, "shrinkB": 0, "zorder": 5.0}
    arrow |= {"edgecolor": style["color"], "facecolor": style["markerfacecolor"]}
    axes.annotate("", ends[1], ends[0], arrowprops=arrow | {"linewidth": style["linewidth"]})
    return ends


def _set_limits(panels: Any, corners: list[Array]) -> Array:
    """Return panels of one size around the points (k, 2) of each row; half of it (2,) [m]."""
    lows = np.array([np.nanmin(points, axis=0) for points in corners]) - _MARGIN
    highs = np.array([np.nanmax(points, axis=0) for points in corners]) + _MARGIN
    half = (highs - lows).max(axis=0) / 2.0
    for row, centre in zip(panels, (lows + highs) / 2.0, strict=True):
        row[0].set_xlim(centre[0] - half[0], centre[0] + half[0])
        row[0].set_ylim(centre[1] - half[1], centre[1] + half[1])
    return np.asarray(half)


def _add_legend(figure: Figure, axes: Axes, name: str) -> None:
    from matplotlib.patches import Patch

    handles, labels = axes.get_legend_handles_labels()
    known = dict(zip(labels, handles, strict=True))
    colour = ROLES["predicted"]["color"]
    known[name] = Patch(facecolor=mixed(colour, TINT), edgecolor=colour)
    for label, style in (("fingers", _FINGERS), ("right, when hanging", _RIGHT)):
        (known[label],) = axes.plot([], [], marker=">", markersize=8, **style)
    figure.legend(known.values(), known.keys(), loc="outside lower center", ncols=4, frameon=False)
