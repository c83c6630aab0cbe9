"""Minimum acceleration, minimum jerk, and the distal-only control."""

from __future__ import annotations

import numpy as np
import pytest
from known_models import planar_arm

import geodesic_ocp as go

TIME = np.linspace(0.0, 1.0, 101)
SEGMENTS = [(0, 30), (30, 64), (64, 100)]
KINEMATIC = [go.baselines.minimum_acceleration, go.baselines.minimum_jerk]


def polynomial(degree: int, rng: np.random.Generator) -> go.Motion:
    curves = [np.polynomial.Polynomial(c) for c in rng.normal(size=(3, degree + 1))]
    q = np.column_stack([curve(TIME) for curve in curves])
    velocity = np.column_stack([curve.deriv()(TIME) for curve in curves])
    return go.Motion(TIME, q, ("a", "b", "c"), velocity, go.trajectory.Subject(name="me"))


def test_cubics_and_quintics_are_predicted(rng: np.random.Generator) -> None:
    cubic = polynomial(3, rng)
    for segments in (SEGMENTS, [(0, 100)]):
        predicted = go.baselines.minimum_acceleration(cubic, segments)
        assert predicted.q == pytest.approx(cubic.q, abs=1e-12)
        assert predicted.velocity == pytest.approx(cubic.velocity, abs=1e-11)
        assert predicted.subject == cubic.subject
        # Accelerations are differences of velocities, exact up to the second power of time.
        assert go.baselines.minimum_jerk(cubic, segments).q == pytest.approx(cubic.q, abs=1e-12)
    quintic = polynomial(5, rng)
    assert np.abs(go.baselines.minimum_jerk(quintic, [(0, 100)]).q - quintic.q).max() < 2e-3
    assert np.abs(go.baselines.minimum_acceleration(quintic, [(0, 100)]).q - quintic.q).max() > 2e-2


def test_a_reach_from_rest_to_rest_is_that_of_flash_and_hogan() -> None:
    """10 s^3 - 15 s^4 + 6 s^5, whatever happens between the ends."""
    s = np.linspace(0.0, 1.0, 1001)[:, None]
    wave = 0.1 * np.sin(np.pi * s) ** 4  # at rest at both ends, without acceleration
    ramp = 3.0 * (10 * s**3 - 15 * s**4 + 6 * s**5)
    q = ramp + wave
    observed = go.Motion(2.0 * s[:, 0], q, ("x",), np.gradient(q, 2.0 * s[:, 0], axis=0))
    predicted = go.baselines.minimum_jerk(observed, [(0, 1000)])
    assert np.abs(predicted.q - ramp).max() < 1e-3


@pytest.mark.parametrize("method", KINEMATIC)
def test_no_variation_costs_less(
    method: type[go.baselines.minimum_jerk], rng: np.random.Generator
) -> None:
    """Of variations that vanish at the ends with the derivatives that are given there."""
    predicted = method(polynomial(6, rng), [(0, 100)])
    order = 2 if method is go.baselines.minimum_acceleration else 3
    step = TIME[1]

    def cost(q: np.ndarray) -> float:
        return float(np.sum((np.diff(q, order, axis=0) / step**order) ** 2) * step)

    bump = np.sin(np.pi * TIME)[:, None] ** 4
    costs = [cost(predicted.q + size * bump) for size in (-0.02, -0.01, 0.0, 0.01, 0.02)]
    assert costs[2] == min(costs)
    assert costs[1] == pytest.approx(costs[3], rel=0.05)  # stationary


@pytest.mark.parametrize("method", KINEMATIC)
def test_predictions_depend_on_the_ends_alone(
    method: type[go.baselines.minimum_jerk], rng: np.random.Generator
) -> None:
    motion = polynomial(4, rng)
    between = np.ones(101, dtype=bool)
    for edge in (0, 30, 64, 100):
        between[max(edge - 2, 0) : edge + 3] = False
    q = motion.q + 0.5 * between[:, None]
    velocity = motion.velocity - 0.7 * between[:, None]
    other = go.Motion(TIME, q, motion.joint_names, velocity)
    assert method(other, SEGMENTS).q == pytest.approx(method(motion, SEGMENTS).q, abs=1e-12)
    edges = [0, 30, 64, 100]
    assert method(motion, SEGMENTS).q[edges] == pytest.approx(motion.q[edges], abs=1e-12)


