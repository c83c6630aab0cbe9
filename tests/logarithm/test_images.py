"""Continuous joints turn the shorter way: closed forms, brute force over images, SciPy's solution
of the boundary value problem, and pinocchio's distance of angles.
"""

from __future__ import annotations

from itertools import product

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from gadget import FAN
from scipy.integrate import solve_bvp

import geodesic_ocp as go
from geodesic_ocp.logarithm.images import circular_mean
from geodesic_ocp.validation import planar_arm

ROD = (1.0,), (1.0,), (0.5,), (1 / 12,)  # uniform, of 1 m and 1 kg
RODS = (1.0, 1.0), (1.0, 1.0), (0.5, 0.5), (1 / 12, 1 / 12)
TURN = 2.0 * np.pi


@pytest.fixture(scope="module")
def two_rods() -> go.KineticEnergy:
    return go.KineticEnergy(planar_arm(*RODS))


@pytest.mark.parametrize(("q0", "q1"), [(3.0, -3.0), (-3.0, 3.0), (0.1, 6.3), (-1.0, 40.0)])
def test_one_joint_turns_by_the_difference_of_angles(q0: float, q1: float) -> None:
    """Of a pendulum it is |dq| sqrt(I), I = m l^2 / 3, with pinocchio's difference dq."""
    metric = go.KineticEnergy(planar_arm(*ROD))
    native = pin.Model()
    native.addJoint(0, pin.JointModelRUBZ(), pin.SE3.Identity(), "joint")
    ends = (np.array([np.cos(q), np.sin(q)]) for q in (q0, q1))
    (change,) = pin.difference(native, *ends)
    assert go.log(metric, [q0], [q1]) == pytest.approx([change], abs=1e-9)
    assert go.distance(metric, [q0], [q1]) == pytest.approx(abs(change) / np.sqrt(3.0), abs=1e-9)
    path = go.geodesic(metric, [q0], [q1])
    assert path(1.0) == pytest.approx([q0 + change], abs=1e-9)
    assert go.exp(metric, [q0], path.velocity) == pytest.approx([q0 + change], abs=1e-9)
    assert path.certificate.locally_shortest
    straight = go.distance(metric, [q0], [q1], wrap=False)
    assert straight == pytest.approx(abs(q1 - q0) / np.sqrt(3.0), abs=1e-9)


