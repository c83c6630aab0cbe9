"""Arms at several instants over each other, the later the darker."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.arms.posture import Postures
from geodesic_ocp.figures.arms.posture_shapes import posture_shapes
from geodesic_ocp.figures.arms.shapes import draw_shapes
from geodesic_ocp.figures.arms.view import View
from geodesic_ocp.figures.obstacles import obstacle_shape
from geodesic_ocp.figures.styles import OBSERVED
from geodesic_ocp.model.primitives import HalfSpace, Obstacle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
    view: View,
    postures: Postures,
    labels: Sequence[str],
    *,
    obstacles: Sequence[Obstacle] = (),
    path: Array | None = None,
) -> None:
    """Draw a model in k configurations into one axes, with numbers in m along two axes of space.

    Args:
        axes: to draw in.
        view: along an axis of space.
        postures: of the model.
        labels: beside the hand in each of them; "" for none.
        obstacles: that do not move.
        path: of the hand (m, 3) [m].
    """
    inks = np.linspace(_LIGHTEST, 1.0, len(postures))
    everywhere = []
    for index, ink in enumerate(inks):
        shapes = posture_shapes(postures, index, view, ink=float(ink), still=index == 0)
        draw_shapes(axes, shapes, 2.0 + 0.1 * index)
        everywhere += [outline for shape in shapes for outline in shape.outlines]
    bodies = [obstacle_shape(each, view) for each in obstacles]
    fixed = [shape for shape in bodies if shape is not None]
    everywhere += [outline for shape in fixed for outline in shape.outlines]
    if path is not None:
        line = view.plane(path)
        axes.plot(*line.T, color=OBSERVED["color"], linewidth=1.2, zorder=4.0)
        everywhere.append(line)
    corners = np.concatenate(everywhere)
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = float((high - low).max())
    low, high = low - _MARGIN * size, high + _MARGIN * size
    planes = [each for each in obstacles if isinstance(each, HalfSpace)]
    ground = [obstacle_shape(each, view, (low, high)) for each in planes]
    draw_shapes(axes, [*(shape for shape in ground if shape is not None), *fixed], 1.0)
    hands = view.plane(postures.hands[:, 0])
    axes.plot(*hands.T, "o", **_DOT)
    centre = view.plane(postures.joints).mean(axis=(0, 1))
    for label, hand in _apart(labels, hands, _NEAR * size):
        outward = hand - centre
        away = _AWAY * outward / max(float(np.linalg.norm(outward)), 1e-12)
        place, offset = (float(hand[0]), float(hand[1])), (float(away[0]), float(away[1]))
        axes.annotate(label, place, offset, textcoords="offset points", **_LABEL)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal", adjustable="box")
    names = ["xyz"[int(np.argmax(np.abs(side)))] for side in (view.right, view.up)]
    axes.set_xlabel(f"{names[0]} [m]")
    axes.set_ylabel(f"{names[1]} [m]")


def _apart(labels: Sequence[str], hands: Array, least: float) -> list[tuple[str, Array]]:
    """The labels, without those too near to others; the first and the last are kept."""
    order = [0, len(labels) - 1, *range(1, len(labels) - 1)]
    kept: list[int] = []
    for index in order:
        distances = np.linalg.norm(hands[kept] - hands[index], axis=1)
        if index in order[:2] or np.all(distances >= least):
            kept.append(index)
    return [(labels[index], hands[index]) for index in sorted(set(kept))]
