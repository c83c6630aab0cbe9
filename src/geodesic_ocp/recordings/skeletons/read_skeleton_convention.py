"""as_skeleton_convention: a convention from its file."""

from __future__ import annotations

from pathlib import Path

from geodesic_ocp.recordings.conventions.read_convention_record import from_record
from geodesic_ocp.recordings.skeletons.skeleton_convention import SkeletonConvention


def as_skeleton_convention(
    given: SkeletonConvention | str | Path | None,
) -> SkeletonConvention | None:
    """The convention itself, or the one in a JSON or TOML file with the attributes as its keys.

        {"name": "mine", "up": "+z", "forward": "+y",
         "joints": {"thorax": "Torso", "right upper arm": ["RUpper", "RArm"]}}

    Raises:
        RecordingError: the file is missing or malformed, or its keys or values are others.
        ValueError: the argument is neither a convention nor a path.
    """
    if given is None or isinstance(given, SkeletonConvention):
        return given
    if not isinstance(given, (str, Path)):
        raise ValueError(f"convention must be a SkeletonConvention or a file, got {given!r}")
    return from_record(SkeletonConvention, Path(given), "joints", "a convention")
