"""MJCF: features that both readers support, and rejection of those that Pinocchio would ignore."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from gadget import MJCF
from numpy.testing import assert_allclose

import geodesic_ocp as go


@pytest.mark.usefixtures("reader")
def test_mjcf_text_and_file(tmp_path: Path) -> None:
    model = go.load_model(MJCF, hand="tip", base="trunk")
    assert model.joint_names == ("a", "b")
    assert model.lower.tolist() == [-1.0, -1.0]
    file = tmp_path / "two.xml"
    file.write_text(MJCF, encoding="utf-8")
    again = go.load_model(file, hand="tip", joints=["a", "b"])
    q = [0.3, 0.1]
    assert_allclose(again.mass_matrix(q), model.mass_matrix(q), rtol=0, atol=1e-14)
    bare = go.load_model(MJCF.replace('armature="0.5"', ""), hand="tip", base="trunk")
    difference = model.mass_matrix(q) - bare.mass_matrix(q)
    assert_allclose(difference, np.diag([0.5, 0.0]), rtol=0, atol=1e-14)
    with pytest.raises(ValueError, match="'root' is a JointModelFreeFlyer"):
        go.load_model(MJCF, hand="tip")
    with pytest.raises(ValueError, match="'c2' mimics 'c1'"):
        go.load_model(MJCF, hand="f2", base="fore")
    with pytest.raises(ValueError, match=r"the text.* 'odd'"):
        go.load_model(
            "<mujoco><worldbody><body><joint type='odd'/></body></worldbody></mujoco>", hand="a"
        )


SHARED_NAMES = """
<mujoco>
  <worldbody>
    <body name="a"><joint name="a" range="-1 1"/><geom type="box" size=".1 .1 .1" mass="1"/>
      <body name="b" pos="0 0 1"><joint name="b" axis="1 0 0" range="-1 1"/>
        <geom type="box" size=".1 .1 .1" mass="1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.usefixtures("reader")
def test_a_joint_and_its_link_may_share_a_name() -> None:
    model = go.load_model(SHARED_NAMES, hand="b", joints=["b"])
    assert model.joint_names == ("b",)
    twice = go.model.combine(model, model, placements=[(0, 0, 0), (1, 0, 0)])
    assert twice.dof == 2
    place = twice.with_hand("the text 2/b").hand_pose([0.0, 0.5])[1]
    assert_allclose(place, model.hand_pose([0.5])[1] + [1.0, 0.0, 0.0], rtol=0, atol=1e-15)


def body(inside: str, before: str = "", after: str = "") -> str:
    """An MJCF with one body on a hinge named j."""
    hinge = "<joint name='j'/>" if "<joint" not in inside else ""
    world = f"<worldbody><body name='a'>{hinge}{inside}</body></worldbody>"
    return f"<mujoco>{before}{world}{after}</mujoco>"


def equal(how: str) -> str:
    return f"<equality><joint joint1='j' joint2='k' {how}/></equality>"


