"""Means over subjects of the subjects' means, with their spread."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from geodesic_ocp.arrays import as_number
from geodesic_ocp.studies.study.statistics.measures import StudyMeasure
from geodesic_ocp.studies.study.statistics.subjects import by_subject, conditions_of, rows_under
from geodesic_ocp.studies.tables.columns import Row


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
