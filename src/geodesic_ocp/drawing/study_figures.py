"""Figures of studies: means and differences over subjects, and distributions of synergies."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import cycle
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.drawing.styles import COMPARED, OBSERVED, new_figure
from geodesic_ocp.figures import added_style
from geodesic_ocp.studies.study_result import ERRORS_SHOWN, MEASURES, StudyResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame, Series


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
# points above their row's mean, and across it
_ABOVE = 0.16
_SPREAD = 0.14
_BELOW = 0.16  # of the mean
_LETTERS = 27  # of a label in a line
_BESIDE = 0.8  # of the least point, at the left end
_DENSE = 40.0  # ratio of the ends of an axis up to which there are three ticks in a decade
_WIDE = 6.0  # ratio of the largest to the smallest mean from which axes are logarithmic
_MEAN: dict[str, Any] = {"markersize": 4.5, "markeredgecolor": "white", "markeredgewidth": 0.6}
STYLES: tuple[dict[str, Any], ...] = tuple(
    {"color": style["color"], "marker": style["marker"]}
    for style in ({**OBSERVED, "marker": "D"}, *COMPARED)
)
_CIRCLE: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 3.2, "color": "0.55"}
_CIRCLE |= {"fillstyle": "none", "markeredgewidth": 0.6}
_INTERVAL: dict[str, Any] = {"linewidth": 1.6, "marker": "|", "markersize": 5.0, "zorder": 3}
_INTERVAL |= {"markeredgewidth": 1.2}


@contextmanager
def paper_style() -> Iterator[None]:
    """Draw and save figures with the fonts and lines of a paper."""
    with added_style(_PAPER):
        yield


@dataclass(frozen=True, repr=False)
class StudyGroup(ShortRepr):
    """Points and mean to be drawn of one method under one condition."""

    label: str  # label of the method
    condition: str  # empty without conditions
    points: tuple[float, ...]  # points of the subjects
    mean: float  # mean of the points; NaN of none
    interval: tuple[float, float] | None = None  # interval of the mean; None if there is none
    note: str = ""  # written at the right edge

    _shown = ("label", "points", "mean")


def draw_groups(axes: Axes, groups: Sequence[StudyGroup], label: str) -> None:
    """Draw one row for each method, from the top: subjects as circles, mean and interval.

    Args:
        groups: in the order of their rows; those of equal labels share one.
        label: label of the horizontal axis, with the unit.
    """
    methods = list(dict.fromkeys(group.label for group in groups))
    conditions = list(dict.fromkeys(group.condition for group in groups))
    share = 0.8 / len(conditions)
    for group in groups:
        number = conditions.index(group.condition)
        row = methods.index(group.label) + share * (number - (len(conditions) - 1) / 2.0)
        style = STYLES[number % len(STYLES)]
        points = np.asarray(group.points)
        above = row - share * (_ABOVE + _SPREAD * _spread(points.size))
        axes.plot(points, above, **_CIRCLE, zorder=2)
        row += share * _BELOW
        if group.interval is not None:
            axes.plot(group.interval, (row, row), color=style["color"], **_INTERVAL)
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
    low = _BESIDE * min(points)
    high = max(*points, *means, *ends) / _BESIDE
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    subs = (1.0, 2.0, 5.0) if high < _DENSE * low else (1.0,)
    axes.xaxis.set_major_locator(LogLocator(subs=subs, numticks=12))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def group_handles(conditions: Sequence[str], interval: str) -> list[Any]:
    """Return the entries of a legend that explain the marks."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], **_CIRCLE, label="subject")]
    for condition, style in zip(conditions, cycle(STYLES), strict=False):
        label = f"{condition}: {interval}" if condition else interval
        handles.append(Line2D([], [], **style, **_MEAN, linewidth=1.6, label=label))
    return handles


def _wrapped(label: str) -> str:
    """Return the label in as few lines as there must be, of about equal lengths."""
    lines = len(textwrap.wrap(label, _LETTERS, break_on_hyphens=False))
    widths = range(max(1, len(label) // max(lines, 1)), _LETTERS + 1)
    found = (textwrap.wrap(label, width, break_on_hyphens=False) for width in widths)
    return "\n".join(next((each for each in found if len(each) == lines), [label]))


def _spread(count: int) -> Array:
    """Return offsets in [-1, 1] that part neighbours, the same every time."""
    golden = (np.sqrt(5.0) - 1.0) / 2.0
    return np.asarray(2.0 * ((0.5 + golden * np.arange(count)) % 1.0) - 1.0)


_POINTS = 400
_DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1)), (0, (5, 1.5, 1, 1.5)))
_MOST = 0.995  # of all values are within the axis


