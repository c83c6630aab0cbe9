"""Groups of subjects side by side: points, means and intervals."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.own_style import added_style
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
_ABOVE, _SPREAD = 0.16, 0.14  # points above their row's mean, and across it
_BELOW = 0.16  # of the mean
_LETTERS = 27  # of a label in a line
_BESIDE = 0.8  # of the least point, at the left end
_DENSE = 40.0  # ratio of the ends of an axis up to which there are three ticks in a decade
_WIDE = 6.0  # ratio of the largest to the smallest mean from which axes are logarithmic
_MEAN: dict[str, Any] = {"markersize": 4.5, "markeredgecolor": "white", "markeredgewidth": 0.6}
_DARK: dict[str, Any] = {"color": OBSERVED["color"], "marker": "D"}
STYLES: tuple[dict[str, Any], ...] = (
    _DARK,
    *({"color": style["color"], "marker": style["marker"]} for style in COMPARED),
)


@contextmanager
def paper_style() -> Iterator[None]:
    """Draw and save figures with the fonts and lines of a paper."""
    with added_style(_PAPER):
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
            row - share * (_ABOVE + _SPREAD * _spread(points.size)),
            linestyle="none",
            marker="o",
            markersize=3.2,
            fillstyle="none",
            markeredgewidth=0.6,
            color="0.55",
            zorder=2,
        )
        row += share * _BELOW
        if group.interval is not None:
            caps: dict[str, Any] = {"marker": "|", "markersize": 5.0, "markeredgewidth": 1.2}
            axes.plot(
                group.interval, (row, row), color=style["color"], linewidth=1.6, zorder=3, **caps
            )
        axes.plot(group.mean, row, linestyle="none", **style, **_MEAN, zorder=4)
        if group.note:
            at = axes.get_yaxis_transform()
            axes.text(1.02, row, group.note, transform=at, va="center", fontsize=7.0)
    axes.set_yticks(range(len(methods)), [_wrapped(method) for method in methods])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(methods) - 0.4, -0.6)
    axes.grid(axis="x", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_xlabel(label)


def fit_scale(axes: Axes, groups: Sequence[StudyGroup]) -> None:
    """Begin the horizontal axis at zero, or make it logarithmic where means differ widely.

    A logarithmic axis ends beside the least point, also where intervals are wider.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    means = [group.mean for group in groups]
    points = [point for group in groups for point in group.points]
    if min(points) <= 0.0 or max(means) < _WIDE * min(means):
        axes.set_xlim(left=0.0)
        axes.xaxis.set_major_locator(MaxNLocator(5))
        return
    ends = [group.interval[1] for group in groups if group.interval is not None]
    low, high = _BESIDE * min(points), max(*points, *means, *ends) / _BESIDE
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    subs = (1.0, 2.0, 5.0) if high < _DENSE * low else (1.0,)
    axes.xaxis.set_major_locator(LogLocator(subs=subs, numticks=12))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


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
        handles.append(Line2D([], [], **style, **_MEAN, linewidth=1.6))
        handles[-1].set_label(f"{condition}: {interval}" if condition else interval)
    return handles


def _wrapped(label: str) -> str:
    """The label in as few lines as there must be, of about equal lengths."""
    lines = len(textwrap.wrap(label, _LETTERS, break_on_hyphens=False))
    widths = range(max(1, len(label) // max(lines, 1)), _LETTERS + 1)
    found = (textwrap.wrap(label, width, break_on_hyphens=False) for width in widths)
    return "\n".join(next((each for each in found if len(each) == lines), [label]))


def _spread(count: int) -> Array:
    """Offsets in [-1, 1] that part neighbours, the same every time."""
    golden = (np.sqrt(5.0) - 1.0) / 2.0
    return np.asarray(2.0 * ((0.5 + golden * np.arange(count)) % 1.0) - 1.0)