COUPLED = equal("active='false'").replace(" joint2='k'", "")
BALL = "<geom type='sphere' size='0.1' mass='1'/>"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            body("<geom type='mesh' mesh='m' mass='3'/>"),
            "the inertia of a mesh of body 'a', which has no <inertial>, is not supported w",
        ),
        (
            body(BALL + "<frame><body name='c'/></frame>"),
            "the text: <frame> is not supported without MuJoCo: pip install",
        ),
        (body(BALL, "<compiler settotalmass='3'/>"), "settotalmass of <compiler> is not supported"),
        (body(BALL + "<include file='more.xml'/>"), "includes 'more.xml', which only a file can"),
        (body(BALL, after=equal("polycoef='x'")), "joint 'j': polycoef must be numbers"),
        (body(BALL, after=equal("polycoef='0 0 1'")), "joint 'j' with 'k' is not linear"),
    ],
)
@pytest.mark.usefixtures("without_mujoco")
def test_unsupported_elements_are_named(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.load_model(text, hand="a")


@pytest.mark.usefixtures("reader")
def test_mjcf_includes_gravity_and_unlimited_hinges(tmp_path: Path) -> None:
    (tmp_path / "more.xml").write_text(f"<mujocoinclude>{BALL}</mujocoinclude>")
    text = body(BALL + "<include file='more.xml'/>", "<option gravity='0 0 -1'/>")
    (tmp_path / "main.xml").write_text(text)
    model = go.load_model(tmp_path / "main.xml", hand="a")
    assert model.mass == 2.0
    assert model.pin.gravity.linear.tolist() == [0.0, 0.0, -1.0]
    assert model.continuous == ("j",)
    assert model.upper == pytest.approx([2 * np.pi])
    free = body("<joint name='j' limited='false' range='-1 1'/>" + BALL)
    assert go.load_model(free, hand="a").continuous == ("j",)
    (tmp_path / "main.xml").write_text(body("<include file='none.xml'/>"))
    with pytest.raises(ValueError, match=r"main\.xml.* none\.xml|main\.xml.* 'none\.xml'"):
        go.load_model(tmp_path / "main.xml", hand="a")
    weld = body(BALL, after="<equality><weld body1='a' body2='world'/></equality>")
    with pytest.warns(UserWarning, match="the <weld> of a and world is ignored"):
        go.load_model(weld, hand="a")
    with pytest.warns(UserWarning, match="joint 'j' with a constant is ignored"):
        go.load_model(body(BALL, after="<equality><joint joint1='j'/></equality>"), hand="a")
    assert go.load_model(body(BALL, after=COUPLED), hand="a").dof == 1


@pytest.mark.usefixtures("reader")
def test_several_joints_of_a_body_are_separated(rng: np.random.Generator) -> None:
    """They are equivalent to the composite joint of Pinocchio."""
    several = (
        "<joint name='x' type='hinge' axis='1 0 0' pos='0 0.1 0' range='-60 60'/>"
        "<joint name='s' type='slide' axis='0 1 1' range='-1 1'/>"
        "<joint name='y' type='hinge' axis='0 1 0' pos='0.2 0 0' range='-60 60' armature='0.3'/>"
    )
    long = "<geom type='capsule' size='0.05' fromto='0.1 0 0 0.3 0.2 0.5' mass='2'/>"
    below = "<body name='b' pos='0 0 1'><joint name='z' range='-60 60'/>" + long + "</body>"
    turned = f"<body name='a' pos='1 0 0' euler='30 20 10'>{several + long + below}</body>"
    text = f"<mujoco><worldbody>{turned}</worldbody></mujoco>"
    model = go.load_model(text, hand="b")
    assert model.joint_names == ("x", "s", "y", "z")
    assert model.mass == 4.0
    assert go.load_model(text, hand="a").joint_names == ("x", "s", "y")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "composite.xml"
        file.write_text(text)
        native = pin.buildModelFromMJCF(str(file))
    data = native.createData()
    for q in rng.uniform(-1.0, 1.0, (4, 4)):
        upper = np.triu(pin.crba(native, data, q))
        expected = upper + np.triu(upper, 1).T
        assert_allclose(model.mass_matrix(q), expected, rtol=0, atol=1e-12)
        pin.framesForwardKinematics(native, data, q)
        place = data.oMf[native.getFrameId("b", pin.FrameType.BODY)]
        assert_allclose(model.hand_pose(q)[1], place.translation, rtol=0, atol=1e-13)
        assert_allclose(model.hand_pose(q)[0], place.rotation, rtol=0, atol=1e-13)


def text_of(bodies: str, before: str = "") -> str:
    return f"<mujoco>{before}<worldbody>{bodies}</worldbody></mujoco>"


BOX = '<geom type="box" size=".05 .2 .1" pos=".1 0 .2"/><site name="tcp" pos=".1 .2 .3"/>'
RADIAN = '<compiler angle="radian"/>'


@pytest.mark.usefixtures("reader")
def test_fixed_bodies_keep_their_poses() -> None:
    """An arm on a wall, beside a table; gravity has no moment about its vertical axis."""
    arm = f'<body name="arm"><joint name="p" axis="0 1 0"/>{BOX}</body>'
    table = f'<body name="table">{BALL}</body>'
    upright = "0.7071067811865476 0.7071067811865476 0 0"
    wall = f'<body name="wall" pos="0 0 1" quat="{upright}">{arm}</body>'
    model = go.load_model(text_of(table + wall), hand="tcp")
    assert model.potential_energy([1.0]) == pytest.approx(model.potential_energy([0.0]), rel=1e-12)
    assert_allclose(model.hand_pose([0.0])[1], [0.1, -0.3, 1.2], rtol=0, atol=1e-14)
    assert model.mass == pytest.approx(
        1000.0 * 8 * 0.05 * 0.2 * 0.1
    )  # density of water, MuJoCo's default


@pytest.mark.usefixtures("reader")
def test_axes_are_normalized() -> None:
    turned = f'<body name="a" axisangle="1 1 0 50"><joint name="j"/>{BOX}</body>'
    rotation, _ = go.load_model(text_of(turned), hand="tcp").hand_pose([0.0])
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-14)
    assert np.rad2deg(np.arccos((np.trace(rotation) - 1.0) / 2.0)) == pytest.approx(50.0)


