"""Groups of subjects side by side: points, means and intervals."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.styles import COMPARED, OBSERVED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Small enough for a column of a paper, which takes fonts as they are.
_PAPER: Any = {
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "pdf.fonttype": 42,  # TrueType, which journals ask for
}
WIDTH = 7.1  # [inch], two columns
_SPREAD = 0.3  # of points across their row
_LETTERS = 26  # of a label in a line
_DARK: dict[str, Any] = {"color": OBSERVED["color"], "marker": "D"}
STYLES: tuple[dict[str, Any], ...] = (
    _DARK,
    *({"color": style["color"], "marker": style["marker"]} for style in COMPARED),
)


@contextmanager
def paper_style() -> Iterator[None]:
    """Draw and save figures with the fonts and lines of a paper."""
    import matplotlib

    with matplotlib.rc_context(_PAPER):
        yield


@dataclass(frozen=True)
class StudyGroup:
    """What is drawn of one method under one condition.

    Attributes:
        label: of the method.
        condition: empty without conditions.
        points: of the subjects.
        mean: of the points; NaN of none.
        interval: of the mean; None if there is none.
        note: written at the right edge.
    """

    label: str
    condition: str
    points: tuple[float, ...]
    mean: float
    interval: tuple[float, float] | None = None
    note: str = ""

    def __repr__(self) -> str:
        return f"StudyGroup({self.label!r}, {len(self.points)} points, mean {self.mean:.3g})"


def draw_groups(axes: Axes, groups: Sequence[StudyGroup], label: str) -> None:
    """Draw one row for each method, from the top: subjects as circles, mean and interval.

    Args:
        axes: of matplotlib.
        groups: in the order of their rows; those of equal labels share one.
        label: of the horizontal axis, with the unit.
    """
    methods = list(dict.fromkeys(group.label for group in groups))
    conditions = list(dict.fromkeys(group.condition for group in groups))
    share = 0.8 / len(conditions)
    for group in groups:
        number = conditions.index(group.condition)
        row = methods.index(group.label) + share * (number - (len(conditions) - 1) / 2.0)
        style = STYLES[number % len(STYLES)]
        points = np.asarray(group.points)
        axes.plot(
            points,
            row + share * _SPREAD * _spread(points.size),
            linestyle="none",
            marker="o",
            markersize=3.2,
            fillstyle="none",
            markeredgewidth=0.6,
            color="0.55",
            zorder=2,
        )
        if group.interval is not None:
            axes.plot(group.interval, (row, row), color=style["color"], linewidth=1.6, zorder=3)
        shown = {**style, "markersize": 5.0, "markeredgecolor": "white", "markeredgewidth": 0.6}
        axes.plot(group.mean, row, linestyle="none", **shown, zorder=4)
        if group.note:
            at = axes.get_yaxis_transform()
            axes.text(1.02, row, group.note, transform=at, va="center", fontsize=7.0)
    axes.set_yticks(range(len(methods)), ["\n".join(textwrap.wrap(m, _LETTERS)) for m in methods])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(methods) - 0.4, -0.6)
    axes.grid(axis="x", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_xlabel(label)


def group_handles(conditions: Sequence[str], interval: str) -> list[Any]:
    """What the marks mean, for a legend."""
    from matplotlib.lines import Line2D

    circle = Line2D(
        [], [], linestyle="none", marker="o", markersize=3.2, fillstyle="none", color="0.55"
    )
    circle.set_label("subject")
    handles = [circle]
    for number, condition in enumerate(conditions):
        style = STYLES[number % len(STYLES)]
        handles.append(
            Line2D([], [], **style, linewidth=1.6, markersize=5.0, markeredgecolor="white")
        )
        handles[-1].set_label(f"{condition}: {interval}" if condition else interval)
    return handles


def _spread(count: int) -> Array:
    """Offsets in [-1, 1] that part neighbours, the same every time."""
    golden = (np.sqrt(5.0) - 1.0) / 2.0
    return np.asarray(2.0 * ((0.5 + golden * np.arange(count)) % 1.0) - 1.0)
