"""What a study compares: errors and numbers of segments, by name."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isclose

import numpy as np
import scipy

from geodesic_ocp.arrays import Array, as_number
from geodesic_ocp.studies.paired_test import PairedTest, paired_test
from geodesic_ocp.studies.tables import Row

_FILTERED = {
    "joint": ("joint_error_rad", "joints [rad]", "joint error [rad]", 1.0),
    "position": ("position_error_m", "hand [m]", "hand position error [mm]", 1000.0),
    "orientation": (
        "orientation_error_rad",
        "hand [rad]",
        "hand orientation error [rad]",
        1.0,
    ),
}


@dataclass(frozen=True)
class StudyMeasure:
    """A number of every recording and method.

    Attributes:
        name: as in `StudyResult.means`.
        column: of recordings.csv.
        header: of a column of a table, with the unit.
        axis: label of a figure's axis, with its unit.
        scale: from the table's unit to that of the axis.
        per_second: whether it is the column's number over the recording's duration.
    """

    name: str
    column: str
    header: str
    axis: str
    scale: float = 1.0
    per_second: bool = False

    def __repr__(self) -> str:
        return f"StudyMeasure({self.name}: {self.header})"

    @property
    def unit(self) -> str:
        """Of the table, such as "rad"; empty of a number without one."""
        return self.header.partition("[")[2].removesuffix("]")

    def of(self, row: Row) -> float:
        """The number in a row of recordings.csv; NaN where it is missing."""
        value, duration = row.get(self.column), row.get("duration_s")
        if not isinstance(value, int | float):
            return math.nan
        if not self.per_second:
            return float(value)
        return value / duration if isinstance(duration, int | float) and duration > 0 else math.nan


MEASURES = {
    each.name: each
    for each in (
        *(StudyMeasure(name, *parts) for name, parts in _FILTERED.items()),
        *(
            StudyMeasure(
                f"{name}_unfiltered",
                column.replace("_error_", "_error_unfiltered_"),
                header.replace(" [", ", unfiltered ["),
                axis.replace(" [", ", unfiltered ["),
                scale,
            )
            for name, (column, header, axis, scale) in _FILTERED.items()
        ),
        StudyMeasure("segments", "segments", "segments", "number of segments"),
        StudyMeasure(
            "segments_per_second",
            "segments",
            "segments per second [1/s]",
            "segments per second [1/s]",
            per_second=True,
        ),
    )
}


def as_measure(name: str) -> StudyMeasure:
    """The measure of this name.

    Raises:
        ValueError: there is none.
    """
    if not isinstance(name, str) or name not in MEASURES:
        raise ValueError(f"measure must be one of {', '.join(MEASURES)}, got {name!r}")
    return MEASURES[name]


def is_known(rows: Iterable[Row], measure: StudyMeasure) -> bool:
    """Whether any row has the measure."""
    return any(math.isfinite(measure.of(row)) for row in rows)


def known_measures(rows: Sequence[Row], names: Iterable[str]) -> list[str]:
    """Those of the measures that any row has."""
    return [name for name in names if is_known(rows, MEASURES[name])]


def known_measure(rows: Sequence[Row], name: str) -> StudyMeasure:
    """The measure of this name.

    Raises:
        ValueError: there is none, or no row has it.
    """
    measure = as_measure(name)
    if not is_known(rows, measure):
        raise ValueError(f"measure {name!r}: the table has no {measure.column}")
    return measure


def holm(p_values: Sequence[float]) -> Array:
    """P-values corrected for their number m by Holm's step-down method.

    p*_(i) = max_(j <= i) min(1, (m - j + 1) p_(j)) for p_(1) <= ... <= p_(m)

    Rejecting where p* < alpha keeps the probability of any false rejection below alpha, whatever
    the dependence of the tests (Holm, "A simple sequentially rejective multiple test procedure",
    Scandinavian Journal of Statistics 6, 1979).
    """
    p = np.asarray(p_values, dtype=float)
    order = np.argsort(p, kind="stable")
    stepped = np.minimum(1.0, p[order] * (p.size - np.arange(p.size)))
    corrected = np.empty_like(p)
    corrected[order] = np.maximum.accumulate(stepped)
    return corrected


def rank_biserial(differences: Sequence[float]) -> float:
    """Matched-pairs rank-biserial correlation, positive where differences are mostly negative.

    r = (W- - W+) / (W- + W+)

    with the sums W of the ranks of |d| over negative and positive differences d; those that are
    zero are left out. 1: every first number is the smaller one; -1: every one is larger; 0 if none
    differs (Kerby, "The simple difference formula", Comprehensive Psychology 3, 2014).
    """
    d = np.asarray(differences, dtype=float)
    d = d[d != 0.0]
    if d.size == 0:
        return 0.0
    ranks = scipy.stats.rankdata(np.abs(d))
    return float(np.sum(np.where(d < 0.0, ranks, -ranks)) / np.sum(ranks))


RowsBySubject = dict[str, list[Row]]


def subject_of(row: Row) -> str:
    """The person; where the recording names none, its file, or else the recording itself."""
    return str(row.get("subject") or row.get("file") or row["recording"])


def by_subject(rows: Iterable[Row]) -> RowsBySubject:
    """Rows of each subject, subjects in natural order."""
    found: RowsBySubject = {}
    for row in rows:
        found.setdefault(subject_of(row), []).append(row)
    return {name: found[name] for name in in_natural_order(found)}


def in_natural_order(names: Iterable[str]) -> list[str]:
    """Names with the numbers in them in order: S2 before S10."""

    def key(name: str) -> tuple[list[tuple[bool, int, str]], str]:
        parts = re.split(r"([0-9]+)", name)
        return [(not p.isdigit(), int(p) if p.isdigit() else 0, p) for p in parts if p], name

    return sorted(names, key=key)


def conditions_of(rows: Iterable[Row], by: str | None) -> list[str]:
    """Values of a column in natural order; a single empty one without a column."""
    return [""] if by is None else in_natural_order({condition_of(row, by) for row in rows})


def condition_of(row: Row, by: str | None) -> str:
    """Value of the column in a row, as text."""
    if by is None:
        return ""
    value = row.get(by)
    return "not given" if value in (None, "") else str(value)


def rows_under(
    rows: Iterable[Row], by: str | None, condition: str, method: str | None = None
) -> list[Row]:
    """The rows under a condition, of one method or of all."""
    return [
        row
        for row in rows
        if condition_of(row, by) == condition and method in (None, row["method"])
    ]


def complete_rows(rows: Sequence[Row], measure: StudyMeasure) -> list[Row]:
    """The rows of the recordings that have the measure of all methods that have it anywhere.

    Raises:
        ValueError: there are no such recordings.
    """
    known = [row for row in rows if math.isfinite(measure.of(row))]
    methods = {row["method"] for row in known}
    counts = Counter(row["recording"] for row in known)
    found = [row for row in rows if counts[row["recording"]] == len(methods)]
    if not found:
        raise ValueError(f"complete: no recording has {measure.name!r} of all methods")
    return found


@dataclass(frozen=True)
class StudyMean:
    """Mean over subjects of their means over recordings: each subject counts the same.

    Attributes:
        method: key of the method.
        condition: of the recordings; empty without conditions.
        measure: name of what is averaged.
        values: by subject, the mean over the recordings that have the measure.
        recordings: their number.
        missing: number of recordings that do not have it, as the method failed or was left out.
        mean: over subjects; NaN without any.
        spread: standard deviation over subjects (n - 1); None with fewer than two subjects.
        interval: confidence interval of the mean by Student's t; None with fewer than two subjects.
    """

    method: str
    condition: str
    measure: str
    values: Mapping[str, float]
    recordings: int
    missing: int
    mean: float
    spread: float | None
    interval: tuple[float, float] | None

    @property
    def subjects(self) -> int:
        """Number of subjects that have the measure."""
        return len(self.values)

    def __repr__(self) -> str:
        where = f" in {self.condition}" if self.condition else ""
        spread = "one subject" if self.spread is None else f"± {self.spread:.3g} (SD)"
        return (
            f"StudyMean({self.method}{where}, {self.measure}: {self.mean:.3g} {spread}, "
            f"{self.subjects} subjects)"
        )


def as_confidence(value: float) -> float:
    """The value, in (0, 1); ValueError otherwise."""
    confidence = as_number("confidence", value)
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must be in (0, 1), got {confidence:g}")
    return confidence


def subject_means(rows: Sequence[Row], measure: StudyMeasure) -> dict[str, float]:
    """Mean over the recordings of each subject that has any, whatever their order."""
    means = {}
    for subject, own in by_subject(rows).items():
        values = [value for row in own if math.isfinite(value := measure.of(row))]
        if values:
            means[subject] = math.fsum(values) / len(values)
    return means


def means_over_subjects(
    rows: Sequence[Row],
    measure: StudyMeasure,
    methods: Sequence[str],
    by: str | None,
    confidence: float,
) -> tuple[StudyMean, ...]:
    """Means of all methods under all conditions, the values of the column `by`."""
    means = []
    for condition in conditions_of(rows, by):
        total = len({row["recording"] for row in rows_under(rows, by, condition)})
        for method in methods:
            own = rows_under(rows, by, condition, method)
            means.append(_mean(own, measure, total, method, condition, confidence))
    return tuple(means)


def _mean(
    rows: Sequence[Row],
    measure: StudyMeasure,
    recordings: int,
    method: str,
    condition: str,
    confidence: float,
) -> StudyMean:
    """The mean of one method's rows under one condition, which has so many recordings in all."""
    found = sum(math.isfinite(measure.of(row)) for row in rows)
    values = subject_means(rows, measure)
    means = np.array(list(values.values()))
    spread, interval = None, None
    mean = math.fsum(means) / means.size if means.size else math.nan
    if means.size > 1:
        spread = float(np.std(means, ddof=1))
        quantile = float(scipy.stats.t.ppf((1.0 + confidence) / 2.0, means.size - 1))
        half = quantile * spread / math.sqrt(means.size)
        interval = (mean - half, mean + half)
    return StudyMean(
        method,
        condition,
        measure.name,
        values,
        found,
        recordings - found,
        mean,
        spread,
        interval,
    )


