"""Rows of a table of the package as tuples, the index first."""

from __future__ import annotations

from typing import Any

import pandas as pd


def rows_of_table(table: pd.DataFrame) -> list[tuple[Any, ...]]:
    """All rows; the first entry of each is its name in the index."""
    return [*table.itertuples(name=None)]


def header_of(table: pd.DataFrame) -> tuple[str, ...]:
    """Names of the index and of the columns."""
    return (str(table.index.name), *table.columns)
