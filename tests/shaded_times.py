"""Which times a panel shades."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes


def is_shaded(axes: Axes, times: np.ndarray) -> np.ndarray:
    """Whether the shaded area of a panel covers each of the times (k,) [s]."""
    (area,) = axes.collections
    (outline,) = area.get_paths()
    points = np.column_stack([times, np.full(times.size, 0.5)])  # half of the panel's height
    return outline.contains_points(points)