_ROUNDING = 1e-12  # of the numbers' size


@dataclass(frozen=True, repr=False)
class StudyTest:
    """Whether a method, or a condition, differs from another over subjects.

    Attributes:
        method: key of the method that is tested.
        condition: of the recordings; empty without conditions.
        against: method or condition that it is compared with.
        measure: name of what is compared.
        differences: by subject, the mean of the first minus that of the second.
        left_out: subjects without a pair.
        test: over subjects; the first wins where its number is smaller.
        effect: matched-pairs rank-biserial correlation in [-1, 1], positive if the first is the
            smaller one in most pairs, see `rank_biserial`.
        corrected_p: of Wilcoxon's test, corrected by Holm's method for the number of tests that
            were made together.
        together: that number.
    """

    method: str
    condition: str
    against: str
    measure: str
    differences: Mapping[str, float]
    left_out: tuple[str, ...]
    test: PairedTest
    effect: float
    corrected_p: float
    together: int

    def __repr__(self) -> str:
        where = f" in {self.condition}" if self.condition else ""
        return (
            f"StudyTest({self.method}{where} against {self.against}, {self.measure}: "
            f"{self.test.pairs} subjects, {len(self.left_out)} left out,\n  mean difference "
            f"{self.test.mean_difference:.3g}, effect {self.effect:.2f}, "
            f"p = {self.corrected_p:.3g} (Wilcoxon, Holm))"
        )


