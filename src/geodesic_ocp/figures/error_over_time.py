"""Errors of several predictions over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.overview import shade_segments
from geodesic_ocp.figures.styles import COMPARED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HEADROOM = 1.6  # above the two predictions with the smallest peaks


def draw_error_over_time(
    axes: Axes,
    time: Array,
    segments: Sequence[tuple[int, int]],
    errors: Mapping[str, Array],
    label: str,
) -> None:
    """Draw errors (k,) over time [s] by prediction; spans between cuts are shaded in turn.

    The two with the smallest peaks set the scale; a peak that exceeds it is written.
    """
    shade_segments(axes, time, segments)
    styles = zip(errors.items(), cycle(COMPARED), strict=False)
    for number, ((name, error), style) in enumerate(styles):
        front = {"marker": "", "zorder": 3.0 - 0.1 * number}
        axes.plot(time, error, **{**style, **front}, label=name)
    peaks = [float(np.max(error)) for error in errors.values()]
    top = min(_HEADROOM * sorted(peaks)[:2][-1], 1.05 * max(peaks))
    for error, peak in zip(errors.values(), peaks, strict=True):
        if peak > top:
            at = time[int(np.argmax(error))]
            note = f"up to {peak:.3g}"
            axes.text(at, 0.93 * top, note, ha="center", va="top", fontsize="small", color="0.3")
    axes.set_ylim(0.0, top or 1.0)
    axes.set_ylabel(label)
