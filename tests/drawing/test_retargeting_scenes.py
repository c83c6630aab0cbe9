"""What is seen of a retargeting and of an alignment is what they say."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_retargeting import both_arms, small_analysis, small_retargeting

import geodesic_ocp as go
from geodesic_ocp.drawing.actors import Actor
from geodesic_ocp.drawing.alignments import alignment_playback
from geodesic_ocp.drawing.retargeting_scenes import (
    BASELINE,
    retargeting_playback,
)
from geodesic_ocp.drawing.scene import Playback, Scene, Trail
from geodesic_ocp.execution.arm_paths import joint_names

MIRROR = np.array([-1.0, 1.0, 1.0])
EXACT = 1e-12  # [m], rounding
pytestmark = pytest.mark.slow  # of a whole retargeting


@pytest.fixture(scope="module")
def found() -> go.retargeting.Retargeting:
    return small_retargeting()


@pytest.fixture(scope="module")
def playback(found: go.retargeting.Retargeting) -> Playback:
    return retargeting_playback(found)


def trail(scene: Scene, name: str) -> Trail:
    (one,) = (each for each in scene.trails if each.name == name)
    return one


def actor(scene: Scene, name: str) -> Actor:
    (one,) = (each for each in scene.actors if each.name == name)
    return one


def test_the_robots_shoulder_is_where_the_persons_is(
    found: go.retargeting.Retargeting, playback: Playback
) -> None:
    """So the mapped path is the person's own, scaled, and mirrored for an arm of the other side."""
    person, robot = playback.scenes
    (arm,) = found.arms
    assert arm.mapping.mirror
    own = trail(person, "hand").points
    mapped = trail(robot, "person's hand, mapped").points
    assert_allclose(mapped, arm.mapping.scale * own * MIRROR, rtol=0.0, atol=EXACT)


def test_colours_are_those_of_the_figure(playback: Playback) -> None:
    person, robot = playback.scenes
    assert trail(person, "hand").role == "observed"
    roles = {each.name: each.role for each in robot.trails}
    assert roles == {
        "person's hand, mapped": "observed",
        "robot's hand": "predicted",
        BASELINE: "baseline",
    }
    shown, overlay = robot.actors
    assert shown.role is None  # the robot has its own colours
    assert (overlay.role, overlay.translucent, overlay.layer) == ("baseline", True, BASELINE)


def test_inverse_kinematics_is_switched_on_by_who_wants_it(playback: Playback) -> None:
    assert BASELINE in playback.hidden
    assert BASELINE in playback.scenes[1].layers
    assert all(
        each.layer == BASELINE for each in playback.scenes[1].trails if BASELINE in each.name
    )


def test_the_person_is_a_whole_person(playback: Playback) -> None:
    links = {mesh.link for each in playback.scenes[0].actors for mesh in each.meshes}
    assert {"head", "thorax"} <= links


def test_links_are_where_the_joints_take_them(
    found: go.retargeting.Retargeting, playback: Playback
) -> None:
    """The hand's link carries the end of its path, in the robot's motion and in the baseline's."""
    (arm,) = found.arms
    scene = playback.scenes[1]
    for one, line, q in zip(
        scene.actors, ("robot's hand", BASELINE), (arm.motion.q, arm.tracked.q), strict=True
    ):
        link = one.meshes[-1].link
        rotation, position = arm.robot.frame_pose(link, q)
        _, tool = arm.robot.hand_pose(q)
        in_link = np.einsum("kji,kj->ki", rotation, tool - position)  # fixed, as the link is rigid
        assert np.ptp(in_link, axis=0).max() < EXACT
        carried = one.positions[link] + np.einsum("kij,kj->ki", one.rotations[link], in_link)
        assert_allclose(carried, trail(scene, line).points, rtol=0.0, atol=EXACT)


def test_distances_are_those_between_the_paths(playback: Playback) -> None:
    scene = playback.scenes[1]
    plot = next(each for each in playback.plots if each.label.endswith("[mm]"))
    wanted = trail(scene, "person's hand, mapped").points
    for curve, line in zip(plot.curves, ("robot's hand", BASELINE), strict=True):
        apart = np.linalg.norm(trail(scene, line).points - wanted, axis=1)
        assert_allclose(curve.values, 1000.0 * apart, atol=1e-9)
    shares = playback.plots[-1]
    assert shares.marks == (1.0,)
    assert shares.curves[0].values.max() <= 1.0 + 1e-6


