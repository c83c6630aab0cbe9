"""The check of trajectories passes what a robot can execute and names each defect by itself."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from gadget import TWO_LINKS
from numpy.testing import assert_allclose
from scipy.interpolate import make_interp_spline
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.execution.check_trajectory import TrajectoryCheck, check_trajectory
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.limits import joint_limits
from geodesic_ocp.execution.sampled_magnitudes import ROUNDING
from geodesic_ocp.execution.trajectory_findings import sample_consistency
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

DURATION = 2.0


@pytest.fixture(scope="module")
def arm() -> go.Model:
    return go.load_model(TWO_LINKS, hand="b")


def swing(rate: float = 100.0, time: Any = None) -> JointTrajectory:
    """From rest to rest, by the polynomial of minimum jerk; peak speed 1.9 rad/s."""
    count = round(DURATION * rate) + 1
    time = np.linspace(0.0, DURATION, count) if time is None else np.asarray(time)
    law = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    distance = np.array([1.0, 2.0])
    states = [
        np.outer(law.deriv(k)(time / DURATION) if k else law(time / DURATION), distance)
        / DURATION**k
        for k in range(3)
    ]
    return JointTrajectory(time, *states, ("shoulder", "elbow"))


def changed(**fields: Any) -> JointTrajectory:
    return replace(swing(), **fields)


def only(check: TrajectoryCheck, *parts: str) -> None:
    """All violations contain all parts, and there is one."""
    assert not check.passed
    for sentence in check.violations:
        for part in parts:
            assert part in sentence, check.violations


@pytest.mark.parametrize("rate", [20.0, 100.0, 1000.0])
def test_a_good_trajectory_passes_with_its_largest_values(arm: go.Model, rate: float) -> None:
    check = check_trajectory(swing(rate), arm)
    assert check.passed, check.violations
    assert_allclose(check.largest["velocity"], np.array([1.0, 2.0]) * 1.875 / DURATION, rtol=1e-3)
    assert_allclose(check.usage["velocity"], check.largest["velocity"] / 3.0)
    assert_allclose(check.usage["position"], [0.5, 0.5])
    # A minimum-jerk movement starts with its largest jerk, 60 / T^3.
    if rate == 1000.0:
        assert_allclose(check.largest["jerk"], np.array([60.0, 120.0]) / DURATION**3, rtol=2e-2)
    # The largest torque is the weight of two links stretched out: 2 kg at 0.5 m and at 1.5 m.
    still = 9.81 * 2.0 * (0.5 + 1.5)
    assert check.largest["torque"][0] == pytest.approx(still, rel=1e-2)


def test_contradictions_by_sampling_have_the_order_of_the_bounds() -> None:
    found = [sample_consistency(swing(rate)) for rate in (50.0, 100.0)]
    for kind in found[0]:  # where the jerk is continuous
        coarse, fine = (np.abs(each[kind][0]).max() for each in found)
        assert coarse / fine == pytest.approx(2.0**3, rel=0.05)
    bounds = (("velocity", 3), ("acceleration", 2))
    for (kind, order), rounding in zip(bounds, ROUNDING[:2], strict=True):
        coarse, fine = (each[kind][1].max() - rounding for each in found)
        assert coarse / fine == pytest.approx(2.0**order, rel=0.2)


@pytest.mark.parametrize("switch", [0.5037, 0.505])
def test_jumps_of_acceleration_between_samples_are_no_contradiction(
    arm: go.Model, switch: float
) -> None:
    """Whether accelerations are stated or derived, which smooths the jump."""
    time = np.arange(0.0, 1.0, 0.01)
    # It speeds up until the switch, then brakes, between two samples.
    a = np.where(time < switch, 2.0, -2.0)
    v = np.where(time < switch, 2.0 * time, 4.0 * switch - 2.0 * time)
    q = np.where(time < switch, time**2, -(time**2) + 4.0 * switch * time - 2.0 * switch**2)
    one = JointTrajectory(time, *(np.c_[x, 0.0 * x] for x in (q, v, a)), ("shoulder", "elbow"))
    smooth = make_interp_spline(time, one.velocities, k=3).derivative()(time)
    for each in (one, replace(one, accelerations=smooth, derived=("acceleration",))):
        check = check_trajectory(each, arm, joint_limits(arm, jerk=np.inf), rest=False)
        assert check.passed, check.violations


def test_an_implied_acceleration_beyond_the_limit_is_found(arm: go.Model) -> None:
    """Velocities that jump by 4.75 rad/s within one sample, positions and accelerations alike."""
    time = np.arange(0.0, 1.0, 0.00845)
    k = 60
    v = np.where(np.arange(time.size) < k, -2.375, 2.375)
    q = np.append(0.0, np.cumsum(np.diff(time) * (v[1:] + v[:-1]) / 2.0))
    a = np.gradient(v, time)
    jump = JointTrajectory(time, *(np.c_[x, 0.0 * x] for x in (q, v, a)), ("shoulder", "elbow"))
    check = check_trajectory(jump, arm, rest=False)
    sentence = next(each for each in check.violations if each.startswith("acceleration of"))
    assert "shoulder is 562.1 rad/s^2" in sentence
    assert f"at {(time[k] + time[k - 1]) / 2:.4g} s, its limit 12" in sentence
    assert check.largest["acceleration"][0] == pytest.approx(4.75 / 0.00845, rel=1e-4)
    assert not any(" elbow " in each and "torque" not in each for each in check.violations)


def test_a_jump_of_velocity_that_accelerations_hide_is_found(arm: go.Model) -> None:
    v = swing().velocities.copy()
    v[100:, 1] -= 4.75
    check = check_trajectory(changed(velocities=v), arm, rest=False)
    assert any(
        s.startswith("accelerations of elbow contradict its velocities: from 0.99 to 1 s")
        and "4.7" in s
        for s in check.violations
    )
    assert any(s.startswith("acceleration of elbow is 47") for s in check.violations)


def test_uneven_samples_are_found(arm: go.Model) -> None:
    steps = np.where(np.arange(90) % 2, 0.008, 0.037)
    time = np.append(0.0, np.cumsum(steps))
    time = time * DURATION / time[-1]
    check = check_trajectory(swing(time=time), arm)
    only(check, "samples are not evenly spaced: steps of 7.9", "to 36.5", "ms")
    assert check_trajectory(swing(time=time), arm, uniform=False).passed


def test_times_that_do_not_increase_are_found(arm: go.Model) -> None:
    time = swing().time.copy()
    time[7] = time[6]
    only(check_trajectory(changed(time=time), arm), "time does not increase: sample 7 at 0.06 s")


def test_accelerations_that_contradict_velocities_are_found(arm: go.Model) -> None:
    """Wrong by a factor, zero, and of the other sign."""
    for factor in (1.2, 0.0, -1.0):
        check = check_trajectory(changed(accelerations=factor * swing().accelerations), arm)
        assert len(check.violations) >= 2
        contradictions = [s for s in check.violations if "contradict its velocities" in s]
        assert len(contradictions) == 2


def test_velocities_that_contradict_positions_are_found(arm: go.Model) -> None:
    slower = swing().velocities * 0.9, swing().accelerations * 0.9
    check = check_trajectory(changed(velocities=slower[0], accelerations=slower[1]), arm)
    only(check, "velocities of", "contradict its positions")
    assert len(check.violations) == 2


def test_a_jump_of_position_is_found(arm: go.Model) -> None:
    q = swing().positions.copy()
    q[60:, 0] += 0.1
    check = check_trajectory(changed(positions=q), arm)
    assert any("velocities of shoulder contradict its positions" in s for s in check.violations)
    assert any(s.startswith("velocity of shoulder is 10") for s in check.violations)


def test_motion_at_the_ends_is_found(arm: go.Model) -> None:
    part = swing()
    end = 115  # a fast part of the movement
    cut = JointTrajectory(
        part.time[:end],
        part.positions[:end],
        part.velocities[:end],
        part.accelerations[:end],
        part.joint_names,
    )
    check = check_trajectory(cut, arm)
    assert any(s.startswith("elbow ends at 1.8") and "not at rest" in s for s in check.violations)
    assert check_trajectory(cut, arm, rest=False).passed


def test_a_start_at_full_acceleration_is_a_jerk(arm: go.Model) -> None:
    time = np.linspace(0.0, 1.0, 101)
    a = np.where(time < 0.5, 2.0, -2.0)[:, None] * [1.0, 0.0]
    a[50] = 0.0
    q = np.where(time < 0.5, time**2, 0.5 - (1.0 - time) ** 2)[:, None] * [1.0, 0.0]
    v = np.where(time < 0.5, 2.0 * time, 2.0 * (1.0 - time))[:, None] * [1.0, 0.0]
    bang = JointTrajectory(time, q, v, a, ("shoulder", "elbow"))
    only(
        check_trajectory(bang, arm, joint_limits(arm, jerk=210.0)),
        "jerk of shoulder is 600 rad/s^3 between samples",
    )
    assert check_trajectory(bang, arm, joint_limits(arm, jerk=610.0)).passed
    only(
        check_trajectory(bang, arm, joint_limits(arm, jerk=190.0)),
        "jerk of shoulder is 200 rad/s^3 on average over the step",
        "its limit 190",
    )


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ({"velocity": [9.0, 1.8]}, "velocity of elbow is 1.875 rad/s at 1 s, its limit 1.8"),
        ({"acceleration": [2.8, 9.0]}, "acceleration of elbow"),
        ({"jerk": [20.0, 10.0]}, "jerk of elbow"),
        ({"torque": [35.0, 40.0]}, "torque of shoulder is 39.2"),
    ],
)
def test_each_limit_is_checked_by_joint(
    arm: go.Model, limits: dict[str, Any], expected: str
) -> None:
    if expected.startswith("acceleration"):
        limits = {"acceleration": [9.0, 2.8]}
    check = check_trajectory(swing(), arm, joint_limits(arm, **{"jerk": 1e4, **limits}))
    only(check, expected)
    assert len(check.violations) == 1


def test_positions_out_of_range_are_found(arm: go.Model) -> None:
    shifted = changed(positions=swing().positions + np.array([0.0, 1.5]))
    check = check_trajectory(shifted, arm)
    only(check, "elbow is at 3.5 rad", "outside its range of -1 to 3")
    assert check.usage["position"][1] == pytest.approx(1.25)


def test_gravity_is_in_the_axes_of_the_base(arm: go.Model) -> None:
    still = np.zeros((3, 2))
    here = JointTrajectory(np.arange(3) / 100, still, still, still, ("shoulder", "elbow"))
    down = check_trajectory(here, arm).largest["torque"]
    assert_allclose(down, 9.81 * 2.0 * np.array([2.0, 0.5]))
    assert_allclose(check_trajectory(here, arm, gravity=(9.81, 0, 0)).largest["torque"], 0.0)
    loaded = arm.with_payload(10.0)
    assert "torque of shoulder" in check_trajectory(here, loaded).violations[0]


def test_joints_are_matched_by_name(arm: go.Model) -> None:
    one = swing()
    flipped = replace(
        one,
        positions=one.positions[:, ::-1],
        velocities=one.velocities[:, ::-1],
        accelerations=one.accelerations[:, ::-1],
        joint_names=("elbow", "shoulder"),
    )
    expected = check_trajectory(one, arm).largest["torque"]
    assert_allclose(check_trajectory(flipped, arm).largest["torque"], expected)
    with pytest.raises(ValueError, match="trajectory has no joints shoulder; it has a, b"):
        check_trajectory(replace(one, joint_names=("a", "b")), arm)
    more = JointTrajectory.side_by_side([one, one], ("shoulder", "elbow", "thumb", "finger"))
    with pytest.raises(ValueError, match=r"elbow, thumb, finger, the model .*: leave the others"):
        check_trajectory(more, arm)
    with pytest.raises(ValueError, match="'elbow' moves in rad, the trajectory is in m"):
        check_trajectory(replace(one, units=("rad", "m")), arm)


def test_several_robots_side_by_side(arm: go.Model) -> None:
    names = [f"{k}/{name}" for k in range(2) for name in arm.joint_names]
    both = JointTrajectory.side_by_side([swing(), swing()], names)
    falls = np.array([[0.0, 0.0, -9.81], [0.0, 0.0, 0.0]])
    check = check_trajectory(both, [arm, arm], gravity=falls)
    assert check.passed
    assert check.largest["torque"][0] > 3.0 * check.largest["torque"][2]
    slow = joint_limits(arm, velocity=1.0)
    only(check_trajectory(both, [arm, arm], [joint_limits(arm), slow]), "1/elbow")
    with pytest.raises(ValueError, match="limits must be of 4 joints, got 2"):
        check_trajectory(both, [arm, arm], slow)
    with pytest.raises(ValueError, match="gravity must be"):
        check_trajectory(both, [arm, arm], gravity=np.zeros((3, 3)))


@pytest.mark.parametrize("rate", [20.0, 100.0, 1000.0])
def test_distances_to_be_kept_are_checked(arm: go.Model, rate: float) -> None:
    q = ca.SX.sym("q", 2)
    # The elbow moves from 0 to 2: the first distance falls to 0.5 at the end, the second to 0.1
    # when the elbow is at 1, half-way.
    bounds = ca.Function("d", [q], [ca.vertcat(2.5 - q[1], 0.1 + (q[1] - 1.0) ** 2)])
    kept = Clearance(bounds, np.array([0.5, 0.05]), ("hand to wall", "hand to body"))
    check = check_trajectory(swing(rate), arm, clearance=kept)
    assert check.passed, check.violations
    assert check.clearance == pytest.approx(0.1)
    near = Clearance(bounds, np.array([0.5, 0.2]), kept.names)
    only(check_trajectory(swing(rate), arm, clearance=near), "hand to body: 0.1 m apart at 1 s")
    # What the function is a lower bound of may be farther away.
    for lower in (near.lower, kept.lower):
        exact = Clearance(bounds, lower, kept.names, exact=lambda q, index: 0.3 + q[0] / 100)
        found = check_trajectory(swing(rate), arm, clearance=exact)
        assert found.passed
        assert found.clearance == pytest.approx(0.3, abs=0.01)
    names = [f"{k}/{name}" for k in range(2) for name in arm.joint_names]
    both = JointTrajectory.side_by_side([swing(), swing()], names)
    with pytest.raises(ValueError, match="clearance must be of the 4 joints"):
        check_trajectory(both, [arm, arm], clearance=kept)


@pytest.mark.parametrize("count", [1, 2])
def test_trajectories_of_one_or_two_samples(arm: go.Model, count: int) -> None:
    still = np.zeros((count, 2))
    check = check_trajectory(
        JointTrajectory(np.arange(count) / 100, still, still, still, ("shoulder", "elbow")), arm
    )
    assert check.violations == (("the trajectory has one sample only",) if count == 1 else ())
    assert "torque" in str(check)


def test_files_with_six_digits_pass(arm: go.Model) -> None:
    one = swing(1000.0)
    rounded = replace(
        one,
        positions=one.positions.round(6),
        velocities=one.velocities.round(6),
        accelerations=one.accelerations.round(6),
    )
    check = check_trajectory(rounded, arm)
    assert check.passed, check.violations


def test_the_result_is_told_as_table_and_text(arm: go.Model) -> None:
    check = check_trajectory(swing(), arm)
    assert repr(check).startswith("TrajectoryCheck(passed; of the limits: position 50%")
    assert [row[0] for row in rows_of_table(check.table())] == ["shoulder", "elbow"]
    assert "all conditions hold" in str(check)
    failed = check_trajectory(swing(), arm, joint_limits(arm, velocity=1.0, jerk=99.0))
    assert failed.violations[0] in str(failed)
    assert "velocity of elbow" in repr(failed)