def test_the_hand_reaches_in_a_straight_line(arm: go.Model) -> None:
    """From rest to rest, with the profile of Flash and Hogan; the observed hand does not."""
    s = TIME[:, None]
    ramp = 10 * s**3 - 15 * s**4 + 6 * s**5
    start = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
    way = 0.5 * np.array([1.0, -0.3, 0.6, 0.9, -0.5, 0.2, 0.4])
    velocity = 30 * s**2 * (1.0 - s) ** 2 * way
    observed = go.Motion(TIME, start + ramp * way, arm.joint_names, velocity)
    hand = go.baselines.minimum_jerk_hand(arm, observed, [(0, 100)])
    assert hand.q[0] == pytest.approx(observed.q[0])
    positions, predicted = arm.hand_pose(observed.q)[1], arm.hand_pose(hand.q)[1]
    assert np.linalg.norm(predicted[-1] - positions[-1]) < 2e-3
    way = positions[-1] - positions[0]
    progress = (predicted - positions[0]) @ way / (way @ way)
    assert np.abs(progress - ramp[:, 0]).max() < 0.02
    off = predicted - positions[0] - np.outer(progress, way)
    assert np.linalg.norm(off, axis=1).max() < 5e-3
    assert np.linalg.norm(positions - positions[0] - np.outer(ramp, way), axis=1).max() > 1e-2


def test_the_hand_turns_about_the_axis_between_its_orientations(arm: go.Model) -> None:
    """One joint turns: its axis, its angle and its rate are those of the hand."""
    q = np.tile([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1], (101, 1))
    q[:, 6] += 0.4 * TIME + 0.3 * TIME**3
    velocity = np.zeros_like(q)
    velocity[:, 6] = 0.4 + 0.9 * TIME**2
    observed = go.Motion(TIME, q, arm.joint_names, velocity)
    scores = go.synergies.score(
        arm, observed, go.baselines.minimum_jerk_hand(arm, observed, [(0, 50), (50, 100)])
    )
    assert scores.rotation_angle < 2e-3
    assert scores.position_mean < 2e-3


def test_joint_inertia_of_distal_joints_alone(arm: go.Model) -> None:
    stiff = arm.with_armature(0.1)
    plain, control = go.KineticEnergy(arm), go.baselines.distal_inertia(stiff)
    q = np.full(7, 0.2)
    added = control.matrix(q) - plain.matrix(q)
    assert added == pytest.approx(np.diag([0, 0, 0, 0, 0.1, 0.1, 0.1]), abs=1e-12)
    default = go.baselines.distal_inertia(arm).model.armature
    assert default == pytest.approx(go.manifold.default_joint_inertia(arm) * [0, 0, 0, 0, 1, 1, 1])
    rods = planar_arm((1.0, 1.0), (1.0, 1.0), (0.5, 0.5), (0.1, 0.1))
    with pytest.raises(ValueError, match="the distal joints of joint1, joint2 are not known"):
        go.baselines.distal_inertia(rods)


def test_bad_arguments_are_named(arm: go.Model, rng: np.random.Generator) -> None:
    motion = polynomial(3, rng)
    bare = go.Motion(TIME, motion.q, motion.joint_names)
    for method in KINEMATIC:
        with pytest.raises(ValueError, match="has no velocities"):
            method(bare, [(0, 100)])
        with pytest.raises(ValueError, match="segments must cover samples 0 to 100"):
            method(motion, [(0, 50)])
    with pytest.raises(ValueError, match="there is no joint RSx_joint"):
        go.baselines.minimum_jerk_hand(arm, motion, [(0, 100)])
    pair = go.Motion(TIME[:2], motion.q[:2], motion.joint_names, motion.velocity[:2])
    with pytest.raises(ValueError, match="accelerations need at least three samples"):
        go.baselines.minimum_jerk(pair, [(0, 1)])