def test_spans_are_the_synergies(found: go.retargeting.Retargeting, playback: Playback) -> None:
    (arm,) = found.arms
    rows = playback.spans
    assert list(rows) == ["person", arm.robot.name]
    assert len(rows["person"]) == len(arm.analysis.synergies)
    assert len(rows[arm.robot.name]) == len(arm.groups)
    for spans in rows.values():
        assert (spans[0].start, spans[-1].stop) == playback.range
        for before, after in pairwise(spans):
            assert before.stop == after.start
    persons, robots = rows["person"], rows[arm.robot.name]
    assert [span.name for span in persons] == [f"{k}" for k in range(1, len(persons) + 1)]
    for number, (span, group) in enumerate(zip(robots, arm.groups, strict=True), 1):
        assert span.name == ("rest" if group.kind == "rest" else f"{number}")
        if group.kind != "rest":
            first, last = (persons[group.members[k]].name for k in (0, -1))
            assert span.text.endswith(f"person's {first if first == last else f'{first}-{last}'}")


def test_several_robots_share_the_person(found: go.retargeting.Retargeting) -> None:
    """Whose time is the recording's, if the robots take different times."""
    slow = small_retargeting(0.8, "slow")
    assert slow.stretch > 1.01
    together = retargeting_playback(found, slow)
    assert [scene.title for scene in together.scenes] == ["person", "robot", "slow"]
    assert list(together.spans) == ["person", "robot", "slow"]
    person, fast, slower = together.scenes
    recorded = small_analysis().motion.time
    assert_allclose(person.time, recorded - recorded[0], atol=1e-12)
    assert slower.time[-1] == pytest.approx(slow.stretch * fast.time[-1])
    assert "times the person's time" in slower.note
    assert not fast.note
    assert len({(plot.label, plot.title) for plot in together.plots}) == len(together.plots)
    same = retargeting_playback(slow, slow)
    assert list(same.spans) == ["person", "slow", "slow (2)"]
    assert same.scenes[0].time[-1] == pytest.approx(same.scenes[1].time[-1])


def test_a_slowed_person_is_said_to_be_and_keeps_the_durations_of_the_analysis() -> None:
    slow = small_retargeting(0.8, "slow")
    playback = retargeting_playback(slow)
    (arm,) = slow.arms
    for number, (span, synergy) in enumerate(
        zip(playback.spans["person"], arm.analysis.synergies, strict=True), 1
    ):
        assert span.text == f"synergy {number} ({synergy.duration:.2f} s)"
    first, last = playback.spans["person"][0], playback.spans["person"][-1]
    recorded = float(np.ptp(arm.analysis.motion.time))
    assert last.stop - first.start == pytest.approx(slow.stretch * recorded)
    assert playback.scenes[0].note.endswith("slowed to the robot's time")


def test_a_person_in_the_time_of_the_recording_is_not_slowed(
    found: go.retargeting.Retargeting,
) -> None:
    for shown in (
        retargeting_playback(found),
        retargeting_playback(found, small_retargeting(0.8, "slow")),
    ):
        assert "slowed" not in shown.scenes[0].note


def test_two_motions_of_one_robot_have_different_titles(found: go.retargeting.Retargeting) -> None:
    slow = small_retargeting(0.8)
    together = retargeting_playback(found, slow)
    assert [scene.title for scene in together.scenes] == ["person", "robot", "robot (2)"]
    assert list(together.spans) == ["person", "robot", "robot (2)"]
    assert len({(plot.label, plot.title) for plot in together.plots}) == len(together.plots)
    assert any(plot.title.startswith("robot (2)") for plot in together.plots)


def test_obstacles_are_where_they_are_on_the_robot(found: go.retargeting.Retargeting) -> None:
    (arm,) = found.arms
    centre = np.array(arm.robot.hand_pose(arm.motion.q[-1])[1])
    ball = go.Ball(tuple(centre), 0.1, name="lamp")
    settings = replace(found.settings, obstacles=[ball])
    robot = retargeting_playback(replace(found, settings=settings)).scenes[1]
    (solid,) = robot.solids
    around = (solid.vertices.min(axis=0) + solid.vertices.max(axis=0)) / 2.0
    assert_allclose(around, trail(robot, "robot's hand").points[-1], atol=1e-3)
    assert "clearances" in robot.layers
    for gap in robot.gaps:
        assert gap.name.endswith("lamp")
        assert_allclose(np.linalg.norm(gap.ends - gap.starts, axis=1), np.abs(gap.distances))
        offsets = np.stack([gap.starts, gap.ends]) - around
        on_ball = np.abs(np.linalg.norm(offsets, axis=2) - 0.1).min(axis=0)
        assert_allclose(on_ball, 0.0, atol=1e-3)
    assert min(gap.distances.min() for gap in robot.gaps) < 0.0


