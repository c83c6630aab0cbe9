"""The figures of a study, for a paper."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.study_figures import (
    WIDTH,
    StudyGroup,
    draw_distributions,
    draw_groups,
    draw_trend,
    fit_scale,
    group_handles,
    paper_style,
)
from geodesic_ocp.figures.styles import new_figure, save_figure
from geodesic_ocp.studies.statistics import (
    LEVELS,
    MEASURES,
    StudyMean,
    StudyMeasure,
    StudyTest,
    SynergyStatistics,
    by_subject,
    conditions_of,
    rows_under,
    subject_means,
)
from geodesic_ocp.studies.study_sources import subjects_note, tests_note
from geodesic_ocp.studies.tables import Row
from geodesic_ocp.table import Table

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


_DOTS = 300.0  # an inch, of .png


def write_study(
    folder: Path,
    tables: Mapping[str, tuple[str, Table]],
    tidy: Mapping[str, Table],
    figures: Mapping[str, Figure],
    summary: str,
) -> None:
    """Write tables as .md and .tex, tidy ones as .csv, figures as .pdf and .png, and study.md.

    Args:
        folder: which exists.
        tables: caption and table, by the name of the file.
        tidy: tables with all digits.
        figures: by the name of the file.
        summary: Markdown, the first part of study.md, above all tables.
    """
    parts = [summary]
    for name, (caption, table) in tables.items():
        latex = table.latex(caption, f"tab:{name}")
        (folder / f"{name}.tex").write_text(latex, encoding="utf-8")
        (folder / f"{name}.md").write_text(table.markdown(), encoding="utf-8")
        parts.append(f"## {caption}\n\n{table.markdown()}")
    (folder / "study.md").write_text("\n".join(parts), encoding="utf-8")
    for name, table in tidy.items():
        (folder / f"{name}.csv").write_text(table.csv(), encoding="utf-8")
    with paper_style():
        for name, figure in figures.items():
            save_figure(figure, folder, name, _DOTS)


Label = Callable[[str], str]
_Cells = tuple[str | int | float, ...]
NONE = "-"  # where a number does not exist


def means_table(
    means: Sequence[Sequence[StudyMean]], label: Label, by: str | None, confidence: float, note: str
) -> Table:
    """Mean, standard deviation over subjects and confidence interval.

    Args:
        means: a row each: one method under one condition, by measure.
        label: of a method.
        by: what the conditions are; None without conditions.
        confidence: of the intervals.
        note: below the table.
    """
    header = [*([by] if by else []), "method", "subjects", "recordings"]
    for each in means[0]:
        name, _, unit = MEASURES[each.measure].header.partition(" [")
        bracket = f" [{unit}" if unit else ""
        header += [f"{name}, mean ± SD{bracket}", f"{confidence:.0%} interval{bracket}"]
    rows: list[_Cells] = []
    for row in means:
        first = row[0]
        counts = {(each.subjects, each.recordings) for each in row}
        subjects, recordings = (
            "/".join(dict.fromkeys(str(c[k]) for c in sorted(counts))) for k in (0, 1)
        )
        cells: list[str | int | float] = [label(first.method), subjects, recordings]
        for each in row:
            cells += [plus_minus(each.mean, each.spread), interval(each.interval)]
        rows.append((*([first.condition] if by else []), *cells))
    return Table(tuple(header), tuple(rows), note)


def tidy_means(means: Sequence[StudyMean], by: str | None, confidence: float) -> Table:
    """One row for each measure, method and condition, with all digits in CSV."""
    names = ("measure", by or "condition", "method", "subjects", "recordings", "missing")
    ends = (f"{confidence:.0%} low", f"{confidence:.0%} high")
    rows: list[_Cells] = []
    for each in means:
        low, high = (NONE, NONE) if each.interval is None else each.interval
        spread = NONE if each.spread is None else each.spread
        counts = (each.subjects, each.recordings, each.missing)
        mean = each.mean if math.isfinite(each.mean) else NONE
        first = (each.measure, each.condition, each.method)
        rows.append((*first, *counts, mean, spread, low, high, MEASURES[each.measure].unit))
    return Table((*names, "mean", "SD", *ends, "unit"), tuple(rows))


def by_subject_table(
    rows: Sequence[Row], measure: StudyMeasure, methods: Mapping[str, str], by: str | None
) -> Table:
    """Means of each subject (row) and method (column)."""
    entries: list[_Cells] = []
    for condition in conditions_of(rows, by):
        means = [
            subject_means(rows_under(rows, by, condition, method), measure) for method in methods
        ]
        for subject, own in by_subject(rows_under(rows, by, condition)).items():
            recordings = len({row["recording"] for row in own})
            values = (each.get(subject, NONE) for each in means)
            entries.append((*((condition,) if by else ()), subject, recordings, *values))
    header = (*([by] if by else []), "subject", "recordings", *methods.values())
    note = " ".join([f"Means of the subject's recordings: {measure.header}.", *subjects_note(rows)])
    return Table(header, tuple(entries), note)


def tests_table(
    tests: Sequence[StudyTest],
    measure: StudyMeasure,
    label: Label,
    by: str | None,
    against: str,
    caveats: Sequence[str],
) -> Table:
    """Paired tests, one a row.

    Args:
        tests: made together; without any, no subject has both numbers of a pair.
        measure: what is compared.
        label: of a method.
        by: what the conditions are; None without conditions.
        against: what the method or condition is called.
        caveats: about the subjects, below the table.
    """
    unit = f" [{measure.unit}]" if measure.unit else ""
    confidence = tests[0].test.confidence if tests else 0.95
    header = (
        *([by] if by else []),
        f"against {against}",
        "subjects",
        "left out",
        "smaller in",
        f"mean difference{unit}",
        f"{confidence:.0%} interval{unit}",
        "effect",
        "Wilcoxon p",
        "p, Holm",
    )
    rows = tuple(
        (
            *([each.condition] if by else []),
            label(each.method),
            each.test.pairs,
            len(each.left_out),
            f"{each.test.wins} of {each.test.pairs}",
            each.test.mean_difference,
            interval(each.test.interval),
            each.effect if each.test.pairs > 1 else NONE,
            each.test.wilcoxon_p if each.test.pairs > 1 else NONE,
            each.corrected_p if each.test.pairs > 1 else NONE,
        )
        for each in tests
    )
    note = tests_note(tests, caveats) if tests else f"No subject can be compared with {against}."
    return Table(header, rows, note)


def tidy_tests(tests: Sequence[StudyTest], by: str | None, confidence: float) -> Table:
    """One row for each test, with all digits in CSV."""
    header = ("measure", by or "condition", "method", "against", "subjects", "left out")
    ends = (f"{confidence:.0%} low", f"{confidence:.0%} high")
    found = ("smaller in", "larger in", "equal in", "mean difference", "unit", *ends)
    rows: list[_Cells] = []
    for each in tests:
        test = each.test
        low, high = (end if math.isfinite(end) else NONE for end in test.interval)
        first = (each.measure, each.condition, each.method, each.against)
        counts = (test.pairs, len(each.left_out), test.wins, test.losses, test.ties)
        difference = (test.mean_difference, MEASURES[each.measure].unit, low, high)
        p = (test.sign_p, test.wilcoxon_p, each.corrected_p, each.together)
        rows.append((*first, *counts, *difference, each.effect, *p))
    p_values = ("sign test p", "Wilcoxon p", "Wilcoxon p, Holm", "tests together")
    return Table((*header, *found, "rank-biserial r", *p_values), tuple(rows))


def synergies_table(
    statistics: Sequence[SynergyStatistics],
    by: str | None,
    unit: str,
    caveats: Sequence[str] = (),
) -> Table:
    """Numbers, durations and lengths of synergies, by subject and over subjects."""
    header = (
        *([by] if by else []),
        "subject",
        "recordings",
        "synergies",
        "per recording",
        "per second [1/s]",
        "duration, median (quartiles) [s]",
        f"length, median (quartiles){f' [{unit}]' if unit else ''}",
    )
    rows: list[_Cells] = []
    for condition in dict.fromkeys(each.condition for each in statistics):
        own = [each for each in statistics if each.condition == condition]
        first: _Cells = (condition,) if by else ()
        for each in own:
            counts = (each.recordings, each.synergies, each.per_recording, each.per_second)
            spans = (_quartiles(each.durations), _quartiles(each.lengths))
            rows.append((*first, each.subject, *counts, *spans))
        if len(own) > 1:
            rows.append((*first, *_over_subjects(own)))
    note = "Segments at rest count as synergies. Quantiles are over all synergies of a subject."
    return Table(header, tuple(rows), " ".join([note, *caveats]))


def tidy_synergies(statistics: Sequence[SynergyStatistics], by: str | None, unit: str) -> Table:
    """One row for each subject and condition, with all quantiles."""
    quantiles = [
        f"{name} {level:.0%}{bracket}"
        for name, bracket in (("duration", " [s]"), ("length", f" [{unit}]" if unit else ""))
        for level in LEVELS
    ]
    header = (by or "condition", "subject", "recordings", "synergies", "per recording")
    rows = tuple(
        (
            each.condition,
            each.subject,
            each.recordings,
            each.synergies,
            each.per_recording,
            *(v if math.isfinite(v) else NONE for v in (each.per_second, *each.durations)),
            *(v if math.isfinite(v) else NONE for v in each.lengths),
        )
        for each in statistics
    )
    return Table((*header, "per second [1/s]", *quantiles), rows)


def plus_minus(mean: float, spread: float | None) -> str:
    """Mean ± standard deviation with two digits of the latter, as 0.123 ± 0.045."""
    if not math.isfinite(mean):
        return NONE
    if not spread:
        return f"{mean:#.3g}" if spread is None else f"{mean:#.3g} ± 0"
    decimals = 1 - math.floor(math.log10(spread))
    if not 0 <= decimals <= 5:
        return f"{mean:#.3g} ± {spread:#.2g}"
    return f"{mean:.{decimals}f} ± {spread:.{decimals}f}"


def interval(ends: tuple[float, float] | None) -> str:
    """Low to high; a dash if there is none."""
    if ends is None or not all(map(math.isfinite, ends)):
        return NONE
    return f"{ends[0]:#.3g} to {ends[1]:#.3g}"


def _quartiles(quantiles: Sequence[float]) -> str:
    _, low, middle, high, _ = quantiles
    if not math.isfinite(middle):
        return NONE
    return f"{middle:#.3g} ({low:#.3g} to {high:#.3g})"


def _over_subjects(statistics: Sequence[SynergyStatistics]) -> _Cells:
    """The row of mean ± standard deviation over subjects."""
    columns = [
        [each.per_recording for each in statistics],
        [each.per_second for each in statistics],
        [each.durations[2] for each in statistics],
        [each.lengths[2] for each in statistics],
    ]
    cells = []
    for column in columns:
        known = [value for value in column if math.isfinite(value)]
        spread = float(np.std(known, ddof=1)) if len(known) > 1 else None
        cells.append(plus_minus(float(np.mean(known)) if known else math.nan, spread))
    totals = (sum(each.recordings for each in statistics), sum(s.synergies for s in statistics))
    return ("all subjects, mean ± SD", *totals, *cells)
