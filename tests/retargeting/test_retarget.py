"""A person's synergies on other human arms, which need no package with robots."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from installed_robots import needs_robots
from numpy.testing import assert_allclose
from shaded_times import is_shaded
from short_reprs import check_reprs
from small_retargeting import small_retargeting
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup
from geodesic_ocp.retargeting.paired_arm import REACHED
from geodesic_ocp.retargeting.result import warn_of_detours


@pytest.fixture(scope="module")
def analysis(bundled_file: Path) -> go.synergies.Analysis:
    """The reach for the box in the bundled recording."""
    motion = go.read_motion(bundled_file).filtered()
    reach = slice(260, 430)
    cut = go.Motion(
        motion.time[reach],
        motion.q[reach],
        motion.joint_names,
        motion.velocity[reach],  # type: ignore[index]
    )
    return go.analyse(go.human_arm("left", 1.78), cut, metric="kinetic")


@pytest.fixture(scope="module")
def robot() -> go.Model:
    """Another person's arm, on the other side, with low speed limits."""
    arm = go.human_arm("right", 1.95, 90.0)
    chain = arm.pin.copy()
    chain.velocityLimit = np.full(7, 2.5)
    return go.Model(chain, "hand", shapes=arm.bodies)


SETTINGS = go.retargeting.RetargetingSettings(merge=0.4, speed_limits=False)
LOOSE = 1e-4  # tolerance of tests that are not about accuracy


@pytest.fixture(scope="module")
def found(analysis: go.synergies.Analysis, robot: go.Model) -> go.retargeting.Retargeting:
    return go.retarget(analysis, robot, tolerance=LOOSE)


def outside(model: go.Model, q: np.ndarray) -> float:
    return float(np.max([model.lower - q, q - model.upper]))


def test_hand_reaches_the_poses(
    found: go.retargeting.Retargeting, analysis: go.synergies.Analysis
) -> None:
    (arm,) = found.arms
    assert arm.mapping.mirror
    assert not arm.out_of_reach
    assert arm.mapping.scale == pytest.approx(1.95 / 1.78, rel=1e-6)
    assert len(arm.groups) <= len(analysis.synergies)
    assert len(arm.groups) == len(arm.synergies) == len(arm.transfers) > 1
    for group, transfer in zip(arm.groups, arm.transfers, strict=True):
        assert transfer.success
        assert max(transfer.position_error, transfer.rotation_error) <= REACHED
        if group.kind != "rest":
            rotation, position = arm.robot.hand_pose(transfer.path.nodes[-1])
            assert_allclose(position, arm.target_poses[1][group.stop], atol=1e-6)
            assert_allclose(rotation, arm.target_poses[0][group.stop], atol=2e-6)
    for one, other in pairwise(arm.transfers):
        assert_allclose(one.path.nodes[-1], other.path.nodes[0], atol=1e-12)


@pytest.mark.slow
def test_a_parallel_gripper_takes_the_better_grasp(
    found: go.retargeting.Retargeting, analysis: go.synergies.Analysis, robot: go.Model
) -> None:
    """Of a hand that is mounted the wrong way round, which two fingers do not mind."""
    aligned = found.arms[0].mapping.target
    hand = np.diag([-1.0, -1.0, 1.0]) @ aligned.hand
    either = replace(aligned, hand=hand, parallel_gripper=True)
    turned = go.retarget(analysis, robot, alignment=either, tolerance=LOOSE)
    assert "gripper turned by 180 degrees" in turned.arms[0].title
    assert "errors are from poses so turned" in turned.synergy_table().attrs["note"]
    assert_allclose(turned.trajectory.positions, found.trajectory.positions, atol=1e-6)


def test_limits_hold_everywhere(found: go.retargeting.Retargeting) -> None:
    (arm,) = found.arms
    assert found.success
    s = np.linspace(0.0, 1.0, 1001)
    for synergy in arm.synergies:
        assert outside(arm.robot, synergy.path(s)) <= 0.0
    q, v, a, j = found.planned.states(np.linspace(0.0, found.planned.duration, 5001))
    assert outside(arm.robot, q) <= 1e-6
    limits = arm.limits
    for values, largest in ((v, limits.velocity), (a, limits.acceleration), (j, limits.jerk)):
        assert np.max(np.abs(values) / largest) <= 1.0 + 1e-6
    assert np.max(np.abs(v)) <= 2.5
    assert found.stretch >= 1.0
    assert found.check.passed, found.check.violations
    for motion in arm.statistics.values():
        assert motion.peak_speed <= 1.001
        assert motion.limit_violation <= 1e-4