def test_the_other_way_is_the_boundary_value_problem_of_the_image(
    two_rods: go.KineticEnergy,
) -> None:
    """SciPy's collocation, from the straight line to the image of the goal."""
    q0, q1 = np.array([3.0, 0.4]), np.array([-3.0, 1.1])
    image = q1 + np.array([TURN, 0.0])

    def rate(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        del s
        states = [two_rods.acceleration(q, v) for q, v in zip(y[:2].T, y[2:].T, strict=True)]
        return np.vstack([y[2:], np.transpose(states)])

    s = np.linspace(0.0, 1.0, 21)
    line = np.vstack([(q0 + s[:, None] * (image - q0)).T, np.tile((image - q0)[:, None], s.size)])
    solved = solve_bvp(
        rate, lambda a, b: np.concatenate([a[:2] - q0, b[:2] - image]), s, line, tol=1e-8
    )
    assert solved.success
    assert go.log(two_rods, q0, q1) == pytest.approx(solved.y[2:, 0], abs=1e-6)


def test_the_nearest_of_all_images_in_both_directions(
    two_rods: go.KineticEnergy, rng: np.random.Generator
) -> None:
    """As by brute force, also in rows, where many differences are near half a revolution."""
    starts = rng.uniform(-np.pi, np.pi, (12, 2))
    goals = starts + rng.choice([0.3, 2.9, np.pi, 3.4, 9.0], (12, 2))
    found = go.distance(two_rods, starts, goals)
    for q0, q1, length in zip(starts, goals, found, strict=True):
        nearest = q1 - TURN * np.round((q1 - q0) / TURN)
        images = [nearest + TURN * np.array(each) for each in product((-1.0, 0.0, 1.0), repeat=2)]
        within = [image for image in images if np.abs(image - q0).max() <= TURN]
        lengths = [go.distance(two_rods, q0, image, wrap=False) for image in within]
        assert length == pytest.approx(min(lengths), rel=1e-8)
        assert length == pytest.approx(go.distance(two_rods, q1, q0), rel=1e-8)
        assert length == pytest.approx(go.geodesic(two_rods, q0, q1).length, rel=1e-6)
        turned = go.distance(two_rods, q0 + TURN, q1 - [0.0, TURN])
        assert length == pytest.approx(turned, rel=1e-8)


def test_the_matrix_of_distances_is_that_of_the_pairs() -> None:
    metric = go.KineticEnergy(go.load_model(FAN, hand="blade"))
    points = np.array([[3.0], [-3.0], [0.0]])
    expected = np.sqrt(2.0) * np.array([[0.0, TURN - 6.0, 3.0], [TURN - 6.0, 0.0, 3.0], [3.0] * 3])
    expected[2, 2] = 0.0
    assert go.distance(metric, points) == pytest.approx(expected, abs=1e-8)


class Sheared(go.Metric):
    """A flat torus with a skewed lattice: the image nearest in each coordinate is not nearest."""

    dim, periods = 2, (1.0, 1.0)

    def matrix(self, q: ca.SX) -> ca.SX:
        return type(q)([[1.0, 0.9], [0.9, 1.0]])


def test_images_nearest_in_every_coordinate_are_not_the_only_ones() -> None:
    change = go.log(Sheared(), [0.0, 0.0], [0.45, 0.45])
    assert change == pytest.approx([0.45, -0.55]) or change == pytest.approx([-0.55, 0.45])


def test_the_mean_of_continuous_joints_is_on_their_circle() -> None:
    metric = go.KineticEnergy(planar_arm(*ROD))
    assert go.frechet_mean(metric, [[3.0], [-3.0]]) == pytest.approx([np.pi], abs=1e-7)
    assert go.frechet_mean(metric, [[-3.0], [3.0]]) == pytest.approx([-np.pi], abs=1e-7)
    assert go.frechet_mean(metric, [[3.0], [-3.0]], wrap=False) == pytest.approx([0.0], abs=1e-7)
    thirds = go.frechet_mean(metric, [[3.0], [-3.0]], [2.0, 1.0])
    assert thirds == pytest.approx([3.0 + (TURN - 6.0) / 3.0], abs=1e-7)


def test_the_mean_on_a_circle_is_the_best_of_all(rng: np.random.Generator) -> None:
    """The sum of squared distances, sampled all around."""
    for _ in range(20):
        angles = rng.uniform(-10.0, 10.0, 5)
        weights = rng.dirichlet(np.ones(5))

        def total(
            x: np.ndarray, angles: np.ndarray = angles, w: np.ndarray = weights
        ) -> np.ndarray:
            change = x[..., None] - angles
            return np.asarray((change - TURN * np.round(change / TURN)) ** 2 @ w)

        found = circular_mean(angles, weights, TURN)
        assert total(np.array(found)) <= total(np.linspace(0.0, TURN, 2000)).min() + 1e-12
        assert abs(found - angles[0]) <= np.pi


def test_a_recorded_motion_keeps_the_way_around_that_it_took() -> None:
    """More than half a revolution of a continuous joint in one segment."""
    arm = planar_arm(*RODS)
    time = np.linspace(0.0, 1.0, 51)
    q = np.column_stack([4.0 * time, 0.5 + 0.2 * time])
    motion = go.Motion(time, q, arm.joint_names, np.tile([4.0, 0.2], (51, 1)))
    rebuilt = go.synergies.reconstruct(go.KineticEnergy(arm), motion, [(0, 50)])
    assert rebuilt.predicted.q[-1] == pytest.approx(q[-1], abs=1e-9)
