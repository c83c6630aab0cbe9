"""What positions alone, efforts and the motion between samples say about limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from gadget import TWO_LINKS
from known_models import planar_arm

import geodesic_ocp as go
from geodesic_ocp.execution.check_trajectory import TrajectoryCheck, check_trajectory
from geodesic_ocp.execution.limits import JointLimits, joint_limits
from geodesic_ocp.trajectory.interpolation import JERK_OVERSHOOT
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

NAMES = ("shoulder", "elbow")
DURATION = 2.0
DISTANCE = np.array([1.0, 2.0])
# The polynomial of minimum jerk: largest derivatives over a unit of distance and of time.
PEAKS = {"velocity": 15.0 / 8.0, "acceleration": 10.0 / np.sqrt(3.0), "jerk": 60.0}


@pytest.fixture(scope="module")
def arm() -> go.Model:
    return go.load_model(TWO_LINKS, hand="b")


def minimum_jerk(rate: float, start: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Times and positions (k, 2) from a time on."""
    time = np.linspace(start, DURATION, round((DURATION - start) * rate) + 1)
    law = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    return time - start, np.outer(law(time / DURATION), DISTANCE)


def positions_only(rate: float, decimals: int = 15, start: float = 0.0) -> JointTrajectory:
    time, q = minimum_jerk(rate, start)
    return JointTrajectory.from_positions(time, q.round(decimals), NAMES)


def stated(rate: float = 100.0) -> JointTrajectory:
    time, _ = minimum_jerk(rate)
    law = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    states = [
        np.outer((law.deriv(k) if k else law)(time / DURATION), DISTANCE) / DURATION**k
        for k in range(3)
    ]
    return JointTrajectory(time, *states, NAMES)


def said(check: TrajectoryCheck, kind: str) -> bool:
    return any(sentence.startswith(f"not judged: {kind}") for sentence in check.not_judged)


@pytest.mark.parametrize("decimals", [15, 9, 6])
@pytest.mark.parametrize("rate", [30.0, 100.0, 1000.0])
def test_positions_of_minimum_jerk_pass_and_are_at_rest(
    arm: go.Model, rate: float, decimals: int
) -> None:
    check = check_trajectory(positions_only(rate, decimals), arm)
    assert check.passed, check.violations
    assert said(check, "motion between samples")
    assert not said(check, "velocity")
    known = PEAKS["velocity"] * DISTANCE / DURATION
    assert check.largest["velocity"] == pytest.approx(known, rel=5e-3)


@pytest.mark.parametrize("kind", PEAKS)
@pytest.mark.parametrize("rate", [30.0, 100.0])
def test_positions_that_exceed_a_limit_are_found_beyond_the_doubt(
    arm: go.Model, kind: str, rate: float
) -> None:
    """Largest derivatives in closed form: above them a limit is kept, below it is violated."""
    order = list(PEAKS).index(kind) + 1
    peak = PEAKS[kind] * DISTANCE / DURATION**order
    # Third differences at the ends are means of the jerk with that of the rest before.
    doubt = {"velocity": 0.005, "acceleration": 0.02, "jerk": 0.3}[kind]
    given = {"jerk": 1e4, "acceleration": 1e3, "velocity": 1e2}
    for share in (1.0 - doubt, 1.0, 1.0 + doubt):
        limits = joint_limits(arm, **{**given, kind: share * peak})
        check = check_trajectory(positions_only(rate, 9), arm, limits)
        beyond = [each for each in check.violations if each.startswith(f"{kind} of")]
        assert len(beyond) == (2 if share < 1.0 else 0), check.violations
        if share > 1.0 or rate < 50.0:  # at 100 Hz the doubt is within the slack of limits
            assert said(check, kind) == (share == 1.0)