def draw_distributions(axes: Axes, values: Mapping[str, Sequence[Array]], label: str) -> None:
    """Draw cumulative distributions: of subjects thin, their mean thick, its median marked.

    The mean of the subjects' distributions counts every subject the same.

    Args:
        values: values of each subject, (k,) each, by condition; NaN are left out.
        label: label of the horizontal axis, with the unit.
    """
    finite = {c: [np.sort(x[np.isfinite(x)]) for x in each] for c, each in values.items()}
    known = {condition: [x for x in each if x.size] for condition, each in finite.items()}
    everything = np.concatenate([np.zeros(0), *(x for each in known.values() for x in each)])
    axes.set_xlabel(label)
    if not everything.size:
        return
    top = float(np.quantile(everything, _MOST)) or 1.0
    grid = np.linspace(0.0, top, _POINTS)
    alone = len(known) == 1
    for number, (condition, subjects) in enumerate(known.items()):
        if not subjects:
            continue
        curves = np.array([np.searchsorted(x, grid, side="right") / x.size for x in subjects])
        mean = curves.mean(axis=0)
        color = STYLES[number % len(STYLES)]["color"]
        if len(subjects) > 1:
            thin: dict[str, Any] = {"linewidth": 0.6, "zorder": 2}
            thin |= {"color": "0.75", "alpha": 0.6} if alone else {"color": color, "alpha": 0.25}
            axes.plot(grid, curves.T, **thin)[0].set_label("subject" if alone else "_subject")
        name = condition or ("mean over subjects" if len(subjects) > 1 else "one subject")
        style = {"color": color, "linestyle": _DASHES[number % len(_DASHES)], "label": name}
        axes.plot(grid, mean, **style, linewidth=1.8, zorder=3)
        middle = grid[int(np.argmax(mean >= 0.5))]
        axes.plot((middle, middle), (0.0, 0.5), color=color, linewidth=0.7)
        axes.plot(middle, 0.5, marker="o", markersize=4.0, color=color, zorder=4)
        place: dict[str, Any] = {"textcoords": "offset points", "va": "top", "zorder": 5}
        offset = (6.0, -3.0 - 10.0 * number)
        axes.annotate(f"median {middle:.2g}", (middle, 0.5), offset, color=color, **place)
    axes.set_xlim(0.0, top)
    axes.set_ylim(0.0, 1.0)
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)


# number of groups at most, and of points in one at least
_BINS = 10
_LEAST = 12
_MOST_SYNERGIES = 0.99  # of all values are within the axes


