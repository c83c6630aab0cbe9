"""load_model: sources, locked joints, base frames and errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from gadget import INERTIAL, MASSLESS, MIMIC, OTHER, POINT, urdf
from numpy.testing import assert_allclose

import geodesic_ocp as go

MMM = Path("data") / "models" / "mmm.xml"


def test_the_chain_from_base_to_hand_moves_and_other_joints_are_locked() -> None:
    model = go.load_model(urdf(), hand="grip")
    assert model.joint_names == ("j_lift", "j_one", "j_two", "j_three")
    assert model.continuous == ("j_two",)
    assert model.mass == pytest.approx(7 * 2.0)  # including the gripper and the other branch
    assert model.name == "gadget"
    arm = go.load_model(urdf(), hand="grip", base="lift")
    assert arm.joint_names == ("j_one", "j_two", "j_three")
    assert arm.mass == pytest.approx(5 * 2.0)


def test_locked_links_keep_their_inertia(backend: str, rng: np.random.Generator) -> None:
    """The mass matrix is a block of the full one at the locked configuration."""
    whole = pin.buildModelFromXML(urdf())
    configuration = {"j_lift": 0.7, "j_left": 0.3}  # others: the limit closest to zero
    model = go.load_model(
        urdf(),
        hand="grip",
        joints=["j_three", "j_one", "j_two"],
        configuration=configuration,
        backend=backend,
    )
    assert model.joint_names == ("j_one", "j_two", "j_three")  # in the order of the file
    one, two, three = rng.uniform(-1.0, 1.0, 3)
    values = {"j_lift": 0.7, "j_one": one, "j_three": three, "j_left": 0.3, "j_right": 0.2}
    full = pin.neutral(whole)
    for name, value in (values | {"j_beside": 0.2}).items():
        full[whole.joints[whole.getJointId(name)].idx_q] = value
    place = whole.joints[whole.getJointId("j_two")].idx_q
    full[place : place + 2] = np.cos(two), np.sin(two)
    matrix = pin.crba(whole, whole.createData(), full)
    index = [whole.joints[whole.getJointId(name)].idx_v for name in model.joint_names]
    expected = matrix[np.ix_(index, index)]
    assert_allclose(model.mass_matrix([one, two, three]), expected, rtol=0, atol=1e-12)


def test_poses_and_gravity_are_expressed_in_the_base(rng: np.random.Generator) -> None:
    model = go.load_model(urdf(), hand="grip", base="lift")
    whole = go.load_model(urdf(), hand="grip")
    lift = whole.with_hand("lift")
    q, q_0 = rng.uniform(0.2, 1.0, (2, 3))
    rotation, position = lift.hand_pose([0.2, *q])
    hand = whole.hand_pose([0.2, *q])
    assert_allclose(rotation @ model.hand_pose(q)[0], hand[0], rtol=0, atol=1e-14)
    assert_allclose(rotation @ model.hand_pose(q)[1] + position, hand[1], rtol=0, atol=1e-14)
    change = model.potential_energy(q) - model.potential_energy(q_0)
    expected = whole.potential_energy([0.2, *q]) - whole.potential_energy([0.2, *q_0])
    assert change == pytest.approx(expected, rel=1e-12)


def test_file_text_and_pin_model_give_the_same_model(tmp_path: Path) -> None:
    file = tmp_path / "gadget.urdf"
    file.write_text(urdf(), encoding="utf-8")
    sources = [urdf(), file, str(file), pin.buildModelFromXML(urdf())]
    q = [0.1, 0.2, 0.3, 0.4]
    matrices = [go.load_model(source, hand="grip").mass_matrix(q) for source in sources]
    for matrix in matrices[1:]:
        assert np.array_equal(matrix, matrices[0])


@pytest.mark.parametrize(
    ("changes", "arguments", "message"),
    [
        ({"left_mimic": OTHER}, {"hand": "left"}, "'j_left' mimics 'j_right'"),
        ({"right_mimic": MIMIC}, {"hand": "left"}, "'j_right' mimics 'j_left', which moves"),
        ({"two": "floating"}, {}, "'j_two' is a JointModelFreeFlyer; .*leave it out"),
        ({"two": "planar"}, {}, "'j_two' is a JointModelPlanar"),
        ({}, {"hand": "gripp"}, "hand 'gripp' is not a frame of 'gadget': .*grip"),
        ({}, {"hand": None}, "hand must name a frame of 'gadget'"),
        ({}, {"base": "bas"}, "base 'bas' is not a frame"),
        ({}, {"base": "beside"}, "base 'beside' is not between the root and the hand 'grip'"),
        ({}, {"base": "one", "joints": ["j_one"]}, "base 'one' moves with joint 'j_one'"),
        ({}, {"joints": ["j_four"]}, "'j_four' is not a joint of 'gadget'"),
        ({}, {"joints": ["j_one", "j_one"]}, "each once"),
        ({}, {"joints": []}, "at least one"),
        ({}, {"joints": "j_one"}, "joints must be a sequence of names"),
        ({}, {"joints": ["j_left"]}, "hand 'grip' does not move with any of the joints j_left"),
        ({}, {"hand": "base"}, "no joint before the hand 'base'"),
        ({}, {"configuration": {"j_four": 0.0}}, "configuration: 'j_four' is not a joint"),
        ({}, {"configuration": {"j_one": 0.3}}, "configuration: 'j_one' moves"),
        ({}, {"configuration": {"j_left": 3.0}}, "'j_left' = 3 lies outside its limits 0.2 to 1"),
        ({}, {"configuration": {"j_left": np.nan}}, "'j_left' must be a finite number"),
        ({}, {"height": 1.7}, "height and mass scale MMM models"),
        ({"left_inertial": MASSLESS}, {"hand": "left"}, "'left' moves .* nor any later link has"),
        ({"two_inertial": POINT}, {}, "link 'two', 2 kg, has an inertia that is not positive"),
        (
            {"two_inertial": INERTIAL.replace('ixx="0.1"', 'ixx="-0.1"')},
            {},
            r"link 'two', 2 kg, .*principal moments -0.1, 0.15, 0.2 kg",
        ),
        ({"one_inertial": INERTIAL.replace('"2"', '"-2"')}, {}, "link 'one' has a negative mass"),
    ],
)  # fmt: skip
def test_errors_name_what_is_wrong(changes: dict, arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.load_model(urdf(**changes), **({"hand": "grip"} | arguments))


def test_faults_outside_the_moving_chain_are_ignored() -> None:
    """A point mass that is fixed to a solid link is part of it; fixed links do not matter."""
    model = go.load_model(urdf(left_inertial=POINT, right_inertial=MASSLESS), hand="grip")
    assert model.mass == pytest.approx(6 * 2.0)
    assert go.load_model(urdf(lift_inertial=POINT), hand="grip", base="lift").dof == 3
    assert go.load_model(urdf(lift_inertial=POINT), hand="grip").dof == 4  # it only translates
    assert go.load_model(urdf(two="floating"), hand="grip", joints=["j_three"]).dof == 1


def test_massless_links_between_joints_are_allowed() -> None:
    model = go.load_model(urdf(one_inertial=MASSLESS, two_inertial=MASSLESS), hand="grip")
    assert model.dof == 4


def test_a_joint_that_moves_no_mass_is_named() -> None:
    """A thin rod has no inertia about its own axis."""
    native = pin.Model()
    first = native.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "turn")
    last = native.addJoint(first, pin.JointModelRX(), pin.SE3.Identity(), "spin")
    middle = native.addJoint(last, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    native.appendBodyToJoint(first, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    native.appendBodyToJoint(middle, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    native.addFrame(pin.Frame("tip", middle, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    assert go.load_model(native, hand="tip").dof == 3
    native.inertias[middle] = pin.Inertia(1.0, np.zeros(3), np.diag([0.0, 1.0, 1.0]))
    with pytest.raises(ValueError, match="not positive definite"):
        go.load_model(native, hand="tip")
    turned = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.0]))
    twice = pin.Model()
    parent = twice.addJoint(0, pin.JointModelRX(), turned, "first")
    parent = twice.addJoint(parent, pin.JointModelRX(), turned, "second")
    twice.appendBodyToJoint(parent, pin.Inertia(1.0, np.zeros(3), np.eye(3)), turned)
    twice.addFrame(pin.Frame("tip", parent, turned, pin.FrameType.OP_FRAME))
    with pytest.raises(ValueError, match="singular in every configuration"):
        go.load_model(twice, hand="tip")


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("<robot><link", "the text is not well-formed XML: .*line 1"),
        ("<sdf/>", "neither URDF .* its root element is <sdf>"),
        ('<robot xmlns:x="http://www.ros.org/wiki/xacro"><x:macro name="a"/></robot>', "xacro"),
        ("nowhere.urdf", "nowhere.urdf cannot be read"),
        ("no such robot", "there is no file and no robot 'no such robot'"),
        (3, "source must be a file"),
    ],
)
def test_unreadable_sources_are_named(source: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.load_model(source, hand="grip")  # type: ignore[arg-type]


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_mmm_models_arm_is_the_human_arm(
    side: str, shared: Path, rng: np.random.Generator
) -> None:
    arm = go.human_arm(side, height=1.83, mass=61.0)  # type: ignore[arg-type]
    letter = side[0].upper()
    model = go.load_model(
        shared / MMM,
        hand=f"Hand {letter} TCP",
        base=f"{letter}Ssegment_joint",
        joints=arm.joint_names,
        height=1.83,
        mass=61.0,
    )
    assert model.joint_names == arm.joint_names
    assert_allclose(model.lower, arm.lower, rtol=0, atol=1e-12)
    assert_allclose(model.upper, arm.upper, rtol=0, atol=1e-12)
    for q in rng.uniform(arm.lower, arm.upper, (5, 7)):
        # The left centres of mass differ by rounding: see anthropometry.py.
        assert_allclose(model.mass_matrix(q), arm.mass_matrix(q), rtol=1e-11, atol=1e-11)
        for ours, theirs in zip(model.hand_pose(q), arm.hand_pose(q), strict=True):
            assert_allclose(ours, theirs, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_the_whole_mmm_body(backend: str, shared: Path, rng: np.random.Generator) -> None:
    """A subset of revolute and prismatic joints, scaled by height and mass."""
    joints = ["BTx_joint", "BTy_joint", "LHx_joint", "RSx_joint", "REsegment_joint", "REx_joint"]
    arguments = {"hand": "Hand R TCP", "joints": joints, "backend": backend}
    model = go.load_model(shared / MMM, **arguments, height=1.6, mass=50.0)
    assert set(model.joint_names) == set(joints)
    unit = go.load_model(shared / MMM, **arguments, height=1.0, mass=1.0)
    q = rng.uniform(-0.1, 0.1, 6)
    slide = model.joint_names.index("REsegment_joint")
    assert model.upper[slide] == pytest.approx(1.6 * 0.188)
    q[slide] = 0.1
    scaled = q.copy()
    scaled[slide] *= 1.6
    scale = np.where(np.arange(6) == slide, 1.0, 1.6)
    expected = 50.0 * unit.mass_matrix(q) * np.outer(scale, scale)
    assert_allclose(model.mass_matrix(scaled), expected, rtol=1e-12, atol=1e-12)
    whole = go.load_model(shared / MMM, hand="Hand R TCP")
    assert whole.mass == pytest.approx(70.0, rel=1e-2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"hand": 3}, "hand 3 is not a frame"),
        ({"joints": 1}, "joints must be a sequence of names, got 1"),
        ({"configuration": [0.1]}, "configuration must map names of joints to values"),
        (
            {"configuration": {"j_left": "0.3"}},
            "configuration: 'j_left' must be a finite number, got '0.3'",
        ),
        ({"configuration": {"j_left": None}}, "must be a finite number, got None"),
        ({"source": "x" * 5000}, "source is neither XML nor a name: 'xxx"),
        ({"source": "a\0b.urdf"}, "source is neither XML nor a name"),
        ({"source": Path(__file__).parent}, "cannot be read"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.load_model(**({"source": urdf(), "hand": "grip"} | arguments))
