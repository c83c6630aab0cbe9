"""Writes tidy tables as CSV, and as Parquet where pyarrow is installed."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from geodesic_ocp.records import replacing
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
    written = [folder / f"{name}.csv"]
    with replacing(written[0]) as file:
        _write_csv(file, columns, rows)
    if has_parquet():
        written.append(folder / f"{name}.parquet")
        with replacing(written[1]) as file:
            write_parquet(file, columns, rows)
    return written


def _write_csv(file: Path, columns: Sequence[TableColumn], rows: Sequence[Row]) -> None:
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([column.name for column in columns])
        for row in rows:
            writer.writerow([row.get(column.name) for column in columns])  # None is empty
