"""The tables of a study, from files or from analyses in memory, and what is checked of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, cast

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.studies.study_result import (
    StudyResult,
    conditions_of,
    in_natural_order,
    labels_of,
)
from geodesic_ocp.studies.study_tables import (
    RECORDINGS,
    TABLES,
    Row,
    entry_of_file,
    new_rows,
    read_file_table,
    read_table,
    recording_rows,
    synergy_rows,
)
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.trajectory.recording import PASSIVE, PASSIVE_REASON

if TYPE_CHECKING:
    from pandas import DataFrame

_MOST_CONDITIONS = 20
_NOT_CONDITIONS = {
    *("recording", "file", "subject", "method", "method_label"),
    *("subject_from", "height_from", "mass_from", "doubts"),
    *(name for name, kind in RECORDINGS.items() if kind != "text"),
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
    """Compute statistics over subjects from the analyses of many recordings.

    Recordings of a person are not independent: all means, intervals and tests are over the means
    of subjects, so that each subject counts the same, however many recordings there are.
    Recordings of a passive arm, in which no joint moves by more than 20 degrees, are left out and
    counted among the failures, unless all are passive.

    >>> recording = go.trajectory.bundled_recording()
    >>> analysis = go.analyse(recording.model, recording.motion)
    >>> go.study([analysis, analysis], subjects=["A", "B"])
    StudyResult(2 recordings of 2 subjects, 11 methods, 44 synergies)

    Args:
        source: the output folder of `geodesic-ocp analyse DIR --out FOLDER`; or the paths of its
            tables, recordings.csv (or .parquet) and, if wanted, the others;
            or analyses in memory.
        by: column of the table of recordings whose values are conditions, such as "condition",
            "trial" or "side"; means and tests are then made for each.
        metadata: CSV file with a column file, the end of each recording's path, and others, such
            as condition, which are added to the table of recordings.
        names: names of the recordings, if the source is analyses; by default they are numbered.
        subjects: the persons, if the source is analyses; by default those of the motions.
        conditions: conditions of the recordings, if the source is analyses.

    Raises:
        RecordingError: a table is missing, cannot be read, is inconsistent, or the recordings were
            cut by metrics or rules that differ; names file and line.
        ValueError: an argument that does not fit the source, or no such column.
        ImportError: only Parquet files are there, and the extra `parquet` is not installed.
    """
    tables = _tables(source, {"names": names, "subjects": subjects, "conditions": conditions})
    if metadata is not None:
        tables["recordings"] = with_metadata(tables["recordings"], metadata)
    if by is None and conditions is not None:
        by = "condition"
    _check_conditions(tables["recordings"], by)
    _check_labels(tables["recordings"], by)
    return StudyResult(**_without_passive(tables), by=by)


def _without_passive(tables: dict[str, DataFrame]) -> dict[str, DataFrame]:
    """Return the tables with passive arms among the failures, unless all are passive."""
    from pandas import concat

    rows = tables["recordings"]
    passive = set(rows.loc[rows["range_rad"] < PASSIVE, "recording"])
    if not passive or passive == set(rows["recording"]):
        return tables
    found = {
        name: table[~table["recording"].isin(passive)].reset_index(drop=True)
        for name, table in tables.items()
    }
    names = [name for name in TABLES["failures"] if name in rows.columns]
    left_out = rows[rows["recording"].isin(passive)].drop_duplicates("recording")[names]
    reasons = left_out.assign(kind="passive", reason=PASSIVE_REASON).to_dict("records")
    known = [found["failures"]] if "failures" in found else []
    found["failures"] = concat([*known, new_rows(reasons, "failures")], ignore_index=True)
    return found


def _tables(source: object, given: dict[str, Sequence[str] | None]) -> dict[str, DataFrame]:
    if isinstance(source, Analysis):
        source = [source]
    paths = [source] if isinstance(source, str | PathLike) else source
    entries = list(paths) if isinstance(paths, Iterable) else []
    if entries and all(isinstance(each, Analysis) for each in entries):
        return analysis_tables(cast(list[Analysis], entries), **given)
    if not entries or not all(isinstance(each, str | PathLike) for each in entries):
        raise ValueError(f"source must be a folder, paths of tables, or analyses, got {source!r}")
    if extra := [name for name, value in given.items() if value is not None]:
        raise ValueError(f"{', '.join(extra)}: only for analyses, as tables have columns for them")
    return read_study_tables(source if isinstance(source, str | PathLike) else entries)


def _check_conditions(rows: DataFrame, by: str | None) -> None:
    """Check that every recording has one condition."""
    if by is None:
        return
    if by not in (columns := [name for name in rows.columns if name not in _NOT_CONDITIONS]):
        raise ValueError(f"by must be a column, one of {', '.join(columns)}, got {by!r}")
    conditions = in_natural_order(conditions_of(rows, by))
    if len(conditions) > _MOST_CONDITIONS:
        raise ValueError(
            f"by: {by!r} has {len(conditions)} values, more than {_MOST_CONDITIONS}, such as "
            f"{', '.join(map(repr, conditions[:3]))}; is it a column of conditions?"
        )
    for recording, own in conditions_of(rows, by).groupby(rows["recording"]).unique().items():
        if len(own) > 1:
            raise ValueError(
                f"by: recording {recording} has several values of {by!r}, {own[0]!r} and {own[1]!r}"
            )


def _check_labels(rows: DataFrame, by: str | None) -> None:
    """Check that a method means the same in all recordings under one condition, and the cuts."""
    labels = rows.assign(condition=conditions_of(rows, by), method_label=labels_of(rows))
    for _, own in labels.groupby("condition", sort=False):
        first = own.iloc[0]
        other = own[own["cuts"] != own.iloc[0]["cuts"]]
        if len(other):
            raise RecordingError(
                f"cuts are {first['cuts'] or 'not known'} in recording {first['recording']}, but "
                f"{other.iloc[0]['cuts'] or 'not known'} in {other.iloc[0]['recording']}: "
                "recordings that were cut by rules that differ cannot be averaged; analyse all "
                "with the same settings, or compare the rules with by='cuts'"
            )
    for (method, _), own in labels.groupby(["method", "condition"], sort=False):
        first = own.iloc[0]
        other = own[own["method_label"] != own.iloc[0]["method_label"]]
        if len(other):
            raise RecordingError(
                f"method {method} is {first['method_label']!r} in recording {first['recording']}, "
                f"but {other.iloc[0]['method_label']!r} in {other.iloc[0]['recording']}: "
                "recordings that were cut by metrics that differ cannot be averaged"
            )


def with_metadata(recordings: DataFrame, table: str | PathLike[str]) -> DataFrame:
    """Return the recordings with all columns of a table that has a column file.

    It holds the end of each file's path, with or without its suffix, as the table of subjects of
    `analyse_recordings` does. Columns that the recordings have already stay as they are.

    Raises:
        RecordingError: as `read_file_table`, or the table does not name one of the recordings.
    """
    entries = read_file_table(table, dict)
    found = []
    for file in recordings["file"]:
        entry = entry_of_file(entries, file)
        if entry is None:
            raise RecordingError(f"{table}: does not name the recording's file {file!r}")
        found.append(entry)
    own = {name for name in recordings.columns if (recordings[name] != "").any()}
    names = [name for name in found[0] if name not in own]
    return recordings.assign(**{name: [each[name] for each in found] for name in names})


def read_study_tables(
    source: str | PathLike[str] | Iterable[str | PathLike[str]],
) -> dict[str, DataFrame]:
    """Read the tables of an output folder, or from the files whose paths are given, by name.

    In a folder the tables are read from .csv files, or from .parquet files where only these are
    there. Given files are told apart by the beginning of their names.

    Raises:
        RecordingError: there is no table of recordings, a table cannot be read, or tables disagree
            about the synergies of a recording, as when one was cut off.
    """
    if isinstance(source, str | PathLike):
        path = Path(source)
        files = _by_name([path]) if path.is_file() else _in_folder(path)
    else:
        files = _by_name([Path(each) for each in source])
    tables = {name: read_table(file, name) for name, file in files.items()}
    if tables["recordings"].empty:
        raise RecordingError(f"{files['recordings']}: has no recordings")
    for name in ("synergies", "profiles"):
        if name in tables and (
            unknown := sorted({*tables[name]["recording"]} - {*tables["recordings"]["recording"]})
        ):
            raise RecordingError(f"{files[name]}: {unknown[0]} is not in the table of recordings")
    if "synergies" in tables:
        _check_synergies(tables["recordings"], tables["synergies"], files["synergies"])
    return tables


def _in_folder(folder: Path) -> dict[str, Path]:
    if not folder.is_dir():
        raise RecordingError(f"{folder}: there is no such folder or table")
    found = {
        table: file
        for table in TABLES
        for suffix in (".parquet", ".csv")  # the latter where both are there
        if (file := folder / f"{table}{suffix}").is_file()
    }
    if "recordings" not in found:
        raise RecordingError(
            f"{folder}: has no recordings.csv or recordings.parquet; it must be the folder of a "
            "finished `geodesic-ocp analyse DIR --out FOLDER`"
        )
    return found


def _by_name(files: Sequence[Path]) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for file in files:
        table = next((t for t in TABLES if file.name.startswith(t)), None)
        if table is None and len(files) == 1:
            table = "recordings"
        if table is None or table in found:
            raise ValueError(
                f"source: the name of {file.name} must begin with one of {', '.join(TABLES)}, "
                "each once"
            )
        found[table] = file
    if "recordings" not in found:
        raise ValueError("source must have the table of recordings, got none")
    return found


def _check_synergies(recordings: DataFrame, synergies: DataFrame, file: Path) -> None:
    """Raise RecordingError if a recording has another number of synergies than segments."""
    counts = Counter(synergies["recording"])
    own = recordings[(recordings["method"] == "riemannian") & recordings["segments"].notna()]
    for name, expected in zip(own["recording"], own["segments"], strict=True):
        if expected != counts[name]:
            raise RecordingError(
                f"{file}: {name} has {counts[name]} synergies, but {expected} in the table of "
                "recordings; is one of the two cut off, or of another analysis?"
            )


def analysis_tables(
    analyses: Sequence[Analysis],
    names: Sequence[str] | None,
    subjects: Sequence[str] | None,
    conditions: Sequence[str] | None,
) -> dict[str, DataFrame]:
    """Return the tables of analyses in memory, as those of a folder.

    Args:
        analyses: one of each recording.
        names: names of the recordings; by default they are numbered.
        subjects: the persons; by default those of the motions.
        conditions: conditions of the recordings, column "condition".

    Raises:
        ValueError: names, subjects or conditions are not one for each analysis, or names are equal.
    """
    count = len(analyses)
    names = [str(k) for k in range(1, count + 1)] if names is None else names
    if subjects is None:
        subjects = [each.motion.subject.name or "" for each in analyses]
    for what, given in (("names", names), ("subjects", subjects), ("conditions", conditions)):
        if given is not None and (isinstance(given, str) or len(given) != count):
            raise ValueError(f"{what} must be {count}, one for each analysis, got {given!r}")
    if len(set(names)) < count:
        raise ValueError(f"names must differ, got {list(names)!r}")
    recordings: list[Row] = []
    synergies: list[Row] = []
    for k, analysis in enumerate(analyses):
        identity: Row = {"recording": str(names[k]), "subject": str(subjects[k])}
        if conditions is not None:
            identity["condition"] = str(conditions[k])
        recordings += [identity | row for row in recording_rows(analysis)]
        synergies += [identity | row for row in synergy_rows(analysis)]
    return {
        "recordings": new_rows(recordings, "recordings"),
        "synergies": new_rows(synergies, "synergies"),
    }