@pytest.mark.slow
def test_trajectory_is_sampled_evenly_and_consistent(
    analysis: go.synergies.Analysis, robot: go.Model, found: go.retargeting.Retargeting
) -> None:
    finer = go.retarget(analysis, robot, tolerance=LOOSE, rate=1000.0)
    for result, rate in ((found, 100.0), (finer, 1000.0)):
        trajectory, h = result.trajectory, 1.0 / rate
        assert trajectory.rate == pytest.approx(rate)
        jerk = float(result.arms[0].limits.jerk.max())
        between = np.diff(trajectory.positions, axis=0) / h
        mean = (trajectory.velocities[1:] + trajectory.velocities[:-1]) / 2.0
        assert np.abs(between - mean).max() <= jerk * h**2 / 12.0 * 1.01
        between = np.diff(trajectory.velocities, axis=0) / h
        mean = (trajectory.accelerations[1:] + trajectory.accelerations[:-1]) / 2.0
        assert np.abs(between - mean).max() <= jerk * h / 4.0 * 1.01
        assert_allclose(trajectory.velocities[[0, -1]], 0.0, atol=1e-9)
        assert_allclose(trajectory.accelerations[[0, -1]], 0.0, atol=1e-9)


def test_action_is_less_than_that_of_tracking_the_hand(found: go.retargeting.Retargeting) -> None:
    statistics = found.arms[0].statistics
    assert statistics["synergies"].action < statistics["ik"].action
    # Tracking follows the whole path, synergies attain the poses at their ends.
    assert statistics["ik"].position < 0.01
    assert statistics["synergies"].position < 0.1


def test_motion_passes_the_ends_of_the_synergies_and_stays_near_them(
    found: go.retargeting.Retargeting,
) -> None:
    (arm,) = found.arms
    motion, time = found.motion, found.motion.time
    assert motion.joint_names == arm.robot.joint_names
    assert len(motion) == len(arm.analysis.motion)
    assert time[0] == 0.0
    assert time[-1] == pytest.approx(found.stretch * arm.analysis.motion.duration)
    for synergy, deviation in zip(arm.synergies, found.planned.path_deviation[0], strict=True):
        assert time[synergy.start] == pytest.approx(synergy.start_time, abs=1e-9)
        assert_allclose(motion.q[synergy.start], synergy.path.nodes[0], atol=1e-5)
        assert_allclose(motion.q[synergy.stop], synergy.path.nodes[-1], atol=1e-5)
        assert deviation.hand < 0.05
    assert_allclose(arm.synergies[-1].path.nodes[-1], found.trajectory.positions[-1], atol=1e-5)


@pytest.mark.slow
def test_own_arm_reaches_the_recorded_poses(analysis: go.synergies.Analysis) -> None:
    """On the person's own arm, from the recorded start, the poses are the recorded ones."""
    first = analysis.motion.q[0]
    settings = go.retargeting.RetargetingSettings(drop=0.0, merge=0.3)
    found = go.retarget(analysis, analysis.model, start=first, settings=settings)
    (arm,) = found.arms
    assert arm.mapping.scale == pytest.approx(1.0)
    assert not arm.mapping.mirror
    observed = analysis.model.hand_pose(analysis.motion.q)
    assert_allclose(arm.target_poses[1], observed[1], atol=1e-12)
    assert_allclose(arm.target_poses[0], observed[0], atol=1e-12)
    assert_allclose(found.motion.q[0], first, atol=3e-6)
    assert found.arms[0].robot is analysis.model  # a person has no rotors


