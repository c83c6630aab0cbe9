"""Values of recordings show themselves in a few lines."""

from __future__ import annotations

import numpy as np
from short_reprs import OF_RECORDINGS, check_reprs

import geodesic_ocp as go
from geodesic_ocp.recordings.conventions.known_angle_conventions import ISB
from geodesic_ocp.recordings.conventions.skeleton_convention import SMPL
from geodesic_ocp.recordings.markers.marker_fit import LostMarker
from geodesic_ocp.trajectory.motion import FrameMotion


def test_reprs_are_short() -> None:
    time = np.arange(1000) / 100.0
    upright = np.tile(np.eye(3), (1000, 1, 1))
    trunk = FrameMotion(upright, np.zeros((1000, 3)))
    segments = [f"{side} {name}" for side in ("right", "left") for name in ("upper arm", "hand")]
    values = [
        trunk,
        go.recordings.SegmentOrientations(
            time, dict.fromkeys(("thorax", *segments), upright), trunk
        ),
        go.recordings.Markers(
            time, tuple(f"marker {k}" for k in range(60)), np.zeros((1000, 60, 3))
        ),
        LostMarker("RSHO", 0.1, 0.2, 0.05, "LSHO"),
        ISB,
        go.recordings.OsimConvention(
            "model.osim", {f"right {name}": name for name in ("hand", "forearm")}
        ),
        SMPL,
    ]
    assert check_reprs(values) >= OF_RECORDINGS
