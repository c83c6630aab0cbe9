"""The logarithm of rotations, and how far poses are from each other."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from geodesic_ocp.ocp.ik.pose_error import pose_difference, rotation_log

TURN = ca.SX.sym("R", 3, 3)
LOG = ca.Function("log", [TURN], [rotation_log(TURN)])
SLOPE = ca.Function("slope", [TURN], [ca.jacobian(rotation_log(TURN), ca.vec(TURN))])
COORDINATE = st.floats(-1.0, 1.0)
ANGLE = st.one_of(
    st.floats(0.0, np.pi),
    st.sampled_from([0.0, 1e-12, 1e-8, 1e-6, 1e-4, np.pi - 1e-4, np.pi - 1e-8, np.pi]),
)


def turned(axis: tuple[float, ...], angle: float) -> tuple[np.ndarray, np.ndarray]:
    vector = np.array(axis)
    unit = vector / np.linalg.norm(vector) if np.linalg.norm(vector) > 0.1 else np.eye(3)[0]
    return angle * unit, Rotation.from_rotvec(angle * unit).as_matrix()


@given(axis=st.tuples(COORDINATE, COORDINATE, COORDINATE), angle=ANGLE)
def test_the_rotation_vector_up_to_half_a_turn(axis: tuple[float, ...], angle: float) -> None:
    vector, matrix = turned(axis, angle)
    found = LOG(matrix).full()[:, 0]
    assert np.linalg.norm(found) == pytest.approx(angle, abs=1e-7)
    if angle < np.pi - 1e-6:
        assert_allclose(found, vector, atol=1e-7)
    assert np.isfinite(SLOPE(matrix).full()).all()


@pytest.mark.parametrize("axis", np.eye(3).tolist())
def test_half_a_turn_about_each_axis(axis: list[float]) -> None:
    matrix = 2.0 * np.outer(axis, axis) - np.eye(3)
    assert_allclose(np.abs(LOG(matrix).full()[:, 0]), np.pi * np.array(axis), atol=1e-12)


def test_the_slope_is_that_of_differences() -> None:
    """Along x -> R exp(x) the derivative at small turns is one, and its second one is finite."""
    x = ca.SX.sym("x", 3)
    skew = ca.skew(x)
    turn = ca.SX.eye(3) + skew + skew @ skew / 2
    function = ca.Function(
        "f",
        [x],
        [ca.jacobian(rotation_log(turn), x), ca.hessian(ca.sumsqr(rotation_log(turn)), x)[0]],
    )
    slope, hessian = function([0.0, 0.0, 0.0])
    assert_allclose(slope.full(), np.eye(3), atol=1e-9)
    assert_allclose(hessian.full(), 2.0 * np.eye(3), atol=1e-9)


@given(axis=st.tuples(COORDINATE, COORDINATE, COORDINATE), angle=ANGLE)
def test_the_miss_of_poses(axis: tuple[float, ...], angle: float) -> None:
    _, matrix = turned(axis, angle)
    wanted = Rotation.from_rotvec([0.3, -1.0, 0.2]).as_matrix()
    away, found = pose_difference(wanted @ matrix, np.array([1.0, 2.0, 2.0]), wanted, np.zeros(3))
    assert away == pytest.approx(3.0)
    assert found == pytest.approx(angle, abs=1e-7)