@pytest.mark.slow
def test_formulation_with_free_geodesics(analysis: go.synergies.Analysis, robot: go.Model) -> None:
    settings = replace(SETTINGS, formulation="geodesic")
    free = go.retarget(analysis, robot, settings=settings)
    (arm,) = free.arms
    assert free.stretch == 1.0
    metric = go.KineticEnergy(robot)
    for group, transfer in zip(arm.groups, arm.transfers, strict=True):
        assert max(transfer.position_error, transfer.rotation_error) <= REACHED
        if group.kind != "rest":
            velocity = transfer.path(0.0, 1)
            end = go.exp(metric, transfer.path.nodes[0], velocity)
            assert_allclose(end, transfer.path.nodes[-1], atol=1e-4)


@pytest.mark.slow
def test_from_rest_to_rest(analysis: go.synergies.Analysis, robot: go.Model) -> None:
    """The recording begins in the middle of a motion, which no robot can."""
    moving, resting = (
        go.retarget(
            analysis,
            robot,
            tolerance=LOOSE,
            settings=go.retargeting.RetargetingSettings(
                merge=0.4, rest=rest, orientation_weight=0.0
            ),
        )
        for rest in (False, True)
    )
    ends = [0, -1]
    assert np.abs(moving.trajectory.velocities[ends]).max() > 0.1
    assert_allclose(resting.trajectory.velocities[ends], 0.0, atol=1e-9)


@pytest.mark.slow
def test_free_orientation(analysis: go.synergies.Analysis, robot: go.Model) -> None:
    found = go.retarget(analysis, robot, settings=replace(SETTINGS, orientation_weight=0.0))
    (arm,) = found.arms
    assert all(transfer.rotation_error == 0.0 for transfer in arm.transfers)
    ends = [group.stop for group in arm.groups if group.kind != "rest"]
    positions = [
        robot.hand_pose(transfer.path.nodes[-1])[1]
        for group, transfer in zip(arm.groups, arm.transfers, strict=True)
        if group.kind != "rest"
    ]
    assert_allclose(positions, arm.target_poses[1][ends], atol=1e-6)


@pytest.mark.slow
def test_free_position_with_slow_joints(analysis: go.synergies.Analysis, robot: go.Model) -> None:
    settings = go.retargeting.RetargetingSettings(position_weight=0.0, merge=0.4)
    found = go.retarget(analysis, robot, settings=settings)
    for transfer in found.arms[0].transfers:
        assert transfer.rotation_error <= REACHED
        assert transfer.position_error == 0.0


@pytest.mark.slow
def test_baseline_begins_at_the_first_pose(
    analysis: go.synergies.Analysis, robot: go.Model
) -> None:
    """Wherever the synergies begin; otherwise it would first move there at high speed."""
    start = np.array([0.2, 0.0, -0.3, 1.9, 0.0, 0.0, 0.0])
    (arm,) = go.retarget(analysis, robot, start=start, tolerance=LOOSE, settings=SETTINGS).arms
    assert_allclose(arm.motion.q[0], start, atol=3e-4)
    _, position = robot.hand_pose(arm.baseline.positions[0])
    assert_allclose(position, arm.target_poses[1][0], atol=1e-5)


@pytest.mark.slow
def test_poses_out_of_reach_are_reported_before_and_replaced_by_the_nearest(
    analysis: go.synergies.Analysis, robot: go.Model
) -> None:
    reported: list[str] = []

    def progress(label: str, done: int, total: int) -> None:
        del total
        reported.append(f"{label} {done}")

    with (
        pytest.warns(UserWarning, match="ends .* from its pose, which is out of reach"),
        pytest.warns(
            UserWarning, match=r"out of reach, by the nearest pose found: .*: 0\.\d+ m and \d"
        ) as caught,
    ):
        found = go.retarget(
            analysis,
            robot,
            alignment=go.retargeting.align(robot),  # or it would be moved
            tolerance=LOOSE,
            settings=replace(SETTINGS, scale=1.5),
            progress=progress,
        )
    assert reported[0].startswith("choosing")
    (arm,) = found.arms
    assert arm.placement is None
    assert arm.out_of_reach
    said = " ".join(str(each.message) for each in caught)
    for number, (distance, _) in arm.out_of_reach.items():
        assert (f"the end of synergy {number} of" if number > 0 else "the first pose of") in said
        if number > 0:
            transfer = arm.transfers[number - 1]
            assert not transfer.within_reach
            assert transfer.position_error == pytest.approx(distance, rel=0.05, abs=1e-3)
            assert "out of reach" in transfer.status
    # What the motion achieves is told of every pose that is missed by more than the tolerance.
    assert not found.success
    assert arm.missed.keys() == {
        number
        for number, error in arm.pose_errors.items()
        if np.any(np.array(error) > (0.0101, 0.0871))
    }
    for number, (distance, _) in arm.missed.items():
        assert any(f"{distance:.3g} m" in fault for fault in found.faults), number
        assert f"{distance:.3g} m" in said
    assert outside(robot, found.motion.q) <= 0.0


