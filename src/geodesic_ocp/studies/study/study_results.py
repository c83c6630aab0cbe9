"""Study: means over subjects, paired tests, tables and figures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from geodesic_ocp.arrays import as_number
from geodesic_ocp.figures.study_groups import paper_style
from geodesic_ocp.records import write_together
from geodesic_ocp.studies.study.compare_over_subjects import (
    compare_conditions,
    compare_methods,
)
from geodesic_ocp.studies.study.means import StudyMean, means_over_subjects
from geodesic_ocp.studies.study.measures import MEASURES, StudyMeasure, as_measure
from geodesic_ocp.studies.study.notes import count, means_note, study_notes, tests_note
from geodesic_ocp.studies.study.study_figures import (
    differences_figure,
    durations_figure,
    errors_figure,
    synergies_figure,
)
from geodesic_ocp.studies.study.study_files import write_study
from geodesic_ocp.studies.study.study_tables import (
    by_subject_table,
    means_table,
    synergies_table,
    tests_table,
    tidy_means,
    tidy_synergies,
)
from geodesic_ocp.studies.study.subject_tests import StudyTest, corrected
from geodesic_ocp.studies.study.subjects import (
    complete_rows,
    conditions_of,
    in_natural_order,
    rows_under,
    subject_of,
)
from geodesic_ocp.studies.study.synergy_statistics import SynergyStatistics, synergy_statistics
from geodesic_ocp.studies.tables import Row
from geodesic_ocp.synergies.usual_metrics import KINETIC_ENERGY, STRAIGHT_LINES
from geodesic_ocp.table import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = ("joint", "position", "orientation")
_ORDER = ("riemannian", "joint_inertia", "kinetic_energy", "euclidean_same_segments", "euclidean")
_LIKE_FOR_LIKE = f"{STRAIGHT_LINES}, same segments"


@dataclass(frozen=True, eq=False, repr=False)
class Study:
    """Recordings of several subjects, analysed; see `study`.

    Attributes:
        rows: one for each recording and method, see `geodesic_ocp.studies.tables`.
        synergies: one for each synergy; None if there is no such table.
        failures: one for each recording that could not be analysed.
        by: column whose values are conditions; None for a single condition.
    """

    rows: tuple[Row, ...]
    synergies: tuple[Row, ...] | None = None
    failures: tuple[Row, ...] = ()
    by: str | None = None

    def __repr__(self) -> str:
        recordings = len({row["recording"] for row in self.rows})
        synergies = "" if self.synergies is None else f", {len(self.synergies)} synergies"
        conditions = f", {len(self.conditions)} conditions ({self.by})" if self.by else ""
        failed = f", {count(len(self.failures), 'failure')}" if self.failures else ""
        return (
            f"Study({count(recordings, 'recording')} of {count(len(self.subjects), 'subject')}, "
            f"{count(len(self.methods), 'method')}{synergies}{conditions}{failed})"
        )

    def _repr_markdown_(self) -> str:
        return self.means_table().markdown()

    @property
    def subjects(self) -> tuple[str, ...]:
        """Names of all persons."""
        return tuple(in_natural_order({subject_of(row) for row in self.rows}))

    @property
    def methods(self) -> dict[str, str]:
        """What each method is called, by its key in the table; the analysis' own is the first."""
        labels: dict[str, set[str]] = {}
        for row in self.rows:
            label = str(row.get("method_label") or row["method"])
            labels.setdefault(str(row["method"]), set()).add(label)
        order = sorted(labels, key=lambda key: (*(key != known for known in _ORDER), key))
        return {key: labels[key].pop() if len(labels[key]) == 1 else key for key in order}

    @property
    def conditions(self) -> tuple[str, ...]:
        """Values of the column `by`; a single empty one if it is None."""
        return tuple(conditions_of(self.rows, self.by))

    @property
    def notes(self) -> tuple[str, ...]:
        """What limits the study, in sentences: failures, one subject only, missing methods."""
        return study_notes(self.rows, self.synergies, self.failures)

    def means(
        self, measure: str = "joint", *, confidence: float = 0.95, complete: bool = False
    ) -> tuple[StudyMean, ...]:
        """Mean over subjects of the subjects' means, of every method under every condition.

        Args:
            measure: "joint", "position", "orientation", these with "_unfiltered" (errors against
                the unfiltered recording), "segments" or "segments_per_second".
            confidence: of the intervals.
            complete: only recordings in which no method lacks the measure, so that methods are
                compared on the same recordings.

        Raises:
            ValueError: an unknown measure, or one that the tables do not have.
        """
        chosen, confidence = as_measure(measure), _as_confidence(confidence)
        self._check_known(chosen)
        rows = complete_rows(self.rows, chosen, self.methods) if complete else self.rows
        return means_over_subjects(rows, chosen, tuple(self.methods), self.by, confidence)

    def means_table(
        self, *measures: str, confidence: float = 0.95, complete: bool = False
    ) -> Table:
        """`means` of several measures, by default errors of joints and hand, one method a row."""
        names = measures or SHOWN
        columns = [self.means(name, confidence=confidence, complete=complete) for name in names]
        note = means_note(self.notes, [each for column in columns for each in column])
        rows = [row for row in zip(*columns, strict=True) if any(each.recordings for each in row)]
        return means_table(rows, self.label, self.by, confidence, note)

    def by_subject(self, measure: str = "joint") -> Table:
        """Mean over the recordings of each subject (row), of every method (column).

        Raises:
            ValueError: an unknown measure, or one that the tables do not have.
        """
        chosen = as_measure(measure)
        self._check_known(chosen)
        return by_subject_table(self.rows, chosen, self.methods, self.by)

    def tests(
        self,
        measure: str = "joint",
        against: str | None = None,
        *,
        confidence: float = 0.95,
        seed: int = 0,
    ) -> tuple[StudyTest, ...]:
        """Paired tests over subjects of all methods against one, or of conditions against one.

        A pair is a subject's means over the recordings that both methods have, or under both
        conditions. P-values of Wilcoxon's test are corrected by Holm's method for the number of
        tests that this call returns.

        Args:
            measure: see `means`.
            against: a method, by key or label, or a condition; by default straight lines on the
                same segments.
            confidence, seed: of the bootstrap interval, see `paired_test`.

        Raises:
            ValueError: an unknown measure, method or condition.
        """
        chosen, confidence = as_measure(measure), _as_confidence(confidence)
        self._check_known(chosen)
        kind, reference = self.reference(against)
        compare = compare_methods if kind == "method" else compare_conditions
        tests = compare(
            self.rows, chosen, tuple(self.methods), self.by, reference, confidence, seed
        )
        return corrected(tests)

    def test_table(
        self,
        measure: str = "joint",
        against: str | None = None,
        *,
        confidence: float = 0.95,
        seed: int = 0,
    ) -> Table:
        """`tests` as a table, with what limits them below.

        Raises:
            ValueError: as `tests`, or no subject has both numbers of any pair.
        """
        tests = self.tests(measure, against, confidence=confidence, seed=seed)
        _, reference = self.reference(against)
        if not tests:
            raise ValueError(
                f"no subject has {MEASURES[measure].header} of {self.label(reference)} and of "
                "another method"
            )
        note = tests_note(tests)
        return tests_table(tests, self.label, self.by, self.label(reference), note)

    def synergy_statistics(self) -> tuple[SynergyStatistics, ...]:
        """Numbers, durations and lengths of the synergies of each subject, by condition.

        Raises:
            ValueError: there is no table of synergies.
        """
        if self.synergies is None:
            raise ValueError("the study has no table of synergies (synergies.csv)")
        found: list[SynergyStatistics] = []
        for condition in self.conditions:
            rows = rows_under(self.rows, self.by, condition)
            found += synergy_statistics(rows, self._synergies(condition), condition)
        return tuple(found)

    def synergy_table(self) -> Table:
        """`synergy_statistics` as a table.

        Raises:
            ValueError: there is no table of synergies.
        """
        note = "Segments at rest count as synergies. Quantiles are over all synergies of a subject."
        return synergies_table(self.synergy_statistics(), self.by, self.length_unit, note)

    def figures(self, measure: str = "joint", against: str | None = None) -> dict[str, Figure]:
        """The figures of a paper, by name.

        "errors": means of joints and hand by method with subjects as points; "differences": paired
        differences from `against`; "synergies": distributions of durations and lengths, and
        "durations": errors against duration, where there is a table of synergies.

        Args:
            measure, against: of the differences, see `tests`.
        """
        _, reference = self.reference(against)
        tests = self.tests(measure, against)
        shown = [name for name in SHOWN if self._has(as_measure(name))]
        with paper_style():
            figures = {"errors": errors_figure([self.means(name) for name in shown], self.label)}
            if tests:
                figures["differences"] = differences_figure(
                    tests, self.label, self.label(reference)
                )
            if self.synergies:
                by_condition = {name: self._synergies(name) for name in self.conditions}
                figures["synergies"] = synergies_figure(by_condition, self.length_unit)
                figures["durations"] = durations_figure(self.synergies)
        return figures

    def plot(self) -> Figure:
        """Errors of joints and hand by method, with subjects as points."""
        return self.figures()["errors"]

    def save(
        self, folder: str | Path, *, measure: str = "joint", against: str | None = None
    ) -> list[Path]:
        """Write tables (.csv, .md and .tex), figures (.pdf and .png) and summary.md to a folder.

        All are written to a temporary folder first and moved together.

        Args:
            folder: is made if there is none.
            measure, against: of the tests and the figure of differences, see `tests`.

        Returns:
            The files' paths.

        Raises:
            ValueError: as `tests`.
            OSError: the folder cannot be created or written to.
        """
        tables = {
            "means": ("Means over subjects", self.means_table()),
            "tests": (
                f"Paired tests: {MEASURES[measure].header}",
                self.test_table(measure, against),
            ),
        }
        known = [name for name, each in MEASURES.items() if self._has(each)]
        means = [each for name in known for each in self.means(name)]
        tidy = {"means": tidy_means(means, self.by, 0.95), "tests": tables["tests"][1]}
        tidy |= {f"by_subject_{name}": self.by_subject(name) for name in known}
        if self.synergies:
            statistics = self.synergy_statistics()
            tables["synergy_statistics"] = "Synergies by subject", self.synergy_table()
            tidy["synergy_statistics"] = tidy_synergies(statistics, self.by, self.length_unit)
        figures = self.figures(measure, against)
        summary = "\n".join(
            ["# Study", "", f"{self!r}", "", *(f"- {each}" for each in self.notes), ""]
        )
        return write_together(
            folder, lambda into: write_study(into, tables, tidy, figures, summary)
        )

    def label(self, name: str) -> str:
        """What a method is called in tables; the name itself if it is not the key of a method."""
        return self.methods.get(name, name)

    @property
    def length_unit(self) -> str:
        """Unit of the synergies' lengths; empty if it is not known."""
        label = self.label("riemannian")
        if STRAIGHT_LINES in label:
            return "rad"
        return "sqrt(kg) m" if KINETIC_ENERGY in label else ""

    def reference(self, against: str | None) -> tuple[str, str]:
        """What `tests` compare with: "method" or "condition", and its key.

        Raises:
            ValueError: there is no such method or condition, or no default.
        """
        methods, conditions = self.methods, self.conditions if self.by else ()
        wanted = _LIKE_FOR_LIKE if against is None else against
        if key := next((k for k, label in methods.items() if wanted in (k, label)), None):
            return "method", key
        if wanted in conditions:
            return "condition", wanted
        known = ", ".join(map(repr, (*methods, *conditions)))
        raise ValueError(f"against must be one of {known}, got {against!r}")

    def _synergies(self, condition: str) -> list[Row]:
        """Rows of the synergies in the recordings under a condition."""
        names = {row["recording"] for row in rows_under(self.rows, self.by, condition)}
        return [row for row in self.synergies or () if row["recording"] in names]

    def _has(self, measure: StudyMeasure) -> bool:
        return any(math.isfinite(measure.of(row)) for row in self.rows)

    def _check_known(self, measure: StudyMeasure) -> None:
        if not self._has(measure):
            raise ValueError(f"measure {measure.name!r}: the table has no {measure.column}")


def _as_confidence(value: float) -> float:
    confidence = as_number("confidence", value)
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must be in (0, 1), got {confidence:g}")
    return confidence
