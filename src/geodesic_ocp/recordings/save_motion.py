"""Motions to files."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from geodesic_ocp.records import write_file
from geodesic_ocp.table import Table
from geodesic_ocp.trajectory.motion import Motion


def save_motion(path: str | PathLike[str], motion: Motion) -> Path:
    """Write a motion as the table (CSV) that `read_motion` reads, with all digits.

    Time in s, joint coordinates in rad or m, and what is known of the subject. Velocities, the
    coordinates before filtering, and the pose of the trunk are not written.

    Raises:
        ValueError: the name of the file does not end in .csv.
        OSError: the file cannot be written.
    """
    file = Path(path)
    if file.suffix.lower() != ".csv":
        raise ValueError(f"path must end in .csv, got {file.name!r}")
    subject = motion.subject
    notes = {"unit": "rad", "height": subject.height, "mass": subject.mass}
    lines = [f"# {key}: {value}" for key, value in notes.items() if value is not None]
    if subject.name:
        lines.append(f"# subject: {' '.join(subject.name.split())}")
    rows = tuple(
        (float(time), *map(float, q)) for time, q in zip(motion.time, motion.q, strict=True)
    )
    table = Table(("time", *motion.joint_names), rows).csv()
    return write_file(file, "\n".join([*lines, table]))
