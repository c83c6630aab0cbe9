"""Retargeting while the person moves."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from small_retargeting import small_analysis

import geodesic_ocp as go
from geodesic_ocp.synergies.segment import OnlineSegmentation

PERSON, ROBOT = go.human_arm("left", 1.78), go.human_arm("right", 1.95)
LIMITS = go.execution.joint_limits(ROBOT, velocity=2.5)
START = np.clip(np.full(7, 0.3), ROBOT.lower, ROBOT.upper)
STEP = 0.01


def new_live() -> go.retargeting.LiveRetargeting:
    return go.retargeting.LiveRetargeting(PERSON, ROBOT, START, limits=LIMITS)


@cache
def recorded() -> go.Motion:
    """The reach for the box at 100 Hz, with velocities of the paper's filter."""
    motion = small_analysis().motion
    raw = go.Motion(motion.time, motion.q, motion.joint_names)
    return raw.resampled(100.0).filtered(21)


def as_trajectory(commands: list[go.retargeting.LiveCommand]) -> go.JointTrajectory:
    names = ("time", "position", "velocity", "acceleration")
    columns = [np.array([getattr(each, name) for each in commands]) for name in names]
    return go.JointTrajectory(*columns, ROBOT.joint_names)


def speed(command: go.retargeting.LiveCommand) -> float:
    return float(np.abs(command.velocity).max())


def test_command_keeps_all_limits_whatever_the_person_does() -> None:
    """Check the claim that averages of motions within limits are within limits."""
    live, rng = new_live(), np.random.default_rng(3)
    commands, q = [live.command], np.zeros(7)
    for k in range(200):
        if k % 25 == 0:  # it jumps, and shakes
            q = rng.uniform(PERSON.lower, PERSON.upper)
        commands.append(live.step(k * STEP, q + 0.02 * rng.normal(size=7)))
    commands += [live.step(k * STEP) for k in range(200, 500)]
    trajectory = as_trajectory(commands)
    checked = go.check_trajectory(trajectory, ROBOT, LIMITS)
    assert checked.passed, checked
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


def test_hand_follows_the_person_closely_and_in_time() -> None:
    """A slow swing of the elbow: the averages' delay is made up for."""
    live, found = new_live(), []
    for time in np.arange(0.0, 4.0, STEP):
        q = np.array([0.3, -0.3, 0.2, 1.2 + 0.3 * np.sin(2.0 * time), 0.0, 0.0, 0.0])
        found.append((live.mapping(q)[1], ROBOT.hand_pose(live.command.position)[1]))
        live.step(time, q)
    wanted, reached = np.array(found[200:]).swapaxes(0, 1)
    assert np.ptp(wanted, axis=0).max() > 0.1  # [m]
    assert np.linalg.norm(reached - wanted, axis=1).max() < 3e-3


def test_synergies_close_where_the_whole_motion_is_cut() -> None:
    motion, live = recorded(), new_live()
    half = slice(10, -10)  # where the whole window of the filter is known
    known = go.Motion(
        *(motion.time[half], motion.q[half], motion.joint_names),
        velocity=np.asarray(motion.velocity)[half],
    )
    seen = 0
    for time, q in zip(motion.time, np.asarray(motion.unfiltered), strict=True):
        live.step(time, q)
        seen = max(seen, len(live.cuts))
    metric = go.analyse(PERSON, motion).metric
    expected = [known.time[start] for start, _ in go.segment(metric, known, rest=0.0)]
    assert len(expected) > 3
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


@pytest.mark.parametrize("repeated", [True, False])
def test_robot_rests_while_the_stream_pauses_and_goes_on_after(repeated: bool) -> None:
    live, begin, after = new_live(), np.array([0.3, -0.3, 0.2, 1.2, 0.0, 0.0, 0.0]), np.zeros(7)
    after[3] = 0.4
    commands = [live.command]
    for k in range(300):  # [rad/s]: 1 until the pause
        commands.append(
            live.step(k * STEP, begin + after * min(k, 50) / 40.0 if k < 51 or repeated else None)
        )
    assert speed(commands[45]) > 0.5
    assert speed(commands[-1]) < 0.02
    for k in range(300, 500):
        commands.append(live.step(k * STEP, begin))
    wanted = live.mapping(begin)[1]
    reached = ROBOT.hand_pose(live.command.position)[1]
    assert reached == pytest.approx(wanted, abs=2e-3)
    assert go.check_trajectory(as_trajectory(commands), ROBOT, LIMITS, rest=False).passed
