"""Retargeting while the person moves."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from installed_robots import needs_robots

import geodesic_ocp as go
from geodesic_ocp.retargeting.live import LiveCommand
from geodesic_ocp.retargeting.paired_arm import gravity_on
from geodesic_ocp.synergies.segment import OnlineSegmentation

PERSON, ROBOT = go.human_arm("left", 1.78), go.human_arm("right", 1.95)
LIMITS = go.execution.joint_limits(ROBOT, velocity=2.5)
START = np.clip(np.full(7, 0.3), ROBOT.lower, ROBOT.upper)
STEP = 0.01


def new_live() -> go.retargeting.LiveRetargeting:
    return go.retargeting.LiveRetargeting(PERSON, ROBOT, START, limits=LIMITS)


def as_trajectory(
    commands: list[LiveCommand], robot: go.Model = ROBOT
) -> go.trajectory.JointTrajectory:
    names = ("time", "position", "velocity", "acceleration")
    columns = [np.array([getattr(each, name) for each in commands]) for name in names]
    return go.trajectory.JointTrajectory(*columns, robot.joint_names, robot.units)


def speed(command: LiveCommand) -> float:
    return float(np.abs(command.velocity).max())


@pytest.mark.slow
def test_command_keeps_all_limits_whatever_the_person_does() -> None:
    """Check the claim that averages of motions within limits are within limits."""
    live, rng = new_live(), np.random.default_rng(3)
    commands, q = [live.command], np.zeros(7)
    for k in range(120):
        if k % 20 == 0:  # it jumps, and shakes
            q = rng.uniform(PERSON.lower, PERSON.upper)
        commands.append(live.step(k * STEP, q + 0.02 * rng.normal(size=7)))
    commands += [live.step(k * STEP) for k in range(120, 220)]
    trajectory = as_trajectory(commands)
    checked = go.execution.check_trajectory(trajectory, ROBOT, LIMITS)
    assert checked.passed, checked
    weight = ROBOT.inverse_dynamics(live.command.position, np.zeros(7), np.zeros(7))
    assert live.command.torque == pytest.approx(weight, abs=1e-9)  # it rests again
    # The claim is exact, and the limits are reached: it is tight for acceleration.
    assert np.all(trajectory.positions >= ROBOT.lower)
    assert np.all(trajectory.positions <= ROBOT.upper)
    assert np.all(np.abs(trajectory.velocities) <= LIMITS.velocity)
    assert np.all(np.abs(trajectory.accelerations) <= LIMITS.acceleration)
    jerk = np.diff(trajectory.accelerations, axis=0) / STEP
    assert np.all(np.abs(jerk) <= LIMITS.jerk)
    assert np.abs(trajectory.accelerations / LIMITS.acceleration).max() > 0.9
    # Between the samples, jerk is constant: the quintic through them is this cubic.
    middle = trajectory.time[:-1] + STEP / 2.0
    between = (trajectory.accelerations[1:] + trajectory.accelerations[:-1]) / 2.0
    assert trajectory.states(middle)[2] == pytest.approx(between, abs=1e-6)


def checked(
    robot: go.Model,
    limits: go.execution.JointLimits | None,
    seed: int,
    every: int = 25,
    held: go.execution.JointLimits | None = None,
) -> go.execution.TrajectoryCheck:
    """The commands to a hand that jumps and shakes, and then to none: do they keep limits?"""
    rng, person = np.random.default_rng(seed), go.human_arm("right")
    start = (robot.lower + robot.upper) / 2.0
    live = go.retargeting.LiveRetargeting(person, robot, start, limits=limits)
    commands = [live.command]
    for k in range(200):
        if k % every == 0:
            q = rng.uniform(np.maximum(person.lower, -1.5), np.minimum(person.upper, 1.5))
        commands.append(live.step(k * STEP, q + 0.01 * rng.normal(size=7)))
    commands += [live.step(k * STEP) for k in range(200, 340)]  # it brakes and rests
    gravity, trajectory = gravity_on(live.mapping.target), as_trajectory(commands, robot)
    return go.execution.check_trajectory(trajectory, robot, held or live.limits, gravity=gravity)


FREE = replace(LIMITS, acceleration=np.full(7, np.inf), jerk=np.full(7, np.inf))
SMOOTH = replace(LIMITS, jerk=0.3 * LIMITS.jerk)  # averages over 33 steps


@pytest.mark.slow
@settings(max_examples=5, deadline=None)
@given(
    seed=st.integers(0, 1000),
    every=st.integers(1, 60),
    rate=st.sampled_from([20.0, 40.0, 80.0, 400.0]),
    torque=st.sampled_from([14.0, 40.0, np.inf]),
    hand_speed=st.sampled_from([0.3, 1.5, np.inf]),
    limits=st.sampled_from([LIMITS, FREE, SMOOTH]),
)
# Where stops are checked before the averages, these exceed the torque rate by 6 %.
@example(seed=54, every=9, rate=20.0, torque=np.inf, hand_speed=np.inf, limits=LIMITS)
@example(seed=65, every=35, rate=40.0, torque=np.inf, hand_speed=np.inf, limits=LIMITS)
@example(seed=142, every=17, rate=20.0, torque=np.inf, hand_speed=np.inf, limits=SMOOTH)
def test_no_limit_is_exceeded_where_samples_jump(
    seed: int,
    every: int,
    rate: float,
    torque: float,
    hand_speed: float,
    limits: go.execution.JointLimits,
) -> None:
    """Also where nothing but torques and their rates bound accelerations."""
    more = {"torque": np.full(7, torque), "torque_rate": np.full(7, rate)}
    found = checked(ROBOT, replace(limits, **more, hand_speed=hand_speed), seed, every)
    assert found.passed, found


@pytest.mark.slow
def test_torques_and_the_hands_speed_are_limited_where_they_would_exceed() -> None:
    tight = replace(LIMITS, torque=np.full(7, 10.0), torque_rate=np.full(7, 80.0), hand_speed=0.8)
    free, within = (checked(ROBOT, each, 0, held=tight) for each in (LIMITS, tight))
    kinds = ("torque", "torque_rate", "hand_speed")
    assert all(free.usage[kind].max() > 1.1 for kind in kinds), free
    assert within.passed, within
    assert all(within.usage[kind].max() > 0.8 for kind in kinds), within


@needs_robots
@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda", "talos-right-arm"])
def test_no_limit_of_a_robot_is_exceeded_where_samples_jump(name: str) -> None:
    """Neither where its hand has to slow down, nor where Talos' joints cannot hold its arm."""
    found = checked(go.load_model(name), None, 0)
    assert found.passed, found


