"""Study: means over subjects, paired tests, tables and figures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from geodesic_ocp.figures.study.groups import paper_style
from geodesic_ocp.records import write_together
from geodesic_ocp.studies.study.methods import length_unit, method_labels, reference
from geodesic_ocp.studies.study.notes import count, means_note, study_notes, subjects_note
from geodesic_ocp.studies.study.output.study_figures import (
    differences_figure,
    durations_figure,
    errors_figure,
    synergies_figure,
)
from geodesic_ocp.studies.study.output.study_files import write_study
from geodesic_ocp.studies.study.output.study_tables import (
    by_subject_table,
    means_table,
    synergies_table,
    tests_table,
    tidy_means,
    tidy_synergies,
    tidy_tests,
)
from geodesic_ocp.studies.study.statistics.compare_over_subjects import (
    compare_conditions,
    compare_methods,
)
from geodesic_ocp.studies.study.statistics.means import (
    StudyMean,
    as_confidence,
    means_over_subjects,
)
from geodesic_ocp.studies.study.statistics.measures import (
    MEASURES,
    known_measure,
    known_measures,
)
from geodesic_ocp.studies.study.statistics.subject_tests import StudyTest, corrected
from geodesic_ocp.studies.study.statistics.subjects import (
    complete_rows,
    conditions_of,
    in_natural_order,
    rows_under,
    subject_of,
)
from geodesic_ocp.studies.study.statistics.synergy_statistics import (
    SynergyStatistics,
    synergy_statistics,
)
from geodesic_ocp.studies.tables.columns import Row
from geodesic_ocp.table import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = ("joint", "position", "orientation")


@dataclass(frozen=True, eq=False, repr=False)
class Study:
    """Recordings of several subjects, analysed; see `study`.

    Attributes:
        rows: one for each recording and method, see `geodesic_ocp.studies.tables.columns`.
        synergies: one for each synergy; None if there is no such table.
        failures: one for each recording that was left out of the analysis.
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
        return method_labels(self.rows)

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
            ValueError: an unknown measure, or one that the tables do not have; with complete, no
                recording has all methods.
        """
        chosen, confidence = known_measure(self.rows, measure), as_confidence(confidence)
        rows = complete_rows(self.rows, chosen) if complete else self.rows
        return means_over_subjects(rows, chosen, tuple(self.methods), self.by, confidence)

    def means_table(
        self, *measures: str, confidence: float = 0.95, complete: bool = False
    ) -> Table:
        """`means` of several measures, by default errors of joints and hand, one method a row."""
        names = measures or known_measures(self.rows, SHOWN) or SHOWN[:1]
        columns = [self.means(name, confidence=confidence, complete=complete) for name in names]
        rows = [row for row in zip(*columns, strict=True) if any(each.recordings for each in row)]
        note = means_note(self.notes, [each for row in rows for each in row])
        return means_table(rows, self.label, self.by, confidence, note)

    def by_subject(self, measure: str = "joint") -> Table:
        """Mean over the recordings of each subject (row), of every method (column).

        Raises:
            ValueError: an unknown measure, or one that the tables do not have.
        """
        chosen = known_measure(self.rows, measure)
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
        chosen, confidence = known_measure(self.rows, measure), as_confidence(confidence)
        kind, key = self._reference(against)
        compare = compare_methods if kind == "method" else compare_conditions
        tests = compare(self.rows, chosen, tuple(self.methods), self.by, key, confidence, seed)
        return corrected(tests)

    def test_table(
        self,
        measure: str = "joint",
        against: str | None = None,
        *,
        confidence: float = 0.95,
        seed: int = 0,
    ) -> Table:
        """`tests` as a table, with what limits them below; raises what `tests` does."""
        tests = self.tests(measure, against, confidence=confidence, seed=seed)
        key = self._reference(against)[1]
        caveats = subjects_note(self.rows)
        return tests_table(tests, MEASURES[measure], self.label, self.by, self.label(key), caveats)

    def synergy_statistics(self) -> tuple[SynergyStatistics, ...]:
        """Numbers, durations and lengths of the synergies of each subject, by condition.

        Raises:
            ValueError: there is no table of synergies.
        """
        if self.synergies is None:
            raise ValueError("the study has no table of synergies (synergies.csv)")
        return tuple(
            each
            for name in self.conditions
            for each in synergy_statistics(
                rows_under(self.rows, self.by, name), self._synergies(name), name
            )
        )

    def synergy_table(self) -> Table:
        """`synergy_statistics` as a table.

        Raises:
            ValueError: there is no table of synergies.
        """
        unit, caveats = length_unit(self.methods), subjects_note(self.rows)
        return synergies_table(self.synergy_statistics(), self.by, unit, caveats)

    def figures(self, measure: str = "joint", against: str | None = None) -> dict[str, Figure]:
        """The figures of a paper, by name.

        "errors": means of joints and hand by method with subjects as points; "differences": paired
        differences from `against`; "synergies": distributions of durations and lengths, and
        "durations": errors against duration, where there is a table of synergies.

        Args:
            measure, against: of the differences, see `tests`.
        """
        key = self._reference(against)[1]
        tests = self.tests(measure, against)
        figures = {"errors": self.plot()}
        with paper_style():
            if tests:
                figures["differences"] = differences_figure(tests, self.label, self.label(key))
            if self.synergies:
                by_condition = {name: self._synergies(name) for name in self.conditions}
                figures["synergies"] = synergies_figure(by_condition, length_unit(self.methods))
                figures["durations"] = durations_figure(self.synergies)
        return figures

    def plot(self) -> Figure:
        """Errors of joints and hand by method, with subjects as points."""
        with paper_style():
            return errors_figure(
                [self.means(name) for name in known_measures(self.rows, SHOWN)], self.label
            )

    def save(
        self, folder: str | Path, *, measure: str = "joint", against: str | None = None
    ) -> list[Path]:
        """Write tables (.csv, .md and .tex), figures (.pdf and .png) and study.md to a folder.

        All are written to a temporary folder first and moved together; their paths are returned.

        Args:
            folder: is created if it does not exist.
            measure, against: of the tests and the figure of differences, see `tests`.

        Raises:
            ValueError: as `tests`.
            OSError: the folder cannot be created or written to.
        """
        tables = {"means": ("Means over subjects", self.means_table())}
        title = f"Paired tests: {MEASURES[measure].header}"
        tables["tests"] = title, self.test_table(measure, against)
        known = known_measures(self.rows, MEASURES)
        means = [each for measured in known for each in self.means(measured)]
        tidy = {"means": tidy_means(means, self.by, 0.95)}
        tidy["tests"] = tidy_tests(self.tests(measure, against), self.by, 0.95)
        tidy |= {f"by_subject_{name}": self.by_subject(name) for name in known}
        if self.synergies:
            name, unit = "synergy_statistics", length_unit(self.methods)
            tables[name] = "Synergies by subject", self.synergy_table()
            tidy[name] = tidy_synergies(self.synergy_statistics(), self.by, unit)
        figures = self.figures(measure, against)
        summary = f"# Study\n\n{self!r}\n\n" + "".join(f"- {note}\n" for note in self.notes)
        return write_together(
            folder, lambda into: write_study(into, tables, tidy, figures, summary)
        )

    def label(self, name: str) -> str:
        """What a method is called in tables; the name itself if it is not the key of a method."""
        return self.methods.get(name, name)

    def _reference(self, against: str | None) -> tuple[str, str]:
        return reference(self.methods, self.conditions if self.by else (), against)

    def _synergies(self, condition: str) -> list[Row]:
        """Rows of the synergies in the recordings under a condition."""
        names = {row["recording"] for row in rows_under(self.rows, self.by, condition)}
        return [row for row in self.synergies or () if row["recording"] in names]
