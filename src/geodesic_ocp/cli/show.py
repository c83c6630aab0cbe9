"""geodesic-ocp show: recordings, results and robots in three dimensions and in motion."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from itertools import chain, count
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from geodesic_ocp.cli.kinds import retargeting_page
from geodesic_ocp.cli.playbacks import Shown
from geodesic_ocp.cli.terminal import check_folder, print_written, progress
from geodesic_ocp.drawing.scene import Playback, beside
from geodesic_ocp.drawing.viewer import PAGES, PICTURES, Viewer, open_page
from geodesic_ocp.records import write_file

_SUFFIXES = (PAGES[0], *PICTURES)
_PICTURE = ".png"
_LITTLE = 0.1  # [MB]
_OF_MOTION = ("rate", "speed")
_OF_PICTURE = ("at",)
_VIDEO = Parameter(group="Videos, animations and pictures")


def show(
    file: list[str],
    /,
    *,
    out: Path | None = None,
    title: str = "",
    layers: str | None = None,
    shown: Annotated[Shown, Parameter(name="*")] = Shown(),  # noqa: B008
    width: Annotated[int | None, _VIDEO] = None,
    at: Annotated[float | None, _VIDEO] = None,
    rate: Annotated[float | None, _VIDEO] = None,
    speed: Annotated[float | None, _VIDEO] = None,
) -> None:
    """Show recordings, results of the other commands, problems and robots in 3-D and in motion.

    They are shown in a browser, or in a page, video or picture. Where there is no screen, a page is
    written to the current folder.

    Args:
        file: what to show: recordings of joint angles, skeletons or markers; folders that analyse,
            retarget or solve wrote; synergies, trajectories, solutions and alignments; problems
            (.py), which are solved; robots (a file or a name). Several are shown side by side;
            synergies and their recording, given together, are shown in one pane. A folder of
            retarget, alone and without options, is shown by its page: person, robot and synergies.
        out: page (.html), video (.mp4), animation (.gif, .webp) or picture (.png) to write in place
            of opening a browser.
        title: title of the page.
        layers: names of what is shown, in a page at first, such as 'hand path,mobility ellipsoids';
            an unknown name lists those that exist; default: most of them.
        width: width of the picture [pixels].
        at: time [s], or path parameter, of a picture (.png); default: the middle.
        rate: pictures per second [Hz].
        speed: factor of the speed; 1 is as fast as it was.

    Raises:
        ValueError: a file cannot be read or shown, or options do not fit; names the file.
        ImportError: there is no browser that shoots pictures, or no ffmpeg for an .mp4.
        OSError: the page cannot be written.
    """
    options = {"width": width, "rate": rate, "speed": speed, "at": at}
    given = {name: value for name, value in options.items() if value is not None}
    check_destination(out, given)
    is_page = out is None or out.suffix.lower() in PAGES
    plain = is_page and not title and layers is None and shown == Shown()
    if plain and len(file) == 1 and (page := retargeting_page(Path(file[0]))):
        _present_page(page, out)
        return
    playback = beside(shown.playbacks(file), title=title)
    if layers is not None:
        playback = playback.showing([name.strip() for name in layers.split(",")])
    present(playback, file, out, given)


def _present_page(page: Path, out: Path | None) -> None:
    """Open a page, or write it elsewhere, or say where it is."""
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        print_written([write_file(out, page.read_text(encoding="utf-8"))])
    elif _has_screen():
        open_page(page)
        print(f"opened {page}")
    else:
        print(f"There is no screen here: open {page} in a browser elsewhere.")


def check_destination(out: Path | None, given: Mapping[str, Any]) -> None:
    """Check --out and the options of videos, before any work is done.

    Args:
        out: the file to write, if one is asked for.
        given: options of videos and pictures that are given.

    Raises:
        ValueError: the options do not fit the file, or it cannot be written.
    """
    if out is not None:
        if out.is_dir():
            raise ValueError(f"--out {out} is a folder, not a file")
        if out.suffix.lower() not in (*PAGES, *PICTURES):
            raise ValueError(f"--out {out}: the file must end in {', '.join(_SUFFIXES)}")
        check_folder(out.parent)
    if out is None or out.suffix.lower() in PAGES:
        _check_absent(
            given, tuple(given), "of videos and pictures only; give --out FILE.mp4 or .png"
        )
    elif out.suffix.lower() == _PICTURE:
        _check_absent(given, _OF_MOTION, "of videos only; give --out FILE.mp4 or FILE.gif")
    else:
        _check_absent(given, _OF_PICTURE, "of a picture only; give --out FILE.png")


def _check_absent(given: Mapping[str, Any], names: Sequence[str], reason: str) -> None:
    if wrong := [f"--{name}" for name in names if name in given]:
        raise ValueError(f"{' and '.join(wrong)}: {reason}")


def present(
    playback: Playback, names: Sequence[str], out: Path | None, given: Mapping[str, Any]
) -> None:
    """Write the file that is asked for, or open a browser, or write a page if there is no screen.

    Args:
        playback: what is shown.
        names: names of the files, for the name of a page.
        out: the file to write, if one is asked for.
        given: options of videos and pictures.

    Raises:
        ValueError: there is no such layer or time.
        ImportError: there is no browser that shoots pictures, or no ffmpeg for an .mp4.
        OSError: the file cannot be written.
    """
    viewer = Viewer(playback)
    if out is None and _has_screen():
        print(f"opened {viewer.open()}")
        return
    if out is None:
        out = _unused(_name(names))
        print("There is no screen here: open the page in a browser elsewhere.")
    out.parent.mkdir(parents=True, exist_ok=True)
    with progress() as bar:
        written = viewer.save(out, **given, progress=bar)
    megabytes = written.stat().st_size / 1e6
    size = f"{megabytes:.1f} MB" if megabytes >= _LITTLE else f"{1e3 * megabytes:.0f} kB"
    print(f"wrote {written} ({size})")


def _has_screen() -> bool:
    if sys.platform in ("darwin", "win32"):
        return True
    return any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def _unused(name: str) -> Path:
    """Return a page of this name in the current folder, numbered if there is one."""
    names = chain([name], (f"{name}_{number}" for number in count(2)))
    return next(file for each in names if not (file := Path(f"{each}{PAGES[0]}")).exists())


def _name(files: Sequence[str]) -> str:
    """Return name of a page of these files, without a suffix."""
    stems = [
        Path(file).resolve().stem if Path(file).exists() else Path(file).name for file in files
    ]
    return stems[0] if len(stems) == 1 else f"{stems[0]}_and_{len(stems) - 1}_more"
