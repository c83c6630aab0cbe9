"""Which poses are within reach, by how much others are not, and what mounting helps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.ocp.inverse_kinematics import nearest_configuration
from geodesic_ocp.ocp.pose_search import PoseSearch
from geodesic_ocp.retargeting.reachability import distances_beyond, reachability


@pytest.fixture(scope="module")
def poses(arm: go.Model) -> tuple[np.ndarray, np.ndarray]:
    """Poses of the arm in random configurations within its limits."""
    rng = np.random.default_rng(8)
    return arm.hand_pose(rng.uniform(arm.lower, arm.upper, (12, 7)))


def test_poses_of_the_arm_itself_are_within_reach(
    arm: go.Model, poses: tuple[np.ndarray, np.ndarray]
) -> None:
    found = reachability(arm, go.retargeting.align(arm), *poses)
    assert found.unreachable == ()
    assert found.advice == ""
    assert found.table().empty
    assert str(found) == "all 12 poses are within reach"
    assert reachability(arm, go.retargeting.align(arm), None, poses[1]).unreachable == ()


def test_positions_beyond_the_arm_are_missed_by_the_excess(arm: go.Model) -> None:
    """Forward and down, where the arm can be stretched, the nearest point is along the way."""
    aligned = go.retargeting.align(arm)
    toward = np.array([[0.0, 1.0, -1.0], [0.0, 1.0, -2.0]])
    toward /= np.linalg.norm(toward, axis=1)[:, None]
    positions = np.vstack([0.8 * aligned.length * toward[:1], 1.25 * aligned.length * toward])
    found = reachability(arm, aligned, None, positions, scale=1.2)
    assert [each.index for each in found.unreachable] == [1, 2]
    for each in found.unreachable:
        assert each.beyond == pytest.approx(0.25 * aligned.length)
        assert each.distance == pytest.approx(each.beyond, rel=1e-2)
        assert each.angle == 0.0
    assert_allclose(
        distances_beyond(aligned, positions), [0.0, *(0.25 * aligned.length,) * 2], atol=1e-12
    )
    assert "2 of 3 poses are out of reach of 'human right arm'" in found.advice
    assert "(2 farther from the shoulder than the arm is long)" in found.advice
    assert "then 3 of 3 are within reach" in found.advice
    assert [row[0] for row in rows_of_table(found.table())] == ["1", "2"]


@pytest.mark.slow
def test_errors_are_those_of_inverse_kinematics(
    arm: go.Model, poses: tuple[np.ndarray, np.ndarray]
) -> None:
    """Out of reach, the nearest pose is that of the package's search one by one."""
    rotations = poses[0][:4] @ Rotation.from_rotvec([0.0, 0.9, 0.0]).as_matrix()
    positions = 1.1 * poses[1][:4]
    found = reachability(arm, go.retargeting.align(arm), rotations, positions)
    assert found.unreachable
    for each in found.unreachable:
        given = arm, np.zeros(7), positions[each.index], rotations[each.index]
        q = nearest_configuration(PoseSearch.checked("test", *given), (1.0, 1.0))
        rotation, position = arm.hand_pose(q)
        angle = Rotation.from_matrix(rotation.T @ rotations[each.index]).magnitude()
        distance = np.linalg.norm(position - positions[each.index])
        assert np.hypot(each.distance, each.angle) == pytest.approx(
            np.hypot(distance, angle), rel=1e-2
        )


@pytest.mark.slow
def test_the_advised_mounting_does_what_is_said(
    arm: go.Model, poses: tuple[np.ndarray, np.ndarray]
) -> None:
    """Poses mapped with a shoulder that is 0.15 m off are brought back."""
    aligned = go.retargeting.align(arm)
    off = replace(aligned, shoulder=(0.0, 0.15, 0.0))
    rotations, positions = off.to_robot(*aligned.to_person(*poses), scale=1.0)
    found = reachability(arm, off, rotations, positions)
    assert found.mounting is not None
    assert found.helped > 12 - len(found.unreachable)
    moved = found.mounting.poses(*off.to_person(rotations, positions))
    again = reachability(arm, found.mounting.alignment, *moved)
    assert 12 - len(again.unreachable) == found.helped
    assert f"then {found.helped} of 12" in found.advice


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"positions": np.zeros(3)}, r"positions must have shape \(k, 3\)"),
        ({"positions": np.full((1, 3), np.nan)}, "positions must be finite"),
        ({"rotations": np.eye(3)}, r"rotations must have shape \(1, 3, 3\)"),
        ({"alignment": "panda"}, "alignment must be an Alignment, got 'panda'"),
        ({"scale": 0.0}, "scale must be positive"),
    ],
)
def test_wrong_arguments_are_named(arm: go.Model, change: dict[str, Any], message: str) -> None:
    given = {
        "alignment": go.retargeting.align(arm),
        "rotations": None,
        "positions": np.zeros((1, 3)),
        **change,
    }
    with pytest.raises(ValueError, match=message):
        reachability(arm, **given)