@pytest.mark.parametrize("compiler", ["", RADIAN])
@pytest.mark.usefixtures("reader")
def test_ranges_of_prismatic_joints_are_in_metres(compiler: str) -> None:
    slide = f'<body name="a"><joint name="j" type="slide" range="0 0.1"/>{BOX}</body>'
    assert go.load_model(text_of(slide, compiler), hand="tcp").upper == pytest.approx([0.1])
    hinge = slide.replace("slide", "hinge").replace("0.1", "0.1" if compiler else "5.729577951308")
    assert go.load_model(text_of(hinge, compiler), hand="tcp").upper == pytest.approx([0.1])


@pytest.mark.usefixtures("reader")
def test_default_classes_are_inherited() -> None:
    defaults = (
        '<default><geom mass="0.7"/><default class="free"><joint limited="false" axis="0 1 0"/>'
        '<default class="light"><geom mass="0.2"/></default></default></default>'
    )
    one = f'<body name="a"><joint name="j" class="free" range="-1 1"/>{BOX}</body>'
    model = go.load_model(text_of(one, defaults), hand="tcp")
    assert model.mass == pytest.approx(0.7)
    assert model.continuous == ("j",)
    light = f'<body name="a" childclass="light"><joint name="j"/>{BOX}</body>'
    model = go.load_model(text_of(light, defaults), hand="tcp")
    assert model.mass == pytest.approx(0.2)
    assert model.hand_pose([0.3])[0][1, 1] == 1.0  # about y
    with pytest.raises(ValueError, match=r"the text.* unknown .*class.* 'none'"):
        go.load_model(text_of(one.replace("free", "none"), defaults), hand="tcp")


@pytest.mark.usefixtures("reader")
def test_scenes_may_include_robots(tmp_path: Path) -> None:
    robot = text_of(f'<body name="a"><joint name="j" axis="0 1 0"/>{BOX}</body>', RADIAN)
    (tmp_path / "robot.xml").write_text(robot)
    floor = '<worldbody><geom type="plane" size="1 1 1"/><light/></worldbody>'
    for scene in (f'<include file="robot.xml"/>{floor}', f'{floor}<include file="robot.xml"/>'):
        (tmp_path / "scene.xml").write_text(f"<mujoco>{scene}</mujoco>")
        model = go.load_model(tmp_path / "scene.xml", hand="tcp")
        assert model.joint_names == ("j",)
        assert model.mass == pytest.approx(8.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (text_of(BALL), "has no <body>"),
        (body(BALL + "<replicate count='3'/>"), "<replicate> is not supported"),
        (body(BALL, "<compiler inertiagrouprange='1 2'/>"), "inertiagrouprange of <compiler>"),
        (
            body(
                BALL + "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>",
                "<compiler inertiafromgeom='true'/>",
            ),
            "inertiafromgeom in place of given <inertial>s",
        ),
        (body(BALL, "<compiler eulerseq='XYZ'/>"), "eulerseq with capitals"),
        (body(BALL, "<compiler coordinate='global'/>"), "coordinate of <compiler> is"),
        (
            body(BALL, after="<actuator><motor name='m' joint='j' armature='0.1'/></actuator>"),
            "armature of the <motor> 'm' is not supported",
        ),
        (body("<joint name='j' type='slide' range='0'/>" + BALL), "range of joint 'j' must be 2"),
    ],
)
@pytest.mark.usefixtures("without_mujoco")
def test_unsupported_attributes_are_named(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.load_model(text, hand="a")