def subject_test(
    first: Mapping[str, float],
    second: Mapping[str, float],
    everybody: Collection[str],
    measure: StudyMeasure,
    names: tuple[str, str, str],
    confidence: float,
    seed: int,
) -> StudyTest | None:
    """Test the means of the subjects that are in both; None if there are none.

    Means that differ by rounding alone, by less than 1e-12 of their size, are equal.

    Args:
        first, second: means by subject.
        everybody: all subjects; those without a pair are named.
        measure: what is compared.
        names: method, condition and what it is compared with.
        confidence, seed: see `paired_test`.
    """
    subjects = in_natural_order(first.keys() & second.keys())
    if not subjects:
        return None
    a, b = [first[name] for name in subjects], [second[name] for name in subjects]
    b = [x if isclose(x, y, rel_tol=_ROUNDING) else y for x, y in zip(a, b, strict=True)]
    differences = {name: x - y for name, x, y in zip(subjects, a, b, strict=True)}
    test = paired_test(a, b, confidence=confidence, seed=seed)
    return StudyTest(
        *names,
        measure.name,
        differences,
        tuple(in_natural_order(set(everybody) - set(subjects))),
        test,
        rank_biserial(list(differences.values())),
        test.wilcoxon_p,
        1,
    )


def corrected(tests: Sequence[StudyTest]) -> tuple[StudyTest, ...]:
    """The tests with p-values corrected for their number."""
    p = holm([each.test.wilcoxon_p for each in tests]).tolist() if tests else []
    return tuple(
        replace(each, corrected_p=value, together=len(tests))
        for each, value in zip(tests, p, strict=True)
    )


