"""One number against another: points, and medians of groups of equal size."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.styles import OBSERVED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BINS, _LEAST = 10, 12  # number of groups at most, and of points in one at least
_MOST = 0.99  # of all values are within the axes


def draw_trend(axes: Axes, x: Array, y: Array, labels: tuple[str, str]) -> None:
    """Draw points (k,) and, of groups of equal numbers along x, medians and quartiles of y.

    Points are one image also in a vector file, which stays small.

    Args:
        axes: of matplotlib.
        x, y: numbers; pairs with a NaN are left out.
        labels: of the two axes, with units.
    """
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    axes.plot(
        x,
        y,
        linestyle="none",
        marker="o",
        markersize=2.2,
        markeredgewidth=0.0,
        color="0.62",
        alpha=float(np.clip(12.0 / np.sqrt(max(x.size, 1)), 0.06, 0.8)),
        rasterized=True,
        zorder=2,
        label="synergy",
    )
    count = min(_BINS, x.size // _LEAST)
    if count >= 2:
        groups = np.array_split(np.argsort(x, kind="stable"), count)
        middle = np.array([np.median(x[group]) for group in groups])
        low, median, high = (
            np.array([np.quantile(y[group], level) for group in groups])
            for level in (0.25, 0.5, 0.75)
        )
        color = OBSERVED["color"]
        band: dict[str, Any] = {"color": color, "alpha": 0.22, "linewidth": 0.0, "zorder": 3}
        axes.fill_between(middle, low, high, **band, label="quartiles")
        line: dict[str, Any] = {
            "color": color,
            "marker": "o",
            "markersize": 3.5,
            "linewidth": 1.6,
            "zorder": 4,
        }
        axes.plot(middle, median, **line, label="median of equal groups")
    if x.size:
        axes.set_xlim(0.0, 1.03 * float(np.quantile(x, _MOST)) or 1.0)
        axes.set_ylim(0.0, 1.05 * float(np.quantile(y, _MOST)) or 1.0)
    axes.set_xlabel(labels[0])
    axes.set_ylabel(labels[1])
