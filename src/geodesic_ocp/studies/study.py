"""Study: means over subjects, paired tests, tables and figures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, cast

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.figures.study_figures import paper_style
from geodesic_ocp.records import write_together
from geodesic_ocp.studies.statistics import (
    MEASURES,
    StudyMean,
    StudyTest,
    SynergyStatistics,
    as_confidence,
    compare_conditions,
    compare_methods,
    complete_rows,
    condition_of,
    conditions_of,
    corrected,
    in_natural_order,
    known_measure,
    known_measures,
    means_over_subjects,
    rows_under,
    subject_of,
    synergy_statistics,
)
from geodesic_ocp.studies.study_output import (
    by_subject_table,
    differences_figure,
    durations_figure,
    errors_figure,
    means_table,
    synergies_figure,
    synergies_table,
    tests_table,
    tidy_means,
    tidy_synergies,
    tidy_tests,
    write_study,
)
from geodesic_ocp.studies.study_sources import (
    StudyTables,
    analysis_tables,
    count,
    length_unit,
    means_note,
    method_labels,
    read_study_tables,
    reference,
    study_notes,
    subjects_note,
    with_metadata,
)
from geodesic_ocp.studies.tables import RECORDING_COLUMNS, Row
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.table import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = ("joint", "position", "orientation")


@dataclass(frozen=True, eq=False, repr=False)
class StudyResult:
    """Recordings of several subjects, analysed; see `study`.

    Attributes:
        rows: one for each recording and method, see `geodesic_ocp.studies.tables`.
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
        counts = (
            f"{count(recordings, 'recording')} of {count(len(self.subjects), 'subject')}, "
            f"{count(len(self.methods), 'method')}"
        )
        return f"StudyResult({counts}{synergies}{conditions}{failed})"

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


_MOST_CONDITIONS = 20
_NOT_CONDITIONS = {
    *("recording", "file", "subject", "method", "method_label"),
    *("subject_from", "height_from", "mass_from"),
    *(column.name for column in RECORDING_COLUMNS if column.kind != "text"),
}


def study(
    source: str | PathLike[str] | Sequence[str | PathLike[str]] | Sequence[Analysis],
    *,
    by: str | None = None,
    metadata: str | PathLike[str] | None = None,
    names: Sequence[str] | None = None,
    subjects: Sequence[str] | None = None,
    conditions: Sequence[str] | None = None,
) -> StudyResult:
    """Statistics over subjects of the analyses of many recordings.

    Recordings of a person are not independent: all means, intervals and tests are over the means
    of subjects, so that each subject counts the same, however many recordings there are.

    Args:
        source: the output folder of `geodesic-ocp analyse DIR --out FOLDER`; or the paths of its
            tables, recordings.csv (or .parquet) and, if wanted, synergies.csv and failures.csv;
            or analyses in memory.
        by: column of the table of recordings whose values are conditions, such as "condition",
            "trial" or "side"; means and tests are then made for each.
        metadata: CSV file with a column file, the end of each recording's path, and others, such
            as condition, which are added to the table of recordings.
        names: of the recordings, if the source is analyses; by default they are numbered.
        subjects: the persons, if the source is analyses; by default those of the motions.
        conditions: of the recordings, if the source is analyses.

    Raises:
        RecordingError: a table is missing, cannot be read, is inconsistent, or the recordings were
            cut by metrics that differ; names file and line.
        ValueError: an argument that does not fit the source, or no such column.
        ImportError: only Parquet files are there, and the extra `parquet` is not installed.
    """
    tables = _tables(source, names, subjects, conditions)
    if metadata is not None:
        tables = replace(tables, recordings=with_metadata(tables.recordings, metadata))
    if by is None and conditions is not None:
        by = "condition"
    _check_conditions(tables.recordings, by)
    _check_labels(tables.recordings, by)
    return StudyResult(tables.recordings, tables.synergies, tables.failures, by)


def _tables(
    source: object,
    names: Sequence[str] | None,
    subjects: Sequence[str] | None,
    conditions: Sequence[str] | None,
) -> StudyTables:
    if isinstance(source, Analysis):
        source = [source]
    paths = [source] if isinstance(source, str | PathLike) else source
    entries = list(paths) if isinstance(paths, Iterable) else []
    if entries and all(isinstance(each, Analysis) for each in entries):
        return analysis_tables(cast(list[Analysis], entries), names, subjects, conditions)
    if not entries or not all(isinstance(each, str | PathLike) for each in entries):
        raise ValueError(f"source must be a folder, paths of tables, or analyses, got {source!r}")
    given = {"names": names, "subjects": subjects, "conditions": conditions}
    if extra := [name for name, value in given.items() if value is not None]:
        raise ValueError(f"{', '.join(extra)}: only for analyses, as tables have columns for them")
    if isinstance(source, str | PathLike):
        return read_study_tables(source)
    return read_study_tables(cast(list[str], entries))


def _check_conditions(rows: Sequence[Row], by: str | None) -> None:
    """Every recording has one condition."""
    if by is None:
        return
    columns = {name: None for row in rows for name in row if name not in _NOT_CONDITIONS}
    if by not in columns:
        raise ValueError(f"by must be a column, one of {', '.join(columns)}, got {by!r}")
    conditions = conditions_of(rows, by)
    if len(conditions) > _MOST_CONDITIONS:
        raise ValueError(
            f"by: {by!r} has {len(conditions)} values, more than {_MOST_CONDITIONS}, such as "
            f"{', '.join(map(repr, conditions[:3]))}; is it a column of conditions?"
        )
    found: dict[object, str] = {}
    for row in rows:
        condition = condition_of(row, by)
        if found.setdefault(row["recording"], condition) != condition:
            raise ValueError(
                f"by: recording {row['recording']} has several values of {by!r}, "
                f"{found[row['recording']]!r} and {condition!r}"
            )


def _check_labels(rows: Sequence[Row], by: str | None) -> None:
    """A method means the same in all recordings under one condition."""
    found: dict[tuple[object, str], Row] = {}
    for row in rows:
        first = found.setdefault((row["method"], condition_of(row, by)), row)
        if first.get("method_label") != row.get("method_label"):
            raise RecordingError(
                f"method {row['method']} is {first.get('method_label')!r} in recording "
                f"{first['recording']}, but {row.get('method_label')!r} in {row['recording']}: "
                "recordings that were cut by metrics that differ cannot be averaged"
            )
