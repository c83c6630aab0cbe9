"""Recordings in folders and of patterns."""

from __future__ import annotations

import glob
import warnings
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from geodesic_ocp.errors import NotConverged, RecordingError
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.recordings.markers.marker_set import MarkerSet
from geodesic_ocp.recordings.markers.markers import Axis
from geodesic_ocp.recordings.read_recording import (
    check_arguments,
    read_motion,
    read_recording,
    that_apply,
)
from geodesic_ocp.trajectory.files.series import Gaps
from geodesic_ocp.trajectory.files.text_lines import unless_stated
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.recording import Recording

#: Ends of the names of recordings, by which a folder is searched.
SUFFIXES = (".xml", ".csv", ".amc", ".bvh", ".mot", ".sto", ".trc", ".c3d", ".npz", ".mvnx", ".tsv")
# Tables of Motion-BIDS that lie beside those of recordings.
_TABLES = ("participants", "_channels", "_events", "_scans", "_sessions")

# What lies together in a folder of results: of many recordings, of one, and of a study.
_RESULTS = (
    ("recordings.csv", "synergies.csv", "results"),
    ("synergies.json", "table.csv"),
    ("study.md", "means.csv"),
)


def recording_files(
    paths: str | PathLike[str] | Iterable[str | PathLike[str]], *, recursive: bool = False
) -> list[Path]:
    """Return the files that paths name: files, folders, and patterns such as "data/**/*.c3d".

    Args:
        paths: one or several. Of a folder all files whose names end as those of recordings do
            (`SUFFIXES`), sorted; hidden ones are left out, and folders within it that hold the
            tables of an analysis or a study. Of a pattern all files that match.
        recursive: also those in the folders within a folder.

    Returns:
        The files in the order given, each once.

    Raises:
        RecordingError: a folder or pattern without any such file, or a path that is neither a
            file nor a folder, without the suffix of a recording.
        ValueError: no path.
    """
    given = [paths] if isinstance(paths, (str, PathLike)) else list(paths)
    files: list[Path] = []
    for path in map(Path, given):
        if path.is_dir():
            files += _in_folder(path, recursive)
        elif glob.has_magic(str(path)) and not path.exists():
            files += _matching(str(path))
        elif path.exists() or path.suffix.lower() in SUFFIXES:
            files.append(path)  # whoever reads it tells if it is missing
        else:
            raise RecordingError(f"{path}: there is no such file or folder")
    if not files:
        raise ValueError("paths must name at least one file or folder, got none")
    return list(dict.fromkeys(files))


def _in_folder(folder: Path, recursive: bool) -> list[Path]:
    ours: dict[Path, bool] = {folder: False}  # whether a folder holds what this package wrote

    def is_result(place: Path) -> bool:
        if place not in ours:
            ours[place] = is_result(place.parent) or any(
                all((place / name).exists() for name in names) for names in _RESULTS
            )
        return ours[place]

    inside = sorted(
        each
        for each in (folder.rglob("*") if recursive else folder.iterdir())
        if each.suffix.lower() in SUFFIXES
        and not (each.suffix.lower() == ".tsv" and each.stem.endswith(_TABLES))
        and each.is_file()
        and not any(part.startswith(".") for part in each.relative_to(folder).parts)
        and not is_result(each.parent)
    )
    if not inside:
        where = "in this folder" + (" or those within it" if recursive else "")
        ends = f"{', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}"
        raise RecordingError(f"{folder}: no file {where} ends in {ends}")
    return inside


def _matching(pattern: str) -> list[Path]:
    found = sorted(Path(each) for each in glob.glob(pattern, recursive=True))
    files = [each for each in found if each.is_file()]
    if not files:
        raise RecordingError(f"{pattern}: no file matches this pattern")
    return files


_SAME = 1e-6  # [rad]; formats print angles with at least this precision