@pytest.mark.slow
def test_obstacle_is_avoided_with_a_margin(
    analysis: go.synergies.Analysis, robot: go.Model
) -> None:
    free = go.retarget(analysis, robot, tolerance=LOOSE, settings=SETTINGS)
    hand = robot.hand_pose(free.motion.q)[1]
    k = len(hand) * 3 // 4  # while the hand rises
    beside = np.cross(hand[k + 1] - hand[k - 1], hand[-1] - hand[0] + np.array([0.0, 0.0, 1.0]))
    centre = hand[k] + 0.06 * beside / np.linalg.norm(beside)
    ball, links = go.Ball(tuple(centre), 0.05, name="lamp"), ("right hand",)
    before = [
        min(go.distances.signed_distances(robot, q, [ball], links=links).values())
        for q in free.motion.q
    ]
    assert min(before) < 0.0
    assert min(before[0], before[-1]) > 0.02
    apart: dict[str, Any] = {"links": links, "margin": 0.0, "obstacle_margin": 0.01}
    settings = replace(SETTINGS, obstacles=[ball], **apart)
    avoiding = go.retarget(analysis, robot, settings=settings)
    after = [
        min(go.distances.signed_distances(robot, q, [ball], links=links).values())
        for q in avoiding.motion.q[::3]
    ]
    assert min(after) > 0.01 - 2e-6


@pytest.mark.slow
def test_a_person_who_rests_is_a_robot_that_rests(
    analysis: go.synergies.Analysis, robot: go.Model
) -> None:
    settings = go.retargeting.RetargetingSettings(
        drop=100.0, merge=100.0, pose_tolerance=(1.0, 3.0)
    )
    found = go.retarget(analysis, robot, tolerance=LOOSE, settings=settings)
    assert found.success
    # The person moves on meanwhile, by this much.
    positions = found.arms[0].target_poses[1]
    expected = np.linalg.norm(positions[-1] - positions[0])
    assert found.synergy_table()["hand error [m]"].tolist() == [pytest.approx(expected, abs=1e-6)]
    (arm,) = found.arms
    assert {group.kind for group in arm.groups} == {"rest"}
    still = np.broadcast_to(arm.motion.q[0], found.trajectory.positions.shape)
    assert_allclose(found.trajectory.positions, still, atol=1e-6)
    assert_allclose(arm.robot.hand_pose(arm.motion.q[0])[1], arm.target_poses[1][0], atol=1e-6)


@pytest.mark.slow
def test_without_any_limits(analysis: go.synergies.Analysis, robot: go.Model) -> None:
    infinite = np.full(7, np.inf)
    free = robot.with_limits(-infinite, infinite)
    settings = go.retargeting.RetargetingSettings(merge=0.4, limits=False, speed_limits=False)
    found = go.retarget(analysis, free, tolerance=LOOSE, settings=settings)
    assert found.success
    assert found.stretch == pytest.approx(1.0, abs=1e-3)


def test_start_in_collision_is_reported_before(
    analysis: go.synergies.Analysis, robot: go.Model
) -> None:
    start = np.array([0.2, 0.0, -0.3, 1.0, 0.0, 0.0, 0.0])
    centre = robot.hand_pose(start)[1]
    called: list[str] = []
    ball = go.Ball(tuple(centre), 0.1, name="lamp")
    with pytest.raises(ValueError, match=r"right forearm to lamp is -0\.\d+ m, and .* 0.03 m"):
        go.retarget(
            analysis,
            robot,
            start=start,
            settings=go.retargeting.RetargetingSettings(obstacles=[ball], obstacle_margin=0.03),
            progress=lambda label, done, total: called.append(label),
        )
    assert not called