def test_mobility_ellipsoids_are_at_the_hand(
    found: go.retargeting.Retargeting, playback: Playback
) -> None:
    """With the axes of the metric in which the paths were planned."""
    (arm,) = found.arms
    robot = playback.scenes[1]
    (track,) = robot.ellipsoids
    assert track.layer in playback.hidden
    assert_allclose(track.centres, trail(robot, "robot's hand").points, atol=1e-12)
    turn = np.asarray(arm.mapping.target.base).T
    images = [(turn.T @ axes) @ (turn.T @ axes).T for axes in track.axes[[0, -1]]]
    for image, q in zip(images, arm.motion.q[[0, -1]], strict=True):
        x = ca.SX.sym("q", arm.robot.dof)
        both = ca.Function(
            "both", [x], [arm.robot.hand_jacobian(x), arm.synergies[0].path.metric.matrix(x)]
        )
        jacobian, tensor = (np.asarray(each) for each in both(q))
        wanted = jacobian[:3] @ np.linalg.solve(tensor, jacobian[:3].T)
        ratio = np.linalg.eigvalsh(image)[-1] / np.linalg.eigvalsh(wanted)[-1]
        assert_allclose(image, ratio * wanted, atol=0.02 * np.abs(image).max())


def test_both_arms_have_one_trajectory_and_files_of_their_own(tmp_path: Path) -> None:
    found = both_arms()
    arms = found.arms
    names = [arm.robot.joint_names for arm in arms]
    assert found.motion.joint_names == (*names[0], *names[1])
    assert found.motion.q.shape[1] == 14
    assert_allclose(arms[0].trajectory.time, arms[1].trajectory.time)
    assert len(found.synergies) == sum(len(arm.groups) for arm in arms)
    assert len(go.plot(found).subfigs) == 2
    one = SimpleNamespace(robot=arms[0].robot)
    assert len(set(joint_names([one, one]))) == 14  # type: ignore[list-item]
    files = {file.name for file in found.save(tmp_path)}
    assert {"synergies_0.json", "synergies_1.json"} <= files


def test_both_arms_are_those_of_one_person() -> None:
    found = both_arms()
    playback = retargeting_playback(found)
    person, robots = playback.scenes
    right, left = (trail(person, name).points for name in ("right hand", "left hand"))
    # The one arm moves as the mirrored other one.
    assert_allclose(right, left * MIRROR, atol=1e-9)
    assert right[:, 0].mean() > 0.0
    assert list(playback.spans) == ["right arm", "left arm", "human right arm", "human left arm"]
    assert len(robots.actors) == 4
    assert len({plot.title for plot in playback.plots}) >= 2


def test_postures_of_an_alignment_correspond() -> None:
    """A person's arm of another size attains every pose, and is the person's arm, scaled."""
    robot = go.human_arm("right", 1.5)
    aligned = go.retargeting.align(robot)
    playback = alignment_playback(aligned, robot)
    person, scene = playback.scenes
    ways = [trail(scene, name).points for name in ("person's hand, mapped", "robot's hand")]
    assert_allclose(ways[0], ways[1], atol=1e-6)
    assert_allclose(ways[0], trail(person, "hand").points * 1.5 / 1.75, atol=1e-9)
    (plot,) = playback.plots
    assert plot.curves[0].values.max() < 1e-3
    scaled = actor(scene, "scaled person's arm")
    assert scaled.layer in playback.hidden
    hand = scaled.meshes[-1].link  # the pose of the hand determines where it is
    assert_allclose(
        scaled.positions[hand], actor(scene, robot.name).positions[hand], rtol=0.0, atol=1e-6
    )
    assert [span.name for span in playback.spans["posture"]] == [
        "hanging",
        "elbow bent",
        "reaching forward",
    ]
