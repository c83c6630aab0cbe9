"""Files of the tidy tables: CSV, and Parquet where pyarrow is installed."""

from __future__ import annotations

import csv
import os
import tempfile
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from typing import Any

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.studies.tables import TABLES, Row, TableColumn

PARQUET_HINT = "Parquet needs pyarrow: pip install 'geodesic_ocp[parquet]'"


def has_parquet() -> bool:
    """Whether tables can be written as Parquet."""
    return find_spec("pyarrow") is not None


def write_tidy(folder: str | PathLike[str], name: str, rows: Sequence[Row]) -> list[Path]:
    """Write a tidy table as CSV, and as Parquet with the extra; each file as a whole.

    Args:
        folder: of the files, which exists.
        name: of the table, one of `TABLES`.
        rows: values by column; those that are left out are missing.

    Returns:
        The files' paths.

    Raises:
        ValueError: a row has a value that is in no column.
        OSError: a file cannot be written.
    """
    columns = TABLES[name]
    known = {column.name for column in columns}
    for row in rows:
        if extra := set(row) - known:
            raise ValueError(f"{name} has no column {', '.join(sorted(extra))}")
    folder = Path(folder)
    written = [_at_once(folder / f"{name}.csv", lambda file: _write_csv(file, columns, rows))]
    if has_parquet():
        parquet = folder / f"{name}.parquet"
        written.append(_at_once(parquet, lambda file: _write_parquet(file, columns, rows)))
    return written


def read_tidy(path: str | PathLike[str], name: str) -> list[Row]:
    """Read a tidy table.

    Args:
        path: of a CSV or Parquet file, or of the folder in which `name`.csv is.
        name: of the table, one of `TABLES`.

    Raises:
        RecordingError: the file is missing, cannot be read, or is not such a table; names the line.
        ImportError: a Parquet file, and pyarrow is not installed.
    """
    if name not in TABLES:
        raise ValueError(f"name must be one of {', '.join(TABLES)}, got {name!r}")
    file = Path(path)
    if file.is_dir():
        file = file / f"{name}.csv"
    if not file.is_file():
        raise RecordingError(f"{file}: there is no such file")
    if file.suffix.lower() == ".parquet":
        return _read_parquet(file, TABLES[name])
    try:
        return _read_csv(file, TABLES[name])
    except OSError as failure:
        raise RecordingError(f"{file}: cannot be read: {failure.strerror}") from None
    except (csv.Error, UnicodeDecodeError) as failure:
        raise RecordingError(f"{file}: is not a table in UTF-8: {failure}") from None


def _write_csv(file: Path, columns: Sequence[TableColumn], rows: Sequence[Row]) -> None:
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([column.name for column in columns])
        for row in rows:
            writer.writerow([row.get(column.name) for column in columns])  # None is empty


def _read_csv(file: Path, columns: Sequence[TableColumn]) -> list[Row]:
    with file.open(encoding="utf-8-sig", newline="") as stream:
        reader = csv.DictReader(stream)
        _check_columns(file, reader.fieldnames or (), columns)
        rows: list[Row] = []
        for entries in reader:
            try:
                rows.append({each.name: each.parsed(entries[each.name] or "") for each in columns})
            except ValueError as failure:
                raise RecordingError(f"{file}: line {reader.line_num}: {failure}") from None
        return rows


def _write_parquet(file: Path, columns: Sequence[TableColumn], rows: Sequence[Row]) -> None:
    import pyarrow
    import pyarrow.parquet

    types = {"text": pyarrow.string(), "integer": pyarrow.int64(), "number": pyarrow.float64()}
    arrays = {
        column.name: pyarrow.array(
            [row.get(column.name, "" if column.kind == "text" else None) for row in rows],
            type=types[column.kind],
        )
        for column in columns
    }
    pyarrow.parquet.write_table(pyarrow.table(arrays), file)


def _read_parquet(file: Path, columns: Sequence[TableColumn]) -> list[Row]:
    if not has_parquet():
        raise ImportError(f"{file}: {PARQUET_HINT}")
    import pyarrow
    import pyarrow.parquet

    try:
        table: Any = pyarrow.parquet.read_table(file)
    except (OSError, pyarrow.ArrowException) as failure:
        raise RecordingError(f"{file}: is not a Parquet table: {failure}") from None
    _check_columns(file, table.column_names, columns)
    rows: list[Row] = table.select([column.name for column in columns]).to_pylist()
    return rows


def _check_columns(file: Path, found: Sequence[str], columns: Sequence[TableColumn]) -> None:
    missing = [column.name for column in columns if column.name not in found]
    if missing:
        raise RecordingError(f"{file}: there is no column {', '.join(missing)}")


def _at_once(file: Path, write: Callable[[Path], None]) -> Path:
    descriptor, name = tempfile.mkstemp(dir=file.parent, prefix=".writing-", suffix=file.suffix)
    os.close(descriptor)
    temporary = Path(name)
    try:
        write(temporary)
        temporary.chmod(0o644)
        return temporary.replace(file)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
