"""URDF: repairs, mimic joints, invalid values and encodings."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from gadget import MIMIC, OTHER, urdf
from numpy.testing import assert_allclose

import geodesic_ocp as go


def test_commas_in_vectors_are_repaired_with_a_warning() -> None:
    faulty = urdf(two_origin='rpy="0.1, 0.2 0.3" xyz="0.1 0.2 0.3"')
    line = next(i for i, text in enumerate(faulty.splitlines(), 1) if "0.1, 0.2" in text)
    with pytest.warns(
        UserWarning, match=rf'the text, line {line}: the comma in rpy="0.1, 0.2'
    ) as warned:
        model = go.load_model(faulty, hand="grip")
    assert len(warned) == 1
    assert warned[0].filename == __file__
    q = [0.3, 0.2, 0.3, 0.4]
    expected = go.load_model(urdf(), hand="grip").mass_matrix(q)
    assert np.array_equal(model.mass_matrix(q), expected)


def test_a_locked_mimic_joint_takes_the_value_of_its_leader() -> None:
    mimicking = go.load_model(urdf(right_mimic=MIMIC), hand="grip", configuration={"j_left": 0.4})
    configuration = {"j_left": 0.4, "j_right": -0.7}
    wide = urdf().replace('lower="0.2"', 'lower="-3"')
    alone = go.load_model(wide, hand="grip", configuration=configuration | {"j_beside": 0.2})
    q = [0.1, 0.2, 0.3, 0.4]
    assert_allclose(mimicking.mass_matrix(q), alone.mass_matrix(q), rtol=0, atol=1e-15)


def test_mimic_joints_may_mimic_each_other() -> None:
    """j_beside mimics j_right, which mimics j_left."""
    second = '<mimic joint="j_right" multiplier="0.5"/>'
    chained = urdf(right_mimic=MIMIC, beside_mimic=second)
    model = go.load_model(chained, hand="grip", configuration={"j_left": 0.4})
    configuration = {"j_left": 0.4, "j_right": -0.7, "j_beside": -0.35}
    wide = urdf().replace('lower="0.2"', 'lower="-3"')
    alone = go.load_model(wide, hand="grip", configuration=configuration)
    q = [0.1, 0.2, 0.3, 0.4]
    assert_allclose(model.mass_matrix(q), alone.mass_matrix(q), rtol=0, atol=1e-15)
    circle = urdf(left_mimic=OTHER, right_mimic=MIMIC)
    with pytest.raises(ValueError, match="joints mimic each other"):
        go.load_model(circle, hand="grip")
    lost = urdf(left_mimic=OTHER.replace("j_right", "j_gone"))
    with pytest.warns(
        UserWarning, match="joint 'j_left' mimics 'j_gone', which is not a moving joint"
    ):
        go.load_model(lost, hand="grip")


def test_mimic_joints_of_a_pin_model_are_rejected() -> None:
    native = pin.buildModelFromXML(urdf(right_mimic=MIMIC), mimic=True)
    with pytest.raises(ValueError, match=r"'j_right' of the pin\.Model is a JointModelMimic"):
        go.load_model(native, hand="grip")


def rod(parent: str, child: str) -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="rod" type="fixed">{ends}</joint>'


RING = (
    '<link name="left half"/><link name="right half"/>'
    + rod("left half", "right half")
    + rod("right half", "left half").replace("rod", "other rod")
)
LIMIT = re.compile("<limit [^>]*>")
MOMENTS = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'


def inertial(moment: str, origin: str = "") -> str:
    moments = MOMENTS.replace('ixx="1"', f'ixx="{moment}"')
    return f'<inertial>{origin}<mass value="1"/>{moments}</inertial>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (urdf().replace('lower="0.2"', 'lower="2"'), "j_lift': its lower limit 2 lies above"),
        (urdf().replace('axis xyz="0 1 0"', 'axis xyz="0 0 0"'), "'j_lift': its axis is zero"),
        (LIMIT.sub("", urdf()), "joint 'j_lift' is prismatic and has no <limit>"),
        (urdf().replace(' name="gadget"', ""), "<robot> has no name"),
        *(
            (urdf().replace('mass value="2"', f'mass value="{value}"'), f"value is '{value}', not")
            for value in ("two", "nan")
        ),
        (urdf(beside_inertial=f"<inertial>{MOMENTS}</inertial>"), "<inertial> has no <mass>"),
        (urdf(beside_inertial=inertial("0,2")), "link 'beside': <inertia>: ixx is '0,2', not a"),
        (urdf(beside_inertial=inertial("1").replace('ixy="0"', "")), "<inertia> has no ixy"),
        (
            urdf(beside_inertial=inertial("1", '<origin xyz="0 ${y} 0"/>')),
            r"'beside': <inertial>: xyz is '0 \$\{y\} 0', not three numbers",
        ),
        (urdf(two_origin='xyz="0,5 0"'), r'line \d+: xyz="0,5 0" is not three numbers'),
        (
            "<robot name='a'><link name='b'/><link name='c'/></robot>",
            "2 links have no parent, and one must be: 'b', 'c'",
        ),
        (
            urdf().replace("</robot>", f"{rod('one', 'three')}</robot>"),
            "link 'three' has 2 parents, by the joints 'j_three' and 'rod': closed chains",
        ),
        (
            urdf().replace('<link name="base"/>', f'<link name="base"/>{rod("three", "base")}'),
            "links 'base', 'lift', 'one', .* form a closed chain without a root",
        ),
        (
            urdf().replace("</robot>", f"{RING}</robot>"),
            "links 'left half', 'right half' form a closed chain without a root",
        ),
        (urdf().replace('link="two"', 'link="too"'), "'j_two' has the child 'too', which is no"),
        (
            urdf().replace('effort="1"', 'effort="a"'),
            "joint 'j_lift': effort must be a finite number >= 0, is 'a'",
        ),
        (
            urdf().replace('velocity="1"', 'velocity="-1"'),
            "joint 'j_lift': velocity must be a finite number >= 0, is '-1'",
        ),
        (urdf().replace('link name="two"', 'link name="one"'), "2 links are named 'one'"),
    ],
)
def test_invalid_values_in_a_urdf_are_named(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.load_model(text, hand="grip")


UNLIMITED = (
    '<link name="mast"/><joint name="j_mast" type="prismatic"><parent link="base"/>'
    '<child link="mast"/><axis xyz="0 0 1"/></joint></robot>'
)


def test_a_joint_without_limits_that_does_not_move_is_locked() -> None:
    """The format requires <limit>, but what is locked has no use for it."""
    text = urdf().replace("</robot>", UNLIMITED)
    for names in ({}, {"joints": ["j_one", "j_two"]}, {"configuration": {"j_mast": 0.5}}):
        model = go.load_model(text, hand="grip", **names)
        assert "j_mast" not in model.joint_names
    with pytest.raises(ValueError, match="'j_mast' is prismatic and has no <limit>; give it one"):
        go.load_model(text, hand="mast")


def test_angles_of_placements_in_degrees_are_said() -> None:
    turned = urdf(two_origin='xyz="0 0 0.5" rpy="0 0 90"')
    with pytest.warns(UserWarning, match="joint 'j_two': rpy is '0 0 90' rad; are these degrees"):
        go.load_model(turned, hand="grip")


def test_what_the_parser_leaves_out_is_said(capfd: pytest.CaptureFixture[str]) -> None:
    """The parser in C++ says it on the standard error stream alone."""
    nameless = urdf().replace("</robot>", "<material/></robot>")
    with pytest.warns(UserWarning, match="the text: Material must contain a name attribute"):
        go.load_model(nameless, hand="grip")
    assert capfd.readouterr().err == ""
    shapeless = '<link name="two"><collision><geometry><box/></geometry></collision>'
    model = go.load_model(urdf().replace('<link name="two">', shapeless), hand="grip")
    with pytest.raises(ValueError, match="Box shape has no size attribute"):
        assert model.bodies


def test_missing_limits_cause_a_warning() -> None:
    text = urdf().replace('lower="0.2" upper="1" ', "")
    with pytest.warns(UserWarning, match="no range: its limits are") as warned:
        go.load_model(text, hand="grip")
    sentence = "the text: joint 'j_one' has no range: its limits are 0 and 0"
    assert sentence in [str(each.message) for each in warned]


def test_encodings_and_comments(tmp_path: Path) -> None:
    comment = '<!-- ünused: <origin rpy="1, 2 3"/> -->'
    text = f"<?xml version='1.0' encoding='latin-1'?>\n{comment}\n{urdf()}"
    expected = go.load_model(urdf(), hand="grip").mass_matrix([0.3, 0.1, 0.2, 0.4])
    file = tmp_path / "gadget.urdf"
    for encoding, content in (
        ("latin-1", text),
        ("utf-16", text.replace("latin-1", "utf-16")),
        ("utf-8-sig", comment + urdf()),
    ):
        file.write_bytes(content.encode(encoding))
        model = go.load_model(file, hand="grip")  # a warning would be an error here
        assert np.array_equal(model.mass_matrix([0.3, 0.1, 0.2, 0.4]), expected)
    assert go.load_model("\ufeff" + text, hand="grip").dof == 4
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="cannot be read"):
        go.load_model(file, hand="grip")