def test_an_obstacle_that_a_link_always_overlaps_is_named(
    analysis: go.synergies.Analysis, robot: go.Model
) -> None:
    around = replace(SETTINGS, obstacles=[go.Ball((0.0, 0.0, 0.0), 0.1, name="lamp")])
    with pytest.raises(ValueError, match="256 configurations: right upper arm to lamp;"):
        go.retarget(analysis, robot, settings=around)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"formulation": "magic"}, "formulation must be one of constrained, geodesic"),
        ({"scale": -1.0}, "scale must be positive"),
        ({"position_weight": 0.0, "orientation_weight": 0.0}, "not both zero"),
        ({"orientation_weight": -1.0}, "zero or above"),
        ({"margin": -1.0}, "^margin must be zero or above"),
        ({"obstacle_margin": -1.0}, "obstacle_margin must be zero or above"),
        ({"pose_tolerance": 0.01}, "pose_tolerance must be a distance"),
        ({"pose_tolerance": (0.01, -1.0)}, "pose_tolerance must not be negative"),
        ({"pose_tolerance": (0.01, 5.0)}, "the angle is in rad"),
        ({"pose_tolerance": ("5deg", "10mm")}, "with units such as 10mm 5deg"),
        ({"path_tolerance": (0.0, 0.1)}, "path_tolerance must be positive"),
        ({"energy_weight": 0.0}, "energy_weight must be positive"),
        ({"num_starts": 0}, "num_starts must be a positive integer"),
        ({"num_starts": None}, "num_starts must be a positive integer"),
        ({"mirror": "yes"}, "mirror must be"),
        ({"pairs": [("right hand",)]}, "pairs must be a list of pairs"),
        (
            {"formulation": "geodesic", "obstacles": [go.Ball((9, 9, 9), 0.1)]},
            "'geodesic' does not avoid collisions",
        ),
    ],
)
def test_wrong_settings_are_named(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.retargeting.RetargetingSettings(**fields)


TAIL = go.retargeting.RetargetingSettings(links=["tail"], obstacles=[go.Ball((9, 9, 9), 0.1)])


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        (
            {"settings": go.retargeting.RetargetingSettings(drop=2.0, merge=1.0)},
            "drop and merge must be",
        ),
        ({"settings": {"drop": 2.0}}, "settings must be RetargetingSettings"),
        ({"settings": TAIL}, "no body at 'tail'"),
        ({"tolerance": 0.0}, "tolerance must be positive"),
        ({"start": np.zeros(3)}, "start"),
        ({"start": np.full(7, 3.0)}, "start: RSx_joint|start: RSz_joint is at 3, outside"),
        ({"start": []}, "start"),
        ({"alignment": "panda"}, "alignments must be of Alignment, got 'panda'"),
        ({"person_alignment": []}, "person_alignments must be of Alignment"),
    ],
)
def test_wrong_arguments_are_named(
    analysis: go.synergies.Analysis, robot: go.Model, keywords: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        go.retarget(analysis, robot, **keywords)


def test_wrong_analyses_and_robots_are_named(
    analysis: go.synergies.Analysis, robot: go.Model
) -> None:
    with pytest.raises(ValueError, match="2 analyses for 1 robots"):
        go.retargeting.retarget_arms([analysis, analysis], [robot])
    motion = analysis.motion
    later = go.Motion(motion.time + 1.0, motion.q, motion.joint_names, motion.velocity)
    other = replace(analysis, motion=later)
    with pytest.raises(ValueError, match="must be of one recording"):
        go.retargeting.retarget_arms([analysis, other], [robot, analysis.model])
    with pytest.raises(ValueError, match="starts must be a list, one for each of 1 robots"):
        go.retargeting.retarget_arms([analysis], [robot], starts=[])
    with pytest.raises(ValueError, match="robot must be a Model"):
        go.retarget(analysis, "panda")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="analysis must be an Analysis"):
        go.retarget(robot, robot)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="robots must be a list of Model"):
        go.retargeting.retarget_arms([analysis], robot)  # type: ignore[arg-type]


