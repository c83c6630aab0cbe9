"""Tidy tables from CSV and Parquet files, with every value checked."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.studies.tables.columns import TABLES, Cell, Row, TableColumn
from geodesic_ocp.studies.tables.parquet import read_parquet
from geodesic_ocp.studies.tables.text_table import read_text_table

# Without these a table says nothing about subjects; other columns may be missing.
_NEEDED = {
    "recordings": ("recording", "subject", "method", "duration_s", "joint_error_rad"),
    "synergies": ("recording", "subject", "duration_s", "length"),
    "failures": ("recording", "reason"),
}
_NOT_NEGATIVE = ("joint_error", "position_error", "orientation_error", "duration", "length", "segm")
_KEYS = {"recordings": ("recording", "method"), "synergies": ("recording", "synergy")}


def read_rows(file: Path, table: str) -> list[Row]:
    """The rows of one of `TABLES`; columns that it does not define are text.

    Raises:
        RecordingError: the file is missing or cannot be read, a column that is needed is missing, a
            value is not a number, or a row is there twice; names file, line (of Parquet, row) and
            column.
        ImportError: a Parquet file without the extra `parquet`.
    """
    if not file.is_file():
        raise RecordingError(f"{file}: there is no such file")
    read = read_parquet if file.suffix.lower() == ".parquet" else read_text_table
    names, lines = read(file)
    if missing := [name for name in _NEEDED[table] if name not in names]:
        raise RecordingError(
            f"{file}: line 1: column {', '.join(missing)} is missing; is it the table of {table}?"
        )
    columns = {column.name: column for column in TABLES[table]}
    rows: list[Row] = []
    seen: dict[tuple[Cell, ...], str] = {}
    for where, values in lines:
        row: Row = {}
        for name, value in zip(names, values, strict=True):
            row[name] = _checked(value, columns.get(name), f"{file}: {where}, column {name}")
        if key := tuple(row[name] for name in _KEYS.get(table, ()) if name in row):
            if key in seen:
                what = ", ".join(map(str, key))
                raise RecordingError(f"{file}: {where}: {what} is there already, in {seen[key]}")
            seen[key] = where
        rows.append(row)
    return rows


def _checked(value: Any, column: TableColumn | None, where: str) -> Cell:
    """The value of a cell, None where it is missing; `where` opens the message if it is wrong."""
    if column is None or column.kind == "text":
        return "" if value is None else str(value)
    if isinstance(value, str):
        try:
            value = column.parsed(value.strip())
        except ValueError:
            raise RecordingError(f"{where}: {value!r} is not a number") from None
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RecordingError(f"{where}: {value!r} is not a number")
    if math.isinf(value):
        raise RecordingError(f"{where}: {value!r} is not finite")
    if value < 0 and column.name.startswith(_NOT_NEGATIVE):
        raise RecordingError(f"{where}: {value!r} is negative")
    return value