@pytest.mark.slow
def test_hand_lags_by_the_stated_delay() -> None:
    live, hand = new_live(), []
    time = np.arange(0.0, 3.0, STEP)
    swing = np.array([0.3, -0.3, 0.2, 1.2, 0.0, 0.0, 0.0]) + np.zeros((time.size, 7))
    swing[:, 3] += 0.3 * np.sin(4.0 * time)
    for sample in zip(time, swing, strict=True):
        hand.append(ROBOT.hand_pose(live.command.position)[1])
        live.step(*sample)
    assert live.delay == pytest.approx(0.055)
    person = live.mapping(swing)[1]
    # How far the hand is on average from where the person's was, by the number of steps since.
    errors = [
        np.linalg.norm(hand[150:] - person[150 - k : 300 - k], axis=1).mean() for k in range(12)
    ]
    assert int(np.argmin(errors)) in (5, 6)
    assert min(errors) < errors[0] / 3.0


@pytest.mark.slow
def test_synergies_close_where_the_whole_motion_is_cut() -> None:
    """With the filter of Klein et al., where all of its window is known."""
    file = files("geodesic_ocp") / "data" / "climb.csv"
    whole = go.read_motion(file, PERSON.joint_names).resampled(100.0)
    raw = whole.part(200, 449)
    live, middle, smooth = new_live(), slice(10, -10), raw.filtered(21)
    for sample in zip(raw.time, raw.q, strict=True):
        live.step(*sample)
    known = go.Motion(
        *(raw.time[middle], smooth.q[middle], raw.joint_names), np.asarray(smooth.velocity)[middle]
    )
    metric = go.analyse(PERSON, known).metric
    expected = [known.time[start] for start, _ in go.segment(metric, known)]
    assert len(expected) > 5
    assert live.cuts == pytest.approx(expected, abs=STEP / 2.0 + 1e-9)


