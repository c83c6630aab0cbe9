"""The logarithm of rotations, and the error between two poses."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from geodesic_ocp.ocp.pose_search import pose_difference, rotation_log

ROTATION = ca.SX.sym("R", 3, 3)
LOG = ca.Function("log", [ROTATION], [rotation_log(ROTATION)])
SLOPE = ca.Function("slope", [ROTATION], [ca.jacobian(rotation_log(ROTATION), ca.vec(ROTATION))])
COORDINATE = st.floats(-1.0, 1.0)
ANGLE = st.one_of(
    st.floats(0.0, np.pi),
    st.sampled_from([0.0, 1e-12, 1e-8, 1e-6, 1e-4, np.pi - 1e-4, np.pi - 1e-8, np.pi]),
)


def rotation_about(axis: tuple[float, ...], angle: float) -> tuple[np.ndarray, np.ndarray]:
    vector = np.array(axis)
    unit = vector / np.linalg.norm(vector) if np.linalg.norm(vector) > 0.1 else np.eye(3)[0]
    return angle * unit, Rotation.from_rotvec(angle * unit).as_matrix()


@given(axis=st.tuples(COORDINATE, COORDINATE, COORDINATE), angle=ANGLE)
def test_rotation_vector_up_to_half_a_revolution(axis: tuple[float, ...], angle: float) -> None:
    vector, matrix = rotation_about(axis, angle)
    found = LOG(matrix).full()[:, 0]
    assert np.linalg.norm(found) == pytest.approx(angle, abs=1e-7)
    if angle < np.pi - 1e-6:
        assert_allclose(found, vector, atol=1e-7)
    assert np.isfinite(SLOPE(matrix).full()).all()


@pytest.mark.parametrize("axis", np.eye(3).tolist())
def test_half_a_revolution_about_each_axis(axis: list[float]) -> None:
    matrix = 2.0 * np.outer(axis, axis) - np.eye(3)
    assert_allclose(np.abs(LOG(matrix).full()[:, 0]), np.pi * np.array(axis), atol=1e-12)


def test_derivatives_at_the_identity() -> None:
    """The derivative of log exp(x) at zero is the identity; the Hessian of |log exp(x)|^2 is 2."""
    x = ca.SX.sym("x", 3)
    skew = ca.skew(x)
    rotation = ca.SX.eye(3) + skew + skew @ skew / 2
    function = ca.Function(
        "f",
        [x],
        [
            ca.jacobian(rotation_log(rotation), x),
            ca.hessian(ca.sumsqr(rotation_log(rotation)), x)[0],
        ],
    )
    slope, hessian = function([0.0, 0.0, 0.0])
    assert_allclose(slope.full(), np.eye(3), atol=1e-9)
    assert_allclose(hessian.full(), 2.0 * np.eye(3), atol=1e-9)


@given(axis=st.tuples(COORDINATE, COORDINATE, COORDINATE), angle=ANGLE)
def test_error_between_poses(axis: tuple[float, ...], angle: float) -> None:
    _, matrix = rotation_about(axis, angle)
    target = Rotation.from_rotvec([0.3, -1.0, 0.2]).as_matrix()
    distance, angle_found = pose_difference(
        target @ matrix, np.array([1.0, 2.0, 2.0]), target, np.zeros(3)
    )
    assert distance == pytest.approx(3.0)
    assert angle_found == pytest.approx(angle, abs=1e-7)
