"""Line styles of the figures."""

from __future__ import annotations

from typing import Any

import numpy as np

# Dark blue and orange differ in hue and in lightness, and remain distinct in greyscale print.
OBSERVED: dict[str, Any] = {"color": "#1b3a5c", "linewidth": 2.0}
PREDICTED: dict[str, Any] = {"color": "#e07b00", "linewidth": 1.5, "linestyle": (0, (4, 1.5))}
BASELINE: dict[str, Any] = {"color": "#4f8a2e", "linewidth": 1.5, "linestyle": (0, (1, 1))}
NEUTRAL: dict[str, Any] = {"color": "#8a9099", "linewidth": 1.3}
# By what a line, an arm or a path shows, in figures and in scenes; several baselines differ.
ROLES: dict[str, dict[str, Any]] = {
    "observed": OBSERVED,
    "predicted": PREDICTED,
    "baseline": BASELINE,
    "second baseline": {"color": "#333333", "linewidth": 1.5, "linestyle": (0, (5, 2))},
    "third baseline": {"color": "#a3478f", "linewidth": 1.5, "linestyle": (0, (6, 2, 1, 2))},
    "fourth baseline": {"color": "#1f9aa8", "linewidth": 1.5, "linestyle": (0, (2, 2))},
    "neutral": NEUTRAL,
}
# What is drawn around arms in three dimensions, on pages and in videos.
SURROUNDINGS: dict[str, str] = {
    "obstacle": "#b5573f",
    "ellipsoid": "#4f7f9f",
    "gap": "#444b54",
    "overlap": "#c0202a",
    "marker": "#5a4a8a",
    **{"x": "#c8372d", "y": "#3d8f40", "z": "#2f5fb3"},  # axes of frames
}
# Of predictions that are compared: with joint inertia, kinetic energy alone, straight lines.
COMPARED: tuple[dict[str, Any], ...] = (
    {**PREDICTED, "linestyle": "-", "linewidth": 2.0, "marker": "o"},
    {**BASELINE, "linewidth": 1.7, "marker": "^"},
    {**ROLES["second baseline"], "marker": "s"},
)
_DASHES: tuple[Any, ...] = ("-", (0, (6, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))


def line_styles(count: int) -> list[dict[str, Any]]:
    """Styles of several lines: colours from dark to light, and dashes for greyscale print."""
    from matplotlib import colormaps

    shades = colormaps["viridis"](np.linspace(0.0, 0.85, max(count, 2)))
    return [
        {"color": shades[index], "linestyle": _DASHES[index % len(_DASHES)], "linewidth": 1.6}
        for index in range(count)
    ]
