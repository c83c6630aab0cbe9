"""Tables of text and numbers, printed as text, Markdown or CSV."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass


@dataclass(frozen=True, repr=False)
class Table:
    """Rows under a header; the first column is text.

    Attributes:
        header: names of the columns, with units.
        rows: entries; numbers are printed with three significant digits, in full in CSV.
        note: below the printed table, text or Markdown, not in CSV.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str | int | float, ...], ...]
    note: str = ""

    def shown(self) -> list[list[str]]:
        """Header and rows as strings."""
        rows = [[f"{e:#.3g}" if isinstance(e, float) else str(e) for e in row] for row in self.rows]
        return [list(self.header), *rows]

    def __repr__(self) -> str:
        return f"Table({len(self.rows)} rows: {', '.join(self.header)})"

    def __str__(self) -> str:
        rows = self.shown()
        widths = [max(len(row[column]) for row in rows) for column in range(len(self.header))]
        lines = [
            "  ".join(
                entry.ljust(width) if column == 0 else entry.rjust(width)
                for column, (entry, width) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
            for row in rows
        ]
        below = ["", self.note] if self.note else []
        return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:], *below])

    def markdown(self) -> str:
        """The table in Markdown."""
        header, *rows = ("| " + " | ".join(row) + " |" for row in self.shown())
        rule = "| --- |" + " ---: |" * (len(self.header) - 1)
        below = ["", self.note] if self.note else []
        return "\n".join([header, rule, *rows, *below]) + "\n"

    def csv(self) -> str:
        """The table as comma-separated values, with all digits."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.header, *self.rows])
        return text.getvalue()

    def _repr_markdown_(self) -> str:
        return self.markdown()