@pytest.mark.slow
def test_tables_and_figure_show_both_methods(found: go.retargeting.Retargeting) -> None:
    table = found.table()
    assert [row[1] for row in rows_of_table(table)] == [
        "geodesic synergies",
        "inverse kinematics",
    ]
    synergies = found.synergy_table()
    (arm,) = found.arms
    assert len(rows_of_table(synergies)) == len(arm.groups)
    assert [row[4] for row in rows_of_table(synergies)] == [group.kind for group in arm.groups]
    # Numbers count from 1, those of the robot and those of the person.
    assert [row[1] for row in rows_of_table(synergies)] == list(range(1, len(arm.groups) + 1))
    assert str(rows_of_table(synergies)[0][2]).startswith("1")
    assert str(rows_of_table(synergies)[-1][2]).endswith(str(len(arm.analysis.synergies)))
    figure = go.plot(found)
    (part,) = figure.subfigs
    panels = part.axes
    labels = [panel.get_ylabel() for panel in panels]
    assert [label.partition(" ")[0] for label in labels[:2]] == ["hand", "hand"]
    assert all(label.endswith("[rad]") for label in labels[2:5])
    edges = [(group.start, group.stop) for group in arm.groups]
    middles = arm.motion.time[np.array(edges)].mean(axis=1)
    shaded = is_shaded(panels[0], middles - arm.motion.time[0])
    assert shaded.tolist() == [k % 2 == 0 for k in range(len(edges))]
    (legend,) = part.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "person's hand, mapped",
        "geodesic synergies",
        "segment ends",
        "inverse kinematics",
    ]


