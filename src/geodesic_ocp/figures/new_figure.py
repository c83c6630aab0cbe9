"""Figures that belong to no window: new ones, and their files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from geodesic_ocp.figures.own_style import added_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of this size [inch], which adjusts its layout to its contents."""
    # Importing matplotlib takes longer than many computations: only what draws imports it.
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def save_figure(figure: Figure, folder: Path, name: str = "figure", dpi: float = 150.0) -> None:
    """Write name.png and name.pdf to the folder; the figure's layout is final then.

    Text in the PDF is text, in embedded TrueType fonts, which journals ask for.
    """
    figure.savefig(folder / f"{name}.png", dpi=dpi)
    figure.set_layout_engine("none")  # finding the layout takes as long as drawing
    with added_style({"pdf.fonttype": 42}):
        figure.savefig(folder / f"{name}.pdf", dpi=dpi)
