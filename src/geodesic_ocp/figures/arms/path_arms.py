"""The arm along a path: side by side in space, or over each other in a plane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.arms.arm_strip import StripArm, draw_arm_strip
from geodesic_ocp.figures.arms.best_view import best_view, plane_of
from geodesic_ocp.figures.arms.close_up import draw_close_up
from geodesic_ocp.figures.arms.nearest import approach, gap_directions
from geodesic_ocp.figures.arms.overlay import draw_overlay
from geodesic_ocp.figures.arms.posture import Postures
from geodesic_ocp.model.distances import NearestPoints
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.trajectory.path import Path

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_INSTANTS, _SAMPLES = 6, 101
_TITLE: dict[str, Any] = {"loc": "left", "fontsize": "medium"}


def moves_in_plane(model: Model, path: Path) -> bool:
    """Whether the arm moves in the plane of two axes of space."""
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
        axes: to draw in.
        path: of the model.
        model: the arm.
        obstacles: that do not move.
        links: that keep clear of obstacles; None: all that move.
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
        axes.set_title(f"{model.name} at values of s, {view.name}", **_TITLE, parse_math=False)
        return
    lines = None if near is None else gap_directions(near)
    view = best_view(postures, np.concatenate(ways), obstacles, lines, closest)
    if near is not None and closest is not None and close is not None:
        least = int(np.argmin(near.distances))
        points, nearest = np.array([near.starts[least], near.ends[least]]), path(s[closest])
        draw_close_up(close, view, model, nearest, points, obstacles, links=links, paths=ways)
        gap = _millimetres(near)
        close.set_title(f"nearest at s = {s[closest]:.2g}, {gap}", **_TITLE)
        close.set_xlabel("dashed: collision bodies", color="0.45", fontsize="small")
    elif close is not None:
        close.remove()
    title = f"{model.name} along the path, {view.name}"
    arms = [StripArm(postures)]
    draw_arm_strip(axes, [view], texts, arms, obstacles=obstacles, paths=ways, title=title)


def _instants(near: NearestPoints | None) -> tuple[Array, list[str], int | None]:
    """Values of s, what is written below each, and which is that of the nearest approach."""
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
    """The least distance."""
    return f"{round(1000.0 * float(near.distances.min()))} mm".replace("-", "\u2212")
