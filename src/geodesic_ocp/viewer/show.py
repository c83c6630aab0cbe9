"""Show results in three dimensions."""

from __future__ import annotations

import sys
from collections.abc import Collection
from os import PathLike
from pathlib import Path
from typing import Any

from geodesic_ocp.scenes.playback_of import playback_of
from geodesic_ocp.viewer.viewer import HEIGHT, PAGES, Viewer, open_page


def show(
    *items: Any,
    file: str | PathLike[str] | None = None,
    title: str = "",
    layers: Collection[str] | None = None,
    open_browser: bool | None = None,
    height: int = HEIGHT,
) -> Viewer:
    """Show results in motion, several of them side by side: inline, in a browser or in a file.

    >>> import geodesic_ocp as go
    >>> arm = go.human_arm("right")
    >>> viewer = show(arm, open_browser=False)
    >>> viewer.html()[:15]
    '<!DOCTYPE html>'

    In a notebook the value displays itself. Elsewhere a browser opens, unless a file is written:
    `show(solution, file="reach.html")` writes a page that needs no network, and `.mp4`, `.gif`,
    `.webp` or `.png` a video, an animation or a picture, see `Viewer.save`.

    Args:
        items: a `Motion` or `JointTrajectory` followed by its `Model`, a `Path`, `Solution`,
            `Analysis`, `Retargeting`, `Model`, ...: see `playback_of`.
        file: to be written; its suffix says what it is.
        title: of the whole.
        layers: names of those that are shown at first, such as "hand path", "obstacles", "frames"
            or "mobility ellipsoids"; the others can be switched on. By default most are shown.
        open_browser: whether a browser shows the page; None: outside notebooks, if no file is
            written.
        height: of the frame in a notebook [px].

    Returns:
        The viewer, whose `save` writes further files.

    Raises:
        TypeError, ValueError: items of which there is nothing to show, a layer that does not exist,
            or a file of another suffix.
        ImportError: Meshcat, whose copy of three.js draws the scenes, is not installed.
        OSError: the file cannot be written.
    """
    if not isinstance(title, str):
        raise TypeError(f"title must be a text, got {title!r}")
    if not isinstance(height, int) or height <= 0:
        raise ValueError(f"height must be a positive number of pixels, got {height!r}")
    playback = playback_of(*items, title=title)
    viewer = Viewer(playback if layers is None else playback.showing(layers), height)
    written = None if file is None else viewer.save(file)
    if open_browser is None:
        open_browser = file is None and not _in_notebook()
    if open_browser and written is not None and _is_page(written):
        open_page(written)
    elif open_browser:
        viewer.open()
    return viewer


def _is_page(file: Path) -> bool:
    return file.suffix.lower() in PAGES


def _in_notebook() -> bool:
    """Whether the value of a cell displays itself: IPython runs as the kernel of a notebook."""
    ipython = sys.modules.get("IPython")  # otherwise nobody has started it
    shell = ipython.get_ipython() if ipython is not None else None
    return any(kind.__name__ == "ZMQInteractiveShell" for kind in type(shell).__mro__)
