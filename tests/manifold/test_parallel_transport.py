"""Parallel transport along paths and recorded motions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_metrics import PolarPlane, Sphere

import geodesic_ocp as go
from geodesic_ocp.manifold.exp import sample_geodesic


def circle_of_latitude(colatitude: float, samples: int) -> go.Motion:
    """Once around the sphere, as a motion of one second."""
    time = np.linspace(0.0, 1.0, samples)
    q = np.column_stack([np.full(samples, colatitude), 2 * np.pi * time])
    return go.Motion(time, q, ("colatitude", "longitude"))


@pytest.mark.parametrize("colatitude", [0.4, 1.0, np.pi / 2])
def test_holonomy_of_a_circle_of_latitude(colatitude: float) -> None:
    """Around the cap of area 2 pi (1 - cos t) a vector rotates by that area."""
    v = np.array([1.0, 0.0])
    transported = go.parallel_transport(Sphere(), circle_of_latitude(colatitude, 50), v)
    frame = np.array([1.0, np.sin(colatitude)])  # lengths of the coordinate vectors
    angle = np.arctan2(*(transported * frame)[::-1])
    expected = -2 * np.pi * np.cos(colatitude)  # the area minus one revolution of the frame
    assert np.exp(1j * angle) == pytest.approx(np.exp(1j * expected), abs=1e-8)


def test_holonomy_of_a_triangle() -> None:
    """Around a geodesic triangle a vector rotates by its area, the excess of its angles."""
    sphere = Sphere()
    corners = np.array([[0.8, 0.0], [1.4, 0.3], [1.1, 1.2]])
    start = np.array([0.3, -0.5])
    v, excess = start, -np.pi
    for a, b, c in zip(corners, np.roll(corners, -1, 0), np.roll(corners, 1, 0), strict=True):
        excess += sphere.angle(a, go.log(sphere, a, b), go.log(sphere, a, c))
        v = go.parallel_transport(sphere, go.geodesic(sphere, a, b), v)
    assert excess > 0.1
    assert sphere.angle(corners[0], start, v) == pytest.approx(excess, abs=1e-8)
    assert sphere.norm(corners[0], v) == pytest.approx(sphere.norm(corners[0], start), rel=1e-9)


def test_the_velocity_of_a_geodesic_is_parallel(arm_metric: go.KineticEnergy) -> None:
    q0 = np.array([0.2, 0.1, -0.8, 0.9, 0.3, -0.1, 0.2])
    q1 = np.array([0.9, -0.2, -1.1, 1.4, -0.1, 0.1, -0.3])
    path = go.geodesic(arm_metric, q0, q1)
    transported = go.parallel_transport(arm_metric, path, path(0.0, 1))
    assert transported == pytest.approx(path(1.0, 1), abs=1e-5)


def test_flat_plane_in_polar_coordinates_has_no_holonomy() -> None:
    time = np.linspace(0.0, 1.0, 100)
    q = np.column_stack([1.5 + 0.5 * np.cos(2 * np.pi * time), 0.8 * np.sin(2 * np.pi * time)])
    v = np.array([0.3, -0.7])
    transported = go.parallel_transport(PolarPlane(), go.Motion(time, q, ("r", "p")), v)
    assert transported == pytest.approx(v, abs=1e-8)


@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1))
def test_inner_products_are_preserved(arm_metric: go.KineticEnergy, seed: int) -> None:
    """Norms and angles do not change, along noisy samples either."""
    metric, rng = arm_metric, np.random.default_rng(seed)
    time = np.linspace(0.0, 1.0, 12)
    smooth = np.sin(time[:, None] * rng.uniform(1.0, 4.0, 7) + rng.uniform(0, 6, 7))
    q = 0.4 * smooth + 0.02 * rng.normal(size=smooth.shape)
    motion = go.Motion(time, q, tuple("abcdefg"))
    u, v = rng.normal(size=(2, 7))
    after = [go.parallel_transport(metric, motion, w) for w in (u, v)]
    for a, b, x, y in ((u, u, 0, 0), (u, v, 0, 1), (v, v, 1, 1)):
        scale = metric.norm(q[0], u) * metric.norm(q[0], v)
        before = metric.inner(q[0], a, b)
        assert metric.inner(q[-1], after[x], after[y]) == pytest.approx(before, abs=1e-8 * scale)


def test_samples_converge_with_the_fourth_order() -> None:
    """By the slope of the error, along splines through samples of a geodesic."""
    sphere = Sphere()
    errors, steps = [], np.array([8, 16, 32, 64])
    for count in steps:
        time = np.linspace(0.0, 1.0, count + 1)
        positions, velocities = sample_geodesic(
            sphere, [1.0, 0.0], [0.7, 1.5], time, tolerance=1e-12
        )
        motion = go.Motion(time, positions, ("t", "p"))
        transported = go.parallel_transport(sphere, motion, velocities[0], tolerance=1e-12)
        errors.append(np.abs(transported - velocities[-1]).max())
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope < -3.5


def test_zero_vector_and_bad_arguments() -> None:
    motion = circle_of_latitude(1.0, 10)
    assert not go.parallel_transport(Sphere(), motion, [0.0, 0.0]).any()
    with pytest.raises(ValueError, match=r"v must have shape \(2,\)"):
        go.parallel_transport(Sphere(), motion, [1.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="tolerance must be positive"):
        go.parallel_transport(Sphere(), motion, [1.0, 0.0], tolerance=-1.0)


def test_paths_converge_with_the_order_of_their_degree() -> None:
    """By the slope of the error, along a geodesic on ever finer grids."""
    metric, start, velocity = Sphere(), np.array([1.0, 0.2]), np.array([0.8, 1.1])
    counts, degree = np.array([4, 6, 8, 12, 16]), 3
    errors = []
    for count in counts:
        grid = go.Grid(int(count), degree)
        nodes, velocities = sample_geodesic(metric, start, velocity, grid.nodes, tolerance=1e-12)
        path = go.Path(metric, grid, nodes)
        transported = go.parallel_transport(metric, path, velocity, tolerance=1e-12)
        errors.append(np.abs(transported - velocities[-1]).max())
    slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope < -(degree + 0.5)  # the error of degree d has order d + 1
