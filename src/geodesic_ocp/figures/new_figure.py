"""New figures, which belong to no window."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of this size [inch], which adjusts its layout to its contents."""
    # Importing matplotlib takes longer than many computations: only what draws imports it.
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")
