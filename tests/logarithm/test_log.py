"""Logarithmic map and distance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from all_metrics import METRICS, points
from hypothesis import given, settings
from hypothesis import strategies as st
from known_metrics import HalfPlane, PolarPlane, Sphere, half_plane_distance, in_plane, on_sphere
from known_models import planar_arm

import geodesic_ocp as go

SEED = st.integers(0, 2**32 - 1)
FEW = settings(max_examples=10)


def distance_on_sphere(a: np.ndarray, b: np.ndarray) -> float:
    x, y = on_sphere(a), on_sphere(b)
    return float(np.arctan2(np.linalg.norm(np.cross(x, y)), x @ y))


@pytest.mark.slow
@FEW
@given(seed=SEED)
def test_distances_on_the_sphere(seed: int) -> None:
    a, b = np.random.default_rng(seed).uniform([0.6, 0.0], [2.5, 1.8], (2, 2))
    assert go.distance(Sphere(), a, b) == pytest.approx(distance_on_sphere(a, b), abs=1e-9)


@FEW
@given(seed=SEED)
def test_distances_in_the_half_plane(seed: int) -> None:
    a, b = np.random.default_rng(seed).uniform([-1.0, 0.3], [1.0, 2.0], (2, 2))
    assert go.distance(HalfPlane(), a, b) == pytest.approx(half_plane_distance(a, b), abs=1e-8)


@FEW
@given(seed=SEED)
def test_distances_in_polar_coordinates(seed: int) -> None:
    a, b = np.random.default_rng(seed).uniform([0.5, -1.0], [2.0, 1.0], (2, 2))
    straight = np.linalg.norm(in_plane(a) - in_plane(b))
    assert go.distance(PolarPlane(), a, b) == pytest.approx(straight, abs=1e-8)


@FEW
@given(seed=SEED)
def test_log_inverts_exp(arm_metric: go.KineticEnergy, seed: int) -> None:
    """On the human arm, for velocities of moderate reaching movements."""
    rng = np.random.default_rng(seed)
    q = rng.uniform([0, -0.5, -1.2, 0.5, -0.5, -0.3, -0.5], [1, 0.5, -0.3, 1.5, 0.5, 0.2, 0.5])
    v = rng.uniform(-0.5, 0.5, 7)
    assert go.log(arm_metric, q, go.exp(arm_metric, q, v)) == pytest.approx(v, abs=1e-6)


@FEW
@given(seed=SEED)
def test_exp_inverts_log(arm_metric: go.KineticEnergy, seed: int) -> None:
    rng = np.random.default_rng(seed)
    low = np.array([0, -0.7, -1.5, 0.3, -0.8, -0.4, -0.8])
    q0, q1 = rng.uniform(low, [1.5, 0.7, -0.2, 2.0, 0.8, 0.3, 0.8], (2, 7))
    v0 = go.log(arm_metric, q0, q1)
    found = go.exp(arm_metric, q0, v0, tolerance=1e-12)
    assert np.abs(found - q1).max() <= 1e-9


def test_human_arm_of_an_independent_implementation(
    known_geodesics: dict[str, Any], backend: str
) -> None:
    metric = go.KineticEnergy(go.human_arm("right", 1.0, 1.0, backend=backend))
    for known in known_geodesics["human_arm_right"]["geodesics"]:
        v0 = go.log(metric, known["q0"], known["q1"])
        assert v0 == pytest.approx(np.array(known["v0"]), abs=1e-8)
        length = go.distance(metric, known["q0"], known["q1"])
        assert length == pytest.approx(known["length"], rel=1e-9)


def test_log_of_a_two_link_arm_is_a_known_geodesic(known_geodesics: dict[str, Any]) -> None:
    """Several geodesics connect these configurations; the one found is among them."""
    known = known_geodesics["two_link_log"]
    metric = go.KineticEnergy(planar_arm((1.0, 1.0), (1.0, 1.0), (0.5, 0.5), (1 / 12, 1 / 12)))
    q0, q1 = np.array(known["q0"]), np.array(known["q1"])
    grid = go.Grid(1, 40)
    straight = go.Path(metric, grid, q0 + grid.nodes[:, None] * (q1 - q0))
    assert straight.length == pytest.approx(known["straight_line_length"], abs=1e-5)
    length = go.distance(metric, q0, q1)
    assert min(abs(length - entry["length"]) for entry in known["geodesics"]) < 1e-5
    shortest = known["geodesics"][0]
    arrival = go.exp(metric, known["q0"], shortest["v0"])
    assert arrival == pytest.approx(np.array(known["q1"]), abs=1e-4)  # v0 has six digits
    assert metric.norm(known["q0"], shortest["v0"]) == pytest.approx(shortest["length"], abs=1e-5)


def test_scaling_masses_scales_length_by_its_root() -> None:
    q0, q1 = np.zeros(7) + 0.1, np.array([0.8, 0.2, -0.6, 1.0, 0.3, -0.1, 0.2])
    light, heavy = (go.KineticEnergy(go.human_arm("right", 1.75, m)) for m in (20.0, 80.0))
    ratio = go.distance(heavy, q0, q1) / go.distance(light, q0, q1)
    assert ratio == pytest.approx(2.0, rel=1e-9)
    assert go.log(heavy, q0, q1) == pytest.approx(go.log(light, q0, q1), abs=1e-8)


@pytest.mark.slow
def test_diverging_geodesics_are_right_or_an_error() -> None:
    """In the half-plane errors grow exponentially with the distance."""
    metric = HalfPlane()
    for x, y in ((2.0, 0.5), (10.0, 0.01), (30.0, 0.01)):
        ends = np.array([-x, y]), np.array([x, y])
        assert go.distance(metric, *ends) == pytest.approx(half_plane_distance(*ends), abs=1e-9)
    with pytest.raises(go.NotConverged, match="geodesics diverge so fast that rounding errors"):
        go.log(metric, [-100.0, 0.01], [100.0, 0.01])


def test_metrics_need_no_hash() -> None:
    @dataclass
    class Scaled(go.Metric):
        weights: list[float]
        dim = 2

        def matrix(self, q: Any) -> Any:
            return type(q)(np.diag(self.weights))

    assert go.distance(Scaled([4.0, 9.0]), [0.0, 0.0], [1.0, 1.0]) == pytest.approx(13.0**0.5)


@pytest.mark.slow
def test_no_geodesic_is_an_error() -> None:
    """Polar coordinates: straight lines cover less than half a revolution about the origin."""
    with pytest.raises(go.NotConverged, match="no geodesic was found from") as failure:
        go.log(PolarPlane(), [1.0, 0.0], [1.0, 4.0])
    assert isinstance(failure.value.solution, go.Path)
    assert failure.value.solution(1.0) == pytest.approx(np.array([1.0, 4.0]))


@pytest.mark.parametrize(
    ("q0", "q1", "message"),
    [
        ([1.0], [1.0, 0.0], r"q0 must have shape \(2,\)"),
        ([1.0, 0.0], [1.0, np.nan], "q1 must be finite"),
    ],
)
def test_bad_arguments_are_named(q0: object, q1: object, message: str) -> None:
    for function in (go.log, go.distance, go.geodesic):
        with pytest.raises(ValueError, match=message):
            function(Sphere(), q0, q1)


class PeriodicSphere(Sphere):
    periods = (np.inf, 2.0 * np.pi)


def test_a_straight_line_that_is_a_geodesic_but_not_the_shortest() -> None:
    """The equator the long way round is stationary; the nearest image is the other way."""
    metric, q0, q1 = PeriodicSphere(), [np.pi / 2, 0.0], [np.pi / 2, 5.0]
    path = go.geodesic(metric, q0, q1, wrap=False)
    assert path.velocity == pytest.approx(np.array([0.0, 5.0]), abs=1e-9)
    assert path.certificate.morse_index == 1
    for starts in (1, 2):
        shortest = go.distance(metric, q0, q1, num_starts=starts)
        assert shortest == pytest.approx(2 * np.pi - 5.0, abs=1e-9)


@pytest.mark.parametrize("solver", ["newton", "ipopt"])
@pytest.mark.parametrize("name", METRICS)
def test_nearby_points(name: str, solver: str, rng: np.random.Generator) -> None:
    """To second order the logarithm is d - q''(d) / 2, from coincident points to 1e-3 apart."""
    metric = METRICS[name]()
    (q0,), direction = points(metric, rng, 1), rng.normal(size=metric.dim)
    for size in [0.0, *10.0 ** np.arange(-18.0, -2.0, 3.0 if solver == "newton" else 5.0)]:
        q1 = q0 + size * direction / np.abs(direction).max()
        d = q1 - q0
        expected = d - metric.acceleration(q0, d) / 2.0
        found = go.log(metric, q0, q1, solver=solver)
        assert np.abs(found - expected).max() <= 1e-13 * size + 1e4 * size**3, size


def test_geodesics_between_nearby_points(arm_metric: go.KineticEnergy) -> None:
    q = np.full(7, 0.3)
    (found,) = go.geodesics(arm_metric, q, q + 1e-11, num_starts=6)
    assert found.velocity == pytest.approx(np.full(7, 1e-11), rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("q0", "q1"),
    [
        pytest.param(
            (0.203, 0.512, -0.06, 0.827, 1.185, -0.083, -0.631),
            (1.597, 1.097, -2.654, 2.527, -0.02, -0.027, 0.789),
            id="found on the way back",
        ),
        pytest.param(
            (2.766, 0.169, -2.677, 0.123, 0.874, -0.043, 1.005),
            (-0.988, 1.082, -0.966, 1.559, -0.541, -0.308, 0.422),
            id="found by Ipopt",
        ),
    ],
)
def test_several_attempts_are_made(arm_metric: go.KineticEnergy, q0: Any, q1: Any) -> None:
    """Far pairs on which Newton's method fails from the straight line on all grids."""
    end = go.exp(arm_metric, q0, go.log(arm_metric, q0, q1))
    assert end == pytest.approx(np.array(q1), abs=1e-8)


@pytest.mark.slow
def test_narrow_margins_are_reached_from_wide_ones(arm_metric: go.KineticEnergy) -> None:
    """Geodesics diverge by factors of 1e4 along the limits; the straight line is a bad start."""
    metric = go.manifold.RegionAvoiding(arm_metric, margin=0.01)
    q0, q1 = (
        (2.05, -0.62, -0.42, 1.51, -0.6, -0.15, -1.44),
        (-0.59, 0.46, -1, 1.71, -0.35, 0.33, 1.11),
    )
    end = go.exp(metric, q0, go.log(metric, q0, q1))
    assert end == pytest.approx(np.array(q1), abs=1e-8)
