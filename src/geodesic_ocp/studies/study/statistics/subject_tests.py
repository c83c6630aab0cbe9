"""Paired tests over subjects, corrected for their number."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isclose

from geodesic_ocp.comparison.paired_test import PairedTest, paired_test
from geodesic_ocp.studies.study.statistics.measures import StudyMeasure
from geodesic_ocp.studies.study.statistics.multiple_tests import holm, rank_biserial
from geodesic_ocp.studies.study.statistics.subjects import in_natural_order

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
