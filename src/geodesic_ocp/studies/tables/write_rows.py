"""Writes tidy tables as CSV, and as Parquet where pyarrow is installed."""

from __future__ import annotations

import csv
import os
import tempfile
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path

from geodesic_ocp.studies.tables.columns import TABLES, Row, TableColumn
from geodesic_ocp.studies.tables.parquet import has_parquet, write_parquet


def write_rows(folder: str | PathLike[str], name: str, rows: Sequence[Row]) -> list[Path]:
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
        written.append(_at_once(parquet, lambda file: write_parquet(file, columns, rows)))
    return written


def _write_csv(file: Path, columns: Sequence[TableColumn], rows: Sequence[Row]) -> None:
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([column.name for column in columns])
        for row in rows:
            writer.writerow([row.get(column.name) for column in columns])  # None is empty


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