def draw_trend(axes: Axes, x: Array, y: Array, labels: tuple[str, str]) -> None:
    """Draw points (k,) and, of groups of equal numbers along x, medians and quartiles of y.

    Points are one image also in a vector file, which stays small.

    Args:
        x, y: numbers; pairs with a NaN are left out.
        labels: labels of the two axes, with units.
    """
    known = np.isfinite(x) & np.isfinite(y)
    x = x[known]
    y = y[known]
    dots: dict[str, Any] = {"linestyle": "none", "marker": "o", "color": "0.62", "label": "synergy"}
    dots |= {"markersize": 2.2, "markeredgewidth": 0.0, "rasterized": True, "zorder": 2}
    axes.plot(x, y, alpha=float(np.clip(12.0 / np.sqrt(max(x.size, 1)), 0.06, 0.8)), **dots)
    count = min(_BINS, x.size // _LEAST)
    if count >= 2:
        groups = np.array_split(np.argsort(x, kind="stable"), count)
        middle = np.array([np.median(x[group]) for group in groups])
        levels = (0.25, 0.5, 0.75)
        low, median, high = np.array([np.quantile(y[group], levels) for group in groups]).T
        band: dict[str, Any] = {"color": OBSERVED["color"], "alpha": 0.22, "linewidth": 0.0}
        axes.fill_between(middle, low, high, **band, zorder=3, label="quartiles")
        line: dict[str, Any] = {"color": OBSERVED["color"], "marker": "o", "markersize": 3.5}
        axes.plot(middle, median, **line, linewidth=1.6, zorder=4, label="median of equal groups")
    if x.size:
        axes.set_xlim(0.0, 1.03 * float(np.quantile(x, _MOST_SYNERGIES)) or 1.0)
        axes.set_ylim(0.0, 1.05 * float(np.quantile(y, _MOST_SYNERGIES)) or 1.0)
    axes.set_xlabel(labels[0])
    axes.set_ylabel(labels[1])


_ROW = 0.36  # [inch] of a method, and of axis and legend
_FRAME = 0.95  # [inch] of a method, and of axis and legend
_COLUMNS = 4  # of a legend
_LEGEND: dict[str, Any] = {"loc": "outside lower center", "frameon": False}


class Means(NamedTuple):
    """Means of a measure to be drawn."""

    axis: str  # label of the axis, with its unit
    scale: float  # from the table's unit to that of the axis
    # table by condition, if there are several, and method, with columns "mean" and the ends of the
    # interval as the last two
    table: DataFrame
    points: list[Array]  # the subjects' means (k,) of each row of the table


def _key(index: Any) -> tuple[str, str]:
    """Return condition and method of a row; the condition is empty if there are none."""
    return index if isinstance(index, tuple) else ("", index)


def errors_figure(means: Sequence[Means]) -> Figure:
    """Draw means of several measures by method, a panel each, with subjects as points."""
    panels = []
    for each in means:
        groups = []
        for (index, row), own in zip(each.table.iterrows(), each.points, strict=True):
            condition, label = _key(index)
            points = tuple(each.scale * own)
            ends = _interval(each.scale, *row.iloc[-2:])
            groups.append(StudyGroup(label, condition, points, each.scale * row["mean"], ends))
        panels.append(groups)
    figure = new_figure(WIDTH, _height(panels[0]))
    all_axes = np.ravel(figure.subplots(1, len(panels), sharey=True, squeeze=False))
    for axes, groups, each in zip(all_axes, panels, means, strict=True):
        draw_groups(axes, groups, each.axis)
        fit_scale(axes, groups)
    several = any(group.interval for groups in panels for group in groups)
    conditions = list(dict.fromkeys(group.condition for groups in panels for group in groups))
    handles = group_handles(conditions, "mean, 95% interval" if several else "mean")
    figure.legend(handles=handles, ncols=min(_COLUMNS, len(handles)), **_LEGEND)
    return figure


def differences_figure(
    tests: DataFrame, points: Sequence[Array], against: str, axis: str, scale: float
) -> Figure:
    """Draw paired differences of one measure, with their intervals and p-values.

    Args:
        tests: tests, indexed by condition (if there are several) and method.
        points: differences of the subjects, (k,) for each test.
        against: label of the reference.
        axis: label of the measure's axis, with its unit.
        scale: from the table's unit to that of the axis.
    """
    groups = []
    for (index, row), own in zip(tests.iterrows(), points, strict=True):
        condition, label = _key(index)
        p = f"p = {row['p, Holm']:.3g}" if row["p, Holm"] >= 0.001 else "p < 0.001"
        note = f"{p}, n = {own.size}" if own.size > 1 else "n = 1"
        ends = _interval(scale, row["95% low"], row["95% high"])
        groups.append(
            StudyGroup(label, condition, tuple(scale * own), scale * float(own.mean()), ends, note)
        )
    figure = new_figure(0.72 * WIDTH, _height(groups))
    axes = figure.subplots()
    axes.axvline(0.0, color="0.3", linewidth=0.8, linestyle=(0, (4, 2)), zorder=1)
    name, bracket, unit = axis.partition(" [")
    draw_groups(axes, groups, f"{name}:\ndifference from {against}{bracket}{unit}")
    several = any(group.interval for group in groups)
    if several:
        head: dict[str, Any] = {"va": "bottom", "fontsize": 7.0, "color": "0.3"}
        axes.text(1.02, 1.0, "Wilcoxon, Holm", transform=axes.transAxes, **head)
    conditions = list(dict.fromkeys(group.condition for group in groups))
    what = "mean difference, 95% interval" if several else "difference"
    handles = group_handles(conditions, what)
    figure.legend(handles=handles, ncols=min(2, len(handles)), **_LEGEND)
    return figure


def synergies_figure(groups: Mapping[str, Sequence[DataFrame]], unit: str) -> Figure:
    """Draw cumulative distributions of the synergies' durations and lengths.

    Args:
        groups: the synergies of each subject, by condition.
        unit: unit of lengths; empty if it is not known.
    """
    figure = new_figure(WIDTH, 2.9)
    panels = figure.subplots(1, 2, sharey=True)
    sign = re.sub(r"sqrt\((\w+)\)", r"√\1", unit)
    labels = ("duration of a synergy [s]", f"length of a synergy{f' [{sign}]' if sign else ''}")
    for axes, column, text in zip(panels, ("duration_s", "length"), labels, strict=True):
        own = {name: [x[column].to_numpy(float) for x in each] for name, each in groups.items()}
        draw_distributions(axes, own, text)
    panels[0].set_ylabel("share of synergies")
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, ncols=min(_COLUMNS, len(handles)), **_LEGEND)
    return figure


