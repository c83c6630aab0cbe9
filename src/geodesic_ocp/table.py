"""Tables of text and numbers, printed as text, Markdown, LaTeX or CSV."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass

from geodesic_ocp.latex import latex_header, latex_note, latex_text


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

    def latex(self, caption: str = "", label: str = "") -> str:
        r"""The table in LaTeX, with the rules of the package booktabs.

        Text is escaped, minus signs, exponents and units are typeset, `nan` is a dash. The preamble
        needs `\usepackage{booktabs}`, and an engine that reads UTF-8 for letters beyond ASCII.

        Args:
            caption: text, not LaTeX; with it the tabular stands in a table environment.
            label: for `\ref`; needs a caption.

        Raises:
            ValueError: a label without a caption, or one that LaTeX cannot read.
        """
        if label and not caption:
            raise ValueError(f"label {label!r} needs a caption")
        if not re.fullmatch(r"[\w:.+/ -]*", label):
            raise ValueError(f"label must be letters, digits and any of :._+-/, got {label!r}")
        header, *rows = self.shown()
        columns = "".join(
            "r" if k and all(re.match(r"[-+]?\d|-?inf|nan|-$", row[k]) for row in rows) else "l"
            for k in range(len(header))
        )
        lines = [
            rf"\begin{{tabular}}{{{columns}}}",
            r"\toprule",
            _latex_row([latex_header(entry) for entry in header]),
            r"\midrule",
            *(_latex_row([latex_text(entry) for entry in row]) for row in rows),
            r"\bottomrule",
            r"\end{tabular}",
        ]
        if self.note:
            # Below the table, as wide as the text.
            lines += ["", rf"\medskip{{\footnotesize {latex_note(self.note)}\par}}"]
        if caption:
            above = [r"\begin{table}", r"\centering", rf"\caption{{{latex_text(caption)}}}"]
            above += [rf"\label{{{label}}}"] if label else []
            lines = [*above, *lines, r"\end{table}"]
        return "\n".join(lines) + "\n"

    def csv(self) -> str:
        """The table as comma-separated values, with all digits."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.header, *self.rows])
        return text.getvalue()

    def _repr_markdown_(self) -> str:
        return self.markdown()


def _latex_row(entries: list[str]) -> str:
    row = " & ".join(entries)
    # A bracket or a star at the beginning would be read as an option of the line break above it.
    return ("{}" + row if row.startswith(("[", "*")) else row) + r" \\"
