"""Line styles of the figures."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from geodesic_ocp.figures import STYLE_LOCK
from geodesic_ocp.tables import in_degrees as table_in_degrees

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure


# What something shows; each role has one colour in scenes, plots and figures.
Role: TypeAlias = Literal[
    "observed",
    "predicted",
    "baseline",
    "second baseline",
    "third baseline",
    "fourth baseline",
    "neutral",
]

# Dark blue and orange differ in hue and in lightness, and remain distinct in greyscale print.
OBSERVED: dict[str, Any] = {"color": "#1b3a5c", "linewidth": 2.0}
PREDICTED: dict[str, Any] = {"color": "#e07b00", "linewidth": 1.5, "linestyle": (0, (4, 1.5))}
BASELINE: dict[str, Any] = {"color": "#1b7837", "linewidth": 1.5, "linestyle": (0, (1, 1))}
NEUTRAL: dict[str, Any] = {"color": "#8a9099", "linewidth": 1.3}
# By what a line, an arm or a path shows, in figures and in scenes; all differ to the colour-blind.
ROLES: dict[str, dict[str, Any]] = {
    "observed": OBSERVED,
    "predicted": PREDICTED,
    "baseline": BASELINE,
    "second baseline": {"color": "#333333", "linewidth": 1.5, "linestyle": (0, (5, 2))},
    "third baseline": {"color": "#8500b2", "linewidth": 1.5, "linestyle": (0, (6, 2, 1, 2))},
    "fourth baseline": {"color": "#00a5e0", "linewidth": 1.5, "linestyle": (0, (2, 2))},
    "neutral": NEUTRAL,
}
# What is drawn around arms in three dimensions, on pages and in videos.
SURROUNDINGS: dict[str, str] = {
    "obstacle": "#b5573f",
    "ellipsoid": "#4f7f9f",
    "gap": "#444b54",
    "overlap": "#7a0020",
    "marker": "#5a4a8a",
    **{"x": "#b3241f", "y": "#5fbf4f", "z": "#2f5fb3"},  # axes of frames
}
# Of predictions that are compared: with joint inertia, kinetic energy alone, straight lines.
COMPARED: tuple[dict[str, Any], ...] = (
    {**PREDICTED, "linestyle": "-", "linewidth": 2.0, "marker": "o"},
    {**BASELINE, "linewidth": 1.7, "marker": "^"},
    {**ROLES["second baseline"], "marker": "s"},
)
_DASHES: tuple[Any, ...] = ("-", (0, (6, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))


def line_styles(count: int) -> list[dict[str, Any]]:
    """Get styles of several lines: colours from dark to light, and dashes for greyscale print."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    shades = [*map(to_hex, colormaps["viridis"](np.linspace(0.0, 0.85, max(count, 2))))]
    return [
        {"color": shades[index], "linestyle": _DASHES[index % len(_DASHES)], "linewidth": 1.6}
        for index in range(count)
    ]


def mixed(colour: str, white: float = 0.0) -> tuple[float, float, float]:
    """Return red, green and blue, from 0 to 1, of a colour with this share of white."""
    from matplotlib.colors import to_rgb

    red, green, blue = (white + (1.0 - white) * each for each in to_rgb(colour))
    return red, green, blue


@contextmanager
def own_style(settings: dict[Any, Any]) -> Iterator[None]:
    """Draw with matplotlib's defaults and these settings, whatever style the user has chosen.

    The user's settings are restored at the end; other threads wait until then.
    """
    import matplotlib.style

    with STYLE_LOCK, matplotlib.style.context(["default", settings]):
        yield


# Lines at stable and at doubtful cuts.
PALE = "0.65"
CUT_LINES: dict[str, dict[str, Any]] = {
    "stable": {"color": "0.25", "linewidth": 0.9, "linestyle": "-"},
    "doubtful": {"color": PALE, "linewidth": 0.9, "linestyle": (0, (4, 3))},
}


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of this size [inch], which adjusts its layout to its contents."""
    # Importing matplotlib takes longer than many computations: only what draws imports it.
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def in_degrees(shown: Any) -> Any:
    """Return a table or a figure with its angles in degrees instead of radians.

    >>> recording = go.trajectory.bundled_recording()
    >>> analysis = go.analyse(recording.model, recording.motion)
    >>> go.drawing.in_degrees(analysis.table()).columns[1]
    'joints [deg]'
    >>> figure = go.drawing.in_degrees(go.plot(analysis))
    >>> figure.axes[1].get_ylabel()
    'joints [deg]'

    Args:
        shown: a table with columns "... [rad]", of which a new one is returned; or a figure with
            axes labelled "... [rad]" or "... [mrad]", whose labels and ticks are changed.
    """
    if hasattr(shown, "columns"):
        return table_in_degrees(shown)
    for axes in shown.axes:
        for axis in (axes.xaxis, axes.yaxis):
            for unit, size in (("[rad]", 1.0), ("[mrad]", 1e-3)):
                if unit in axis.get_label_text():
                    axis.set_label_text(axis.get_label_text().replace(unit, "[deg]"))
                    _mark_degrees(axis, size)
                    for each in axes.texts if axis is axes.yaxis else ():
                        word, _, peak = each.get_text().rpartition(" ")
                        if word == "up to":  # of a line that leaves the panel
                            each.set_text(f"{word} {np.degrees(size * float(peak)):.3g}")
    return shown


def _mark_degrees(axis: Axis, size: float) -> None:
    """Mark degrees on an axis whose values are in a unit of this size [rad]."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    class Degrees(MaxNLocator):
        def tick_values(self, vmin: float, vmax: float) -> Any:
            low, high = np.degrees([size * vmin, size * vmax])
            return np.radians(super().tick_values(low, high)) / size

    axis.set_major_locator(Degrees(nbins=6, steps=[1, 2, 3, 5, 10]))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{np.degrees(size * value):.4g}"))
