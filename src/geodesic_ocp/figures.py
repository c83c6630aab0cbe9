"""Files of figures, and settings of Matplotlib that are taken back."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Settings are global: two threads that set and restore them by turns would leave one's for good.
STYLE_LOCK = threading.RLock()


@contextmanager
def added_style(settings: dict[Any, Any]) -> Iterator[None]:
    """Draw with the user's style and these settings on top, which are taken back at the end."""
    import matplotlib

    with STYLE_LOCK, matplotlib.rc_context(settings):
        yield


def save_figure(figure: Figure, folder: Path, name: str = "figure", dpi: float = 150.0) -> None:
    """Write name.png and name.pdf to the folder; the figure's layout is final then.

    Text in the PDF is text, in embedded TrueType fonts, which journals ask for.
    """
    figure.savefig(folder / f"{name}.png", dpi=dpi)
    figure.set_layout_engine("none")  # finding the layout takes as long as drawing
    with added_style({"pdf.fonttype": 42}):
        figure.savefig(folder / f"{name}.pdf", dpi=dpi)
