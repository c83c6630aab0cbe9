"""Paths in a plane, their coordinates, and unit balls of metrics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.styles import OBSERVED, PREDICTED, line_styles

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_coordinates(axes: Axes, s: Array, values: Array, names: Sequence[str]) -> None:
    """Draw coordinates (k, n) over s (k,), each with its name."""
    for name, column, style in zip(names, values.T, line_styles(len(names)), strict=True):
        axes.plot(s, column, label=name, **style)
    axes.set_xlim(s[0], s[-1])


def draw_plane_path(axes: Axes, path: Array, via: Array, names: tuple[str, str]) -> None:
    """Draw a path (k, 2) with marks at its ends and at via points (m, 2)."""
    axes.plot(*path.T, **OBSERVED, label="path")
    hollow = {"color": "white", "markeredgecolor": OBSERVED["color"], "markersize": 6}
    axes.plot(*path[:1].T, "o", label="start", **hollow)
    if len(via):
        axes.plot(*via.T, "D", label="via point", color="#7a7a7a", markersize=6)
    axes.plot(*path[-1:].T, "s", label="end", color=PREDICTED["color"], markersize=6)
    axes.set_xlabel(names[0])
    axes.set_ylabel(names[1])
    axes.set_aspect("equal", adjustable="datalim")


def draw_unit_balls(axes: Axes, centres: Array, matrices: Array, size: float) -> None:
    """Draw unit balls of metrics (k, 2, 2) around points (k, 2), the largest with this radius.

    They are narrow in directions in which motion is expensive.
    """
    if not len(centres):
        return
    turns = np.linspace(0.0, 2.0 * np.pi, 73)
    circle = np.array([np.cos(turns), np.sin(turns)])
    outlines = np.linalg.solve(np.linalg.cholesky(matrices).transpose(0, 2, 1), circle)
    scale = size / np.abs(outlines).max()
    for index, (centre, outline) in enumerate(zip(centres, outlines, strict=True)):
        label = "unit balls of the metric" if index == 0 else None
        axes.plot(*(centre[:, None] + scale * outline), color="#8fa3b8", linewidth=1.0, label=label)
