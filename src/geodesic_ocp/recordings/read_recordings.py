"""Recordings from files, with the arms of the people in them."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from os import PathLike
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.human.anthropometry import Side
from geodesic_ocp.model.human.human_arm import DEFAULT_HEIGHT, DEFAULT_MASS, human_arm
from geodesic_ocp.model.model import Model
from geodesic_ocp.recordings.plausible import check_plausible
from geodesic_ocp.recordings.read_motion import read_motion
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.trajectory.motion import Motion, Subject

_SUFFIXES = (".xml", ".csv")
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
) -> tuple[Recording, ...]:
    """Read files or folders of recordings of human arms, filter them, and scale an arm to each.

    The arm is `human_arm` of the side, with the height and mass of the file's subject. Mass does
    not change geodesics of the kinetic energy, nor those with the default joint inertia, which is
    proportional to it; but it does with a joint inertia in kg m^2. Give `mass` where files contain
    a placeholder.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> folder = files("geodesic_ocp") / "data"
    >>> [(each.name, each.model.name) for each in go.read_recordings(folder, "left")]
    [('climb, left', 'human left arm')]

    Args:
        paths: files (MMM or tables, see `read_motion`) or folders, one or several; of a folder, all
            files that end in .xml or .csv.
        side: "right" or "left".
        height: of all subjects [m]; by default that in the file, or 1.75 m.
        mass: of all subjects [kg]; by default that in the file, or 70 kg.
        cutoff: of the filter [Hz], see `Motion.filtered`; chosen for each file by default.
        duration: of the window of a Savitzky-Golay filter [s], instead of a cut-off.
        skip: leave out files that cannot be used, with a warning that names each.

    Returns:
        One recording a file, in the order given, sorted by name within a folder. Its name is that
        of the file with the side, its subject that in the file.

    Raises:
        RecordingError: files cannot be used, or none is left; names each with its reason: it cannot
            be read or filtered, has no arm of that side, is implausible, or holds the same motion
            as another file, which statistics would count twice.
        ValueError: no path, both cutoff and duration, or one of the numbers is not positive.
    """
    if cutoff is not None and duration is not None:
        raise ValueError(
            f"give only one of cutoff and duration, got {cutoff:g} Hz and {duration:g} s"
        )
    numbers = {"height": height, "mass": mass, "cutoff": cutoff, "duration": duration}
    for name, number in numbers.items():
        if number is not None:
            as_positive(name, number)
    joints = human_arm(side).joint_names
    found: list[tuple[Path, Motion, Recording]] = []
    reasons: list[str] = []
    arms: dict[tuple[float, float], Model] = {}
    for file in _files(paths):
        try:
            motion = read_motion(file, joints)
            arm = _arm(motion.subject, side, height, mass, arms)
            check_plausible(arm, motion)
            filtered = motion.filtered(cutoff=cutoff, duration=duration)
        except ValueError as failure:
            reasons.append(_with_name(file, str(failure)))
            continue
        same = [other for other, its_motion, _ in found if _is_same(motion, its_motion)]
        if same:
            reasons.append(f"{file}: holds the same motion as {same[0]}")
        else:
            name = f"{file.stem}, {side}"
            found.append((file, motion, Recording(arm, filtered, name, motion.subject.name)))
    if reasons and (not skip or not found):
        raise RecordingError(";\n".join(reasons))
    for reason in reasons:
        warnings.warn(f"left out: {reason}", stacklevel=2)
    return tuple(recording for _, _, recording in found)


def _files(paths: str | PathLike[str] | Iterable[str | PathLike[str]]) -> list[Path]:
    given = [paths] if isinstance(paths, (str, PathLike)) else list(paths)
    files: list[Path] = []
    for path in map(Path, given):
        if path.is_dir():
            inside = sorted(each for each in path.iterdir() if each.suffix.lower() in _SUFFIXES)
            if not inside:
                raise RecordingError(f"{path}: no file in this folder ends in .xml or .csv")
            files += inside
        else:
            files.append(path)
    if not files:
        raise ValueError("paths must name at least one file or folder, got none")
    return files


def _arm(
    subject: Subject,
    side: Side,
    height: float | None,
    mass: float | None,
    arms: dict[tuple[float, float], Model],
) -> Model:
    """The arm of a subject, one model for all recordings of equal height and mass."""
    height = height if height is not None else subject.height or DEFAULT_HEIGHT
    mass = mass if mass is not None else subject.mass or DEFAULT_MASS
    return arms.setdefault((height, mass), human_arm(side, height, mass))


def _with_name(file: Path, reason: str) -> str:
    return reason if reason.startswith(str(file)) else f"{file}: {reason}"


def _is_same(first: Motion, second: Motion) -> bool:
    same_shape = first.q.shape == second.q.shape
    return same_shape and bool(np.allclose(first.q, second.q, rtol=0.0, atol=_SAME))
