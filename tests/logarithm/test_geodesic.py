"""Geodesics as paths."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from known_metrics import Sphere
from numpy.testing import assert_allclose

import geodesic_ocp as go

START = np.array([0.4, 0.1, -0.6, 1.2, 0.2, 0.0, 0.1])
VELOCITY = np.array([0.5, -0.2, -0.3, 0.4, 0.3, -0.2, 0.2])


def test_geodesic_is_the_path_of_the_log(arm_metric: go.KineticEnergy) -> None:
    q0 = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
    q1 = np.array([1.2, -0.2, -0.9, 1.6, -0.3, 0.1, 0.4])
    path, v0 = go.geodesic(arm_metric, q0, q1), go.log(arm_metric, q0, q1)
    assert np.array_equal(path(0.0), q0)
    assert np.array_equal(path(1.0), q1)
    assert path(0.0, 1) == pytest.approx(v0, abs=1e-5)
    assert path.length == pytest.approx(go.distance(arm_metric, q0, q1), rel=1e-10)
    for s in np.linspace(0.0, 1.0, 7):
        assert path(s) == pytest.approx(go.exp(arm_metric, q0, s * v0), abs=1e-7)
        assert arm_metric.norm(path(s), path(s, 1)) == pytest.approx(path.length, rel=1e-5)


def test_equal_ends(arm_metric: go.KineticEnergy) -> None:
    q = np.full(7, 0.2)
    assert not go.log(arm_metric, q, q).any()
    path = go.geodesic(arm_metric, q, q)
    assert path.length == 0.0
    assert path(0.3) == pytest.approx(q, abs=1e-15)


def test_ends_whose_squared_distance_underflows(arm_metric: go.KineticEnergy) -> None:
    q = np.zeros(7)
    assert np.array_equal(go.log(arm_metric, q, q + 1e-200), np.full(7, 1e-200))
    assert np.array_equal(go.geodesic(arm_metric, q, q + 1e-200)(1.0), np.full(7, 1e-200))


def test_geodesic_from_velocity_ends_at_exp(arm_metric: go.KineticEnergy) -> None:
    path = go.logarithm.geodesic_from_velocity(arm_metric, START, VELOCITY)
    assert_allclose(path(1.0), go.exp(arm_metric, START, VELOCITY), atol=1e-9)
    assert_allclose(path(0.0, 1), VELOCITY, atol=1e-5)
    with pytest.raises(ValueError, match="v0 must not be zero"):
        go.logarithm.geodesic_from_velocity(arm_metric, START, np.zeros(7))


class TorusOfRevolution(go.Metric):
    """In angles about the tube and about the axis, both of them periodic."""

    dim = 2
    periods = (2 * np.pi, 2 * np.pi)

    def matrix(self, q: ca.SX) -> list:
        return [[1.0, 0.0], [0.0, (3.0 + ca.cos(q[0])) ** 2]]


def test_every_result_of_log_can_be_sampled() -> None:
    """Errors grow along this geodesic: its points are known to 1e-9, not to 1e-10."""
    ends = [0.3, 0.0], [2.0, 5.5]
    path = go.geodesic(TorusOfRevolution(), *ends)
    assert path.length == pytest.approx(go.distance(TorusOfRevolution(), *ends), rel=1e-9)
    assert path.certificate.endpoint_error < 1e-8


def test_geodesics_of_length_zero_have_a_certificate() -> None:
    path = go.geodesic(Sphere(), [1.0, 0.0], [1.0, 0.0])
    assert path.certificate == go.ocp.Certificate(0.0, 0.0, True, 0)


def test_repr_shows_a_certificate_once_it_is_known(arm_metric: go.KineticEnergy) -> None:
    path = go.logarithm.geodesic_from_velocity(arm_metric, START, VELOCITY)
    assert repr(path).startswith(f"Geodesic(length {path.length:.6g}, from [ 0.4")
    assert len(repr(path).splitlines()) == 2
    certificate = path.certificate
    assert str(certificate) in repr(path)
    assert len(repr(path).splitlines()) == 3
