"""The quadratic program of a step, and the bounds on its speeds."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.execution.limits import joint_limits
from geodesic_ocp.execution.track_within_limits import (
    StepConditions,
    box_least_squares,
    speed_bounds,
)


@given(st.integers(0, 10_000), st.integers(1, 8), st.floats(-4.0, 1.0))
def test_minimum_between_bounds_meets_the_optimality_conditions(
    seed: int, size: int, exponent: float
) -> None:
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(max(size - 1, 1), size))
    hessian = rows.T @ rows + 10.0**exponent * np.eye(size)
    gradient = rng.normal(size=size)
    lower = rng.uniform(-1.0, 0.5, size)
    upper = lower + rng.uniform(0.0, 1.0, size) * (rng.random(size) > 0.2)
    upper[rng.random(size) > 0.9] = np.inf
    x = box_least_squares(hessian, gradient, lower, upper)
    assert np.all((lower <= x) & (x <= upper))
    slope = hessian @ x + gradient
    at_lower, at_upper = (np.isclose(x, bound, rtol=0.0, atol=1e-9) for bound in (lower, upper))
    assert_allclose(slope[~at_lower & ~at_upper], 0.0, atol=1e-8)
    assert np.all(slope[at_lower & ~at_upper] >= -1e-8)
    assert np.all(slope[at_upper & ~at_lower] <= 1e-8)


def test_firm_conditions_give_way_last() -> None:
    """Of three conditions on x and y, each in [0, 1]: x + y >= 1.5, and y <= 0.2 or x + y >= 3."""
    lower, upper = np.zeros(2), np.ones(2)
    rows, least = np.array([[1.0, 1.0], [0.0, -1.0]]), np.array([1.5, -0.2])
    least_squares = partial(box_least_squares, np.eye(2), np.zeros(2), lower, upper)
    most = np.full(2, np.inf)
    assert_allclose(least_squares(StepConditions(rows, least, most, 1)), [1.0, 0.5], atol=1e-6)
    # With both alike, each is violated a little.
    x, y = least_squares(StepConditions(rows, least, most))
    assert x + y < 1.5 - 0.01
    assert y > 0.2 + 0.01
    # Where bounds do not allow a hard one, it is met as far as they do.
    found = least_squares(StepConditions(rows[:1], np.array([3.0]), most[:1], 1))
    assert_allclose(found, [1.0, 1.0], atol=1e-6)


ACCELERATIONS = st.sampled_from([0.5, 10.0, 400.0, np.inf])


@given(st.integers(0, 10_000), ACCELERATIONS, st.sampled_from([0.05, 3.0, np.inf]))
def test_some_speed_is_always_within_the_bounds(seed: int, most: float, fastest: float) -> None:
    """Whatever speeds are wanted, no limit is exceeded, and the joint ends at rest."""
    rng = np.random.default_rng(seed)
    arm = go.human_arm("right")
    limits = joint_limits(arm, velocity=fastest, acceleration=most)
    step, count = 0.01, 80
    bounds = partial(speed_bounds, arm, limits, step)
    q = rng.uniform(arm.lower, arm.upper)
    speeds = [np.zeros(7)]
    wanted = np.zeros(7)
    for k in range(count):
        lower, upper = bounds(q, speeds[-1], min(k, count - 1 - k))
        assert np.all(lower <= upper)
        if rng.random() < 0.1:
            wanted = rng.choice([-100.0, 0.0, 100.0], 7)
        speeds.append(np.clip(wanted, lower, upper))
        q = q + step * speeds[-1]
        assert np.all((arm.lower <= q) & (q <= arm.upper))
        assert np.all(np.abs(speeds[-1]) <= fastest)
    for one, other in pairwise(speeds):
        assert np.all(np.abs(other - one) <= most * step)
    assert_allclose(speeds[-1], 0.0, atol=1e-12)


def test_joints_brake_as_late_as_possible() -> None:
    """Towards its limit a joint goes at full speed until full braking stops it just there."""
    arm = go.human_arm("right")
    step, most, fastest = 0.01, 10.0, 1.5
    limits = joint_limits(arm, velocity=fastest, acceleration=most)
    bounds = partial(speed_bounds, arm, limits, step)
    q, speeds = np.zeros(7), [np.zeros(7)]
    for _ in range(400):
        speeds.append(bounds(q, speeds[-1], 10_000)[1])
        q = q + step * speeds[-1]
    assert_allclose(q, arm.upper, atol=1e-6)
    for joint in np.flatnonzero(arm.upper > fastest**2 / most + 0.1):
        of_joint = np.array(speeds)[:, joint]
        assert_allclose(of_joint.max(), fastest, rtol=1e-6)
        braking = -np.diff(of_joint)[np.argmax(of_joint) :]
        braking = braking[braking > 1e-6]
        # All but the first and the last few steps of braking are at the limit.
        assert_allclose(np.sort(braking)[2:], most * step, rtol=1e-6)
