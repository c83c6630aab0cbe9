"""Distances between capsules and boxes, compared with coal, a sampled minimum and differences."""

from __future__ import annotations

import casadi as ca
import coal
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.model.primitives import box_distance

SIZE = (0.4, 0.2, 0.6)
TURN = Rotation.from_euler("xyz", [0.3, -0.5, 0.8]).as_matrix()
BOX = go.Box((0.1, -0.2, 0.3), SIZE, tuple(map(tuple, TURN)))
X = ca.SX.sym("ends", 6)
DISTANCE, HERE, THERE, _ = box_distance(X[:3], X[3:] - X[:3], BOX)
HESSIAN, GRADIENT = ca.hessian(DISTANCE, X)
FUNCTION = ca.Function("distance", [X], [DISTANCE, GRADIENT, HESSIAN, HERE, THERE])
COORDINATE = st.floats(-0.6, 0.6)
ENDS = st.tuples(*[COORDINATE] * 6).map(np.array)
# Many on the axes, the faces and the edges of the box, and parallel to them.
SPECIAL = st.tuples(*[st.sampled_from((-0.5, -0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.5))] * 6)


def at(ends: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    distance, gradient, hessian, here, there = FUNCTION(ends)
    flat = (gradient.full()[:, 0], hessian.full(), here.full()[:, 0], there.full()[:, 0])
    return (float(distance), *flat)


def coals_distance(ends: np.ndarray, radius: float) -> float:
    """By coal, negative where they overlap."""
    start, end = ends[:3], ends[3:]
    turn = Rotation.align_vectors([end - start], [[0.0, 0.0, 1.0]])[0].as_matrix()
    capsule = coal.Capsule(radius, float(np.linalg.norm(end - start)))
    placed = coal.Transform3s(turn, (start + end) / 2.0)
    box = coal.Box(*SIZE), coal.Transform3s(TURN, np.array(BOX.centre))
    result = coal.DistanceResult()
    return float(coal.distance(capsule, placed, *box, coal.DistanceRequest(), result))


def in_base_frame(points: tuple[float, ...]) -> np.ndarray:
    ends = np.array(points).reshape(2, 3)
    return np.ravel(ends @ TURN.T + BOX.centre)


@given(ENDS)
@pytest.mark.filterwarnings("ignore:Optimal rotation")
def test_distances_agree_with_coal_also_inside(ends: np.ndarray) -> None:
    assume(np.linalg.norm(ends[3:] - ends[:3]) > 1e-2)
    assert at(ends)[0] - 0.05 == pytest.approx(coals_distance(ends, 0.05), abs=2e-5)


@given(SPECIAL.map(in_base_frame))
def test_special_positions(ends: np.ndarray) -> None:
    """No point of the segment is nearer, and derivatives are finite."""
    assume(np.any(ends[:3] != ends[3:]))
    distance, gradient, hessian, here, there = at(ends)
    assert np.all(np.isfinite(gradient))
    assert np.all(np.isfinite(hessian))
    share = np.linspace(0.0, 1.0, 401)[:, None]
    points = (ends[:3] + share * (ends[3:] - ends[:3]) - BOX.centre) @ TURN
    outside = np.linalg.norm(np.maximum(np.abs(points) - np.divide(SIZE, 2.0), 0.0), axis=1)
    assert max(distance, 0.0) <= outside.min() + 1e-7
    assert max(distance, 0.0) >= outside.min() - 2e-3
    assert np.linalg.norm(here - there) == pytest.approx(max(distance, 0.0), abs=1e-7)


@given(ENDS, ENDS)
def test_the_distance_is_continuous(ends: np.ndarray, way: np.ndarray) -> None:
    """It is Lipschitz: it changes at most as much as an end moves."""
    distances = [at(ends + step * way)[0] for step in np.linspace(0.0, 1.0, 41)]
    fastest = np.linalg.norm(way.reshape(2, 3), axis=1).max() / 40.0
    assert np.abs(np.diff(distances)).max() <= fastest + 1e-7


@given(ENDS)
def test_derivatives_are_those_of_differences(ends: np.ndarray) -> None:
    distance, gradient, hessian, *_ = at(ends)
    step = 1e-5 * np.eye(6)
    around = [(at(ends + each), at(ends - each)) for each in step]
    values = np.array([(up[0], down[0]) for up, down in around])
    slopes = np.array([(up[1], down[1]) for up, down in around])
    # Not across a kink: differences to either side agree.
    assume(np.abs(values.sum(axis=1) - 2.0 * distance).max() < 1e-8)
    assume(np.abs(slopes.sum(axis=1) - 2.0 * gradient).max() < 1e-5)
    assert_allclose((values[:, 0] - values[:, 1]) / 2e-5, gradient, atol=5e-4)
    differences = (slopes[:, 0] - slopes[:, 1]) / 2e-5
    assert_allclose(differences, hessian, atol=1e-2, rtol=1e-3)


def test_a_carried_box_and_a_ball_at_a_box(arm: go.Model) -> None:
    ball = go.Ball((0.0, 0.0, 0.0), 0.05, arm.hand, name="hand")
    held = arm.with_bodies(ball)
    q = np.linspace(0.1, 0.4, arm.dof)
    rotation, position = arm.hand_pose(q)
    box = go.Box(tuple(position + np.array([0.3, 0.0, 0.0])), (0.2, 0.2, 0.2), name="box")
    found = go.distances.signed_distances(held, q, [box], links=[arm.hand])
    assert found["hand to box"] == pytest.approx(0.15)
    far = rotation.T @ (np.array(box.centre) - position)
    turned = tuple(map(tuple, rotation.T))
    carried = go.Box(tuple(far), box.size, turned, link=arm.hand, name="cargo")
    apart = go.distances.signed_distances(arm, q, [carried, box])
    for name, value in apart.items():
        if name.endswith("to cargo"):
            assert value == pytest.approx(apart[name.replace("cargo", "box")], abs=1e-9)


def test_wrong_boxes_are_rejected() -> None:
    with pytest.raises(ValueError, match="size must be positive"):
        go.Box((0.0, 0.0, 0.0), (1.0, 0.0, 1.0))
    with pytest.raises(ValueError, match="rotation must be a rotation matrix"):
        go.Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), tuple(map(tuple, 2.0 * np.eye(3))))
