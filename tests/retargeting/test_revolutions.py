"""Continuous joints of a robot turn the shorter way between the poses of a person's hand."""

from __future__ import annotations

import numpy as np
import pytest
from small_retargeting import small_analysis

import geodesic_ocp as go
from geodesic_ocp.retargeting.revolutions import periods, shorter_way, unwrapped

TURN = 2.0 * np.pi


def robot(zero: float) -> go.Model:
    """Six joints, of which the first, the fourth and the last are continuous; the zero of the first
    one is turned [rad].
    """
    axes = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1")
    lengths = (0.15, 0.1, 0.3, 0.2, 0.2, 0.1)
    parts, parent = ['<robot name="six joints"><link name="base"/>'], "base"
    for number, (axis, length) in enumerate(zip(axes, lengths, strict=True), start=1):
        turns = number in (1, 4, 6)
        limit = "" if turns else '<limit lower="-2.5" upper="2.5" effort="40" velocity="2"/>'
        parts.append(
            f'<link name="link{number}"><inertial><origin xyz="0 0 0.08"/>'
            f'<mass value="{3.2 / number}"/><inertia ixx="{0.03 / number}" iyy="{0.03 / number}" '
            f'izz="{0.006 / number}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="joint{number}" type="{"continuous" if turns else "revolute"}">'
            f'<parent link="{parent}"/><child link="link{number}"/><axis xyz="{axis}"/>'
            f'<origin xyz="0 0 {length}" rpy="0 0 {zero if number == 1 else 0.0}"/>{limit}</joint>'
        )
        parent = f"link{number}"
    parts.append(
        f'<link name="tool"/><joint name="flange" type="fixed"><parent link="{parent}"/>'
        '<child link="tool"/><origin xyz="0 0 0.08"/></joint></robot>'
    )
    return go.load_model("".join(parts), hand="tool")


@pytest.mark.slow
@pytest.mark.parametrize("zero", [np.pi / 2.0, np.pi])
def test_the_zero_of_a_continuous_joint_does_not_matter(zero: float) -> None:
    """The person's motion passes half a revolution of one of them."""
    settings = go.retargeting.RetargetingSettings(speed_limits=False)
    actions, ranges = [], []
    for arm in (robot(0.0), robot(zero)):
        aligned = go.retargeting.propose_alignment(arm)
        result = go.retarget(
            small_analysis(), arm, alignment=aligned, tolerance=1e-4, settings=settings
        )
        q = np.vstack([path.nodes for path in result.paths.paths[0]])
        actions.append(result.paths.action)
        ranges.append(np.ptp(q, axis=0))
        assert np.abs(q).max() < 1.5 * np.pi
    assert actions[1] == pytest.approx(actions[0], rel=2e-3)
    assert ranges[1] == pytest.approx(ranges[0], abs=0.05)


def test_joints_turn_the_shorter_way_within_their_limits() -> None:
    period = np.array([TURN, TURN, np.inf])
    q = np.array([[3.0, 3.0, 3.0], [-3.0, -3.0, -3.0], [-2.0, -3.0, 0.0]])
    wide, narrow = np.full(3, TURN), np.array([TURN, 3.2, 3.2])
    found = unwrapped(q, period, (-wide, wide), np.zeros(3))
    assert found[:, 0] == pytest.approx([3.0 - TURN, -3.0, -2.0])  # nearer to the middle
    assert found[:, 1] == pytest.approx([3.0, TURN - 3.0, TURN - 3.0])
    assert np.array_equal(found[:, 2], q[:, 2])
    assert np.array_equal(unwrapped(q, period, (-narrow, narrow), np.zeros(3))[:, 1], q[:, 1])
    given = unwrapped(q, period, (-wide, wide), None)
    assert np.array_equal(given[0], q[0])
    assert given[:, 0] == pytest.approx([3.0, TURN - 3.0, TURN - 2.0])
    assert shorter_way(np.array([[6.0, -6.0, 6.0]]), period)[0] == pytest.approx(
        [6.0 - TURN, TURN - 6.0, 6.0]
    )


def test_only_continuous_joints_with_room_to_turn_have_a_period() -> None:
    arm = robot(0.0)
    assert np.array_equal(np.isfinite(periods(arm, True)), [True, False, False, True, False, True])
    narrow = arm.with_limits({"joint1": -2.0}, {"joint1": 2.0})
    assert not np.isfinite(periods(narrow, True)[0])
    assert np.isfinite(periods(narrow, False)[0])
