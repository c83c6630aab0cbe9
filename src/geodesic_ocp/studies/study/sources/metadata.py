"""Further columns for the recordings, such as conditions, from a table of their files."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path, PurePosixPath

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.studies.tables.columns import Row
from geodesic_ocp.studies.tables.text_table import read_text_table


def with_metadata(rows: Sequence[Row], table: str | PathLike[str]) -> tuple[Row, ...]:
    """The rows with all columns of the table that they do not have.

    The table has a column file, with the end of each file's path, with or without its suffix, as
    the table of subjects of `analyse_recordings`.

    Raises:
        RecordingError: the table cannot be read, has no column file, names a file twice, or does
            not name one of the recordings.
    """
    path = Path(table)
    names, lines = read_text_table(path)
    if "file" not in names:
        raise RecordingError(f"{path}: line 1: there is no column file")
    entries: dict[str, Row] = {}
    for where, values in lines:
        entry: Row = dict(zip(names, values, strict=True))
        key = _key(str(entry["file"]).replace("\\", "/"))
        if key in entries:
            raise RecordingError(f"{path}: {where}: {entry['file']} is there already")
        entries[key] = entry
    return tuple(_entry(str(row.get("file") or ""), entries, path) | row for row in rows)


def _entry(file: str, entries: dict[str, Row], path: Path) -> Row:
    parts = PurePosixPath(_key(file)).parts
    for length in range(len(parts), 0, -1):
        if (entry := entries.get("/".join(parts[-length:]))) is not None:
            return entry
    longer = [key for key in entries if key.endswith(f"/{_key(file)}")]
    if len(longer) == 1:  # the table gives more of the path than the recordings do
        return entries[longer[0]]
    raise RecordingError(f"{path}: does not name the recording's file {file!r}")


def _key(file: str) -> str:
    return str(PurePosixPath(file).with_suffix("")) if PurePosixPath(file).name else file