def test_long_rests_close_at_both_ends() -> None:
    metric, time = go.Euclidean(2), np.arange(0.0, 3.0, STEP)
    speeds = np.where((time > 1.0) & (time < 2.0), 0.0, 1.0)[:, None] * [1.0, 0.5]
    q, online = np.cumsum(STEP * speeds, axis=0), OnlineSegmentation(metric)
    for sample in zip(time.tolist(), q, speeds, strict=True):
        online.add(*sample)
    motion = go.Motion(time, q, ("x", "y"), speeds)
    expected = [time[start] for start, _ in go.segment(metric, motion)]
    assert online.cuts == pytest.approx(expected, abs=STEP)
    assert len(expected) == 3


@pytest.mark.parametrize(
    ("time", "q", "message"),
    [
        (1.01, [0.0, 0.0, np.nan, 0.0, 0.0, 0.0, 0.0], "q must be finite"),
        (1.01, np.zeros(6), r"q must have shape \(7,\), got \(6,\)"),
        (1.01, np.full(7, 90.0), "are these degrees"),
        (1.0, np.zeros(7), "time must increase, got 1 s after 1 s"),
        (np.nan, np.zeros(7), "time must be a finite number"),
    ],
)
def test_bad_samples_are_named_and_leave_the_command(
    time: float, q: np.ndarray, message: str
) -> None:
    live = new_live()
    before = live.step(1.0, np.zeros(7))
    with pytest.raises(ValueError, match=message):
        live.step(time, q)
    assert live.command is before
    assert live.step(1.01, np.zeros(7)).time == pytest.approx(2 * STEP)


def test_another_rate_is_noticed_but_not_a_jitter() -> None:
    live, rng = new_live(), np.random.default_rng(5)
    for k in range(60):
        live.step(k * STEP + 0.4 * STEP * rng.uniform(-1.0, 1.0))
    live.step(1.0)  # after a pause it counts anew
    for k in range(1, 16):
        live.step(1.0 + k / 120.0)
    with pytest.raises(ValueError, match="step was called 120 times per second, not 100"):
        live.step(1.0 + 16.0 / 120.0)


@pytest.mark.slow
@pytest.mark.parametrize("repeated", [True, False])
def test_robot_rests_while_the_stream_pauses_and_goes_on_after(repeated: bool) -> None:
    live, begin = new_live(), np.array([0.3, -0.3, 0.2, 1.2, 0.0, 0.0, 0.0])
    commands = [live.command]
    for k in range(200):
        moved = begin.copy()
        moved[3] += 0.01 * min(k, 60)
        commands.append(live.step(k * STEP, moved if k <= 60 or repeated else None))
    assert speed(commands[60]) > 0.5
    assert speed(commands[-1]) < (0.05 if repeated else 1e-12)  # creeps to the pose, or brakes
    for k in range(200, 400):
        commands.append(live.step(k * STEP, begin))
    reached = ROBOT.hand_pose(live.command.position)[1]
    assert reached == pytest.approx(live.mapping(begin)[1], abs=5e-3)
    assert go.execution.check_trajectory(as_trajectory(commands), ROBOT, LIMITS, rest=False).passed


def test_limits_of_jerk_need_limits_of_acceleration() -> None:
    limits = replace(LIMITS, acceleration=np.full(7, np.inf))
    with pytest.raises(ValueError, match="limit of jerk need one of acceleration"):
        go.retargeting.LiveRetargeting(PERSON, ROBOT, START, limits=limits)


@pytest.mark.slow
def test_a_parallel_gripper_begins_with_the_nearer_grasp() -> None:
    """The robot rests with a hand that is mounted the wrong way round, and stays there."""
    aligned, q = go.retargeting.align(ROBOT), np.clip(np.full(7, 0.3), PERSON.lower, PERSON.upper)
    hand = np.diag([-1.0, -1.0, 1.0]) @ np.asarray(aligned.hand)
    either = replace(aligned, hand=hand, parallel_gripper=True)
    kept = new_live()
    start = go.ocp.inverse_kinematics(ROBOT, START, *reversed(kept.mapping(q)))
    live = go.retargeting.LiveRetargeting(PERSON, ROBOT, start, alignment=either, limits=LIMITS)
    for k in range(30):
        live.step(k * STEP, q)
    assert live.mapping.turned
    assert live.command.position == pytest.approx(start, abs=0.02)
