"""A strip of arms: bodies side by side, one for each of some instants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.drawing.arm_shapes import (
    TINT,
    Postures,
    Shape,
    approach,
    draw_shapes,
    gap_directions,
    obstacle_shapes,
    outline_of_all,
    posture_shapes,
)
from geodesic_ocp.drawing.best_view import best_view, plane_of
from geodesic_ocp.drawing.camera import Camera
from geodesic_ocp.drawing.styles import OBSERVED, PREDICTED, ROLES, mixed
from geodesic_ocp.model.distances import NearestPoints
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import HalfSpace, Obstacle, as_capsule
from geodesic_ocp.trajectory.path import Path

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes


_GAP = 0.18  # between figures and between views, of the largest extent
_SCALES = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)  # [m]
_SHORT = 0.15  # of an axis that is not named, as it is seen nearly end-on
_NEARBY = 0.4  # of the length of axes: nearer tips have one label
_NOTE: dict[str, Any] = {"color": "0.45", "fontsize": "small"}  # read on black, too
_PATH: dict[str, Any] = {"linewidth": 0.9, "zorder": 4.0}
_OUTLINE: dict[str, Any] = {"linewidth": 1.0, "linestyle": (0, (3.0, 1.2)), "zorder": 3.0}
_TARGET: dict[str, Any] = {"markersize": 6.0, "markeredgewidth": 1.2, "zorder": 4.1}
_TARGET |= {"color": OBSERVED["color"]}


@dataclass(frozen=True, eq=False, repr=False)
class StripArm(ShortRepr):
    """Shapes to be drawn of a model in each figure of a strip."""

    postures: Postures  # at the instants
    role: str = "observed"  # role whose colour it has
    label: str = "arm"  # for the legend
    filled: bool = True  # whether its bodies are filled; otherwise they are dashed outlines on top

    _shown = ("label", "role")


def draw_scale(axes: Axes, x: float, y: float, height: float) -> None:
    """Draw a vertical bar of a round length [m] from a point in the figure."""
    length = max((each for each in _SCALES if each <= 0.6 * height), default=_SCALES[0])
    axes.plot([x, x], [y, y + length], color="0.45", linewidth=1.5)
    place: dict[str, Any] = {"textcoords": "offset points", "ha": "left", "va": "center"}
    axes.annotate(f"{length:g} m", (x, y + length / 2), (4.0, 0.0), rotation=90, **place, **_NOTE)


def draw_axes_of_space(axes: Axes, view: Camera, origin: Array, length: float) -> None:
    """Draw the axes x, y and z [m] from a point (2,) of the figure."""
    named: list[tuple[Array, str]] = []
    for name, tip in zip("xyz", length * view.plane(np.eye(3)), strict=True):
        line = np.array([origin, origin + tip]).T
        axes.plot(*line, color="0.45", linewidth=1.0, clip_on=False)
        near = [k for k, (at, _) in enumerate(named) if np.linalg.norm(at - tip) < _NEARBY * length]
        if near:  # two axes that look alike have one label
            named[near[0]] = (named[near[0]][0], f"{named[near[0]][1]}, {name}")
        elif np.linalg.norm(tip) > _SHORT * length:
            named.append((tip, name))
    for tip, name in named:
        x, y = origin + 1.35 * tip
        axes.text(x, y, name, ha="center", va="center", **_NOTE)


def strip_instants(segments: Sequence[tuple[int, int]], count: int) -> list[int]:
    """Return samples halfway between cuts, of the segments at `count` evenly spaced times.

    At the cuts a prediction agrees with the observation by construction.
    """
    edges = np.linspace(segments[0][0], segments[-1][1], count + 1)
    wanted = (edges[1:] + edges[:-1]) / 2
    shown = [each for each in segments if np.any((wanted >= each[0]) & (wanted < each[1]))]
    return sorted({(start + stop) // 2 for start, stop in shown})


def draw_arm_strip(
    axes: Axes,
    views: Sequence[Camera],
    labels: Sequence[str],
    arms: Sequence[StripArm],
    *,
    obstacles: Sequence[Obstacle] = (),
    paths: Sequence[Array] = (),
    targets: Array | None = None,
    title: str = "",
) -> list[Artist]:
    """Draw arms at some instants side by side, in one row for each view.

    Args:
        axes: to draw in; its own axes are hidden, and a bar gives the scale.
        views: from where they are seen.
        labels: below each of the k instants.
        arms: at the instants; bodies that do not move are those of the first.
        obstacles: in every figure; planes where they are seen edge-on.
        paths: lines (m, 3) [m] in every figure, such as the path of the hand.
        targets: points (k, 3) [m], one in each figure, where the hand was to be.
        title: above the strip.

    Returns:
        Handles for a legend.
    """
    rows = [_row(view, len(labels), arms, obstacles, paths) for view in views]
    planes = [each for each in obstacles if isinstance(each, HalfSpace)]
    colour = ROLES[arms[0].role]["color"]
    width, tallest = np.max([high - low for _, low, high in rows], axis=0)
    gap = _GAP * max(width, tallest)
    pitch = width + gap
    top = 0.0
    for view, (columns, low, high) in zip(views, rows, strict=True):
        height = float(high[1] - low[1])
        origin = np.array([(low[0] + high[0]) / 2.0, high[1]])
        margins = np.array([[-pitch / 2.0, -height - gap / 4.0], [pitch / 2.0, gap / 3.0]])
        for column, shapes in enumerate(columns):
            shift = np.array([column * pitch, top]) - origin
            low, high = margins + origin
            ground = obstacle_shapes(planes, view, (low, high))
            draw_shapes(axes, [shape.moved(shift) for shape in (*ground, *shapes)])
            for arm in arms:
                if not arm.filled:
                    line = outline_of_all(arm.postures, column, view) + shift
                    axes.plot(*line.T, color=ROLES[arm.role]["color"], **_OUTLINE)
            for path in paths:
                axes.plot(*(view.plane(path) + shift).T, color=colour, **_PATH)
            if targets is not None:
                axes.plot(*view.plane(targets[column]) + shift, "+", **_TARGET)
        if len(views) > 1:
            middle = (-0.5 * pitch, top - 0.5 * height)
            side = view.side(arms[0].postures.forward)
            axes.text(*middle, side, **_NOTE, rotation=90, ha="right", va="center")
        if view.axis is None:
            corner = np.array([-0.5 * pitch, top - height])
            draw_axes_of_space(axes, view, corner, 0.14 * max(height, width))
        top -= height + gap
    bottom = top + gap
    for column, label in enumerate(labels):
        axes.text(column * pitch, bottom - 0.35 * gap, label, ha="center", va="top")
    draw_scale(axes, (len(labels) - 0.5) * pitch, bottom, tallest)
    sides = (-0.55 * pitch, (len(labels) - 0.4) * pitch)
    axes.set(xlim=sides, ylim=(bottom - gap, 0.5 * gap))
    axes.set_aspect("equal", anchor="W")
    axes.set_axis_off()
    if title:
        axes.set_title(title, loc="left", fontsize="medium", parse_math=False)
    return [_handle(arm) for arm in arms]


def _row(
    view: Camera,
    count: int,
    arms: Sequence[StripArm],
    obstacles: Sequence[Obstacle],
    paths: Sequence[Array],
) -> tuple[list[list[Shape]], Array, Array]:
    """Return shapes of each figure, and the corners (2,) of a box around all of them."""
    fixed = obstacle_shapes(obstacles, view)
    columns = [list(fixed) for _ in range(count)]
    for column, shapes in enumerate(columns):
        for arm in (each for each in arms if each.filled):
            still = arm is arms[0]
            shapes += posture_shapes(arm.postures, column, view, arm.role, still=still)
    points = [outline for shapes in columns for shape in shapes for outline in shape.outlines]
    points += [view.plane(arm.postures.joints).reshape(-1, 2) for arm in arms]
    every = np.concatenate([*points, *(view.plane(path) for path in paths)])
    return columns, every.min(axis=0), every.max(axis=0)


def _handle(arm: StripArm) -> Artist:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    colour = ROLES[arm.role]["color"]
    if arm.filled:
        return Patch(facecolor=mixed(colour, TINT), edgecolor=colour, label=arm.label)
    return Line2D([], [], color=colour, label=arm.label, **_OUTLINE)


_LIGHTEST = 0.3  # ink of the first
_MARGIN = 0.08  # around everything, of its size
_NEAR = 0.07  # least distance between labels, of the size
_AWAY = 11.0  # [pt], from the hand to what is written beside it
_DOT: dict[str, Any] = {"color": "white", "markeredgecolor": OBSERVED["color"], "markersize": 4.0}
_DOT |= {"zorder": 4.1}
_LABEL: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": "small", "zorder": 5.0}
_LABEL |= {"bbox": {"boxstyle": "round,pad=0.1", "color": "white", "alpha": 0.75, "linewidth": 0}}


def draw_overlay(
    axes: Axes,
    view: Camera,
    postures: Postures,
    labels: Sequence[str],
    *,
    obstacles: Sequence[Obstacle] = (),
    path: Array | None = None,
) -> None:
    """Draw a model in k configurations into one axes, with numbers in m along two axes of space.

    Args:
        view: along an axis of space.
        postures: postures of the model.
        labels: beside the hand in each of them; "" for none.
        obstacles: obstacles that do not move.
        path: path of the hand (m, 3) [m].
    """
    fixed = obstacle_shapes(obstacles, view)
    everywhere = [outline for shape in fixed for outline in shape.outlines]
    for index, ink in enumerate(np.linspace(_LIGHTEST, 1.0, len(postures))):
        shapes = posture_shapes(postures, index, view, ink=float(ink), still=index == 0)
        draw_shapes(axes, shapes, 2.0 + 0.1 * index)
        everywhere += [outline for shape in shapes for outline in shape.outlines]
    if path is not None:
        everywhere.append(view.plane(path))
        axes.plot(*everywhere[-1].T, color=OBSERVED["color"], linewidth=1.2, zorder=4.0)
    corners = np.concatenate(everywhere)
    low = corners.min(axis=0)
    high = corners.max(axis=0)
    size = float((high - low).max())
    low = low - _MARGIN * size
    high = high + _MARGIN * size
    draw_shapes(axes, obstacle_shapes(obstacles, view, (low, high)), 1.0)
    hands = view.plane(postures.hands[:, 0])
    axes.plot(*hands.T, "o", **_DOT)
    centre = view.plane(postures.joints).mean(axis=(0, 1))
    for label, hand in _apart(labels, hands, _NEAR * size):
        away: Any = _AWAY * (hand - centre) / max(float(np.linalg.norm(hand - centre)), 1e-12)
        axes.annotate(label, (hand[0], hand[1]), away, textcoords="offset points", **_LABEL)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_aspect("equal", adjustable="box")
    names = ["xyz"[int(np.argmax(np.abs(side)))] for side in view.axes[:2]]
    axes.set(xlabel=f"{names[0]} [m]", ylabel=f"{names[1]} [m]")


def _apart(labels: Sequence[str], hands: Array, least: float) -> list[tuple[str, Array]]:
    """Return the labels, without those too near to others; the first and the last are kept."""
    order = [0, len(labels) - 1, *range(1, len(labels) - 1)]
    kept: list[int] = []
    for index in order:
        distances = np.linalg.norm(hands[kept] - hands[index], axis=1)
        if index in order[:2] or np.all(distances >= least):
            kept.append(index)
    return [(labels[index], hands[index]) for index in sorted(set(kept))]


_HALF = 0.42  # of the width, relative to the extent of the arm
_BODY: dict[str, Any] = {"color": "0.25", "linewidth": 0.9, "linestyle": (0, (2.5, 1.5))}
_INSET_GAP: dict[str, Any] = {"color": PREDICTED["color"], "solid_capstyle": "butt"}
_INSET_GAP |= {"linewidth": 2.5, "zorder": 5.0}
_INSET_PATH: dict[str, Any] = {"color": OBSERVED["color"], "linewidth": 0.9, "zorder": 4.0}


def draw_close_up(
    axes: Axes,
    view: Camera,
    model: Model,
    q: Array,
    points: Array,
    obstacles: Sequence[Obstacle],
    *,
    links: Sequence[str] | None = None,
    paths: Sequence[Array] = (),
) -> None:
    """Draw an arm around the two points at which it is nearest to an obstacle.

    Args:
        axes: to draw in; its own axes have no numbers, and a bar gives the scale.
        view: in which it is seen.
        model: the arm.
        q: its configuration (n,).
        points: the two points that are nearest, (2, 3) [m].
        obstacles: obstacles that do not move.
        links: links whose collision bodies are drawn, dashed; None: of all that move.
        paths: lines (m, 3) [m], such as the path of the hand.
    """
    posture = Postures.of(model, q)
    centre = view.plane(points.mean(axis=0))
    half = _HALF * float(np.ptp(posture.joints[0], axis=0).max())
    box = centre - half, centre + half
    shapes = [*posture_shapes(posture, 0, view), *obstacle_shapes(obstacles, view, box)]
    draw_shapes(axes, shapes)
    for body in model.bodies:
        if body.link is not None and model.moves(body.link) and body.link in (links or [body.link]):
            rotation, position = model.frame_pose(body.link, q)
            capsule = as_capsule(body)
            ends = (rotation @ np.array(at) + position for at in (capsule.start, capsule.end))
            start, end = (tuple(each.tolist()) for each in ends)
            placed = replace(capsule, start=start, end=end, link=None)
            for shape in obstacle_shapes([placed], view):
                (outline,) = shape.outlines
                axes.plot(*np.concatenate([outline, outline[:1]]).T, zorder=3.0, **_BODY)
    for path in paths:
        axes.plot(*view.plane(path).T, **_INSET_PATH)
    axes.plot(*view.plane(points).T, **_INSET_GAP)
    axes.set_aspect("equal", adjustable="box")
    (left, low), (right, high) = box
    axes.set(xlim=(left, right), ylim=(low, high), xticks=[], yticks=[])
    draw_scale(axes, left + 0.08 * half, low + 0.08 * half, half)


_INSTANTS = 6
_SAMPLES = 101
_TITLE: dict[str, Any] = {"loc": "left", "fontsize": "medium"}


def moves_in_plane(model: Model, path: Path) -> bool:
    """Return whether the arm moves in the plane of two axes of space."""
    return plane_of(Postures.of(model, path(np.linspace(0.0, 1.0, 5)))) is not None


def draw_path_arms(
    axes: Axes,
    path: Path,
    model: Model,
    obstacles: Sequence[Obstacle] = (),
    links: Sequence[str] | None = None,
    close: Axes | None = None,
) -> None:
    """Draw a model at some instants of a path, one of them where it is nearest to an obstacle.

    Args:
        path: path of the model.
        obstacles: obstacles that do not move.
        links: links that keep clear of obstacles; None: all that move.
        close: where it is nearest to an obstacle is drawn here, too; removed if that is not known.
    """
    fine = path(np.linspace(0.0, 1.0, _SAMPLES))
    near = approach(model, fine, obstacles, links)
    s, texts, closest = _instants(near)
    postures = Postures.of(model, path(s))
    ways = [model.frame_pose(hand, fine)[1] for hand in model.hands]
    view = plane_of(postures)
    if view is not None:
        texts = [text.removeprefix("s = ") for text in texts]
        draw_overlay(axes, view, postures, texts, obstacles=obstacles, path=ways[0])
        axes.set_title(
            f"{model.name} at values of s, {view.side(postures.forward)}",
            **_TITLE,
            parse_math=False,
        )
        return
    lines = None if near is None else gap_directions(near)
    view = best_view(postures, np.concatenate(ways), obstacles, lines, closest)
    if near is not None and closest is not None and close is not None:
        least = int(np.argmin(near.distances))
        points = np.array([near.starts[least], near.ends[least]])
        nearest = path(s[closest])
        draw_close_up(close, view, model, nearest, points, obstacles, links=links, paths=ways)
        gap = _millimetres(near)
        close.set_title(f"nearest at s = {s[closest]:.2g}, {gap}", **_TITLE)
        close.set_xlabel("dashed: collision bodies", color="0.45", fontsize="small")
    elif close is not None:
        close.remove()
    title = f"{model.name} along the path, {view.side(postures.forward)}"
    arms = [StripArm(postures)]
    draw_arm_strip(axes, [view], texts, arms, obstacles=obstacles, paths=ways, title=title)


def _instants(near: NearestPoints | None) -> tuple[Array, list[str], int | None]:
    """Return values of s, what is written below each, and which is that of the nearest approach."""
    s = np.linspace(0.0, 1.0, _INSTANTS)
    if near is None:
        return s, [f"s = {each:.1g}" for each in s], None
    least = int(np.argmin(near.distances))
    number = round(least / (_SAMPLES - 1) * (_INSTANTS - 1))
    s[number] = least / (_SAMPLES - 1)
    texts = [f"s = {each:.2g}" for each in s]
    texts[number] += f"\nnearest, {_millimetres(near)}"
    return s, texts, number


def _millimetres(near: NearestPoints) -> str:
    """Return the least distance."""
    return f"{round(1000.0 * float(near.distances.min()))} mm".replace("-", "\u2212")
