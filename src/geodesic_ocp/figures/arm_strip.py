"""A strip of arms: stick figures side by side, one for each of some instants."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.styles import OBSERVED, PREDICTED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_VIEWS = (1, 0)  # the horizontal axis of each view; z is vertical in both
_GAP = 0.15  # between figures and between views, of the largest extent
_SCALES = (0.05, 0.1, 0.2, 0.5, 1.0)  # [m]
_NOTE: dict[str, Any] = {"color": "0.3", "fontsize": "small"}


def strip_instants(segments: Sequence[tuple[int, int]], count: int) -> list[int]:
    """Samples halfway between cuts, of the segments at `count` evenly spaced times.

    At the cuts a prediction agrees with the observation by construction.
    """
    edges = np.linspace(segments[0][0], segments[-1][1], count + 1)
    wanted = (edges[1:] + edges[:-1]) / 2
    chosen = {
        (start + stop) // 2
        for start, stop in segments
        if np.any((wanted >= start) & (wanted < stop))
    }
    return sorted(chosen)


def draw_arm_strip(
    axes: Axes,
    times: Array,
    observed: Array,
    predicted: Array,
    names: tuple[str, str] = ("observed", "predicted"),
) -> None:
    """Draw stick figures, observed and predicted, at some instants, seen along x and along y.

    Args:
        axes: to draw in; its own axes are hidden, and a bar gives the scale.
        times: of the instants (k,) [s].
        observed: end points of the links (k, links, 2, 3) [m].
        predicted: the same, as predicted.
        names: of the two, for a legend.
    """
    both = np.concatenate([observed, predicted])
    low, high = both.min(axis=(0, 1, 2)), both.max(axis=(0, 1, 2))
    height, width = float((high - low)[2]), float((high - low)[list(_VIEWS)].max())
    gap = _GAP * max(height, width)
    pitch = width + gap
    for row, axis in enumerate(_VIEWS):
        origin = np.array([(low[axis] + high[axis]) / 2, high[2] + row * (height + gap)])
        for column in range(len(times)):
            shift = np.array([column * pitch, 0.0]) - origin
            new = row == column == 0
            for links, style, label in (
                (observed[column], {**OBSERVED, "linewidth": 3.0, "marker": "o"}, names[0]),
                (predicted[column], PREDICTED, names[1]),
            ):
                _draw_links(axes, links[..., [axis, 2]] + shift, style, label if new else None)
        middle = (-0.5 * pitch, -row * (height + gap) - 0.5 * height)
        text = f"seen along {'xyz'[1 - axis]}"
        axes.text(*middle, text, **_NOTE, rotation=90, ha="right", va="center")
    bottom = gap - 2 * (height + gap)
    for column, time in enumerate(times):
        axes.text(column * pitch, bottom - 0.3 * gap, f"{time:.1f} s", ha="center", va="top")
    _draw_scale(axes, (len(times) - 0.5) * pitch, bottom, height)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _draw_links(axes: Axes, links: Array, style: dict[str, Any], label: str | None) -> None:
    """Draw links (links, 2, 2) as one line that is broken between them."""
    breaks = np.full((len(links), 1, 2), np.nan)
    line = np.concatenate([links, breaks], axis=1).reshape(-1, 2)
    axes.plot(*line.T, **{"markersize": 4, "solid_capstyle": "round", **style}, label=label)


def _draw_scale(axes: Axes, x: float, y: float, height: float) -> None:
    """Draw a vertical bar of a round length [m]."""
    length = max((each for each in _SCALES if each <= 0.6 * height), default=_SCALES[0])
    axes.plot([x, x], [y, y + length], color="0.3", linewidth=1.5)
    axes.text(x, y + length / 2, f"  {length:g} m", ha="left", va="center", **_NOTE)
