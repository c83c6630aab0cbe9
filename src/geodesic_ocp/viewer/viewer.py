"""Viewer: a playback that can be looked at in a browser or a notebook, or saved."""

from __future__ import annotations

import html
import tempfile
import webbrowser
from collections.abc import Collection
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

from geodesic_ocp.progress import Progress
from geodesic_ocp.records import write_file
from geodesic_ocp.scenes.plain_text import plain_text
from geodesic_ocp.scenes.playback import Playback
from geodesic_ocp.viewer.page.document import document
from geodesic_ocp.viewer.page.fragment import fragment

PAGES = (".html", ".htm")
PICTURES = (".mp4", ".gif", ".webp", ".png")
HEIGHT = 760  # of the frame in a notebook [px]


@dataclass(frozen=True, eq=False, repr=False)
class Viewer:
    """An animated view of a playback; a notebook displays it inline.

    Attributes:
        playback: what is shown.
        height: of the frame in a notebook [px].
    """

    playback: Playback
    height: int = HEIGHT

    def __repr__(self) -> str:
        return f"Viewer({self.playback!r})"

    def html(self) -> str:
        """A self-contained page, which opens from disk without a network.

        Raises:
            ImportError: Meshcat, whose copy of three.js draws the scenes, is not installed.
        """
        title = plain_text(self.playback.title)
        only = plain_text(self.playback.scenes[0].title) if len(self.playback.scenes) == 1 else ""
        heading = f"<h1>{html.escape(title)}</h1>\n" if title not in ("", only) else ""
        return document(title, heading + fragment(self.playback))

    def save(
        self,
        file: str | PathLike[str],
        *,
        rate: float = 25.0,
        width: int = 960,
        speed: float = 1.0,
        at: float | None = None,
        layers: Collection[str] | None = None,
        progress: Progress | None = None,
    ) -> Path:
        """Write a page (.html), a video (.mp4), an animation (.gif, .webp) or a picture (.png).

        Args:
            file: path, whose folder must exist.
            rate: of the frames of a video or animation [1 / s].
            width: of a video, animation or picture [px].
            speed: of a video or animation; at 2 it takes half of the time.
            at: time of a picture, in the playback's; the middle by default.
            layers: those that are shown, in a page at first; all but `playback.hidden` by default.
            progress: of a video or animation: called with what is done, the number of frames drawn,
                and the total.

        Returns:
            Path of the file.

        Raises:
            ValueError: another suffix, an argument out of range, or a layer that does not exist.
            ImportError: Meshcat, or what a video needs, is not installed.
            OSError: the file cannot be written; what was there is left as it was.
        """
        path = Path(file)
        if path.suffix.lower() in PAGES:
            if at is not None:
                raise ValueError("at is the time of a .png, not of a page")
            shown = self.playback if layers is None else self.playback.showing(layers)
            return write_file(path, replace(self, playback=shown).html())
        if path.suffix.lower() not in PICTURES:
            known = ", ".join((PAGES[0], *PICTURES))
            raise ValueError(f"file: {path} must end in one of {known}")
        from geodesic_ocp.viewer.video.save_video import save_video

        return save_video(
            self.playback,
            path,
            rate=rate,
            width=width,
            speed=speed,
            at=at,
            layers=layers,
            progress=progress,
        )

    def open(self) -> Path:
        """Write the page to a temporary file, open it in a browser, and return its path.

        If no browser opens, the path is printed. The file stays among the system's temporary
        files, because the browser may read it later.

        Raises:
            ImportError: Meshcat, whose copy of three.js draws the scenes, is not installed.
            OSError: the file cannot be written.
        """
        page = self.html()
        path = write_file(Path(tempfile.mkdtemp(prefix="geodesic_ocp-")) / "viewer.html", page)
        open_page(path)
        return path

    def _repr_html_(self) -> str:
        page, title = _ascii(self.html()), _ascii(plain_text(self.playback.title))
        style = f"border: 0; height: {self.height}px; width: 100%"
        # In a sandbox, its scripts cannot reach the notebook.
        allowed = 'sandbox="allow-scripts" allow="fullscreen"'
        return f'<iframe srcdoc="{page}" title="{title}" style="{style}" {allowed}></iframe>'


def _ascii(text: str) -> str:
    """Text for an attribute, the same whatever encoding the document around it has."""
    return html.escape(text).encode("ascii", "xmlcharrefreplace").decode("ascii")


def open_page(path: Path) -> None:
    """Open a page in a browser, or print where it is."""
    try:
        opened = webbrowser.open(path.resolve().as_uri())
    except webbrowser.Error:
        opened = False
    if not opened:
        print(f"No browser could be opened; the page is at {path}")
