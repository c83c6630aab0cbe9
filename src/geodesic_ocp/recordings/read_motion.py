"""Motions from files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.named_failures import named_failures
from geodesic_ocp.recordings.plausible import check_radians
from geodesic_ocp.recordings.recognise import FORMATS, MARKERS, recognise
from geodesic_ocp.trajectory.motion import Motion


def read_motion(
    path: str | PathLike[str],
    joints: Sequence[str] | None = None,
    *,
    convention: Any = None,
    skeleton: str | PathLike[str] | None = None,
) -> Motion:
    """Read a recorded motion from a file, whose format is told by its content, not by its suffix.

    Read are MMM XML of both layouts, tables of comma-separated values, ASF/AMC, BVH, OpenSim's .mot
    and .sto, and AMASS-style .npz. The angles of the first two, and of OpenSim files in no known
    convention, are those in the file; those of the others are converted through the orientations
    of the segments to the joints of `human_arm` and of the trunk.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv")
    >>> len(motion), motion.joint_names[:3]
    (840, ('LSx_joint', 'LSz_joint', 'LSy_joint'))

    Args:
        path: of the file.
        joints: names of the joints to read, in the order of the result; all by default.
        convention: of the joint angles in an OpenSim file, or of the skeleton in a BVH file; by
            default the one that fits the names in the file.
        skeleton: file (.asf) that belongs to an AMC file; by default the one beside it.

    Raises:
        RecordingError: the file is missing, of an unknown format, or malformed, or its angles look
            like degrees though they should be radians; the message names the file, the line or
            element, and what was expected there.
        ValueError: an argument that the format does not have.
    """
    file = Path(path)
    if joints is not None and (isinstance(joints, str) or not joints):
        raise ValueError(f"joints must be a sequence of names or None, got {joints!r}")
    with named_failures(file):
        kind = recognise(file)
    if kind in MARKERS:
        raise RecordingError(
            f"{file}: {FORMATS[kind]} has markers, not joint angles; read it with go.read_markers, "
            "and compute angles with go.fit_motion"
        )
    _check_arguments(kind, convention, skeleton)
    with named_failures(file):
        motion = _READERS[kind](file, joints, convention, skeleton)
        check_radians(motion)
    return motion


def _check_arguments(kind: str, convention: Any, skeleton: str | PathLike[str] | None) -> None:
    if convention is not None and kind not in ("bvh", "opensim"):
        raise ValueError(f"convention is for BVH and OpenSim files, the file is {FORMATS[kind]}")
    if skeleton is not None and kind != "amc":
        raise ValueError(f"skeleton is for AMC files, the file is {FORMATS[kind]}")


# Readers are imported when a file of their format is read.


def _mmm(file: Path, joints: Sequence[str] | None, *_: Any) -> Motion:
    from geodesic_ocp.recordings.formats.mmm import read_mmm

    return read_mmm(file, joints)


def _table(file: Path, joints: Sequence[str] | None, *_: Any) -> Motion:
    from geodesic_ocp.recordings.formats.csv_table import read_table

    return read_table(file, joints)


_READERS: dict[str, Callable[..., Motion]] = {
    "mmm": _mmm,
    "table": _table,
}
