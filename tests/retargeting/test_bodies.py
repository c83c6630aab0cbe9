"""Bodies: several hands of one robot with a waist that they share, in one program."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose
from small_retargeting import small_analysis

import geodesic_ocp as go
from geodesic_ocp.execution.limits import joint_limits
from geodesic_ocp.ocp.pose_search import search_each, step_terms
from geodesic_ocp.retargeting.arm_alignment import Alignment

HANDS = ("right hand", "left hand")


MASSES = {"waist": 1.3, "upper": 1.1, "fore": 1.0, "hand": 0.9}  # [kg]


def _link(name: str, length: float) -> str:
    mass = MASSES[name.split()[-1]]
    return (
        f'<link name="{name}"><inertial><origin xyz="0 {length / 2} 0"/><mass value="{mass}"/>'
        '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>'
    )


def _joint(parent: str, child: str, place: str) -> str:
    return (
        f'<joint name="{child} joint" type="revolute"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{place}"/><axis xyz="0 0 1"/>'
        '<limit lower="-2.5" upper="2.5" effort="60" velocity="4"/></joint>'
    )


def planar_body(name: str) -> go.Model:
    """A waist and two arms of three joints each, all in one plane, without gravity in it."""
    parts = ['<link name="base"/>', _link("waist", 0.2), _joint("base", "waist", "0 0 0")]
    for side, x in (("right", 0.2), ("left", -0.2)):
        chain = [("upper", f"{x} 0.1 0"), ("fore", "0 0.3 0"), ("hand", "0 0.3 0")]
        parent = "waist"
        for part, place in chain:
            parts += [_link(f"{side} {part}", 0.2), _joint(parent, f"{side} {part}", place)]
            parent = f"{side} {part}"
    text = f'<robot name="{name}">{"".join(parts)}</robot>'
    return go.load_model(text, hand=HANDS)


def alignments(body: go.Model) -> list[Alignment]:
    names = [(f"{side} fore joint", f"{side} hand joint") for side in ("right", "left")]
    places = ((0.2, 0.1, 0.0), (-0.2, 0.1, 0.0))
    sides = ("right", "left")
    return [
        Alignment(place, np.eye(3), np.eye(3), 0.6, side, *joints)
        for place, side, joints in zip(places, sides, names, strict=True)
    ]


def test_joints_of_a_body_are_those_before_any_of_its_hands() -> None:
    body = planar_body("body")
    assert (body.dof, body.hands, body.shared_joints) == (7, HANDS, ("waist joint",))


def test_one_configuration_has_the_poses_of_both_hands() -> None:
    """The search meets poses that differ from those of each hand alone: the waist is shared."""
    body, rng = planar_body("body"), np.random.default_rng(0)
    for _ in range(3):
        q = rng.uniform(-1.0, 1.0, body.dof)
        rotation, position = body.stacked_poses(HANDS, q)
        near = q + rng.normal(0.0, 0.1, body.dof)
        terms = step_terms(body, tuple(range(12)), HANDS)
        p = np.concatenate([position, rotation.ravel(order="F"), np.eye(3).ravel()])
        bounds = body.lower, body.upper
        (found,), errors = search_each(terms, p[None], near[None, None], bounds, np.ones(12))
        assert np.abs(errors).max() < 1e-9
        for hand in HANDS:
            one = body.with_hand(hand)
            for part, wanted in zip(one.hand_pose(found[0]), one.hand_pose(q), strict=True):
                assert_allclose(part, wanted, atol=1e-8)


@pytest.fixture(scope="module")
def analysis() -> go.synergies.Analysis:
    """A person who turns the waist and reaches with both arms."""
    person = planar_body("person")
    time = np.linspace(0.0, 2.0, 81)
    begin = np.array([0.0, -0.4, 0.9, 0.2, 0.4, -0.9, -0.2])
    end = np.array([0.6, 0.3, 0.4, 0.5, 0.9, -0.5, 0.3])
    smooth = (time / 2.0) ** 2 * (3.0 - time)
    motion = go.Motion(time, begin + smooth[:, None] * (end - begin), person.joint_names)
    return go.analyse(person, motion.filtered())


@pytest.fixture(scope="module")
def result(analysis: go.synergies.Analysis) -> go.retargeting.Retargeting:
    """On a body with another waist."""
    body = planar_body("body")
    limits = joint_limits(body, hand_speed=0.5)
    settings = go.retargeting.RetargetingSettings(
        exact=True, rotor_inertia=False, self_collision=False
    )
    given = alignments(body)
    return go.retarget(
        *(analysis, body),
        alignment=given,
        person_alignment=given,
        limits=limits,
        settings=settings,
    )


@pytest.mark.slow
def test_both_hands_pass_their_poses_on_one_trajectory(result: go.retargeting.Retargeting) -> None:
    """By Pinocchio, from the trajectory alone."""
    assert result.success, result.faults
    assert len(result.arms) == 2
    assert len(result.bodies) == len(result.planned.arms) == 1
    assert result.joint_names == result.arms[0].robot.joint_names
    model = result.arms[0].robot.pin
    data = model.createData()
    for arm in result.arms:
        frame = model.getFrameId(arm.robot.hand)
        recorded = arm.analysis.motion.time[[arm.groups[0].start, arm.groups[-1].stop]]
        for time, sample in zip(result.planned.robot_time(recorded), (0, -1), strict=True):
            q = result.planned.states([time])[0][0]
            pin.framesForwardKinematics(model, data, q)
            assert_allclose(data.oMf[frame].translation, arm.target_poses[1][sample], atol=2e-3)
            assert_allclose(data.oMf[frame].rotation, arm.target_poses[0][sample], atol=5e-3)


@pytest.mark.slow
def test_a_displaced_body_is_found_again(analysis: go.synergies.Analysis) -> None:
    """Its base moves both hands' poses by one rigid motion."""
    body = planar_body("body")
    given = alignments(body)
    planted = [replace(each, shoulder=np.add(each.shoulder, (0.2, 0.25, 0.0))) for each in given]
    found = go.retargeting.place_base(
        *(body, analysis),
        alignment=planted,
        person_alignment=given,
        settings=go.retargeting.RetargetingSettings(rotor_inertia=False, self_collision=False),
        height=(0.0, 0.0),
    )
    assert found.reached == found.count > found.reached_before
    # Where the poses are those of the same body, and so are its waist and elbows.
    for each, before in zip(found.alignments, given, strict=True):
        assert_allclose(each.shoulder, before.shoulder, atol=0.01)
        assert_allclose(each.base, before.base, atol=0.02)
    assert found.yaw == pytest.approx(0.0, abs=0.02)
    assert found.cost < found.cost_before


@pytest.mark.slow
def test_the_waist_turns_as_the_persons(result: go.retargeting.Retargeting) -> None:
    """Equal bodies have the same configurations, by the likeness of waist and elbows."""
    arm = result.bodies[0]
    assert_allclose(arm.motion.q[-1], arm.analysis.motion.q[-1], atol=0.05)


@pytest.mark.slow
def test_a_limit_of_the_hands_speed_is_for_every_hand(result: go.retargeting.Retargeting) -> None:
    q, v, _, _ = result.planned.states(np.linspace(0.0, result.planned.duration, 400))
    speeds = [
        np.linalg.norm(
            np.einsum("kij,kj->ki", [arm.robot.hand_jacobian(each)[:3] for each in q], v), axis=1
        ).max()
        for arm in result.arms
    ]
    assert max(speeds) <= 0.5 * (1.0 + 1e-6)
    assert max(speeds) > 0.45  # the limit takes time
    assert result.stretch > 1.0


def test_hands_must_correspond() -> None:
    with pytest.raises(ValueError, match="analyse as many"):
        go.retarget(small_analysis(), planar_body("body"))
