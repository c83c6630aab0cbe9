"""Where a study's tables come from: a folder, files, or analyses."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.studies.tables.columns import TABLES, Row
from geodesic_ocp.studies.tables.read_rows import read_rows

_SUFFIXES = (".csv", ".parquet")


@dataclass(frozen=True, repr=False)
class StudyTables:
    """The rows of the three tables; see `geodesic_ocp.studies.tables.columns`.

    Attributes:
        recordings: one for each recording and method.
        synergies: one for each synergy; None if there is no such table.
        failures: one for each recording without a result.
    """

    recordings: tuple[Row, ...]
    synergies: tuple[Row, ...] | None = None
    failures: tuple[Row, ...] = ()

    def __repr__(self) -> str:
        synergies = "no table of" if self.synergies is None else len(self.synergies)
        return (
            f"StudyTables({len(self.recordings)} rows of recordings and methods, {synergies} "
            f"synergies, {len(self.failures)} failures)"
        )


def read_study_tables(
    source: str | PathLike[str] | Iterable[str | PathLike[str]],
) -> StudyTables:
    """Read the tables of an output folder, or from the files whose paths are given.

    In a folder recordings, synergies and failures are read from .csv files, or from .parquet
    files where only these are there. Given files are told apart by the beginning of their names.

    Raises:
        RecordingError: there is no table of recordings, a table cannot be read, or tables disagree
            about the synergies of a recording, as when one was cut off.
    """
    if isinstance(source, str | PathLike):
        path = Path(source)
        files = _in_folder(path) if not path.is_file() else _by_name([path])
    else:
        files = _by_name([Path(each) for each in source])
    rows = {table: tuple(read_rows(file, table)) for table, file in files.items()}
    if not rows["recordings"]:
        raise RecordingError(f"{files['recordings']}: has no recordings")
    if "synergies" in rows:
        _check_synergies(rows["recordings"], rows["synergies"], files["synergies"])
    return StudyTables(rows["recordings"], rows.get("synergies"), rows.get("failures", ()))


def _in_folder(folder: Path) -> dict[str, Path]:
    if not folder.is_dir():
        raise RecordingError(f"{folder}: there is no such folder or table")
    found: dict[str, Path] = {}
    for table in TABLES:
        files = [folder / f"{table}{suffix}" for suffix in _SUFFIXES]
        if there := [file for file in files if file.is_file()]:
            found[table] = there[0]
    if "recordings" not in found:
        raise RecordingError(
            f"{folder}: has no recordings.csv or recordings.parquet; it must be the folder of a "
            "finished `geodesic-ocp analyse DIR --out FOLDER`"
        )
    return found


def _by_name(files: list[Path]) -> dict[str, Path]:
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


def _check_synergies(recordings: Iterable[Row], synergies: Iterable[Row], file: Path) -> None:
    """RecordingError if a recording has another number of synergies than segments."""
    counts = Counter(str(row["recording"]) for row in synergies)
    known = {str(row["recording"]) for row in recordings}
    if unknown := sorted(set(counts) - known):
        raise RecordingError(f"{file}: {unknown[0]} is not in the table of recordings")
    for row in recordings:
        name, expected = str(row["recording"]), row.get("segments")
        if row["method"] == "riemannian" and expected not in (None, counts[name]):
            raise RecordingError(
                f"{file}: {name} has {counts[name]} synergies, but {expected} in the table of "
                "recordings; is one of the two cut off, or of another analysis?"
            )
