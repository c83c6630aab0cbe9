"""A study: statistics over subjects of an analysis of many recordings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from os import PathLike
from typing import cast

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.studies.study.sources.analysis_tables import analysis_tables
from geodesic_ocp.studies.study.sources.metadata import with_metadata
from geodesic_ocp.studies.study.sources.source import StudyTables, read_study_tables
from geodesic_ocp.studies.study.statistics.subjects import condition_of, conditions_of
from geodesic_ocp.studies.study.study_results import Study
from geodesic_ocp.studies.tables.columns import RECORDING_COLUMNS, Row
from geodesic_ocp.synergies.analyse import Analysis

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
) -> Study:
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
    return Study(tables.recordings, tables.synergies, tables.failures, by)


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
