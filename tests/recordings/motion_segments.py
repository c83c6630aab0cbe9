"""Orientations of segments from joint angles: the inverse of `joint_angles`."""

from __future__ import annotations

import numpy as np

import geodesic_ocp as go
from geodesic_ocp.recordings.conventions.continuous_angles import successive_rotations
from geodesic_ocp.recordings.conventions.segment_orientations import (
    ARM_JOINTS,
    SIDES,
    TRUNK_JOINTS,
    SegmentOrientations,
)


def segment_orientations(motion: go.Motion) -> SegmentOrientations:
    """Orientations of the segments of a motion of the Master Motor Map's joints.

    Thorax: that of `motion.trunk`, or upright. Upper arms, forearms and hands follow where the
    motion has all angles from the thorax to them, abdomen and pelvis with the trunk's joints.
    """

    def turn(letter: str, joints: tuple[str, ...], axes: str) -> np.ndarray | None:
        names = [f"{letter}{joint}_joint" for joint in joints]
        if not set(names) <= set(motion.joint_names):
            return None
        return successive_rotations(axes, motion.select(names).q)

    upright = np.broadcast_to(np.eye(3), (len(motion), 3, 3))
    thorax = upright if motion.trunk is None else motion.trunk.rotations
    rotations = {"thorax": thorax}
    upper, lower = turn("", TRUNK_JOINTS[3:], "xzy"), turn("", TRUNK_JOINTS[:3], "xzy")
    if upper is not None:
        rotations["abdomen"] = thorax @ np.swapaxes(upper, 1, 2)
        if lower is not None:
            rotations["pelvis"] = rotations["abdomen"] @ np.swapaxes(lower, 1, 2)
    chain = (("upper arm", 0, 3, "xzy"), ("forearm", 3, 5, "xz"), ("hand", 5, 7, "xy"))
    for side in SIDES:
        pose = thorax
        for segment, first, end, axes in chain:
            turned = turn(side[0].upper(), ARM_JOINTS[first:end], axes)
            if turned is None:
                break
            pose = pose @ turned
            rotations[f"{side} {segment}"] = pose
    return SegmentOrientations(motion.time, rotations, motion.trunk, motion.subject)
