"""Distributions of several subjects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.study.groups import STYLES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_POINTS = 400
_DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1)), (0, (5, 1.5, 1, 1.5)))
_MOST = 0.995  # of all values are within the axis


def draw_distributions(axes: Axes, values: Mapping[str, Sequence[Array]], label: str) -> None:
    """Draw cumulative distributions: of subjects thin, their mean thick, its median marked.

    The mean of the subjects' distributions counts every subject the same.

    Args:
        axes: of matplotlib.
        values: by condition, those of each subject, (k,) each; NaN are left out.
        label: of the horizontal axis, with the unit.
    """
    finite = {c: [np.sort(x[np.isfinite(x)]) for x in each] for c, each in values.items()}
    known = {condition: [x for x in each if x.size] for condition, each in finite.items()}
    everything = np.concatenate([np.zeros(0), *(x for each in known.values() for x in each)])
    axes.set_xlabel(label)
    if not everything.size:
        return
    top = float(np.quantile(everything, _MOST)) or 1.0
    grid = np.linspace(0.0, top, _POINTS)
    for number, (condition, subjects) in enumerate(known.items()):
        if not subjects:
            continue
        curves = np.array([_cumulative(each, grid) for each in subjects])
        mean = curves.mean(axis=0)
        style = {
            "color": STYLES[number % len(STYLES)]["color"],
            "linestyle": _DASHES[number % len(_DASHES)],
        }
        if len(subjects) > 1:
            shade = "0.75" if len(known) == 1 else style["color"]
            alpha = 0.6 if len(known) == 1 else 0.25
            thin: dict[str, Any] = {"color": shade, "linewidth": 0.6, "alpha": alpha, "zorder": 2}
            lines = axes.plot(grid, curves.T, **thin)
            lines[0].set_label("subject" if len(known) == 1 else "_subject")
        one = "mean over subjects" if len(subjects) > 1 else "one subject"
        axes.plot(grid, mean, **style, linewidth=1.8, zorder=3, label=condition or one)
        middle = grid[int(np.argmax(mean >= 0.5))]
        axes.plot((middle, middle), (0.0, 0.5), color=style["color"], linewidth=0.7)
        axes.plot(middle, 0.5, marker="o", markersize=4.0, color=style["color"], zorder=4)
        axes.annotate(
            f"median {middle:.2g}",
            (middle, 0.5),
            xytext=(6.0, -3.0 - 10.0 * number),
            textcoords="offset points",
            va="top",
            color=style["color"],
            zorder=5,
        )
    axes.set_xlim(0.0, top)
    axes.set_ylim(0.0, 1.0)
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)


def _cumulative(ordered: Array, grid: Array) -> Array:
    """Share of the values that do not exceed each point of the grid."""
    return np.searchsorted(ordered, grid, side="right") / ordered.size
