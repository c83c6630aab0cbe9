"""Values of recordings show themselves in a few lines."""

from __future__ import annotations

import numpy as np
from short_reprs import check_reprs

import geodesic_ocp as go
from geodesic_ocp.recordings.conventions.known_angle_conventions import ISB
from geodesic_ocp.recordings.conventions.skeleton_convention import SMPL

OF_RECORDINGS = {
    go.AngleConvention,
    go.AxisRotation,
    go.FrameMotion,
    go.LostMarker,
    go.Markers,
    go.OsimConvention,
    go.SegmentOrientations,
    go.SegmentRelation,
    go.SkeletonConvention,
}


def test_reprs_are_short() -> None:
    time = np.arange(1000) / 100.0
    upright = np.tile(np.eye(3), (1000, 1, 1))
    trunk = go.FrameMotion(upright, np.zeros((1000, 3)))
    segments = [f"{side} {name}" for side in ("right", "left") for name in ("upper arm", "hand")]
    values = [
        trunk,
        go.SegmentOrientations(time, dict.fromkeys(("thorax", *segments), upright), trunk),
        go.Markers(time, tuple(f"marker {k}" for k in range(60)), np.zeros((1000, 60, 3))),
        go.LostMarker("RSHO", 0.1, 0.2, 0.05, "LSHO"),
        ISB,
        go.OsimConvention("model.osim", {f"right {name}": name for name in ("hand", "forearm")}),
        SMPL,
    ]
    assert check_reprs(values) >= OF_RECORDINGS
