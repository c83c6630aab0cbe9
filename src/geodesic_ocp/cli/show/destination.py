"""Where to show something: in a browser if there is a screen, else in a file."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from contextlib import closing
from itertools import chain, count
from pathlib import Path

from geodesic_ocp.cli.analyse.recording import check_folder
from geodesic_ocp.cli.interrupts import ProgressBar
from geodesic_ocp.cli.viewer_extra import require_pages
from geodesic_ocp.scenes.playback import Playback
from geodesic_ocp.viewer.viewer import PAGES, PICTURES, Viewer

_SUFFIXES = (PAGES[0], *PICTURES)
_PICTURE = ".png"
_LITTLE = 0.1  # [MB]
_OF_MOTION, _OF_PICTURE = ("rate", "speed"), ("at",)
_GIVEN = ("width", *_OF_MOTION, *_OF_PICTURE)


def check_destination(options: argparse.Namespace) -> None:
    """Check --out and the options of videos, before any work is done.

    Raises:
        ValueError: they cannot be met.
        ImportError: the extra viewer is not installed.
    """
    out: Path | None = options.out
    if out is not None:
        if out.is_dir():
            raise ValueError(f"--out {out} is a folder, not a file")
        if out.suffix.lower() not in (*PAGES, *PICTURES):
            raise ValueError(f"--out {out}: the file must end in {', '.join(_SUFFIXES)}")
        check_folder(out.parent)
    if out is None or out.suffix.lower() in PAGES:
        require_pages()
        _check_absent(options, _GIVEN, "of videos and pictures only; give --out FILE.mp4 or .png")
    elif out.suffix.lower() == _PICTURE:
        _check_absent(options, _OF_MOTION, "of videos only; give --out FILE.mp4 or FILE.gif")
    else:
        _check_absent(options, _OF_PICTURE, "of a picture only; give --out FILE.png")


def _check_absent(options: argparse.Namespace, names: Sequence[str], reason: str) -> None:
    if given := [f"--{name}" for name in names if getattr(options, name) is not None]:
        raise ValueError(f"{' and '.join(given)}: {reason}")


def present(playback: Playback, options: argparse.Namespace) -> None:
    """Write the file that is asked for, or open a browser, or write a page if there is no screen.

    Raises:
        ValueError: there is no such layer or time.
        ImportError: the extra viewer is not installed.
        OSError: the file cannot be written.
    """
    if options.layers is not None:
        playback = playback.showing([name.strip() for name in options.layers.split(",")])
    shown = Viewer(playback)
    out: Path | None = options.out
    if out is None and _has_screen():
        print(f"opened {shown.open()}")
        return
    if out is None:
        out = _unused(_name(options.file))
        print("There is no screen here: open the page in a browser elsewhere.")
    given = {name: getattr(options, name) for name in _GIVEN}
    given = {name: value for name, value in given.items() if value is not None}
    out.parent.mkdir(parents=True, exist_ok=True)
    with closing(ProgressBar()) as bar:
        written = shown.save(out, **given, progress=bar)
    megabytes = written.stat().st_size / 1e6
    size = f"{megabytes:.1f} MB" if megabytes >= _LITTLE else f"{1e3 * megabytes:.0f} kB"
    print(f"wrote {written} ({size})")


def _has_screen() -> bool:
    if sys.platform in ("darwin", "win32"):
        return True
    return any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def _unused(name: str) -> Path:
    """A page of this name in the current folder, numbered if there is one."""
    names = chain([name], (f"{name}_{number}" for number in count(2)))
    return next(file for each in names if not (file := Path(f"{each}{PAGES[0]}")).exists())


def _name(files: list[str]) -> str:
    """Name of a page of these files, without a suffix."""
    stems = [
        Path(file).resolve().stem if Path(file).exists() else Path(file).name for file in files
    ]
    return stems[0] if len(stems) == 1 else f"{stems[0]}_and_{len(stems) - 1}_more"
