"""Theorems of Riemannian geometry, on all types of metrics, at random points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pytest
from all_metrics import METRICS, planar, points

import geodesic_ocp as go

# log and exp keep 1e-9 in every coordinate, on geodesics of length about one.
EXACT = 1e-7
STEP = 1e-4  # of central differences: their error is of its square
DIFFERENCES = 1e-5


@pytest.fixture(params=METRICS)
def metric(request: pytest.FixtureRequest) -> go.Metric:
    return METRICS[request.param]()


def test_the_connection_is_metric(metric: go.Metric, rng: np.random.Generator) -> None:
    """d<a, b> / dt along v is <D_v a, b> + <a, D_v b>: dG/dq_k = Gamma_ijk + Gamma_jik."""
    (q,) = points(metric, rng, 1)
    gamma = metric.christoffel(q)
    v = rng.normal(size=metric.dim)
    slope = (metric.matrix(q + STEP * v) - metric.matrix(q - STEP * v)) / (2.0 * STEP)
    expected = (gamma + gamma.transpose(1, 0, 2)) @ v
    assert slope == pytest.approx(expected, abs=DIFFERENCES * np.abs(gamma).max() + 1e-10)
    assert np.array_equal(gamma, gamma.transpose(0, 2, 1))


def test_gauss_lemma(metric: go.Metric, rng: np.random.Generator) -> None:
    """The derivative of Exp preserves inner products with the radial direction."""
    (q,) = points(metric, rng, 1)
    v, w = rng.uniform(-0.3, 0.3, (2, metric.dim))

    def differential(direction: np.ndarray) -> np.ndarray:
        forth, back = (
            go.exp(metric, q, v + sign * STEP * direction, tolerance=1e-11) for sign in (1.0, -1.0)
        )
        return (forth - back) / (2.0 * STEP)

    end = go.exp(metric, q, v)
    scale = metric.norm(q, v) * metric.norm(q, w)
    found = metric.inner(end, differential(v), differential(w))
    assert found == pytest.approx(metric.inner(q, v, w), abs=DIFFERENCES * scale)


def test_first_variation(metric: go.Metric, rng: np.random.Generator) -> None:
    """The gradient of the squared distance to a point is -2 Log."""
    q, goal = points(metric, rng, 2)
    v = go.log(metric, q, goal)
    w = rng.normal(size=metric.dim)
    w /= metric.norm(q, w)
    squares = go.distance(metric, [q + STEP * w, q - STEP * w], goal) ** 2
    slope = (squares[0] - squares[1]) / (2.0 * STEP)
    expected = -2.0 * metric.inner(q, v, w)
    assert slope == pytest.approx(expected, abs=10.0 * DIFFERENCES * metric.norm(q, v))


@pytest.mark.slow
def test_distance_is_a_metric(metric: go.Metric, rng: np.random.Generator) -> None:
    """Symmetric, positive, with the triangle inequality."""
    a, b, c = points(metric, rng, 3)
    there, back, detour = go.distance(metric, [a, b, a], [b, a, c])
    assert there > 0.0
    assert back == pytest.approx(there, rel=EXACT)
    assert there <= detour + go.distance(metric, c, b) + EXACT
    middle = go.geodesic(metric, a, b)(0.4)
    assert go.distance(metric, a, middle) == pytest.approx(0.4 * there, rel=1e-5)


@dataclass(frozen=True)
class InOtherCoordinates(go.Metric):
    """The same manifold in coordinates y with q = chart(y)."""

    metric: go.Metric
    chart: Callable[[Any], Any]

    @property
    def dim(self) -> int:
        return self.metric.dim

    def matrix(self, q: Any) -> Any:
        y = ca.SX.sym("y", self.dim)
        jacobian = ca.Function("J", [y], [ca.jacobian(self.chart(y), y)])(q)
        return jacobian.T @ self.metric.matrix(self.chart(q)) @ jacobian

    def to_chart(self, y: np.ndarray) -> np.ndarray:
        return np.array(ca.DM(self.chart(ca.DM(y))))[:, 0]

    def push_forward(self, y: np.ndarray, w: np.ndarray) -> np.ndarray:
        symbols = ca.SX.sym("y", self.dim)
        jacobian = ca.Function("J", [symbols], [ca.jacobian(self.chart(symbols), symbols)])
        return jacobian(y).full() @ w


CHARTS: dict[str, Callable[[Any], Any]] = {
    "reflected": lambda y: 0.3 - y,
    "curved": lambda y: y + 0.2 * ca.sin(2.0 * y) + 0.1 * ca.sumsqr(y),
}


@pytest.mark.slow
@pytest.mark.parametrize("chart", CHARTS)
def test_coordinates_do_not_matter(metric: go.Metric, chart: str, rng: np.random.Generator) -> None:
    other = InOtherCoordinates(metric, CHARTS[chart])
    base = -0.9 if chart == "reflected" else 0.8
    a, b = base + rng.uniform(-0.1, 0.1, (2, metric.dim))
    w = go.log(other, a, b)
    ends = other.to_chart(a), other.to_chart(b)
    v = go.log(metric, *ends)
    assert other.push_forward(a, w) == pytest.approx(v, abs=EXACT * max(1.0, np.abs(v).max()))
    assert other.norm(a, w) == pytest.approx(metric.norm(ends[0], v), rel=EXACT)
    assert other.to_chart(go.exp(other, a, 0.5 * w)) == pytest.approx(
        go.exp(metric, ends[0], 0.5 * v), abs=EXACT
    )


def test_rotating_the_base_of_a_planar_arm(rng: np.random.Generator) -> None:
    """The first angle is a symmetry: geodesics are shifted, lengths stay the same."""
    metric, shift = planar(), np.array([0.7, 0.0])
    a, b = rng.uniform(-0.5, 0.5, (2, 2))
    assert go.log(metric, a + shift, b + shift) == pytest.approx(go.log(metric, a, b), abs=EXACT)