@pytest.mark.slow
def test_saved_files_can_be_read(found: go.retargeting.Retargeting, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    files = {file.name for file in found.save(folder, figure=go.plot(found))}
    assert files == {
        "comparison.csv",
        "comparison.md",
        "figure.pdf",
        "figure.png",
        "synergies.csv",
        "synergies.json",
        "synergies.md",
        "table.csv",
        "table.md",
        "trajectory.csv",
        "trajectory.json",
        "trajectory.npz",
    }
    (arm,) = found.arms
    metric = go.KineticEnergy(arm.robot)
    again = go.synergies.load_synergies(folder / "synergies.json", metric)
    assert len(again) == len(arm.synergies)
    times = again[-1].start_time + np.array([0.0, 0.4, 1.0]) * again[-1].duration
    assert_allclose(again[-1](times), arm.synergies[-1](times), atol=1e-9)
    message = json.loads((folder / "trajectory.json").read_text())
    assert tuple(message["joint_names"]) == arm.robot.joint_names
    assert len(message["points"]) == len(found.trajectory.time)
    for suffix in ("csv", "npz", "json"):
        again = go.read_trajectory(folder / f"trajectory.{suffix}")
        assert_allclose(again.positions, found.trajectory.positions, atol=1e-12)
        assert_allclose(again.accelerations, found.trajectory.accelerations, atol=1e-12)


def test_reprs_are_short(found: go.retargeting.Retargeting) -> None:
    values = [found, found.motion, found.trajectory, dict(found.arms[0].statistics)]
    assert check_reprs(values) >= {
        go.retargeting.Retargeting,
        go.retargeting.RetargetedArm,
        SynergyGroup,
    }


@pytest.mark.slow
@needs_robots
def test_on_panda(analysis: go.synergies.Analysis) -> None:
    """By the synergies of Klein et al."""
    analysis = go.analyse(analysis.model, analysis.motion, metric="kinetic", segments=go.segment)
    settings = go.retargeting.RetargetingSettings(merge=0.3)
    found = go.retarget(analysis, go.load_model("panda"), settings=settings)
    (arm,) = found.arms
    assert arm.mapping.mirror
    for transfer in arm.transfers:
        assert max(transfer.position_error, transfer.rotation_error) <= REACHED
    assert outside(arm.robot, found.motion.q) <= 0.0
    statistics = arm.statistics
    assert statistics["synergies"].action < statistics["ik"].action
    assert statistics["synergies"].peak_speed <= 1.001


@pytest.mark.slow
@needs_robots
def test_torques_beyond_the_share_are_named(analysis: go.synergies.Analysis) -> None:
    robot, share = go.load_model("talos-right-arm"), 0.2
    settings = go.retargeting.RetargetingSettings(torque_share=share)
    with pytest.warns(UserWarning, match="more than the share of 0.2") as told:
        found = go.retarget(analysis, robot, settings=settings)
    said = " ".join(str(each.message) for each in told)
    taken = np.abs(found.trajectory.efforts).max(axis=0) / found.arms[0].limits.torque
    assert found.success
    for joint, most in zip(robot.joint_names, taken, strict=True):
        assert (f"{joint} takes {most:.3g} of its torque limit" in said) == (most > 1.001 * share)


@pytest.mark.slow
@needs_robots
@pytest.mark.filterwarnings("ignore::UserWarning")  # of a base that is moved
def test_links_whose_capsules_always_overlap_keep_the_margin(bundled_file: Path) -> None:
    """As do the others, or half of the largest distance that they can have."""
    robot, person = go.load_model("talos-left-arm"), go.human_arm("left", 1.78)
    analysis = go.analyse(person, go.read_motion(bundled_file, person.joint_names))
    found = go.retarget(analysis, robot)
    margin = found.settings.margin
    pairs = go.execution.link_pairs(robot, margin=margin)
    report = go.execution.trajectory_clearance(robot, found.trajectory, pairs=pairs)
    assert found.success
    assert {(each.one, each.other) for each in report.closest} >= {*pairs.exact_only}
    for each in report.closest:
        assert each.distance >= pairs.margin(each.one, each.other, margin) - 1e-4
    assert found.clearance is not None
    wider = replace(found.clearance, lower=found.clearance.lower + 0.03)
    with pytest.warns(UserWarning, match="mm at .* s, less than their margin of 40 mm"):
        warn_of_detours(replace(found, clearance=wider))


@pytest.mark.slow
def test_a_baseline_that_no_configuration_is_clear_for_begins_where_the_synergies_do(
    found: go.retargeting.Retargeting,
) -> None:
    around = replace(SETTINGS, obstacles=[go.Ball((0.0, 0.0, 0.0), 0.1)])
    arm = replace(found.arms[0], settings=around)
    assert_allclose(arm.baseline.positions[0], arm.motion.q[0])


@pytest.mark.slow
@pytest.mark.parametrize("sample", [0, -1])
def test_an_obstacle_where_the_hand_has_to_be_moves_the_robot_unless_it_is_fixed(
    analysis: go.synergies.Analysis, robot: go.Model, found: go.retargeting.Retargeting, sample: int
) -> None:
    """The obstacle moves with it, as it is in the frame of its base."""
    (arm,) = found.arms
    ball = go.Ball(tuple(arm.target_poses[1][sample]), 0.03, name="lamp")
    hand = ("right hand",)
    settings = replace(SETTINGS, obstacles=[ball], links=hand, self_collision=False, margin=0.0)
    given: dict[str, Any] = {"tolerance": LOOSE, "settings": settings}
    with pytest.warns(UserWarning, match="lamp|from its (first )?pose"):
        avoiding = go.retarget(analysis, robot, alignment=arm.mapping.target, **given)
    assert not avoiding.success
    assert avoiding.touches or avoiding.arms[0].missed
    assert not avoiding.paths.within_reach[0][sample]  # type: ignore[union-attr]
    with pytest.warns(UserWarning, match="is moved, with its obstacles, as it does not attain"):
        moved = go.retarget(analysis, robot, **given)
    assert moved.success
    apart = [
        min(go.distances.signed_distances(robot, q, [ball], links=hand).values())
        for q in moved.trajectory.positions
    ]
    assert min(apart) > 0.0


def test_a_speed_that_no_source_limits_is_no_success() -> None:
    """Speeds of 0 in a file are unknown limits: without one there is nothing to plan with."""
    result = small_retargeting(speed=0.0)
    assert not result.success
    (fault,) = result.unfit
    assert fault.startswith("no limit on the speed of RSx_joint, RSz_joint")
    assert "--velocity" in fault
    assert result.bodies[0].limits.unknown == result.joint_names
