"""segment_orientations: the orientations of the segments with given joint angles."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.conventions.continuous_angles import successive_rotations
from geodesic_ocp.recordings.conventions.joint_angles import ARM_JOINTS, SIDES, TRUNK_JOINTS
from geodesic_ocp.recordings.conventions.segment_orientations import SegmentOrientations
from geodesic_ocp.trajectory.motion import Motion


def segment_orientations(motion: Motion) -> SegmentOrientations:
    """The orientations of the segments of a motion of the Master Motor Map's joints.

    Thorax: that of `motion.trunk`, or upright. Upper arms, forearms and hands follow where the
    motion has all angles from the thorax to them, abdomen and pelvis with the trunk's joints. It
    is the inverse of `joint_angles`.

    Raises:
        ValueError: the motion has no angles of a whole shoulder or of the trunk.
    """
    count = len(motion)
    upright = np.broadcast_to(np.eye(3), (count, 3, 3))
    thorax = upright if motion.trunk is None else motion.trunk.rotations
    rotations = {"thorax": thorax}
    upper = _rotation(motion, "", TRUNK_JOINTS[3:], "xzy")
    if upper is not None:
        rotations["abdomen"] = thorax @ np.swapaxes(upper, 1, 2)
        lower = _rotation(motion, "", TRUNK_JOINTS[:3], "xzy")
        if lower is not None:
            rotations["pelvis"] = rotations["abdomen"] @ np.swapaxes(lower, 1, 2)
    for side in SIDES:
        pose = thorax
        chain = (("upper arm", 0, 3, "xzy"), ("forearm", 3, 5, "xz"), ("hand", 5, 7, "xy"))
        for segment, first, end, axes in chain:
            turn = _rotation(motion, side[0].upper(), ARM_JOINTS[first:end], axes)
            if turn is None:
                break
            pose = pose @ turn
            rotations[f"{side} {segment}"] = pose
    if len(rotations) == 1:
        raise ValueError(
            "the motion must have the angles of a shoulder, such as RSx_joint, RSz_joint and "
            f"RSy_joint, or of the trunk; it has {', '.join(motion.joint_names)}"
        )
    return SegmentOrientations(motion.time, rotations, motion.trunk, motion.subject)


def _rotation(motion: Motion, letter: str, joints: tuple[str, ...], axes: str) -> Array | None:
    names = [f"{letter}{joint}_joint" for joint in joints]
    if not set(names) <= set(motion.joint_names):
        return None
    return successive_rotations(axes, motion.select(names).q)
