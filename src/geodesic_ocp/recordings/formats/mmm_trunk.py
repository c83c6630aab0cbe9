"""The pose of the thorax in recordings of the Master Motor Map.

A recording has the pose of the root, which is the pelvis: RootPosition [mm] and RootRotation, roll,
pitch and yaw [rad] about fixed axes. The joints of the trunk lead from there to the thorax, in the
reference model scaled by the person's height. Of take_book_from_shelf_right_arm_02 of the KIT
database, the markers at C7 and CLAV are then 26 and 12 mm from where the model has them; with the
angles about axes that turn with the pelvis it would be 43 and 22 mm.
"""

from __future__ import annotations

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.anthropometry import trunk
from geodesic_ocp.trajectory.motion import FrameMotion

#: The joints of the trunk, from the pelvis to the thorax.
TRUNK_JOINTS = tuple(f"B{part}{axis}_joint" for part in "PT" for axis in "xzy")
_MILLIMETRE = 1e-3  # [m]


def root_motion(positions: Array, angles: Array) -> FrameMotion:
    """The poses of the pelvis from RootPosition [mm] and RootRotation [rad], (k, 3) each.

    Raises:
        ValueError: a pose is not finite.
    """
    finite = np.isfinite(positions).all(axis=1) & np.isfinite(angles).all(axis=1)
    if not finite.all():
        raise ValueError(f"the pose of the root is not finite at sample {int(np.argmin(finite))}")
    turned = scipy.spatial.transform.Rotation.from_euler("xyz", angles)
    return FrameMotion(turned.as_matrix(), _MILLIMETRE * positions)


def thorax_motion(root: FrameMotion, angles: Array, height: float) -> FrameMotion:
    """The poses of the thorax, its origin midway between the shoulders.

    Args:
        root: poses of the pelvis.
        angles: of `TRUNK_JOINTS` (k, 6) [rad].
        height: of the person [m].
    """
    rotation = scipy.spatial.transform.Rotation
    lengths = trunk()
    rotations, positions = np.array(root.rotations), np.array(root.positions)
    steps = (lengths.pelvis, angles[:, :3]), (lengths.abdomen_length, angles[:, 3:])
    for length, turned in steps:
        positions += height * length * rotations[:, :, 2]
        rotations = rotations @ rotation.from_euler("XZY", turned).as_matrix()
    positions += height * lengths.thorax_length * rotations[:, :, 2]
    return FrameMotion(rotations, positions)
