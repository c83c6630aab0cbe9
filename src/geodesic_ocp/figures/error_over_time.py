"""Errors of several predictions over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.overview import shade_segments
from geodesic_ocp.figures.styles import BASELINE, PREDICTED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HEADROOM = 1.6  # above the first two predictions
# Of the first, second, ... prediction; distinct in greyscale by their dashes.
ERROR_STYLES: tuple[dict[str, Any], ...] = (
    {**PREDICTED, "linestyle": "-", "linewidth": 2.0, "zorder": 3},
    {"color": "0.25", "linewidth": 1.3, "linestyle": (0, (5, 2))},
    {**BASELINE, "linewidth": 1.5},
)


def draw_error_over_time(
    axes: Axes,
    time: Array,
    segments: Sequence[tuple[int, int]],
    errors: Mapping[str, Array],
    label: str,
) -> None:
    """Draw errors (k,) over time [s] by prediction; spans between cuts are shaded in turn.

    The first two predictions set the scale; the peak of another that exceeds it is written.
    """
    shade_segments(axes, time, segments)
    for (name, error), style in zip(errors.items(), ERROR_STYLES, strict=False):
        axes.plot(time, error, **style, label=name)
    peaks = [float(np.max(error)) for error in errors.values()]
    top = min(_HEADROOM * max(peaks[:2]), 1.05 * max(peaks))
    for error, peak in zip(errors.values(), peaks, strict=True):
        if peak > top:
            at = time[int(np.argmax(error))]
            note = f"up to {peak:.2g}"
            axes.text(at, 0.93 * top, note, ha="center", va="top", fontsize="small", color="0.3")
    axes.set_ylim(0.0, top or 1.0)
    axes.set_ylabel(label)
