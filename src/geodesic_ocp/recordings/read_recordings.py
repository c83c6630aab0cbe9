"""Recordings from files, with the arms of the people in them."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.errors import NotConverged, RecordingError
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.recordings.markers.sets.marker_set import MarkerSet
from geodesic_ocp.recordings.markers.space_axes import Axis, as_axis
from geodesic_ocp.recordings.read_recording import read_recording, that_apply
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.recordings.recording_files import recording_files
from geodesic_ocp.trajectory.motion import Motion

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
        paths: files (in any format of `read_recording`), folders, or patterns such as
            "data/**/*.c3d", one or several; of a folder, all files whose names end as those of
            recordings do: .xml, .csv, .amc, .bvh, .mot, .sto, .trc, .c3d, .npz.
        side: "right" or "left".
        height: of all subjects [m]; by default that in the file, or 1.75 m.
        mass: of all subjects [kg]; by default that in the file, or 70 kg.
        cutoff: of the filter [Hz], see `Motion.filtered`; chosen for each file by default.
        duration: of the window of a Savitzky-Golay filter [s], instead of a cut-off.
        skip: leave out files that cannot be used, with a warning that names each.
        recursive: also take the files in the folders within a folder.
        convention, unit, rate, skeleton, up, marker_set: see `read_recording`; each is used for
            the files to whose format it applies.

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
    human_arm(side)  # raises for another side
    stated = {
        "convention": convention,
        "unit": unit,
        "rate": rate,
        "skeleton": skeleton,
        "up": up,
        "marker_set": marker_set,
    }
    if up is not None:
        as_axis(up)
    found: list[tuple[Path, Recording]] = []
    reasons: list[str] = []
    for file in recording_files(paths, recursive=recursive):
        try:
            recording = read_recording(
                file,
                side,
                height=height,
                mass=mass,
                cutoff=cutoff,
                duration=duration,
                **that_apply(file, stated),
            )
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


def _with_name(file: Path, reason: str) -> str:
    return reason if reason.startswith(str(file)) else f"{file}: {reason}"


def _is_same(first: Motion, second: Motion) -> bool:
    ours, others = (
        motion.q if motion.unfiltered is None else motion.unfiltered for motion in (first, second)
    )
    return ours.shape == others.shape and bool(np.allclose(ours, others, rtol=0.0, atol=_SAME))
