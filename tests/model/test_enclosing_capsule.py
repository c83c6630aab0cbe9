"""Small capsules around points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_models import capsule_volume, contains
from scipy.spatial import ConvexHull

import geodesic_ocp as go
from geodesic_ocp.model.link_geometry import enclosing_capsule


@settings(max_examples=6)
@given(st.integers(0, 10_000), st.integers(2, 60), st.sampled_from([1e-3, 1.0, 1e3]))
def test_all_points_are_in_the_capsule(seed: int, count: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    points = size * rng.normal(size=(count, 3)) * rng.uniform(0.05, 1.0, 3) + size
    assert contains(enclosing_capsule(points), points)


def test_the_capsule_is_small(rng: np.random.Generator) -> None:
    """For points on a capsule, it is that capsule, up to a few percent of volume."""
    start, end, radius = np.array([0.1, 0.2, 0.3]), np.array([0.6, -0.2, 0.5]), 0.12
    centres = start + (rng.uniform(size=(4000, 1)) > 0.5) * (end - start)
    normals = rng.normal(size=(4000, 3))
    points = centres + radius * normals / np.linalg.norm(normals, axis=1, keepdims=True)
    found = enclosing_capsule(points)
    exact = go.Capsule(tuple(start), tuple(end), radius)
    assert ConvexHull(points).volume < capsule_volume(found) < 1.02 * capsule_volume(exact)


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.zeros((3, 2)), [[0, 0, np.nan]]])
def test_wrong_points_are_rejected(points: object) -> None:
    with pytest.raises(ValueError, match="points must be finite, of shape"):
        enclosing_capsule(points)


def test_points_that_coincide_are_rejected() -> None:
    with pytest.raises(ValueError, match="points must not all coincide"):
        enclosing_capsule(np.ones((4, 3)))
