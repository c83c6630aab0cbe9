"""Metrics: inner products, angles, Christoffel symbols and accelerations."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from known_metrics import HalfPlane, PolarPlane, Sphere
from known_models import random_tree

import geodesic_ocp as go

CURVED = [Sphere(), HalfPlane(), PolarPlane(), go.KineticEnergy(go.human_arm())]
ALL = [*CURVED, go.Euclidean(3)]


def point(metric: go.Metric, rng: np.random.Generator) -> np.ndarray:
    """A random point, away from singularities of the charts and from gimbal lock."""
    return rng.uniform(0.3, 1.2, metric.dim)


@pytest.mark.parametrize("metric", ALL, ids=lambda metric: type(metric).__name__)
def test_inner_product(metric: go.Metric, rng: np.random.Generator) -> None:
    q, (u, v) = point(metric, rng), rng.normal(size=(2, metric.dim))
    G = metric.matrix(q)
    assert pytest.approx(G.T, abs=1e-15) == G
    assert np.linalg.eigvalsh(G).min() > 0
    assert metric.inner(q, u, v) == pytest.approx(u @ G @ v, rel=1e-12)
    assert metric.norm(q, u) ** 2 == pytest.approx(metric.inner(q, u, u), rel=1e-12)
    cosine = metric.inner(q, u, v) / metric.norm(q, u) / metric.norm(q, v)
    assert metric.angle(q, u, v) == pytest.approx(np.arccos(cosine), abs=1e-9)


@given(exponent=st.floats(-12.0, 0.0))
def test_small_angles_are_accurate(exponent: float) -> None:
    angle = 10.0**exponent
    found = go.Euclidean(2).angle([0, 0], [1, 0], [np.cos(angle), np.sin(angle)])
    assert found == pytest.approx(angle, rel=1e-3 if angle < 1e-11 else 1e-5)
    opposite = go.Euclidean(2).angle([0, 0], [1, 0], [-np.cos(angle), np.sin(angle)])
    assert opposite == pytest.approx(np.pi - angle, abs=1e-15)


def test_the_angle_to_a_zero_vector_is_an_error() -> None:
    with pytest.raises(ValueError, match="angle to a zero vector"):
        go.Euclidean(2).angle([0, 0], [1, 0], [0, 0])


@pytest.mark.parametrize("metric", ALL, ids=lambda metric: type(metric).__name__)
def test_christoffel_symbols(metric: go.Metric, rng: np.random.Generator) -> None:
    """Symmetric in j and k; dG/dq_k = Gamma_ijk + Gamma_jik (metric compatibility)."""
    q = point(metric, rng)
    gamma = metric.christoffel(q)
    assert gamma == pytest.approx(gamma.transpose(0, 2, 1), abs=1e-14)
    h = 1e-6
    for k, unit in enumerate(np.eye(metric.dim)):
        slope = (metric.matrix(q + h * unit) - metric.matrix(q - h * unit)) / (2 * h)
        # The error of central differences is of order h^2 plus rounding / h.
        assert gamma[:, :, k] + gamma[:, :, k].T == pytest.approx(slope, abs=1e-8)


@pytest.mark.parametrize("metric", ALL, ids=lambda metric: type(metric).__name__)
def test_symbolic_equals_numeric(metric: go.Metric, rng: np.random.Generator) -> None:
    q, u, v = point(metric, rng), *rng.normal(size=(2, metric.dim))
    for kind in (ca.SX, ca.MX):
        symbols = [kind.sym(name, metric.dim) for name in "quv"]
        function = ca.Function(
            "f",
            symbols,
            [
                metric.matrix(symbols[0]) if kind is ca.SX else metric.inner(*symbols),
                metric.inner(*symbols),
                metric.norm(symbols[0], symbols[1]),
                metric.acceleration(symbols[0], symbols[2]),
                ca.vertcat(*(ca.vec(part.T) for part in metric.christoffel(symbols[0]))),
            ],
        )
        _, inner, norm, acceleration, gamma = (out.full() for out in function(q, u, v))
        assert inner.item() == pytest.approx(metric.inner(q, u, v), rel=1e-12)
        assert norm.item() == pytest.approx(metric.norm(q, u), rel=1e-12)
        assert acceleration[:, 0] == pytest.approx(metric.acceleration(q, v), rel=1e-9, abs=1e-12)
        assert gamma.ravel() == pytest.approx(metric.christoffel(q).ravel(), abs=1e-12)


@pytest.mark.parametrize("metric", CURVED, ids=lambda metric: type(metric).__name__)
def test_acceleration_solves_the_geodesic_equation(
    metric: go.Metric, rng: np.random.Generator
) -> None:
    q, v = point(metric, rng), rng.normal(size=metric.dim)
    force = np.einsum("ijk,j,k->i", metric.christoffel(q), v, v)
    residual = metric.matrix(q) @ metric.acceleration(q, v) + force
    assert np.abs(residual).max() < 1e-12 * max(1.0, np.abs(force).max())


class FromTensor(go.KineticEnergy):
    """The same metric from derivatives of G: subclasses with a tensor of their own are."""

    def matrix(self, q: Any) -> Any:
        return self.model.mass_matrix(q)


SLOW = ("both arms", "payload", "armature", "numbered otherwise", "tree 1")


@cache
def models() -> dict[str, go.Model]:
    arm, rng = go.human_arm(), np.random.default_rng(5)
    geared = random_tree(rng, joints=5)
    geared.armature = rng.uniform(0.1, 1.0, geared.nv)
    trees = {f"tree {index}": go.Model(random_tree(rng, 5), "tool") for index in range(2)}
    return trees | {
        "both arms": go.model.combine(go.human_arm("left"), arm),
        "payload": arm.with_payload(2.0, (0.0, 0.1, 0.2)),
        "armature": go.Model(geared, "tool"),
        "numbered otherwise": go.Model(random_tree(rng, 5, depth_first=False), "tool"),
    }


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.slow] if n in SLOW else []) for n in models()],
)
def test_recursions_and_derivatives_of_the_tensor_agree(
    name: str, rng: np.random.Generator
) -> None:
    pair = go.KineticEnergy(models()[name]), FromTensor(models()[name])
    n = pair[0].dim
    for _ in range(3):
        q, u, v, w, z = rng.uniform(-1.5, 1.5, (5, n))
        energies = [float(metric.energy_density(q, v)) for metric in pair]
        assert energies[0] == pytest.approx(energies[1], rel=1e-12)
        geodesics = [metric.geodesic_equation(np.r_[q, v]).full()[n:, 0] for metric in pair]
        transports = [metric.transport_equation(w, np.r_[q, v]).full()[:, 0] for metric in pair]
        # As forces: terms cancel, and rounding is relative to the terms.
        G, gamma = pair[0].matrix(q), np.abs(pair[0].christoffel(q))
        for rates, other in ((geodesics, v), (transports, w)):
            terms = np.einsum("ijk,j,k->i", gamma, np.abs(v), np.abs(other)).max()
            terms += (np.abs(G) @ np.abs(rates[1])).max()
            assert np.abs(G @ (rates[0] - rates[1])).max() <= 1e-12 * terms
        curvatures = [float(metric.curvature_form(q, u, v, w, z)) for metric in pair]
        assert curvatures[0] == pytest.approx(curvatures[1], rel=1e-11)


def test_recursions_make_smaller_functions(arm: go.Model) -> None:
    """About half of the operations of derivatives of G."""
    for name in ("energy_density", "geodesic_equation", "transport_equation"):
        pair = [getattr(metric(arm), name).n_nodes() for metric in (go.KineticEnergy, FromTensor)]
        assert pair[0] < 0.6 * pair[1]


def test_a_user_defined_metric() -> None:
    class Cylinder(go.Metric):
        dim = 2

        def __init__(self, radius: float) -> None:
            self.radius = radius

        def matrix(self, q: Any) -> Any:
            return ca.diag(ca.vertcat(self.radius**2, 1.0))

    assert Cylinder(2.0).matrix([0.0, 0.0]).tolist() == [[4.0, 0.0], [0.0, 1.0]]
    assert go.distance(Cylinder(2.0), [0.0, 0.0], [1.5, 4.0]) == pytest.approx(5.0, abs=1e-12)


def test_wrong_metrics_and_vectors_are_named() -> None:
    class Flat(go.Metric):
        dim = 3

        def matrix(self, q: Any) -> Any:
            return ca.SX.eye(2)

    with pytest.raises(ValueError, match=r"Flat.matrix\(q\) must have shape \(3, 3\)"):
        Flat().matrix(np.zeros(3))
    with pytest.raises(ValueError, match=r"u must have shape \(2,\), got \(3,\)"):
        Sphere().norm([1.0, 0.0], [1.0, 0.0, 0.0])
    with pytest.raises(ValueError, match=r"Euclidean\.dim must be a positive integer"):
        go.Euclidean(0)
    with pytest.raises(ValueError, match=r"Euclidean\.dim must be a positive integer, is 2\.5"):
        go.Euclidean(2.5)


def test_symbols_besides_q_and_complex_numbers_are_named(arm: go.Model) -> None:
    class WithMass(go.Metric):
        dim = 2

        def matrix(self, q: Any) -> Any:
            return ca.SX.eye(2) * (1 + ca.SX.sym("mass"))

    for call in (WithMass().matrix, lambda q: go.exp(WithMass(), q, q)):
        with pytest.raises(ValueError, match=r"WithMass.matrix\(q\) contains mass"):
            call([1.0, 2.0])
    metric, q = go.KineticEnergy(arm), np.full(arm.dof, 0.1)
    names, time = arm.joint_names, [0.0, 1.0]
    for complex_call, name in (
        (lambda: metric.matrix(q + 0.1j), "q must be 7 real"),
        (lambda: go.exp(metric, q, list(q * 1j)), "v must be 7 real"),
        (lambda: go.log(metric, [q, q + 0.1j], [q, q]), "row 1: q0 must be 7 real"),
        (lambda: go.frechet_mean(metric, [q, q * 1j]), "points must be real"),
        (lambda: go.Motion(time, [q, q * 1j], names), "q must be real"),
        (lambda: arm.with_armature(q * 1j), "armature must be 7 numbers"),
    ):
        with pytest.raises(ValueError, match=name):
            complex_call()


def test_a_matrix_may_be_a_list_of_rows() -> None:
    class Rows(go.Metric):
        dim = 2

        def matrix(self, q: Any) -> Any:
            return [[1.0, 0.0], [0.0, ca.sin(q[0]) ** 2]]

    q = np.array([0.7, 0.2])
    assert np.array_equal(Rows().matrix(q), Sphere().matrix(q))
    assert go.distance(Rows(), q, [1.1, 0.9]) == go.distance(Sphere(), q, [1.1, 0.9])

    class Words(go.Metric):
        dim = 2

        def matrix(self, q: Any) -> Any:
            return "flat"

    with pytest.raises(ValueError, match=r"Words\.matrix\(q\) must be a matrix of CasADi"):
        go.exp(Words(), q, q)


def test_christoffel_symbols_of_the_sphere() -> None:
    t = 0.7
    expected = np.zeros((2, 2, 2))
    expected[0, 1, 1] = -np.sin(t) * np.cos(t)
    expected[1, 0, 1] = expected[1, 1, 0] = np.sin(t) * np.cos(t)
    assert Sphere().christoffel([t, 0.3]) == pytest.approx(expected, abs=1e-15)


class Indefinite(go.Metric):
    """Positive definite only for |q| < 1."""

    dim = 2

    def matrix(self, q: Any) -> Any:
        return ca.blockcat([[1.0, q[0]], [q[0], 1.0 + 0.0 * q[1]]])


@pytest.mark.parametrize("call", [go.exp, lambda m, q, v: go.log(m, q, v), go.geodesic])
def test_an_indefinite_matrix_is_no_singularity(call: Callable[..., Any]) -> None:
    with pytest.raises(
        ValueError, match=r"is indefinite at .* negative squared lengths"
    ) as failure:
        call(Indefinite(), [2.0, 0.0], [0.1, 0.1])
    assert "singularity but an error of matrix" in str(failure.value)
    assert "kinematic" not in str(failure.value)
    assert Indefinite().near_singularity(np.array([0.5, 0.0])) == ""
    assert "nearly singular" in Indefinite().near_singularity(np.array([1.0 - 1e-6, 0.0]))
    assert "kinematic" not in Indefinite().near_singularity(np.array([1.0 - 1e-6, 0.0]))
