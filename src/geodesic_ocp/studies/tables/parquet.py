"""Tidy tables as Parquet files, where pyarrow is installed."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.studies.tables.columns import Row, TableColumn

PARQUET_HINT = "Parquet needs pyarrow: pip install 'geodesic_ocp[parquet]'"


def has_parquet() -> bool:
    """Whether tables can be written as Parquet."""
    return find_spec("pyarrow") is not None


def write_parquet(file: Path, columns: Sequence[TableColumn], rows: Sequence[Row]) -> None:
    """Write rows of these columns; needs pyarrow."""
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


def read_parquet(file: Path) -> tuple[list[str], list[tuple[str, list[Any]]]]:
    """Names of the columns, and the rows, each with its place in the file.

    Raises:
        RecordingError: the file cannot be read.
        ImportError: pyarrow is not installed.
    """
    if not has_parquet():
        raise ImportError(f"{file}: {PARQUET_HINT}")
    import pyarrow
    import pyarrow.parquet

    try:
        table = pyarrow.parquet.read_table(file)
        columns = [column.to_pylist() for column in table.columns]
    except (OSError, ValueError, pyarrow.ArrowException) as error:  # ValueError: text is not UTF-8
        raise RecordingError(f"{file}: cannot be read as Parquet: {error}") from None
    rows = zip(*columns, strict=True)
    return list(table.column_names), [(f"row {k}", list(row)) for k, row in enumerate(rows, 1)]
