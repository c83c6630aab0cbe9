"""Curvature of known spaces, symmetries of the tensor, and its definition."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pytest
from all_metrics import METRICS, points
from known_metrics import HalfPlane, PolarPlane, Sphere
from known_models import planar_arm

import geodesic_ocp as go

# Relative rounding error of second derivatives of a few hundred operations.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Product(go.Metric):
    """The product of two metrics."""

    first: go.Metric
    second: go.Metric

    @property
    def dim(self) -> int:
        return self.first.dim + self.second.dim

    def matrix(self, q: Any) -> Any:
        n = self.first.dim
        return ca.diagcat(self.first.matrix(q[:n]), self.second.matrix(q[n:]))


def close(found: float, expected: float, scale: float = 1.0) -> bool:
    return abs(found - expected) <= ROUNDING * max(scale, abs(expected))


@pytest.mark.parametrize(
    ("metric", "curvature"), [(Sphere(), 1.0), (HalfPlane(), -1.0), (PolarPlane(), 0.0)]
)
def test_surfaces_of_constant_curvature(
    metric: go.Metric, curvature: float, rng: np.random.Generator
) -> None:
    for _ in range(20):
        q, u, v = rng.uniform(0.3, 1.5, 2), *rng.normal(size=(2, 2))
        assert go.manifold.sectional_curvature(metric, q, u, v) == pytest.approx(
            curvature, abs=1e-10
        )
        assert close(go.manifold.scalar_curvature(metric, q), 2.0 * curvature)


def test_product_of_spheres(rng: np.random.Generator) -> None:
    metric = Product(Sphere(), Sphere())
    q = rng.uniform(0.3, 1.5, 4)
    unit = np.eye(4)
    assert close(go.manifold.sectional_curvature(metric, q, unit[0], unit[1]), 1.0)
    assert close(go.manifold.sectional_curvature(metric, q, unit[2], unit[3]), 1.0)
    for i in (0, 1):
        for j in (2, 3):
            assert close(go.manifold.sectional_curvature(metric, q, unit[i], unit[j]), 0.0)
    assert close(go.manifold.scalar_curvature(metric, q), 4.0)
    assert close(go.manifold.scalar_curvature(Product(Sphere(), HalfPlane()), q), 0.0)


def test_flat_mechanisms() -> None:
    """A point mass at the tip of two massless links, and a balanced second link."""
    tip_mass = planar_arm((1.0, 0.8), (0.0, 2.0), (0.0, 0.8), (0.0, 0.0))
    balanced = planar_arm((1.0, 0.6), (1.3, 0.7), (0.4, 0.0), (0.2, 0.1))
    for arm in (tip_mass, balanced):
        assert close(
            go.manifold.scalar_curvature(go.KineticEnergy(arm), [0.4, 1.1]), 0.0, scale=100.0
        )
    assert go.manifold.scalar_curvature(go.Euclidean(3), [1.0, 2.0, 3.0]) == 0.0
    pendulum = go.KineticEnergy(planar_arm((1.0,), (2.0,), (0.5,), (0.1,)))
    assert go.manifold.scalar_curvature(pendulum, [0.3]) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", METRICS)
def test_symmetries_and_bianchi(kind: str, rng: np.random.Generator) -> None:
    """R is antisymmetric in each pair, symmetric between them, and its cyclic sum is zero."""
    metric = METRICS[kind]()
    n = metric.dim

    def form(*vectors: np.ndarray) -> float:
        return go.manifold.riemann_curvature(metric, q, *vectors)

    for q in points(metric, rng, 5):
        u, v, w, z = rng.uniform(-1.0, 1.0, (4, n))
        cycle = [form(u, v, w, z), form(v, w, u, z), form(w, u, v, z)]
        scale, size = np.abs(cycle).max(), np.abs(metric.matrix(q)).max()
        if scale < 1e-9 * size:  # flat: the curvature is only rounding
            scale = size
        assert close(sum(cycle), 0.0, scale)
        assert close(form(v, u, w, z), -cycle[0], scale)
        assert close(form(u, v, z, w), -cycle[0], scale)
        assert close(form(w, z, u, v), cycle[0], scale)
        assert close(form(2.0 * u, v + z, w, z), 2.0 * (cycle[0] + form(u, z, w, z)), scale)


@pytest.mark.parametrize("kind", METRICS)
def test_christoffel_symbols_are_symmetric_and_compatible_with_the_metric(
    kind: str, rng: np.random.Generator
) -> None:
    """Gamma_ijk = Gamma_ikj, and d_k g_ij = Gamma_ijk + Gamma_jik."""
    metric = METRICS[kind]()
    for q in points(metric, rng, 3):
        gamma, step = metric.christoffel(q), 1e-5
        size = max(1.0, np.abs(gamma).max())
        assert np.abs(gamma - gamma.transpose(0, 2, 1)).max() <= 1e-13 * size
        for k, unit in enumerate(np.eye(metric.dim)):
            ahead, behind = metric.matrix(q + step * unit), metric.matrix(q - step * unit)
            slope = (ahead - behind) / (2.0 * step)
            assert np.abs(gamma[:, :, k] + gamma[:, :, k].T - slope).max() <= 1e-6 * size


def test_curvature_is_the_commutator_of_covariant_derivatives(
    arm_metric: go.KineticEnergy, rng: np.random.Generator
) -> None:
    """R(u, v) w = D_u D_v w - D_v D_u w for constant fields, by finite differences."""

    def second_kind(q: np.ndarray) -> np.ndarray:
        """Gamma^i_jk, (n, n, n)."""
        return np.einsum(
            "il,ljk->ijk", np.linalg.inv(arm_metric.matrix(q)), arm_metric.christoffel(q)
        )

    q, u, v, w, z = rng.uniform(-0.8, 0.8, (5, 7))
    step = 1e-5
    gamma = second_kind(q)

    def nested(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        slope = (second_kind(q + step * a) - second_kind(q - step * a)) / (2.0 * step)
        inner = np.einsum("ijk,j,k->i", gamma, b, w)
        return np.einsum("ijk,j,k->i", slope, b, w) + np.einsum("ijk,j,k->i", gamma, a, inner)

    expected = arm_metric.inner(q, nested(u, v) - nested(v, u), z)
    assert go.manifold.riemann_curvature(arm_metric, q, u, v, w, z) == pytest.approx(
        expected, rel=1e-6
    )


def test_sectional_curvature_depends_on_the_plane_only(
    arm_metric: go.KineticEnergy, rng: np.random.Generator
) -> None:
    q, u, v = rng.uniform(-0.8, 0.8, (3, 7))
    expected = go.manifold.sectional_curvature(arm_metric, q, u, v)
    other = go.manifold.sectional_curvature(arm_metric, q, 2.0 * u - v, 0.5 * u + 3.0 * v)
    assert other == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("q", "u", "v", "message"),
    [
        ([1.0, 0.0], [1.0, 2.0], [-2.0, -4.0], "u and v do not span a plane"),
        ([1.0, 0.0], [1.0, 2.0], [0.0, 0.0], "u and v do not span a plane"),
        ([0.0, 0.0], [1.0, 2.0], [0.0, 1.0], "q: the metric is not positive definite"),
        ([1.0, 0.0], [1.0], [0.0, 1.0], r"u must have shape \(2,\)"),
        ([1.0, np.nan], [1.0, 0.0], [0.0, 1.0], "q must be finite"),
    ],
)
def test_bad_arguments_are_named(q: list, u: list, v: list, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.manifold.sectional_curvature(Sphere(), q, u, v)
    with pytest.raises(ValueError, match="metric must be"):
        go.manifold.scalar_curvature("sphere", q)


def test_curvature_scales_with_the_inverse_squared_radius(rng: np.random.Generator) -> None:
    class Globe(go.Metric):
        dim = 2

        def matrix(self, q: Any) -> Any:
            return 25.0 * Sphere().matrix(q)

    assert close(
        go.manifold.sectional_curvature(Globe(), [1.0, 2.0], [1.0, 0.0], [0.0, 1.0]), 1.0 / 25.0
    )
