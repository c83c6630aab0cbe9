"""Robots whose files can hardly be right say so: in a warning, their repr and the command line."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from installed_robots import known_robot
from six_joints import six_joints

import geodesic_ocp as go
from geodesic_ocp.model.doubts import doubts_of
from geodesic_ocp.model.formats.robots import ROBOTS

LIMIT = '<limit lower="-2.8" upper="2.8" velocity="3" effort="80"/>'
INERTIA = 'ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"'


def equal_masses() -> str:
    text = six_joints()
    for number in range(6):
        text = text.replace(f'<mass value="{3.0 - 0.4 * number}"/>', '<mass value="1"/>')
    return text


def in_grams() -> str:
    """Masses and moments a thousand times as large, as where both are in grams."""
    text = six_joints().replace(INERTIA, 'ixx="20" ixy="0" ixz="0" iyy="20" iyz="0" izz="10"')
    for number in range(6):
        mass = 3.0 - 0.4 * number
        text = text.replace(f'<mass value="{mass}"/>', f'<mass value="{1000.0 * mass}"/>')
    return text


FAULTS = {
    "a large moment": (
        six_joints().replace('izz="0.01"', 'izz="0.2"', 1),
        r"link 'pan_link': no rigid body has .* \(3 kg, moments 0.02, 0.02, 0.2 kg m\^2\)",
    ),
    "grams": (in_grams(), "link 'pan_link' and 5 others: no material is as dense .* in grams"),
    "kg mm^2": (
        six_joints().replace(INERTIA, 'ixx="2e4" ixy="0" ixz="0" iyy="2e4" iyz="0" izz="1e4"'),
        "link 'pan_link' and 5 others: such large moments .* 2e\\+04 kg m.* in kg cm.* or kg mm",
    ),
    "radians as degrees": (
        six_joints().replace("2.8", f"{np.deg2rad(2.8):.4f}"),
        "joint 'pan' and 5 others: limits of -0.0489 to 0.0489 rad; were radians read as degrees",
    ),
    "placeholders": (equal_masses(), "6 of 6 links weigh 1 kg each; is this a placeholder"),
    "degrees": (
        six_joints().replace("2.8", "170"),
        "joint 'pan' and 5 others: limits of -170 to 170 rad; are these degrees",
    ),
    "degrees per second": (
        six_joints().replace('velocity="3"', 'velocity="120"'),
        "joint 'pan' and 5 others: a limit of 120 rad/s, 19.1 turns per second; are these",
    ),
    "no speed": (
        six_joints().replace('velocity="3"', 'velocity="0"'),
        "joint 'pan' and 5 others: no limit on speed is known",
    ),
    "no effort": (
        six_joints().replace(' effort="80"', ""),
        "joint 'pan' and 5 others: no limit on effort is known, as it is 0 or left out",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_said_once_and_kept(fault: str) -> None:
    text, sentence = FAULTS[fault]
    with pytest.warns(UserWarning, match=f"six-joints: {sentence}") as found:
        model = go.load_model(text, hand="flange")
    assert len(found) == 1
    assert len(model.doubts) == 1
    assert f"doubts: {model.doubts[0]}" in repr(model)
    assert model.doubts[0] in model._repr_markdown_()


def test_a_model_that_is_right_has_no_doubts() -> None:
    """Neither a sound file, nor a person, nor one whose limits have been put right."""
    assert go.load_model(six_joints(), hand="flange").doubts == ()
    assert "doubts" not in repr(go.human_arm())
    assert go.human_arm("left", table="de_leva", sex="female").doubts == ()
    with pytest.warns(UserWarning, match="are these degrees"):
        wrong = go.load_model(FAULTS["degrees"][0], hand="flange")
    assert wrong.with_limits(np.deg2rad(wrong.lower), np.deg2rad(wrong.upper)).doubts == ()


def test_moments_of_solids_are_possible_as_long_as_digits_are_rounded() -> None:
    """A thin plate has c = a + b, a rod a = 0; rounded to three digits they may be beyond it."""
    for moments in ((0.0101, 0.0102, 0.0204), (1e-9, 0.0335, 0.0336)):
        assert doubts_of(single(2.0, moments)) == ()
    assert "no rigid body" in doubts_of(single(2.0, (0.01, 0.01, 0.021)))[0]


def test_solids_of_the_densest_materials_are_possible() -> None:
    """A ball of radius r has moments 2/5 m r^2; lead has 11,340 kg/m^3, osmium 22,590."""
    radius = 0.03
    for density, is_possible in ((11_340.0, True), (22_000.0, True), (30_000.0, False)):
        mass = 4.0 / 3.0 * np.pi * density * radius**3
        assert (doubts_of(single(mass, [0.4 * mass * radius**2] * 3)) == ()) is is_possible


@pytest.mark.parametrize("density", [30.0, 500.0, 2700.0, 7800.0])
def test_moments_of_solids_are_taken_for_other_units_in_these_alone(density: float) -> None:
    """A ball, and a rod of 3 m and 1 cm across, from foam to steel."""
    mass = 4.0 / 3.0 * np.pi * density * 0.1**3
    ball = np.full(3, 0.4 * mass * 0.1**2)
    light = np.pi * density * 0.005**2 * 3.0
    rod = light * np.array([0.005**2 / 2.0, 3.0**2 / 12.0, 3.0**2 / 12.0])
    for weight, moments in ((mass, ball), (light, rod)):
        assert doubts_of(single(weight, moments)) == ()
        for factor in (1e4, 1e6, 1e9):  # kg cm^2, kg mm^2, g mm^2
            assert "such large moments" in doubts_of(single(weight, factor * moments))[0]


def test_one_narrow_joint_is_no_doubt() -> None:
    first = six_joints().replace("2.8", "0.1", 2)
    assert go.load_model(first, hand="flange").doubts == ()


def single(mass: float, moments: object) -> pin.Model:
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "hinge")
    body = pin.Inertia(mass, np.zeros(3), np.diag(np.asarray(moments)))
    model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    return model


@pytest.mark.parametrize("name", ROBOTS)
def test_robots_known_by_name_are_sound(name: str) -> None:
    assert known_robot(name).doubts == ()


def test_robots_of_packages_with_faults_say_so() -> None:
    """The moments of the right arm of romeo_small; the fastest of the solo12's are placeholders."""
    known_robot("panda")  # where the robots are installed
    with pytest.warns(UserWarning, match="'RShoulderYawLink' and 1 other: no rigid body has mome"):
        go.load_model("romeo_small", hand="r_wrist", base="torso")
    with pytest.warns(UserWarning, match="1000 rad/s, 159 turns per second; are these degrees, or"):
        go.load_model("solo12", hand="FL_LOWER_LEG")
