"""Metrics with a constant tensor, whose geodesics are straight lines in closed form."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from known_metrics import Sphere

import geodesic_ocp as go
from geodesic_ocp.ipopt import Ipopt
from geodesic_ocp.manifold.exp import sample_geodesic

TENSOR = np.array([[2.0, 0.3, 0.0], [0.3, 1.0, -0.2], [0.0, -0.2, 0.5]])
START, GOAL, VECTOR = np.array([[0.1, -0.4, 2.0], [1.3, 0.2, -0.7], [0.3, 1.0, -2.0]])


class Constant(go.Metric):
    """A user's metric with a constant tensor."""

    dim = 3

    def matrix(self, q: Any) -> Any:
        return type(q)(TENSOR)


class Disguised(go.Metric):
    """The same tensor, in an expression that contains q: nothing is known of its geodesics."""

    dim = 3

    def matrix(self, q: Any) -> Any:
        return ca.if_else(q[0] > 1e3, 2.0, 1.0) * TENSOR


@pytest.fixture
def no_solver(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object, **keywords: object) -> None:
        raise AssertionError("a closed form needs neither Ipopt nor the integrator")

    monkeypatch.setattr(Ipopt, "__call__", fail)
    monkeypatch.setattr("geodesic_ocp.manifold.exp.integrate_by_scipy", fail)


def test_constant_tensors_are_recognized() -> None:
    assert go.Euclidean(3).has_constant_tensor
    assert Constant().has_constant_tensor
    assert not Disguised().has_constant_tensor
    assert not Sphere().has_constant_tensor
    assert not go.KineticEnergy(go.human_arm()).has_constant_tensor


@pytest.mark.usefixtures("no_solver")
@pytest.mark.parametrize("metric", [go.Euclidean(3), Constant()])
def test_closed_forms_need_no_solver(metric: go.Metric) -> None:
    length = metric.norm(START, GOAL - START)
    assert np.array_equal(go.exp(metric, START, VECTOR), START + VECTOR)
    assert np.array_equal(go.log(metric, START, GOAL), GOAL - START)
    assert np.array_equal(go.log(metric, [START, GOAL], GOAL), [GOAL - START, np.zeros(3)])
    assert go.distance(metric, START, GOAL) == length
    path = go.geodesic(metric, START, GOAL)
    assert isinstance(path, go.logarithm.Geodesic)
    assert path.length == pytest.approx(length, rel=1e-14)
    assert np.array_equal(path(1.0), GOAL)
    assert path.certificate.locally_shortest
    assert path.certificate.endpoint_error < 1e-15  # rounding of q0 + (q1 - q0)
    assert path.certificate.drift < 1e-12
    (only,) = go.geodesics(metric, START, GOAL)
    assert np.array_equal(only.velocity, GOAL - START)
    assert np.array_equal(
        go.logarithm.geodesic_from_velocity(metric, START, VECTOR)(1.0), START + VECTOR
    )
    assert np.array_equal(go.parallel_transport(metric, path, VECTOR), VECTOR)
    mean = go.frechet_mean(metric, [START, GOAL], [2.0, 1.0])
    assert mean == pytest.approx((2.0 * START + GOAL) / 3.0, rel=1e-14)


def test_paths_agree_with_the_general_route() -> None:
    one, other = (go.geodesic(metric, START, GOAL) for metric in (Constant(), Disguised()))
    s = np.linspace(0.0, 1.0, 9)
    assert one(s) == pytest.approx(other(s), abs=1e-9)
    assert one.velocity == pytest.approx(other.velocity, abs=1e-9)
    assert one.grid == other.grid
    assert one.certificate.morse_index == other.certificate.morse_index == 0
    transported = [go.parallel_transport(path.metric, path, VECTOR) for path in (one, other)]
    assert transported[0] == pytest.approx(transported[1], abs=1e-9)
    times = [0.5, 0.7, 1.5]
    for closed, integrated in zip(
        *(sample_geodesic(path.metric, START, VECTOR, times) for path in (one, other)), strict=True
    ):
        assert closed == pytest.approx(integrated, abs=1e-9)


@pytest.mark.usefixtures("no_solver")
def test_arguments_are_checked_as_for_any_metric() -> None:
    metric = Constant()
    for call, message in (
        (lambda: go.exp(metric, START[:2], VECTOR), r"q must have shape \(3,\)"),
        (lambda: go.exp(metric, START, [np.inf, 0.0, 0.0]), "v must be finite"),
        (lambda: go.exp(metric, START, VECTOR, tolerance=0.0), "tolerance must be positive"),
        (lambda: go.log(metric, START, [np.nan, 0.0, 0.0]), "q1 must be finite"),
        (lambda: go.log(metric, START, GOAL, num_starts=0), "num_starts must be a positive"),
        (lambda: go.log(metric, START, [GOAL, np.full(3, np.inf)]), "row 1: q1 must be finite"),
        (
            lambda: go.logarithm.geodesic_from_velocity(metric, START, np.zeros(3)),
            "v0 must not be zero",
        ),
    ):
        with pytest.raises(ValueError, match=message):
            call()


@pytest.mark.usefixtures("no_solver")
def test_a_constant_tensor_must_be_positive_definite() -> None:
    class Lorentzian(go.Metric):
        dim = 2

        def matrix(self, q: Any) -> Any:
            return type(q)(np.diag([1.0, -1.0]))

    line = go.geodesic(go.Euclidean(2), [0.0, 0.0], [1.0, 1.0])
    for call in (
        lambda: go.exp(Lorentzian(), [0.0, 0.0], [1.0, 1.0]),
        lambda: go.log(Lorentzian(), [0.0, 0.0], [1.0, 1.0]),
        lambda: go.parallel_transport(Lorentzian(), line, [1.0, 1.0]),
    ):
        with pytest.raises(ValueError, match="the metric is not positive definite"):
            call()
