"""Which methods and which conditions are compared with one of them, over subjects."""

from __future__ import annotations

import math
from collections.abc import Sequence

from geodesic_ocp.studies.study.statistics.means import subject_means
from geodesic_ocp.studies.study.statistics.measures import StudyMeasure
from geodesic_ocp.studies.study.statistics.subject_tests import StudyTest, subject_test
from geodesic_ocp.studies.study.statistics.subjects import conditions_of, rows_under, subject_of
from geodesic_ocp.studies.tables.columns import Row


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
