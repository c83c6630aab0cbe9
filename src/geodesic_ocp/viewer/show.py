"""Show results in three dimensions."""

from __future__ import annotations

from os import PathLike
from typing import Any

from geodesic_ocp.viewer.viewer import Viewer


def show(
    *items: Any,
    file: str | PathLike[str] | None = None,
    title: str | None = None,
    open_browser: bool | None = None,
    height: int = 760,
) -> Viewer:
    """Show results in motion, several of them side by side: inline, in a browser or in a file."""
    raise NotImplementedError
