"""The figures of a study, for a paper."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.new_figure import new_figure
from geodesic_ocp.figures.study.distributions import draw_distributions
from geodesic_ocp.figures.study.groups import (
    WIDTH,
    StudyGroup,
    draw_groups,
    fit_scale,
    group_handles,
)
from geodesic_ocp.figures.study.trend import draw_trend
from geodesic_ocp.studies.study.statistics.means import StudyMean
from geodesic_ocp.studies.study.statistics.measures import MEASURES
from geodesic_ocp.studies.study.statistics.subject_tests import StudyTest
from geodesic_ocp.studies.study.statistics.subjects import by_subject
from geodesic_ocp.studies.tables.columns import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ROW, _FRAME = 0.36, 0.95  # [inch] of a method, and of axis and legend
_CONFIDENCE = 0.95
_COLUMNS = 4  # of a legend
_LEGEND: dict[str, Any] = {"loc": "outside lower center", "frameon": False}


def errors_figure(means: Sequence[Sequence[StudyMean]], label: Callable[[str], str]) -> Figure:
    """Means of several measures by method, a panel each, with subjects as points."""
    shown = [[each for each in own if each.subjects] for own in means]
    conditions = list(dict.fromkeys(each.condition for own in shown for each in own))
    figure = new_figure(WIDTH, _height(shown[0], conditions))
    panels = np.ravel(figure.subplots(1, len(shown), sharey=True, squeeze=False))
    for axes, own in zip(panels, shown, strict=True):
        measure = MEASURES[own[0].measure]
        groups = []
        for each in own:
            points = tuple(measure.scale * value for value in each.values.values())
            ends = each.interval and (
                measure.scale * each.interval[0],
                measure.scale * each.interval[1],
            )
            groups.append(
                StudyGroup(
                    label(each.method), each.condition, points, measure.scale * each.mean, ends
                )
            )
        draw_groups(axes, groups, measure.axis)
        fit_scale(axes, groups)
    several = any(each.interval for own in shown for each in own)
    mean = f"mean, {_CONFIDENCE:.0%} interval" if several else "mean"
    handles = group_handles(conditions, mean)
    figure.legend(handles=handles, ncols=min(_COLUMNS, len(handles)), **_LEGEND)
    return figure


def differences_figure(
    tests: Sequence[StudyTest], label: Callable[[str], str], against: str
) -> Figure:
    """Paired differences of one measure, with their intervals and p-values."""
    measure = MEASURES[tests[0].measure]
    conditions = list(dict.fromkeys(each.condition for each in tests))
    figure = new_figure(0.72 * WIDTH, _height(tests, conditions))
    axes = figure.subplots()
    groups = []
    for each in tests:
        points = tuple(measure.scale * value for value in each.differences.values())
        low, high = each.test.interval
        ends = (measure.scale * low, measure.scale * high) if np.isfinite(low) else None
        p = f"p = {each.corrected_p:.3g}" if each.corrected_p >= 0.001 else "p < 0.001"
        note = f"{p}, n = {each.test.pairs}" if each.test.pairs > 1 else "n = 1"
        mean = measure.scale * each.test.mean_difference
        groups.append(StudyGroup(label(each.method), each.condition, points, mean, ends, note))
    axes.axvline(0.0, color="0.3", linewidth=0.8, linestyle=(0, (4, 2)), zorder=1)
    name, _, unit = measure.axis.partition(" [")
    bracket = f" [{unit}" if unit else ""
    draw_groups(axes, groups, f"{name}:\ndifference from {against}{bracket}")
    several = any(group.interval for group in groups)
    what = f"mean difference, {_CONFIDENCE:.0%} interval" if several else "difference"
    if several:
        head: dict[str, Any] = {
            "transform": axes.transAxes,
            "va": "bottom",
            "fontsize": 7.0,
            "color": "0.3",
        }
        axes.text(1.02, 1.0, "Wilcoxon, Holm", **head)
    handles = group_handles(conditions, what)
    figure.legend(handles=handles, ncols=min(2, len(handles)), **_LEGEND)
    return figure


def synergies_figure(rows: dict[str, list[Row]], unit: str) -> Figure:
    """Cumulative distributions of the synergies' durations and lengths, by condition."""
    figure = new_figure(WIDTH, 2.9)
    panels = figure.subplots(1, 2, sharey=True)
    sign = re.sub(r"sqrt\((\w+)\)", r"√\1", unit)
    labels = ("duration of a synergy [s]", f"length of a synergy{f' [{sign}]' if sign else ''}")
    for axes, column, text in zip(panels, ("duration_s", "length"), labels, strict=True):
        values = {
            condition: [_numbers(own, column) for own in by_subject(each).values()]
            for condition, each in rows.items()
        }
        draw_distributions(axes, values, text)
    panels[0].set_ylabel("share of synergies")
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, ncols=min(_COLUMNS, len(handles)), **_LEGEND)
    return figure


def durations_figure(rows: Sequence[Row]) -> Figure:
    """Errors of joints and hand within each synergy, against its duration."""
    figure = new_figure(WIDTH, 2.9)
    panels = figure.subplots(1, 2)
    time = _numbers(rows, "duration_s")
    for axes, name in zip(panels, ("joint", "position"), strict=True):
        measure = MEASURES[name]
        errors = measure.scale * _numbers(rows, measure.column)
        draw_trend(axes, time, errors, ("duration of a synergy [s]", f"mean {measure.axis}"))
    handles, names = panels[0].get_legend_handles_labels()
    legend = figure.legend(handles, names, ncols=min(_COLUMNS, len(handles)), **_LEGEND)
    for handle in legend.legend_handles[:1]:
        if handle is not None:
            handle.set_alpha(1.0)  # a single point of many is too pale to see
    return figure


def _height(rows: Sequence[StudyMean] | Sequence[StudyTest], conditions: Sequence[str]) -> float:
    methods = len({each.method for each in rows})
    return _FRAME + _ROW * methods * max(1.0, 0.55 * len(conditions))


def _numbers(rows: Sequence[Row], column: str) -> Array:
    """The column's numbers (k,); NaN where they are missing."""
    values = (row.get(column) for row in rows)
    return np.array([v if isinstance(v, int | float) else np.nan for v in values], dtype=float)