@pytest.mark.parametrize("rate", [30.0, 100.0])
def test_the_positions_of_a_plan_pass(rate: float) -> None:
    robot = planar_arm((0.5, 0.4), (2.0, 1.5), (0.25, 0.2), (0.05, 0.04))
    limits = JointLimits(*(np.full(2, each) for each in (3.0, 15.0, 300.0, np.inf)))
    metric = go.KineticEnergy(robot)
    paths = [go.geodesic(metric, [0.0, 0.5], [0.9, 1.2]), go.geodesic(metric, [0.9, 1.2], [0, 2])]
    arms = go.execution.ArmPaths(robot, limits, np.array([0.0, 0.3, 0.6]), paths)
    planned = go.execution.plan_trajectory(arms, rate=rate).sampled(rate)
    alone = JointTrajectory.from_positions(
        planned.time, planned.positions.round(9), planned.joint_names
    )
    check = check_trajectory(alone, robot, limits)
    assert check.passed, check.violations
    assert said(check, "acceleration")
    stated_all = check_trajectory(planned, robot, limits)
    assert stated_all.passed, stated_all.violations
    assert not stated_all.not_judged
    # A tenth quicker, with accelerations larger by a fifth.
    quick = JointTrajectory.from_positions(alone.time / 1.1, alone.positions, alone.joint_names)
    assert any(
        s.startswith("acceleration") for s in check_trajectory(quick, robot, limits).violations
    )


def test_few_digits_hide_the_jerk_and_are_said_to(arm: go.Model) -> None:
    check = check_trajectory(positions_only(1000.0, 4), arm)
    assert check.passed, check.violations
    assert said(check, "jerk")
    assert said(check, "acceleration")


def test_positions_that_begin_in_motion_are_found(arm: go.Model) -> None:
    for rate in (30.0, 100.0):
        check = check_trajectory(positions_only(rate, 9, start=0.7), arm)
        assert sum("not at rest" in sentence for sentence in check.violations) == 2
        assert any(s.startswith("elbow begins at 1.") for s in check.violations)


def test_velocities_that_are_stated_are_not_derived(arm: go.Model) -> None:
    one = replace(stated(), derived=("acceleration",))
    check = check_trajectory(one, arm)
    assert check.passed, check.violations
    assert any("by cubics, whose accelerations jump" in each for each in check.not_judged)
    slower = replace(one, velocities=0.9 * one.velocities)
    assert any("contradict its positions" in s for s in check_trajectory(slower, arm).violations)


def test_stated_efforts_are_those_of_inverse_dynamics(arm: go.Model) -> None:
    """Right values by Pinocchio's recursive Newton-Euler algorithm."""
    one = stated()
    data = arm.pin.createData()
    states = zip(one.positions, one.velocities, one.accelerations, strict=True)
    efforts = np.array([pin.rnea(arm.pin, data, *state) for state in states])
    for digits in (12, 3):
        right = replace(one, efforts=efforts.round(digits))
        assert check_trajectory(right, arm).passed
    for wrong in (0.5 * efforts, 1.01 * efforts, efforts + 0.5):
        check = check_trajectory(replace(one, efforts=wrong), arm)
        assert len(check.violations) == 2, check.violations
        assert all("contradict the dynamics" in sentence for sentence in check.violations)
    large = check_trajectory(replace(one, efforts=np.full_like(efforts, 500.0)), arm)
    assert "stated effort of shoulder is 500 N m at 0 s, its limit 60" in str(large)
    loaded = check_trajectory(replace(one, efforts=efforts), arm.with_payload(0.5))
    assert any("of this robot, gravity and payload" in each for each in loaded.violations)


def test_the_quintic_between_samples_overshoots_a_step_of_the_jerk(arm: go.Model) -> None:
    """The jerk steps from 0 to 4 where the quintic's overshoot is largest, see its closed form."""
    step = 0.1
    share = (6.0 - np.sqrt(6.0)) / 10.0
    time = step * np.arange(9)
    late = np.maximum(time - (5.0 - share) * step, 0.0)
    states = [4.0 * late**k / np.prod(range(1, k + 1)) for k in (3, 2, 1)]
    one = JointTrajectory(time, *(np.c_[x, 0.0 * x] for x in states), NAMES)
    given = {"velocity": 1e2, "acceleration": 1e3}
    largest = 4.0 * (1.0 + JERK_OVERSHOOT)
    tight = check_trajectory(one, arm, joint_limits(arm, **given, jerk=0.99 * largest), rest=False)
    (sentence,) = tight.violations
    assert sentence.startswith("jerk of shoulder is 5.496 rad/s^3 between samples")
    assert tight.between["jerk"][0] == pytest.approx(largest)
    assert tight.usage["jerk"][0] == pytest.approx(1.0 / (0.99 * (1.0 + JERK_OVERSHOOT)))
    wide = check_trajectory(one, arm, joint_limits(arm, **given, jerk=1.01 * largest), rest=False)
    assert wide.passed, wide.violations
