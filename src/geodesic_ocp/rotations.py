"""Rotation vectors."""

from __future__ import annotations

from scipy.spatial.transform import Rotation

from geodesic_ocp.arrays import Array


def rotation_vector(rotation: Array) -> Array:
    """Axis times angle (..., 3) [rad] of rotation matrices (..., 3, 3), accurate up to pi."""
    result: Array = Rotation.from_matrix(rotation).as_rotvec()
    return result
