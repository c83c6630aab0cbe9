"""Tables are pandas DataFrames; here is how they are made, printed and saved.

Where a table is shown, numbers have three significant digits; CSV has them in full. What stands
below a table is in `attrs["note"]`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from pandas import DataFrame


def new_table(header: Sequence[str], rows: Iterable[Sequence[Any]], note: str = "") -> DataFrame:
    """Return a table whose first column is the index.

    Args:
        header: names of the columns, with units.
        rows: entries; NaN or None where there is none.
        note: for below the table.
    """
    from pandas import DataFrame

    table = DataFrame([*map(list, rows)], columns=[*header], dtype=object)
    for k in range(len(header)):  # whole numbers among others stay what they are
        types = {*table.iloc[:, k].map(type)}
        if types <= {float, np.float64, type(None)} or len(types) == 1:
            table.isetitem(k, table.iloc[:, k].infer_objects())
    table = table.set_index(header[0])
    table.attrs["note"] = note
    return table


def text(table: DataFrame) -> str:
    """Return the table for a terminal, with its note."""
    return _tabulated(table, "simple")


def markdown(table: DataFrame) -> str:
    """Return the table in Markdown, with its note."""
    return _tabulated(table, "pipe") + "\n"


def html(table: DataFrame) -> str:
    """Return the table as HTML, which scrolls sideways where it is wider than the page."""
    return f'<div style="overflow-x: auto">{_tabulated(table, "html")}</div>'


def latex(table: DataFrame, caption: str, label: str) -> str:
    """Return the table as a float of LaTeX, which needs the package booktabs; its note is below."""
    shown = _shown(table)
    styled = shown.style.hide(axis="index").format(escape="latex")
    columns = styled.format_index(escape="latex", axis="columns")
    return str(columns.to_latex(hrules=True, caption=caption, label=label))


def save_tables(folder: Path, tables: Mapping[str, DataFrame]) -> None:
    """Write each table as NAME.csv, with all digits, and as NAME.md."""
    for name, table in tables.items():
        table.to_csv(folder / f"{name}.csv")
        (folder / f"{name}.md").write_text(markdown(table), encoding="utf-8")


def _shown(table: DataFrame) -> DataFrame:
    """Return the table with its index as columns and all entries as text."""
    return table.reset_index().map(_entry)


def _entry(value: Any) -> str:
    from pandas import isna

    if isna(value):
        return "-"
    return f"{value:#.3g}" if isinstance(value, float) else str(value)


def _tabulated(table: DataFrame, style: str) -> str:
    from tabulate import tabulate

    shown = _shown(table)
    align = ["left" if k < table.index.nlevels else "right" for k in range(shown.shape[1])]
    rows = shown.to_numpy().tolist()
    found = tabulate(
        rows, [*shown.columns], style, colalign=align if rows else None, disable_numparse=True
    )
    note = str(table.attrs.get("note", ""))
    note = escape(note) if style == "html" else note
    return f"{found}\n\n{note}" if note else str(found)


def in_degrees(table: DataFrame) -> DataFrame:
    """Return a table whose columns "... [rad]" are in degrees, and named so."""
    angles = [name for name in table.columns if str(name).endswith("[rad]")]
    found = table.assign(**{name: np.degrees(table[name].astype(float)) for name in angles})
    found = found.rename(columns={name: name.replace("[rad]", "[deg]") for name in angles})
    found.attrs = dict(table.attrs)
    return found
