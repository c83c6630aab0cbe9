"""Joint inertias that URDF, MJCF and SRDF files state."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from gadget import MIMIC, urdf
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.model.formats.robots import ROBOTS, folder
from geodesic_ocp.model.formats.urdf import srdf_armature

DRAKE = (
    '<transmission name="t{joint}" xmlns:drake="http://drake.mit.edu"><joint name="{joint}"/>'
    '<actuator name="m">{actuator}</actuator></transmission></robot>'
)


def with_transmission(text: str, joint: str, actuator: str) -> str:
    return text.replace("</robot>", DRAKE.format(joint=joint, actuator=actuator))


def with_dynamics(text: str, joint: str, attributes: str) -> str:
    head, tail = text.split(f'<joint name="{joint}"', 1)
    return f'{head}<joint name="{joint}"' + tail.replace(
        "<limit", f"<dynamics {attributes}/><limit", 1
    )


def test_rotor_inertia_counts_with_the_square_of_the_gear_ratio() -> None:
    rotor = '<drake:rotor_inertia value="2e-4"/><drake:gear_ratio value="50"/>'
    text = with_transmission(urdf(), "j_two", rotor)
    text = with_transmission(text, "j_one", '<drake:rotor_inertia value="0.3"/>')
    ungeared = "<mechanicalReduction>100</mechanicalReduction>"  # without a rotor inertia
    text = with_transmission(text, "j_lift", ungeared)
    geared, bare = go.load_model(text, hand="grip"), go.load_model(urdf(), hand="grip")
    expected = {"j_lift": 0.0, "j_one": 0.3, "j_two": 0.5, "j_three": 0.0}
    assert dict(zip(geared.joint_names, geared.armature.tolist(), strict=True)) == expected
    inertia = "joint inertia 0 to 0.5 kg and kg m^2"
    assert f"{inertia} from the file)" in repr(geared)
    assert f"{inertia})" in repr(geared.with_armature(geared.armature))
    assert "inertia" not in repr(bare)
    assert geared.continuous == ("j_two",)  # which Pinocchio stores with two coordinates
    q = [0.3, 0.2, 0.3, 0.4]
    difference = geared.mass_matrix(q) - bare.mass_matrix(q)
    assert_allclose(difference, np.diag(list(expected.values())), rtol=0, atol=1e-12)


def test_armature_of_a_joint_counts_once() -> None:
    """It is the sum of what its motor reflects, so a transmission does not add to it."""
    text = with_dynamics(urdf(), "j_three", 'damping="0.1" armature="0.7"')
    assert go.load_model(text, hand="grip").armature.tolist() == [0.0, 0.0, 0.0, 0.7]
    text = with_transmission(text, "j_three", '<drake:rotor_inertia value="9"/>')
    assert go.load_model(text, hand="grip").armature.tolist() == [0.0, 0.0, 0.0, 0.7]


def test_locked_joints_and_followers_leave_none_behind() -> None:
    text = with_dynamics(urdf(right_mimic=MIMIC), "j_right", 'armature="0.7"')
    text = with_dynamics(with_dynamics(text, "j_left", 'armature="0.9"'), "j_one", 'armature="2"')
    model = go.load_model(text, hand="grip", configuration={"j_left": 0.4})
    assert model.armature.tolist() == [0.0, 2.0, 0.0, 0.0]
    one = go.load_model(text, hand="grip", joints=["j_two", "j_one"])
    assert one.armature.tolist() == [2.0, 0.0]


@pytest.mark.parametrize("value", ["-1", "nan", "inf", "much"])
def test_wrong_values_in_a_urdf_are_named(value: str) -> None:
    named = f"armature must be a finite number >= 0, is '{value}'"
    with pytest.raises(ValueError, match=f"joint 'j_one': {named}"):
        go.load_model(with_dynamics(urdf(), "j_one", f'armature="{value}"'), hand="grip")
    rotor = f'<drake:rotor_inertia value="1"/><drake:gear_ratio value="{value}"/>'
    with pytest.raises(ValueError, match="the actuator of joint 'j_one': gear_ratio must be"):
        go.load_model(with_transmission(urdf(), "j_one", rotor), hand="grip")


def test_armature_of_default_classes_in_mjcf() -> None:
    """Two joints of one body, an inherited class, and a value of the joint's own."""
    text = """
    <mujoco><compiler angle="radian"/>
      <default><joint armature="0.1"/>
        <default class="wrist"><joint armature="0.02"/></default>
      </default>
      <worldbody><body name="upper">
        <joint name="a" axis="0 1 0" range="-1 1"/><joint name="b" axis="1 0 0" range="-1 1"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 0.5" mass="1"/>
        <body name="hand" pos="0 0 0.5" childclass="wrist">
          <joint name="c" axis="0 1 0" range="-1 1"/>
          <joint name="d" axis="1 0 0" range="-1 1" armature="0.3"/>
          <geom type="capsule" size="0.02" fromto="0 0 0 0 0 0.2" mass="0.5"/>
          <site name="tip" pos="0 0 0.2"/>
        </body>
      </body></worldbody>
    </mujoco>"""
    assert go.load_model(text, hand="tip").armature.tolist() == [0.1, 0.1, 0.02, 0.3]


SRDF = """<robot name="{name}"><rotor_params>
  <joint name="j_one" mass="1e-4" gear_ratio="50."/><joint name="j_gone" mass="1" gear_ratio="1"/>
  <joint name="j_two" mass="0.0" gear_ratio="0.0"/>
</rotor_params></robot>"""


def test_only_an_srdf_for_the_robot_is_read(tmp_path: Path) -> None:
    for part in ("urdf", "srdf"):
        (tmp_path / part).mkdir()
    file = tmp_path / "urdf" / "gadget.urdf"
    file.write_text(urdf())
    assert srdf_armature(file) == {}
    (tmp_path / "srdf" / "another.srdf").write_text(SRDF.format(name="another"))
    (tmp_path / "srdf" / "broken.srdf").write_text("<robot")
    assert srdf_armature(file) == {}
    (tmp_path / "srdf" / "gadget.srdf").write_text(SRDF.format(name="gadget"))
    found = srdf_armature(file)
    assert found == pytest.approx({"j_one": 0.25, "j_gone": 1.0, "j_two": 0.0})
    (tmp_path / "srdf" / "gadget.srdf").write_text(SRDF.format(name="gadget").replace("1e-4", "x"))
    with pytest.raises(
        ValueError, match="rotor_params of joint 'j_one': mass must be a finite num"
    ):
        srdf_armature(file)
    shutil.rmtree(tmp_path / "srdf")
    assert srdf_armature(file) == {}


def test_known_robots_carry_what_their_files_state() -> None:
    """Talos' SRDF has rotors of 1e-5 kg m^2 behind gears of 100; the other files have none."""
    if (root := folder("example-robot-data")) is None:
        pytest.skip("example-robot-data is not installed (make robots)")
    srdf = root / "talos_data" / "srdf" / "talos.srdf"
    for side in ("left", "right"):
        model = go.load_model(f"talos-{side}-arm")
        native = pin.buildModelFromUrdf(str(root / ROBOTS["talos-left-arm"].file))
        assert pin.loadRotorParameters(native, str(srdf), False)
        reflected = native.rotorInertia * native.rotorGearRatio**2
        joints = [native.joints[native.getJointId(name)].idx_v for name in model.joint_names]
        assert_allclose(model.armature, reflected[joints], rtol=1e-15)
        assert_allclose(model.armature, 0.1, rtol=1e-15)
    for name in ("panda", "ur5", "xarm7", "tiago-pro-left-arm"):
        assert not go.load_model(name).armature.any()
