"""Further columns for the recordings, such as conditions, from a table of their files."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.studies.tables.columns import Row
from geodesic_ocp.studies.tables.file_names import named_file, path_ends
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
        key = named_file(values[names.index("file")])
        if key in entries:
            raise RecordingError(f"{path}: {where}: {entry['file']} is there already")
        entries[key] = entry
    return tuple(_entry(str(row.get("file") or ""), entries, path) | row for row in rows)


def _entry(file: str, entries: dict[str, Row], path: Path) -> Row:
    ends = list(path_ends(file))
    for end in ends:
        if (entry := entries.get(end)) is not None:
            return entry
    for whole in [end for end in ends if end.count("/") == ends[0].count("/")]:
        # The table may give more of the path than the recordings do.
        longer = [key for key in entries if key.endswith(f"/{whole}")]
        if len(longer) == 1:
            return entries[longer[0]]
        if longer:
            break
    raise RecordingError(f"{path}: does not name the recording's file {file!r}")
