"""The recording that comes with the package."""

from __future__ import annotations

from pathlib import Path

from geodesic_ocp.model.human import human_arm
from geodesic_ocp.trajectory.files.angle_tables import read_table
from geodesic_ocp.trajectory.recording import Recording, prepared

BUNDLED = Path(__file__).resolve().parents[1] / "data" / "climb.csv"


def bundled_recording() -> Recording:
    """Return the recording that comes with the package: the left arm of a person who climbs onto a
    box (motion capture, 7 s).

    >>> go.trajectory.bundled_recording().name
    'climb, left'
    """
    motion = read_table(BUNDLED)
    assert motion.subject.height is not None
    arm = human_arm("left", height=motion.subject.height)
    return Recording(arm, prepared(arm, motion, BUNDLED.stem), f"{BUNDLED.stem}, left")
