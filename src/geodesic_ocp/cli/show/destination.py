"""Where to show something: in a browser if there is a screen, else in a file."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from geodesic_ocp.cli.analyse.recording import check_folder
from geodesic_ocp.cli.viewer_extra import require_pages
from geodesic_ocp.scenes.playback import Playback
from geodesic_ocp.viewer.viewer import PAGES, PICTURES, Viewer

_SUFFIXES = (PAGES[0], *PICTURES)
_OF_VIDEOS = ("width", "rate", "speed")


def check_destination(options: argparse.Namespace) -> None:
    """Check --out and the options of videos, before any work is done.

    Raises:
        ValueError: they cannot be met.
        ImportError: the extra viewer is not installed.
    """
    out: Path | None = options.out
    given = [name for name in _OF_VIDEOS if getattr(options, name) is not None]
    if out is not None:
        if out.is_dir():
            raise ValueError(f"--out {out} is a folder, not a file")
        if out.suffix.lower() not in (*PAGES, *PICTURES):
            raise ValueError(f"--out {out}: the file must end in {', '.join(_SUFFIXES)}")
        check_folder(out.parent)
    if out is None or out.suffix.lower() in PAGES:
        require_pages()
        if given:
            named = " and ".join(f"--{name}" for name in given)
            raise ValueError(f"{named}: of videos only; give --out FILE.mp4 or FILE.gif")


def present(playback: Playback, options: argparse.Namespace) -> None:
    """Write the file that is asked for, or open a browser, or write a page if there is no screen.

    Raises:
        ImportError: the extra viewer is not installed.
        OSError: the file cannot be written.
    """
    shown = Viewer(playback)
    out: Path | None = options.out
    if out is None and _has_screen():
        print(f"opened {shown.open()}")
        return
    if out is None:
        out = Path(f"{_name(options.file)}.html")
        print("There is no screen here: open the page in a browser elsewhere.")
    given = {name: getattr(options, name) for name in _OF_VIDEOS}
    out.parent.mkdir(parents=True, exist_ok=True)
    written = shown.save(out, **{name: each for name, each in given.items() if each is not None})
    print(f"wrote {written} ({written.stat().st_size / 1e6:.1f} MB)")


def _has_screen() -> bool:
    if sys.platform in ("darwin", "win32"):
        return True
    return any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def _name(files: list[str]) -> str:
    """Name of a page of these files, without a suffix."""
    stems = [
        Path(file).resolve().stem if Path(file).exists() else Path(file).name for file in files
    ]
    return stems[0] if len(stems) == 1 else f"{stems[0]}_and_{len(stems) - 1}_more"
