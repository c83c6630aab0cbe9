"""Viewer: a playback that can be looked at in a browser or a notebook, or saved; reports."""

from __future__ import annotations

import base64
import html
import io
import sys
import tempfile
import webbrowser
from collections.abc import Collection
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

from geodesic_ocp.drawing.page import document, fragment, page
from geodesic_ocp.drawing.playback_of import playback_of
from geodesic_ocp.drawing.retargeting_figure import retargeting_figure
from geodesic_ocp.drawing.retargeting_scenes import retargeting_playback
from geodesic_ocp.drawing.scene import Playback, plain_text
from geodesic_ocp.progress import Progress
from geodesic_ocp.records import write_file
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.tables import html as html_table

PAGES = (".html", ".htm")
PICTURES = (".mp4", ".gif", ".webp", ".png")
_HEIGHT = 760  # [px], of the frame in a notebook until its page says how tall it is
_FIT = """<script>addEventListener("message", ({source, data}) => {
  for (const frame of document.querySelectorAll("iframe")) {
    if (frame.contentWindow === source && data?.geodesicOcpHeight) {
      frame.style.height = `${Number(data.geodesicOcpHeight)}px`;
    }
  }
});</script>"""


@dataclass(frozen=True, eq=False, repr=False)
class Viewer:
    """An animated view of a playback; a notebook displays it inline.

    Attributes:
        playback: what is shown.
        height: height of the frame in a notebook [px]; None: that of its content.
    """

    playback: Playback
    height: int | None = None

    def __repr__(self) -> str:
        return f"Viewer({self.playback!r})"

    def html(self) -> str:
        """Return a self-contained page, which opens from disk without a network."""
        return page(self.playback)

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
            rate: rate of the frames of a video or animation [1 / s].
            width: width of a video, animation or picture [px].
            speed: speed of a video or animation; at 2 it takes half of the time.
            at: time of a picture, in the playback's; the middle by default.
            layers: those that are shown, in a page at first; all but `playback.hidden` by default.
            progress: progress of a video or animation: called with what is done, the number of
                frames drawn, and the total.

        Returns:
            Path of the file.

        Raises:
            ValueError: another suffix, an argument out of range, or a layer that does not exist.
            ImportError: there is no browser that shoots pictures, or no ffmpeg for an .mp4.
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
        from geodesic_ocp.drawing.save_video import save_video

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
            OSError: the file cannot be written.
        """
        folder = Path(tempfile.mkdtemp(prefix="geodesic_ocp-"))
        path = write_file(folder / "viewer.html", self.html())
        open_page(path)
        return path

    def _repr_html_(self) -> str:
        source = _ascii(self.html())
        title = _ascii(plain_text(self.playback.title))
        style = f"border: 0; height: {self.height or _HEIGHT}px; width: 100%"
        # In a sandbox, its scripts cannot reach the notebook.
        allowed = 'sandbox="allow-scripts" allow="fullscreen"'
        frame = f'<iframe srcdoc="{source}" title="{title}" style="{style}" {allowed}></iframe>'
        return frame if self.height else frame + _FIT


def _ascii(text: str) -> str:
    """Return text for an attribute, the same whatever encoding the document around it has."""
    return html.escape(text).encode("ascii", "xmlcharrefreplace").decode("ascii")


def open_page(path: Path) -> None:
    """Open a page in a browser, or print where it is."""
    try:
        opened = webbrowser.open(path.resolve().as_uri())
    except webbrowser.Error:
        opened = False
    if not opened:
        print(f"No browser could be opened; the page is at {path}")


def show(
    *items: Any,
    file: str | PathLike[str] | None = None,
    title: str = "",
    layers: Collection[str] | None = None,
    open_browser: bool | None = None,
    height: int | None = None,
) -> Viewer:
    """Show results in motion, several of them side by side: inline, in a browser or in a file.

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
        title: title of the whole.
        layers: names of those that are shown at first, such as "hand path", "obstacles", "frames"
            or "mobility ellipsoids"; the others can be switched on. By default most are shown.
        open_browser: whether a browser shows the page; None: outside notebooks, if no file is
            written.
        height: height of the frame in a notebook [px]; None: that of its content.

    Returns:
        The viewer, whose `save` writes further files.

    Raises:
        TypeError, ValueError: items of which there is nothing to show, a layer that does not exist,
            or a file of another suffix.
        OSError: the file cannot be written.
    """
    if not isinstance(title, str):
        raise TypeError(f"title must be a text, got {title!r}")
    if height is not None and (not isinstance(height, int) or height <= 0):
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
    """Return whether IPython runs as the kernel of a notebook, which displays values."""
    ipython = sys.modules.get("IPython")  # otherwise nobody has started it
    shell = ipython.get_ipython() if ipython is not None else None
    return any(kind.__name__ == "ZMQInteractiveShell" for kind in type(shell).__mro__)


def report(retargeting: Retargeting, file: str | PathLike[str]) -> Path:
    """Write an HTML page of a retargeting: person and robots in motion, tables and the figure.

    The page needs only a browser. It has what `show` has of a retargeting; the paths of the robot's
    hand, of the person's, mapped to the robot, and of inverse kinematics have the colours of the
    figure below.

    >>> import tempfile
    >>> recording = go.trajectory.bundled_recording()
    >>> analysis = go.analyse(recording.model, recording.motion.part(270, 429))
    >>> result = go.retarget(analysis, go.human_arm("left", height=1.95), tolerance=1e-3)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     go.drawing.report(result, f"{folder}/report.html").name
    'report.html'

    Args:
        retargeting: result of `retarget`.
        file: path of the page; its folder must exist.

    Returns:
        Path of the file.

    Raises:
        OSError: the file cannot be written.
    """
    playback = retargeting_playback(retargeting)
    title = playback.title[:1].upper() + playback.title[1:]
    parts = [
        f"<h1>{html.escape(title)}</h1>",
        f"<p>{html.escape(_sentences(retargeting))}</p>",
        fragment(playback),
        "<h2>Compared with inverse kinematics that tracks the whole path of the hand</h2>",
        html_table(retargeting.table()),
        "<h2>The robot's synergies, and the person's synergies from which they are made</h2>",
        html_table(retargeting.synergy_table()),
        f'<p><img alt="hand and joints over time" src="{_picture(retargeting)}"></p>',
    ]
    return write_file(file, document(title, "\n".join(parts)))


def _sentences(retargeting: Retargeting) -> str:
    within_limits = retargeting.settings.within_limits
    held = "within the robot's limits" if within_limits else "without limits"
    formulation = retargeting.settings.formulation
    description = {
        "constrained": "Each synergy is the path of least energy to the hand pose at its end, "
        f"{held}.",
        "geodesic": "Each synergy is the geodesic that brings the hand nearest to the pose at the "
        "person's; joint limits are not considered.",
    }[formulation]
    stretch = retargeting.stretch
    time = (
        f"The robot takes {stretch:.2f} times as long as the person, because of joint speed limits."
        if stretch > 1.0
        else "The robot takes the person's time."
    )
    num_unreachable = sum(len(arm.out_of_reach) for arm in retargeting.arms)
    reach = f" Poses out of reach: {num_unreachable}." if num_unreachable else ""
    return f"{description} {time}{reach}"


def _picture(retargeting: Retargeting) -> str:
    """Return the figure as a data URL."""
    data = io.BytesIO()
    retargeting_figure(retargeting).savefig(data, format="png", dpi=110)
    return f"data:image/png;base64,{base64.b64encode(data.getvalue()).decode()}"