def read_recordings(
    paths: str | PathLike[str] | Iterable[str | PathLike[str]],
    side: Side = "right",
    *,
    height: float | None = None,
    mass: float | None = None,
    cutoff: float | None = None,
    duration: float | None = None,
    skip: bool = False,
    recursive: bool = False,
    convention: Any = None,
    unit: str | float | None = None,
    rate: float | None = None,
    skeleton: str | PathLike[str] | None = None,
    up: Axis | None = None,
    marker_set: MarkerSet | str | PathLike[str] | None = None,
    person: str | None = None,
    columns: Any = None,
    fill: float | None = None,
    part: int | None = None,
    degrees_in: bool | None = None,
) -> tuple[Recording, ...]:
    """Read files or folders of recordings of human arms, filter them, and scale an arm to each.

    The arm is `human_arm` of the side, with the height and mass of the file's subject. Mass does
    not change geodesics of the kinetic energy, nor those with the default joint inertia, which is
    proportional to it; but it does with a joint inertia in kg m^2. Give `mass` where files contain
    a placeholder.

    >>> from importlib.resources import files
    >>> folder = files("geodesic_ocp") / "data"
    >>> [(each.name, each.model.name) for each in go.recordings.read_recordings(folder, "left")]
    [('climb, left', 'human left arm')]

    Args:
        paths: files (in any format of `read_recording`), folders, or patterns such as
            "data/**/*.c3d", one or several; of a folder, all files whose names end as those of
            recordings do: .xml, .csv, .amc, .bvh, .mot, .sto, .trc, .c3d, .npz.
        side: "right" or "left".
        height: height of all subjects [m]; by default that in the file, or 1.75 m.
        mass: mass of all subjects [kg]; by default that in the file, or 70 kg.
        cutoff: cutoff of the filter [Hz], see `Motion.filtered`; chosen for each file by default.
        duration: duration of the window of a Savitzky-Golay filter [s], instead of a cut-off.
        skip: leave out files that cannot be used, with a warning that names each.
        recursive: also take the files in the folders within a folder.
        convention, unit, rate, skeleton, up, marker_set, person, columns, fill, part, degrees_in:
            see `read_recording`; each is used for the files to whose format it applies, `rate` and
            `degrees_in` for those that do not state theirs. With `fill`, a file with longer gaps is
            a recording for each part between them, or for this part.

    Returns:
        One recording a file or part, in the order given, sorted by name within a folder. Its name
        is that of the file with the side, its subject that in the file.

    Raises:
        RecordingError: files cannot be used, or none is left; names each with its reason: it cannot
            be read or filtered, has no arm of that side, is implausible, or holds the same motion
            as another file, which statistics would count twice.
        ValueError: no path, both cutoff and duration, or one of the numbers is not positive.
    """
    numbers: dict[str, Any] = {"height": height, "mass": mass}
    numbers |= {"cutoff": cutoff, "duration": duration}
    stated = {"convention": convention, "unit": unit, "rate": rate, "skeleton": skeleton}
    stated |= {"up": up, "marker_set": marker_set, "person": person, "columns": columns}
    stated |= {"fill": fill, "part": part, "degrees_in": degrees_in}
    check_arguments(side, up, numbers)
    human_arm(side)  # raises for another side, or for both
    found: list[tuple[Path, Recording]] = []
    reasons: list[str] = []
    for file in recording_files(paths, recursive=recursive):
        given = that_apply(file, stated)
        for number in parts_of(file, side, given):
            try:
                with unless_stated():
                    recording = read_recording(file, side, **(numbers | given | {"part": number}))
            except (ValueError, NotConverged) as failure:
                reasons.append(_with_name(file, str(failure)))
                continue
            same = [other for other, its in found if _is_same(recording.motion, its.motion)]
            if same:
                reasons.append(f"{file}: holds the same motion as {same[0]}")
            else:
                found.append((file, recording))
    if reasons and (not skip or not found):
        raise RecordingError(";\n".join(reasons))
    for reason in reasons:
        warnings.warn(f"left out: {reason}", stacklevel=2)
    return tuple(recording for _, recording in found)


def parts_of(file: Path, side: Side, stated: Mapping[str, Any]) -> Sequence[int | None]:
    """Return numbers of the parts between gaps that are longer than `fill`.

    (None,) of a file that is read as a whole, or that cannot be read.

    Args:
        file: to read.
        side: of the arm.
        stated: arguments of `read_recording` that apply to the file.
    """
    if stated.get("fill") is None or stated.get("part") is not None:
        return (stated.get("part"),)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # whoever reads it tells
            read_motion(file, human_arm(side).joint_names, **stated)
    except Gaps as gaps:
        return range(1, len(gaps.parts) + 1) or (None,)
    except ValueError:
        pass
    return (None,)


def _with_name(file: Path, reason: str) -> str:
    return reason if reason.startswith(str(file)) else f"{file}: {reason}"


def _is_same(first: Motion, second: Motion) -> bool:
    ours, others = (
        motion.q if motion.unfiltered is None else motion.unfiltered for motion in (first, second)
    )
    return ours.shape == others.shape and bool(np.allclose(ours, others, rtol=0.0, atol=_SAME))
