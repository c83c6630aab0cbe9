"""The geometry of links in the frames of their joints, and exact distances between links."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from installed_robots import needs_robots
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.model.link_solids import (
    exact_distance,
    is_closer,
    joint_poses,
    link_solids,
    reach_bound,
)

ARM = """<robot name="balls"><link name="base">{ball}</link>
  <link name="upper">{inertia}{ball}</link><link name="lower">{inertia}{ball}</link>
  <link name="tip">{box}</link>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.5"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.4" effort="1" velocity="1"/></joint>
  <joint name="turn" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="fixed" type="fixed"><parent link="lower"/><child link="tip"/>
    <origin xyz="0.6 0 0" rpy="0 0 0.4"/></joint></robot>""".format(
    ball='<collision><geometry><sphere radius="0.1"/></geometry></collision>',
    box='<collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>',
    inertia='<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    "</inertial>",
)


@pytest.fixture(scope="module")
def robot() -> go.Model:
    return go.load_model(ARM, hand="tip")


def test_links_are_carried_by_joints_and_follow_each_other(robot: go.Model) -> None:
    solids = {each.link: each for each in link_solids(robot)}
    assert {link: (each.joint, each.parent) for link, each in solids.items()} == {
        "base": (0, ""),
        "upper": (1, "base"),
        "lower": (2, "upper"),
        "tip": (2, "lower"),
    }


def test_exact_distances_of_balls(robot: go.Model) -> None:
    """The ball of the lower link is 0.3 m beside that of the upper one, whatever the angle."""
    solids = {each.link: each for each in link_solids(robot)}
    q = np.array([[0.0, 0.0], [0.3, 1.2]])
    rotations, positions = joint_poses(robot, q)
    for k, lift in enumerate(q[:, 0]):
        base, upper, lower = (
            (solids[link], (rotations[k, joint], positions[k, joint]))
            for joint, link in enumerate(("base", "upper", "lower"))
        )
        assert exact_distance(*base, *upper) == pytest.approx(0.3 + lift, abs=1e-6)
        assert exact_distance(*upper, *lower) == pytest.approx(0.1, abs=1e-6)
        assert not is_closer(*upper, *lower)
        assert is_closer(*upper, *lower, 0.101)
        assert exact_distance(*upper, *upper) == 0.0
        assert is_closer(*upper, *upper)


def test_capsules_of_solids_are_the_bodies_of_the_model(robot: go.Model) -> None:
    """In the frames of joints instead of links."""
    q = np.array([0.2, -0.7])
    rotations, positions = joint_poses(robot, q[None])
    bodies = {body.link: body for body in robot.bodies}
    for solid in link_solids(robot):
        (capsule,) = solid.capsules
        expected = bodies[solid.link]
        rotation, position = robot.frame_pose(solid.link, q)
        at_link = getattr(expected, "start", getattr(expected, "centre", None))
        found = rotations[0, solid.joint] @ np.array(capsule.start) + positions[0, solid.joint]
        assert_allclose(found, rotation @ np.array(at_link) + position, atol=1e-9)
        assert capsule.radius == pytest.approx(expected.radius, abs=1e-9)


def test_no_point_leaves_the_ball_of_reach(robot: go.Model, rng: np.random.Generator) -> None:
    moving = [each for each in link_solids(robot) if each.joint > 0]
    centre, radius = reach_bound(robot, moving)
    for q in rng.uniform(robot.lower, robot.upper, (50, robot.dof)):
        rotations, positions = joint_poses(robot, q[None])
        for each in moving:
            for capsule in each.capsules:
                for end in (capsule.start, capsule.end):
                    point = rotations[0, each.joint] @ np.array(end) + positions[0, each.joint]
                    assert np.linalg.norm(point - centre) <= radius
    assert radius < 2.0


def test_models_without_a_file_have_their_bodies() -> None:
    arm = go.human_arm()
    solids = {each.link for each in link_solids(arm)}
    assert solids == {body.link for body in arm.bodies}
    assert link_solids(replace(arm, shapes=())) == ()


@pytest.mark.slow
@needs_robots
def test_convex_meshes_have_the_same_distances_as_convex_bodies(rng: np.random.Generator) -> None:
    solids = {each.link: each for each in link_solids(go.load_model("talos-left-arm"))}
    one, other = solids["arm_left_2_link"], solids["arm_left_5_link"]
    assert all(
        type(fast).__name__ == "Convex" for each in (one, other) for fast, _ in each.fast_shapes
    )
    as_meshes = [replace(each) for each in (one, other)]
    for each in as_meshes:
        each.__dict__["fast_shapes"] = each.shapes
    here = np.eye(3), np.zeros(3)
    for _ in range(20):
        there = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=3)
        there[0][:, 0] *= np.linalg.det(there[0])
        expected = exact_distance(as_meshes[0], here, as_meshes[1], there)
        assert exact_distance(one, here, other, there) == pytest.approx(expected, abs=1e-6)
