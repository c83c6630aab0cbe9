"""Whether pages can be made, asked before anything long is computed."""

from __future__ import annotations

from importlib.util import find_spec

_MISSING = "the page needs Meshcat: pip install 'geodesic_ocp[viewer]'"


def why_no_pages() -> str:
    """Why no page of the viewer can be made here; empty if it can."""
    return _MISSING if find_spec("meshcat") is None else ""


def require_pages() -> None:
    """Raise if no page of the viewer can be made.

    Raises:
        ImportError: Meshcat, whose copy of three.js draws the scenes, is not installed.
    """
    if reason := why_no_pages():
        raise ImportError(reason)
