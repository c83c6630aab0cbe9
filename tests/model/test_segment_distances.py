"""Distances between many segments at once: those of the expressions, and of special positions."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

from geodesic_ocp.model.distances import line_segment, segment_distance, segment_distances
from geodesic_ocp.model.primitives import Capsule


def test_numbers_and_expressions_agree(rng: np.random.Generator) -> None:
    ends = rng.normal(size=(40, 4, 3))
    found = segment_distances(*ends.transpose(1, 0, 2))
    for distance, (start, end, other_start, other_end) in zip(found, ends, strict=True):
        segments = [
            line_segment(Capsule(tuple(one), tuple(other), 1.0))
            for one, other in ((start, end), (other_start, other_end))
        ]
        assert distance == pytest.approx(float(ca.DM(segment_distance(*segments))), abs=1e-7)


def test_points_parallel_and_crossing_segments() -> None:
    zero, x, y = np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    starts = np.array([zero, zero, zero, -x, zero])
    ends = np.array([zero, x, x, x, zero])
    other_starts = np.array([3.0 * x, y, 3.0 * x, -y, 2.0 * x - y])
    other_ends = np.array([3.0 * x, x + y, 2.0 * x, y, 2.0 * x + y])
    found = segment_distances(starts, ends, other_starts, other_ends)
    assert_allclose(found, [3.0, 1.0, 1.0, 0.0, 2.0], atol=1e-12)
    assert_allclose(segment_distances(other_starts, other_ends, starts, ends), found, atol=1e-12)