def durations_figure(durations: Series, errors: Sequence[tuple[str, Series]]) -> Figure:
    """Draw errors within each synergy against its duration [s]; each with its axis label."""
    figure = new_figure(WIDTH, 2.9)
    panels = figure.subplots(1, len(errors))
    for axes, (label, values) in zip(panels, errors, strict=True):
        labels = ("duration of a synergy [s]", f"mean {label}")
        draw_trend(axes, durations.to_numpy(float), values.to_numpy(float), labels)
    handles, names = panels[0].get_legend_handles_labels()
    legend = figure.legend(handles, names, ncols=min(_COLUMNS, len(handles)), **_LEGEND)
    for handle in legend.legend_handles[:1]:
        if handle is not None:
            handle.set_alpha(1.0)  # a single point of many is too pale to see
    return figure


def _interval(scale: float, low: float, high: float) -> tuple[float, float] | None:
    return (scale * low, scale * high) if np.isfinite(low) else None


def _height(groups: Sequence[StudyGroup]) -> float:
    methods = len({group.label for group in groups})
    conditions = len({group.condition for group in groups})
    return _FRAME + _ROW * methods * max(1.0, 0.55 * conditions)


def study_figure(study: StudyResult) -> Figure:
    """Draw errors of joints and hand by method, with subjects as points."""
    means = []
    for name in study.known(ERRORS_SHOWN):
        table, points = study.subjects_by_row(name)
        means.append(Means(MEASURES[name].axis, MEASURES[name].scale, table, points))
    with paper_style():
        return errors_figure(means)


def study_figures(
    study: StudyResult, measure: str = "joint", against: str | None = None
) -> dict[str, Figure]:
    """Return the figures of a paper, by name.

    >>> recording = go.trajectory.bundled_recording()
    >>> analysis = go.analyse(recording.model, recording.motion)
    >>> study = go.study([analysis, analysis], subjects=["A", "B"])
    >>> list(go.drawing.study_figures(study))
    ['errors', 'differences', 'synergies', 'durations']

    "errors": means of joints and hand by method with subjects as points; "differences": paired
    differences from `against`; "synergies": distributions of durations and lengths, and
    "durations": errors against duration, if there is a table of synergies.

    Args:
        study: result of `study`.
        measure, against: measure and reference of the differences, see `StudyResult.tests`.

    Raises:
        ValueError: as `StudyResult.tests`.
    """
    tests, points = study.paired_differences(measure, against)
    figures = {"errors": study_figure(study)}
    with paper_style():
        if len(tests):
            chosen = MEASURES[measure]
            references = tests["against"].unique()
            label = str(references[0]) if len(references) == 1 else "the counterpart"
            figures["differences"] = differences_figure(
                tests, points, label, chosen.axis, chosen.scale
            )
        if study.synergies is not None and len(study.synergies):
            rows = study.synergy_rows
            groups = {
                name: [own for _, own in under.groupby("subject")]
                for name, under in rows.groupby("condition")
            }
            figures["synergies"] = synergies_figure(groups, study.length_unit)
            errors = [MEASURES[name] for name in ERRORS_SHOWN[:2]]
            axes = [(each.axis, each.scale * rows[each.column]) for each in errors]
            figures["durations"] = durations_figure(rows["duration_s"], axes)
    return figures
