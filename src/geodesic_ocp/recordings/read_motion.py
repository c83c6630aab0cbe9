"""Motions from files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.formats.recognise import FORMATS, MARKERS, recognise
from geodesic_ocp.recordings.named_failures import named_failures
from geodesic_ocp.recordings.plausible import check_radians
from geodesic_ocp.trajectory.motion import Motion


def read_motion(
    path: str | PathLike[str],
    joints: Sequence[str] | None = None,
    *,
    convention: Any = None,
    skeleton: str | PathLike[str] | None = None,
    rate: float | None = None,
    unit: str | float | None = None,
) -> Motion:
    """Read a recorded motion from a file, whose format its content tells, not its suffix.

    The formats are MMM XML of both layouts, tables of comma-separated values, ASF/AMC, BVH,
    OpenSim's .mot and .sto, and .npz as in AMASS. The angles of the first two are those in the
    file, as are those of OpenSim files in no known convention; others are converted through the
    orientations of the segments to the joints of `human_arm` and of the trunk.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv")
    >>> len(motion), motion.joint_names[:3]
    (840, ('LSx_joint', 'LSz_joint', 'LSy_joint'))

    Args:
        path: of the file.
        joints: names of the joints to read, in the order of the result; all by default.
        convention: of the joint angles of an OpenSim file, which may be the file of its model
            (.osim), or of the skeleton of an AMC, BVH or .npz file; by default the known one that
            fits the names in the file.
        skeleton: file (.asf) that belongs to an AMC file; by default the one beside it.
        rate: of an AMC file [Hz], which does not contain it; 120 Hz by default.
        unit: of lengths in a BVH or AMC file: "m", "cm", "mm", "in" or a number of metres.

    Raises:
        RecordingError: the file is missing, of an unknown format, or malformed, or its angles look
            like degrees though they should be radians; the message names the file, the line or
            element, and what was expected there.
        ValueError: an argument that does not apply to files of this format.
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
    reader, _ = _READERS[kind]
    arguments = {"convention": convention, "skeleton": skeleton, "rate": rate, "unit": unit}
    given = {name: value for name, value in arguments.items() if value is not None}
    check_stated(file, kind, given)
    with named_failures(file):
        return reader(file, joints, **given)


def check_stated(file: Path, kind: str, names: Iterable[str]) -> None:
    """Raise ValueError if arguments of these names do not apply to files of this format."""
    for name in names:
        if name not in _stated(kind):
            others = [FORMATS[each] for each in FORMATS if name in _stated(each)]
            raise ValueError(f"{name} is for {' and '.join(others)}; {file} is {FORMATS[kind]}")


def that_apply(file: Path, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the arguments of `read_recording` that apply to the format of the file.

    For files of several formats; of a file that cannot be recognised, none.
    """
    try:
        kind = recognise(file)
    except (RecordingError, OSError):
        return {}
    return {name: value for name, value in arguments.items() if name in _stated(kind)}


def _stated(kind: str) -> tuple[str, ...]:
    return ("up", "marker_set") if kind in MARKERS else _READERS[kind][1]


# Readers are imported when a file of their format is read.


def _mmm(file: Path, joints: Sequence[str] | None) -> Motion:
    from geodesic_ocp.recordings.formats.mmm import read_mmm

    motion = read_mmm(file, joints)
    check_radians(motion.joint_names, motion.q)
    return motion


def _table(file: Path, joints: Sequence[str] | None) -> Motion:
    from geodesic_ocp.recordings.formats.csv_table import read_table

    motion = read_table(file, joints)
    check_radians(motion.joint_names, motion.q)
    return motion


def _amc(file: Path, joints: Sequence[str] | None, **given: Any) -> Motion:
    from geodesic_ocp.recordings.conventions.joint_angles import joint_angles
    from geodesic_ocp.recordings.formats.skeletons.amc import read_amc

    return joint_angles(read_amc(file, **given), joints)


def _bvh(file: Path, joints: Sequence[str] | None, **given: Any) -> Motion:
    from geodesic_ocp.recordings.conventions.joint_angles import joint_angles
    from geodesic_ocp.recordings.formats.skeletons.bvh import read_bvh

    return joint_angles(read_bvh(file, **given), joints)


def _opensim(file: Path, joints: Sequence[str] | None, **given: Any) -> Motion:
    from geodesic_ocp.recordings.formats.opensim import read_opensim

    return read_opensim(file, joints, **given)


def _smpl(file: Path, joints: Sequence[str] | None, **given: Any) -> Motion:
    from geodesic_ocp.recordings.conventions.joint_angles import joint_angles
    from geodesic_ocp.recordings.formats.skeletons.smpl import read_smpl

    return joint_angles(read_smpl(file, **given), joints)


# By format, the reader and the arguments of `read_motion` that apply to it.
_READERS: dict[str, tuple[Callable[..., Motion], tuple[str, ...]]] = {
    "mmm": (_mmm, ()),
    "table": (_table, ()),
    "amc": (_amc, ("convention", "skeleton", "rate", "unit")),
    "bvh": (_bvh, ("convention", "unit")),
    "opensim": (_opensim, ("convention",)),
    "smpl": (_smpl, ("convention",)),
}
