"""Rotations as vectors."""

from __future__ import annotations

import numpy as np
import pytest

from geodesic_ocp.arrays import rotation_vector


@pytest.mark.parametrize("angle", [1e-9, 0.3, np.pi - 1e-9, np.pi])
def test_rotation_vectors_up_to_an_angle_of_pi(angle: float, rng: np.random.Generator) -> None:
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    cross = np.cross(np.eye(3), axis)
    rotation = np.eye(3) - np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    found = rotation_vector(rotation)
    assert np.linalg.norm(found) == pytest.approx(angle, rel=1e-6)
    assert abs(found @ axis) == pytest.approx(angle, rel=1e-6)
