"""The Fréchet mean: closed forms on known spaces, and its first-order condition on an arm."""

from __future__ import annotations

import numpy as np
import pytest
from known_metrics import HalfPlane, PolarPlane, Sphere, in_plane, on_sphere

import geodesic_ocp as go

EXACT = 1e-7  # the condition is met to 1e-8 of the spread, which is about one


def test_mean_in_flat_space_is_the_arithmetic_mean(rng: np.random.Generator) -> None:
    points, weights = rng.normal(size=(5, 3)), rng.uniform(0.5, 2.0, 5)
    assert go.frechet_mean(go.Euclidean(3), points) == pytest.approx(points.mean(axis=0), abs=EXACT)
    expected = weights @ points / weights.sum()
    assert go.frechet_mean(go.Euclidean(3), points, weights) == pytest.approx(expected, abs=EXACT)
    polar = np.column_stack([rng.uniform(1.0, 2.0, 5), rng.uniform(-0.5, 0.5, 5)])
    found = go.frechet_mean(PolarPlane(), polar)
    assert in_plane(found) == pytest.approx(in_plane(polar).mean(axis=0), abs=EXACT)


def test_mean_of_two_points_is_halfway() -> None:
    metric, q0, q1 = Sphere(), np.array([1.0, 0.2]), np.array([1.8, 1.1])
    assert go.frechet_mean(metric, [q0, q1]) == pytest.approx(
        go.geodesic(metric, q0, q1)(0.5), abs=EXACT
    )
    third = go.geodesic(metric, q0, q1)(1.0 / 3.0)
    assert go.frechet_mean(metric, [q0, q1], [2.0, 1.0]) == pytest.approx(third, abs=EXACT)


def test_mean_on_the_sphere_is_a_minimum(rng: np.random.Generator) -> None:
    """Distances on the sphere are known in closed form: their sum is larger all around."""
    points = np.column_stack([rng.uniform(0.9, 2.0, 6), rng.uniform(-0.8, 0.8, 6)])

    def total(q: np.ndarray) -> float:
        return float(np.sum(np.arccos(on_sphere(points) @ on_sphere(q)) ** 2))

    found = go.frechet_mean(Sphere(), points)
    around = [found + 1e-3 * direction for direction in rng.normal(size=(20, 2))]
    assert all(total(q) > total(found) for q in around)


def test_first_order_condition_on_the_arm(
    arm: go.Model, arm_metric: go.KineticEnergy, rng: np.random.Generator
) -> None:
    points = (arm.lower + arm.upper) / 2 + rng.uniform(-0.4, 0.4, (3, 7))
    found = go.frechet_mean(arm_metric, points)
    logs = np.array([go.log(arm_metric, found, point) for point in points])
    spread = max(arm_metric.norm(found, each) for each in logs)
    assert arm_metric.norm(found, logs.mean(axis=0)) <= 1e-8 * spread
    assert go.frechet_mean(arm_metric, points[::-1]) == pytest.approx(found, abs=EXACT)


def test_one_point_is_its_own_mean(arm_metric: go.KineticEnergy) -> None:
    q = np.full(7, 0.2)
    assert np.array_equal(go.frechet_mean(arm_metric, [q]), q)
    assert np.array_equal(go.frechet_mean(arm_metric, [q, q]), q)


@pytest.mark.parametrize(
    ("points", "weights", "message"),
    [
        ([], None, r"points must have shape \(k, 2\)"),
        ([1.0, 2.0], None, r"points must have shape \(k, 2\)"),
        ([[1.0, 2.0], [0.0, 1.0]], None, r"points\[1\]: the metric is not positive definite"),
        ([[1.0, 2.0], [np.nan, 1.0]], None, r"points\[1\] must be finite"),
        ([[1.0, 2.0], [1.0, 1.0]], [1.0, 0.0], "weights must be 2 finite numbers above zero"),
        ([[1.0, 2.0], [1.0, 1.0]], [1.0], "weights must be 2 finite numbers above zero"),
    ],
)
def test_bad_arguments_are_named(points: list, weights: list | None, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.frechet_mean(Sphere(), points, weights)


@pytest.mark.slow
def test_mean_of_equal_and_nearly_equal_points(
    arm_metric: go.KineticEnergy, rng: np.random.Generator
) -> None:
    for _ in range(10):
        point = rng.uniform(-1.0, 1.0, 7)
        for offset in (0.0, 1e-15, 1e-11):
            found = go.frechet_mean(arm_metric, point + offset * np.array([[0.0], [1.0], [2.0]]))
            assert found == pytest.approx(point + offset, abs=1e-15, rel=0.0)


def test_mean_of_a_regular_triangle_is_its_centre() -> None:
    """Three points at the same distance around a point of the sphere, and of the half-plane."""
    for metric, centre in ((Sphere(), [1.4, 0.7]), (HalfPlane(), [0.5, 1.5])):
        basis = np.linalg.inv(np.linalg.cholesky(metric.matrix(np.array(centre)))).T
        angles = 0.3 + 2.0 * np.pi / 3.0 * np.arange(3)
        velocities = 0.6 * np.column_stack([np.cos(angles), np.sin(angles)]) @ basis.T
        triangle = [go.exp(metric, centre, v) for v in velocities]
        assert go.frechet_mean(metric, triangle) == pytest.approx(np.array(centre), abs=EXACT)
