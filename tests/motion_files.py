"""Recorded motions in the two formats that the core reads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import geodesic_ocp as go
from geodesic_ocp.trajectory.files.angle_tables import read_table
from geodesic_ocp.trajectory.files.mmm import read_mmm


def motion_in(file: Path, joints: Sequence[str] | None = None) -> go.Motion:
    """The motion in an MMM file or in a table."""
    return (read_mmm if file.suffix == ".xml" else read_table)(file, joints)