def compare_methods(
    rows: Sequence[Row],
    measure: StudyMeasure,
    methods: Sequence[str],
    by: str | None,
    against: str,
    confidence: float,
    seed: int,
) -> list[StudyTest]:
    """Every method against one, under each condition, over the recordings that both have.

    Where no subject has a recording with both there is no test.
    """
    found = []
    for condition in conditions_of(rows, by):
        everybody = {subject_of(row) for row in rows_under(rows, by, condition)}
        second = rows_under(rows, by, condition, against)
        for method in methods:
            if method == against:
                continue
            first = rows_under(rows, by, condition, method)
            common = _recordings(first, measure) & _recordings(second, measure)
            a, b = (
                subject_means([row for row in one if row["recording"] in common], measure)
                for one in (first, second)
            )
            names = (method, condition, against)
            found.append(subject_test(a, b, everybody, measure, names, confidence, seed))
    return [each for each in found if each is not None]


def compare_conditions(
    rows: Sequence[Row],
    measure: StudyMeasure,
    methods: Sequence[str],
    by: str | None,
    against: str,
    confidence: float,
    seed: int,
) -> list[StudyTest]:
    """Every condition against one, for each method, over the subjects that have both."""
    found = []
    for condition in conditions_of(rows, by):
        if condition == against:
            continue
        both = [*rows_under(rows, by, condition), *rows_under(rows, by, against)]
        everybody = {subject_of(row) for row in both}
        for method in methods:
            a, b = (
                subject_means(rows_under(rows, by, each, method), measure)
                for each in (condition, against)
            )
            names = (method, condition, against)
            found.append(subject_test(a, b, everybody, measure, names, confidence, seed))
    return [each for each in found if each is not None]


def _recordings(rows: Sequence[Row], measure: StudyMeasure) -> set[object]:
    return {row["recording"] for row in rows if math.isfinite(measure.of(row))}


LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass(frozen=True)
class SynergyStatistics:
    """The synergies of a subject, those at rest included.

    Attributes:
        subject, condition: names; the condition is empty without conditions.
        recordings, synergies: their numbers.
        per_recording: number of synergies in a recording, mean over the recordings.
        per_second: number of synergies in the time [s] of all recordings [1/s].
        durations: quantiles at `LEVELS` [s].
        lengths: quantiles at `LEVELS`, in the metric's unit.
    """

    subject: str
    condition: str
    recordings: int
    synergies: int
    per_recording: float
    per_second: float
    durations: tuple[float, ...]
    lengths: tuple[float, ...]

    def __repr__(self) -> str:
        where = f" in {self.condition}" if self.condition else ""
        return (
            f"SynergyStatistics({self.subject}{where}, {self.synergies} synergies in "
            f"{self.recordings} recordings, median {self.durations[2]:.3g} s)"
        )


def synergy_statistics(
    recordings: Sequence[Row], synergies: Sequence[Row], condition: str
) -> tuple[SynergyStatistics, ...]:
    """Statistics of each subject, in natural order of their names.

    Args:
        recordings: rows of recordings and methods under the condition.
        synergies: rows of the synergies in them.
        condition: its name.
    """
    own = by_subject(synergies)
    found = []
    for subject, rows in by_subject(recordings).items():
        times = {str(row["recording"]): _number(row["duration_s"]) for row in rows}
        mine = own.get(subject, [])
        total = math.fsum(times.values())
        found.append(
            SynergyStatistics(
                subject,
                condition,
                len(times),
                len(mine),
                len(mine) / len(times),
                len(mine) / total if total > 0.0 else math.nan,
                _quantiles([_number(row["duration_s"]) for row in mine]),
                _quantiles([_number(row["length"]) for row in mine]),
            )
        )
    return tuple(found)


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan


def _quantiles(values: Sequence[float]) -> tuple[float, ...]:
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return (math.nan,) * len(LEVELS)
    return tuple(np.quantile(known, LEVELS).tolist())
