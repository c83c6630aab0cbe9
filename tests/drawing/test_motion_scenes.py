"""Motions, models and trajectories as scenes: what is drawn is where the model says it is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from six_joints import six_joints

import geodesic_ocp as go
from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.model_scene import (
    HAND_SPEED,
    MOST,
    RATE,
    joint_groups,
    model_scene,
    shown_samples,
)
from geodesic_ocp.drawing.motion_scenes import (
    SPEED_SHARES,
    TORQUE_SHARES,
    model_playback,
    motion_playback,
    planned_playback,
    replay_playback,
    trajectory_playback,
)
from geodesic_ocp.drawing.scene import Playback, Plot
from geodesic_ocp.drawing.surroundings import upright

STILL = model_scene(go.human_arm("right"), np.zeros(1), np.zeros((1, 7)))


def waving(model: go.Model, rate: float = 50.0, duration: float = 1.0) -> go.Motion:
    """Sines of different frequencies within the limits, with their velocities."""
    time = np.arange(round(duration * rate) + 1) / rate
    low, high = np.maximum(model.lower, -1.0), np.minimum(model.upper, 1.0)
    angular = 1.0 + np.arange(model.dof)
    phases = time[:, None] * angular
    q = (low + high) / 2.0 + 0.4 * (high - low) * np.sin(phases)
    return go.Motion(time, q, model.joint_names, 0.4 * (high - low) * angular * np.cos(phases))


def plots_of(playback: Playback, label: str) -> list[Plot]:
    return [plot for plot in playback.plots if plot.label == label]


@pytest.fixture(scope="module")
def lift(tmp_path_factory: pytest.TempPathFactory) -> go.Model:
    """A robot with a prismatic joint and six revolute ones."""
    file = tmp_path_factory.mktemp("robot") / "lift.urdf"
    file.write_text(six_joints(lift=True))
    return go.load_model(file, hand="flange")


def test_the_arm_and_its_hand_are_where_the_model_says(arm: go.Model) -> None:
    motion = waving(arm)
    (scene,) = motion_playback(motion, arm).scenes
    np.testing.assert_array_equal(scene.time, motion.time)
    (trail,) = scene.trails
    np.testing.assert_allclose(trail.points, arm.hand_pose(motion.q)[1], atol=1e-12)
    np.testing.assert_allclose(trail.dot, trail.points)
    rotations, positions = arm.frame_pose("right forearm", motion.q)
    np.testing.assert_allclose(scene.actors[0].rotations["right forearm"], rotations, atol=1e-12)
    np.testing.assert_allclose(scene.actors[0].positions["right forearm"], positions, atol=1e-12)
    assert {frame.name for frame in scene.frames} == {"base", "hand"}


def test_joints_are_found_by_their_names(arm: go.Model) -> None:
    motion = waving(arm)
    order = np.random.default_rng(0).permutation(arm.dof)
    names = (*(arm.joint_names[k] for k in order), "RKx_joint")
    other = go.Motion(motion.time, np.column_stack([motion.q[:, order], motion.time]), names)
    expected, found = (motion_playback(each, arm) for each in (motion, other))
    np.testing.assert_array_equal(
        found.scenes[0].trails[0].points, expected.scenes[0].trails[0].points
    )
    assert "1 more joints recorded" in found.scenes[0].note


def test_missing_joints_are_named(arm: go.Model) -> None:
    motion = waving(arm)
    some = motion.select(arm.joint_names[:5])
    with pytest.raises(ValueError, match="no joint RWx_joint, RWy_joint of human right arm"):
        motion_playback(some, arm)
    trajectory = go.trajectory.JointTrajectory.from_positions(some.time, some.q, some.joint_names)
    with pytest.raises(ValueError, match="no joint RWx_joint, RWy_joint of human right arm"):
        trajectory_playback(trajectory, arm)


@given(count=st.integers(1, 40000), rate=st.floats(10.0, 5000.0))
def test_samples_are_thinned_and_never_in_silence(count: int, rate: float) -> None:
    time = np.arange(count) / rate
    shown, note = shown_samples(time)
    assert shown[0] == 0
    assert shown[-1] == count - 1
    assert np.all(np.diff(shown) > 0)
    assert bool(note) == (len(shown) < count)
    assert len(shown) <= 1.02 * MOST
    if count > 2:
        assert len(shown) - 2 <= 1.02 * RATE * time[-1]
    if rate <= RATE and count <= MOST:
        assert len(shown) == count


def test_a_fast_recording_keeps_its_own_samples(arm: go.Model) -> None:
    motion = waving(arm, rate=1000.0)
    playback = motion_playback(motion, arm)
    (scene,) = playback.scenes
    assert "every 5th of 1001 samples is shown" in scene.note
    np.testing.assert_array_equal(scene.time, motion.time[::5])
    np.testing.assert_allclose(scene.trails[0].points, arm.hand_pose(motion.q[::5])[1], atol=1e-12)
    # The speed is that of the recording, not of the samples that are shown.
    (speed,) = plots_of(playback, HAND_SPEED)
    jacobian = arm.hand_jacobian(motion.q[500])[:3]
    expected = np.linalg.norm(jacobian @ motion.velocity[500])  # type: ignore[index]
    assert speed.curves[0].values[100] == pytest.approx(expected)


@pytest.mark.slow
def test_plots_of_many_joints_are_grouped_by_limb() -> None:
    person = go.human_upper_body()
    playback = motion_playback(waving(person, 20.0), person)
    titles = [plot.title for plot in playback.plots]
    assert titles == ["trunk", "right arm", "left arm", ""]
    assert [curve.name for curve in playback.plots[-1].curves] == ["right hand", "left hand"]
    drawn = [curve.name for plot in playback.plots[:-1] for curve in plot.curves]
    assert sorted(drawn) == sorted(name.removesuffix("_joint") for name in person.joint_names)


def test_two_arms_beside_each_other_are_grouped_by_arm() -> None:
    left, right = go.human_arm("left"), go.human_arm("right")
    both = go.model.combine(left, right, placements=[(-0.2, 0.0, 0.0), (0.2, 0.0, 0.0)])
    assert [len(group) for group in joint_groups(both).values()] == [7, 7]


def test_metres_and_radians_are_apart(lift: go.Model) -> None:
    playback = motion_playback(waving(lift), lift)
    by_label = {plot.label: [curve.name for curve in plot.curves] for plot in playback.plots}
    assert by_label["prismatic joints [m]"] == ["column"]
    assert len(by_label["joint angles [rad]"]) == 6


def test_a_motion_without_velocities_says_that_it_is_not_filtered(arm: go.Model) -> None:
    motion = waving(arm)
    bare = go.Motion(motion.time, motion.q, motion.joint_names)
    assert plots_of(motion_playback(bare, arm), HAND_SPEED)[0].title.endswith("without filtering")
    assert plots_of(motion_playback(motion, arm), HAND_SPEED)[0].title == ""


def test_a_model_alone_is_shown_within_its_limits(arm: go.Model) -> None:
    limited = arm.with_limits(lower={"REx_joint": 0.7}, upper={"RSy_joint": -0.2})
    (scene,) = model_playback(limited).scenes
    frames = {frame.name: frame for frame in scene.frames}
    assert set(frames) == {"base", *arm.joint_names, "hand"}
    q = np.zeros(7)
    q[[2, 3]] = -0.2, 0.7
    np.testing.assert_allclose(frames["hand"].positions[0], arm.hand_pose(q)[1])
    assert scene.trails == ()


def test_configurations_are_shown_one_after_the_other(arm: go.Model) -> None:
    rows = np.random.default_rng(1).uniform(0.0, 0.3, (3, 7))
    playback = model_playback(arm, rows)
    (scene,) = playback.scenes
    assert scene.trails == ()  # what lies between them is not known
    spans = playback.spans["configurations"]
    assert [span.name for span in spans] == ["1", "2", "3"]
    for row, span in zip(rows, spans, strict=True):
        inside = (scene.time >= span.start) & (scene.time < span.start + 0.99)
        places = scene.actors[0].positions["right forearm"][inside]
        assert len(places) == 2  # held, not passed
        expected = np.broadcast_to(arm.frame_pose("right forearm", row)[1], places.shape)
        np.testing.assert_allclose(places, expected, atol=1e-12)


@pytest.mark.parametrize("q", [0.0, np.zeros(6), np.zeros((2, 6)), np.zeros((0, 7))])
def test_configurations_of_another_shape_are_refused(arm: go.Model, q: Array | float) -> None:
    with pytest.raises(ValueError, match=r"q must have shape \(7,\) or \(k, 7\)"):
        model_playback(arm, q)
    with pytest.raises(ValueError, match="q must be finite"):
        model_playback(arm, np.full(7, np.nan))


def test_speeds_and_torques_are_shares_of_known_limits(lift: go.Model) -> None:
    motion = waving(lift)
    torques = np.tile(np.linspace(0.0, 40.0, len(motion))[:, None], (1, 7))
    trajectory = go.trajectory.JointTrajectory(
        motion.time,
        motion.q,
        motion.velocity,  # type: ignore[arg-type]
        np.zeros_like(motion.q),
        lift.joint_names,
        lift.units,
        torques,
    )
    playback = trajectory_playback(trajectory, lift)
    (speeds,), (shares,) = plots_of(playback, SPEED_SHARES), plots_of(playback, TORQUE_SHARES)
    assert speeds.marks == shares.marks == (100.0,)
    np.testing.assert_allclose(
        speeds.curves[2].values,
        100.0 * np.abs(motion.velocity[:, 2]) / 3.0,  # type: ignore[index]
    )
    np.testing.assert_allclose(shares.curves[0].values, 100.0 * torques[:, 0] / 80.0)
    in_radians = go.trajectory.JointTrajectory(
        *(trajectory.time, trajectory.positions, trajectory.velocities),
        *(trajectory.accelerations, lift.joint_names),
    )
    with pytest.raises(ValueError, match="joint column is in rad, but the model's is in m"):
        trajectory_playback(in_radians, lift)


def test_velocities_without_limits_are_shown_as_they_are(arm: go.Model) -> None:
    motion = waving(arm)
    trajectory = go.trajectory.JointTrajectory.from_positions(
        motion.time, motion.q, arm.joint_names
    )
    (plot,) = plots_of(trajectory_playback(trajectory, arm), "joint velocities [rad/s]")
    np.testing.assert_array_equal(plot.curves[3].values, trajectory.velocities[:, 3])


@given(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3))
def test_up_is_up(direction: list[float]) -> None:
    up = np.array(direction)
    size = float(np.linalg.norm(up))
    up = up / size if size > 1e-3 else np.array([0.0, 0.0, -1.0])
    turned = upright(STILL, up)
    turn = turned.frames[0].rotations[0]
    np.testing.assert_allclose(turn @ up, (0.0, 0.0, 1.0), atol=1e-7)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(turn) > 0.0
    expected = STILL.actors[0].positions["right forearm"] @ turn.T
    np.testing.assert_allclose(turned.actors[0].positions["right forearm"], expected, atol=1e-12)


@pytest.mark.slow
def test_a_planned_trajectory_knows_its_robots(arm: go.Model) -> None:
    wide = np.full(7, 3.0)
    arm, left = (each.with_limits(-wide, wide) for each in (arm, go.human_arm("left")))
    straight = go.Euclidean(7)
    q = np.full((3, 7), 0.1)
    q[1] += 0.2
    q[2] -= 0.05
    edges = np.array([0.0, 1.0, 2.0])
    arms = [
        go.execution.ArmPaths(
            robot,
            go.execution.joint_limits(robot, velocity=4.0),
            edges,
            [go.geodesic(straight, *q[[0, 1]]), go.geodesic(straight, *q[[1, 2]])],
        )
        for robot in (arm, left)
    ]
    planned = go.execution.plan_trajectory(arms)
    playback = planned_playback(planned)
    assert [scene.title for scene in playback.scenes] == [arm.name, left.name]
    for scene, robot, number in zip(playback.scenes, (arm, left), range(2), strict=True):
        at = planned.states(scene.time, number)[0]
        np.testing.assert_allclose(scene.trails[0].points, robot.hand_pose(at)[1], atol=1e-9)
    stops = [span.stop for span in playback.spans[arm.name]]
    np.testing.assert_allclose(stops, planned.robot_edges[1:])


def test_a_replay_shows_what_the_robot_should_do_as_an_overlay(lift: go.Model) -> None:
    motion = waving(lift)
    wanted = go.trajectory.JointTrajectory.from_positions(
        motion.time, motion.q, lift.joint_names, lift.units
    )
    late = go.Motion(motion.time, motion.q - 0.01, lift.joint_names, motion.velocity)
    limits = np.full(7, 80.0)
    replay = go.execution.Replay(
        lift, wanted, late, np.zeros_like(motion.q), limits, None, "computed torque"
    )
    playback = replay_playback(replay)
    actors = {actor.name: actor for actor in playback.scenes[0].actors}
    assert actors["trajectory"].translucent
    (hand,) = plots_of(playback, "hand error [mm]")
    np.testing.assert_allclose(hand.curves[0].values, 1000.0 * replay.position_error)
