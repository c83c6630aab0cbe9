"""The files of a study."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from geodesic_ocp.figures.new_figure import save_figure
from geodesic_ocp.figures.study.groups import paper_style
from geodesic_ocp.table import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_DOTS = 300.0  # an inch, of .png


def write_study(
    folder: Path,
    tables: Mapping[str, tuple[str, Table]],
    tidy: Mapping[str, Table],
    figures: Mapping[str, Figure],
    summary: str,
) -> None:
    """Write tables as .md and .tex, tidy ones as .csv, figures as .pdf and .png, and study.md.

    Args:
        folder: which exists.
        tables: caption and table, by the name of the file.
        tidy: tables with all digits.
        figures: by the name of the file.
        summary: Markdown, the first part of study.md, above all tables.
    """
    parts = [summary]
    for name, (caption, table) in tables.items():
        latex = table.latex(caption, f"tab:{name}")
        (folder / f"{name}.tex").write_text(latex, encoding="utf-8")
        (folder / f"{name}.md").write_text(table.markdown(), encoding="utf-8")
        parts.append(f"## {caption}\n\n{table.markdown()}")
    (folder / "study.md").write_text("\n".join(parts), encoding="utf-8")
    for name, table in tidy.items():
        (folder / f"{name}.csv").write_text(table.csv(), encoding="utf-8")
    with paper_style():
        for name, figure in figures.items():
            save_figure(figure, folder, name, _DOTS)
