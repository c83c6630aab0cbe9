"""load_model: files, texts, names; what stays when joints are locked; what is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from gadget import INERTIAL, MASSLESS, MIMIC, MJCF, OTHER, POINT, urdf
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.model.formats.robots import ROBOTS, folder
from geodesic_ocp.model.rigid_body import BACKENDS, why_unavailable

MMM = Path("data") / "models" / "mmm.xml"


def test_the_chain_from_base_to_hand_moves_and_the_rest_is_locked() -> None:
    model = go.load_model(urdf(), hand="grip")
    assert model.joint_names == ("j_lift", "j_one", "j_two", "j_three")
    assert model.continuous == ("j_two",)
    assert model.mass == pytest.approx(7 * 2.0)  # nothing is lost: gripper and what is beside
    assert model.name == "gadget"
    arm = go.load_model(urdf(), hand="grip", base="lift")
    assert arm.joint_names == ("j_one", "j_two", "j_three")
    assert arm.mass == pytest.approx(5 * 2.0)


def test_locked_joints_keep_their_inertia_in_their_posture(
    backend: str, rng: np.random.Generator
) -> None:
    """The mass matrix is the whole one's block at the locked configuration."""
    whole = pin.buildModelFromXML(urdf())
    configuration = {"j_lift": 0.7, "j_left": 0.3}  # the others at the limit nearest to zero
    model = go.load_model(
        urdf(),
        hand="grip",
        joints=["j_three", "j_one", "j_two"],
        configuration=configuration,
        backend=backend,
    )
    assert model.joint_names == ("j_one", "j_two", "j_three")  # the file's order
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


def test_poses_and_gravity_are_the_bases(rng: np.random.Generator) -> None:
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


def test_file_text_and_pin_model_give_the_same(tmp_path: Path) -> None:
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
        ({"left_inertial": MASSLESS}, {"hand": "left"}, "link 'left' moves with .* no mass"),
        ({"two_inertial": POINT}, {}, "link 'two', 2 kg, has an inertia that is not positive"),
        (
            {"two_inertial": INERTIAL.replace('ixx="0.1"', 'ixx="-0.1"')},
            {},
            r"link 'two', 2 kg, .*principal moments -0.1, 0.15, 0.2 kg",
        ),
        ({"one_inertial": INERTIAL.replace('"2"', '"-2"')}, {}, "link 'one' has a negative mass"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(changes: dict, arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.load_model(urdf(**changes), **({"hand": "grip"} | arguments))


def test_faults_outside_the_chain_do_no_harm() -> None:
    """A point mass that is fixed to a solid link is part of it; what stands still has no say."""
    model = go.load_model(urdf(left_inertial=POINT, right_inertial=MASSLESS), hand="grip")
    assert model.mass == pytest.approx(6 * 2.0)
    assert go.load_model(urdf(lift_inertial=POINT), hand="grip", base="lift").dof == 3
    assert go.load_model(urdf(lift_inertial=POINT), hand="grip").dof == 4  # it only slides
    assert go.load_model(urdf(two="floating"), hand="grip", joints=["j_three"]).dof == 1


def test_links_without_mass_may_stand_between_joints() -> None:
    model = go.load_model(urdf(one_inertial=MASSLESS, two_inertial=MASSLESS), hand="grip")
    assert model.dof == 4


def test_an_idle_joint_is_named() -> None:
    """A rod without width about its own axis carries nothing."""
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
def test_sources_that_cannot_be_read(source: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.load_model(source, hand="grip")  # type: ignore[arg-type]


def test_two_roots_are_not_a_urdf(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="not a URDF that Pinocchio can read"):
        go.load_model("<robot name='a'><link name='b'/><link name='c'/></robot>", hand="b")
    capfd.readouterr()  # urdfdom says more on standard error


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
        # The left arm's centres of mass: see anthropometry.py.
        assert_allclose(model.mass_matrix(q), arm.mass_matrix(q), rtol=1e-11, atol=1e-11)
        for ours, theirs in zip(model.hand_pose(q), arm.hand_pose(q), strict=True):
            assert_allclose(ours, theirs, rtol=0, atol=1e-12)


def test_the_whole_mmm_body(backend: str, shared: Path, rng: np.random.Generator) -> None:
    """Revolute and prismatic joints; any subset of them; scaled by height and mass."""
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


def loaded(robot: str, backend: str) -> go.Model:
    if folder(ROBOTS[robot].package) is None:
        pytest.skip(f"{ROBOTS[robot].package} is not installed (make robots)")
    if robot.startswith("armar6"):
        with pytest.warns(UserWarning, match=r"armar6.urdf, line (232|526): the comma"):
            return go.load_model(robot, backend=backend)
    return go.load_model(robot, backend=backend)


@pytest.mark.parametrize("robot", ROBOTS)
def test_known_robots_can_be_loaded(robot: str) -> None:
    model = loaded(robot, "built-in")
    assert model.dof == {"ur5": 6, "armar6-left": 8, "armar6-right": 8}.get(robot, 7)
    assert np.all(np.isfinite([model.lower, model.upper]))
    assert model.name == robot
    assert len(model.continuous) == (3 if robot.startswith("armar6") else 0)
    if robot.endswith(("left", "left-arm")):  # with x forward, or as ARMAR-6's torso, y
        side = 0 if robot.startswith("armar6") else 1
        assert model.pin.jointPlacements[1].translation[side] * (-1) ** (1 - side) > 0.0


def both_arms(backend: str, shared: Path) -> go.Model:
    left = go.human_arm("left", table="de_leva", sex="female", backend=backend)
    return go.combine(left, go.human_arm("right", backend=backend).with_payload(2.0, [0, 0, 0.1]))


def mmm_body(backend: str, shared: Path) -> go.Model:
    return go.load_model(shared / MMM, hand="Hand L TCP", base="BPx_joint", backend=backend)


KINDS: dict[str, Callable[[str, Path], go.Model]] = {
    **{robot: lambda backend, shared, robot=robot: loaded(robot, backend) for robot in ROBOTS},
    "both arms, one with a load": both_arms,
    "MMM": mmm_body,
    "URDF": lambda backend, shared: go.load_model(urdf(), hand="grip", backend=backend),
    "MJCF": lambda backend, shared: go.load_model(MJCF, hand="tip", base="trunk", backend=backend),
}


def configurations(model: go.Model, rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(np.maximum(model.lower, -3.0), np.minimum(model.upper, 3.0), (5, model.dof))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_model_agrees_with_numeric_pinocchio(
    kind: str, backend: str, request: pytest.FixtureRequest, rng: np.random.Generator
) -> None:
    model = KINDS[kind](backend, request.getfixturevalue("shared") if kind == "MMM" else Path())
    data, frame = model.pin.createData(), model.pin.getFrameId(model.hand)
    for q in configurations(model, rng):
        upper = np.triu(pin.crba(model.pin, data, q))
        expected = upper + np.triu(upper, 1).T
        atol = 1e-11 * np.abs(expected).max()
        assert_allclose(model.mass_matrix(q), expected, rtol=0, atol=atol)
        pin.framesForwardKinematics(model.pin, data, q)
        assert_allclose(model.hand_pose(q)[1], data.oMf[frame].translation, rtol=0, atol=1e-12)
        assert_allclose(model.hand_pose(q)[0], data.oMf[frame].rotation, rtol=0, atol=1e-12)
        energy = pin.computePotentialEnergy(model.pin, data, q)
        assert model.potential_energy(q) == pytest.approx(energy, rel=1e-11, abs=1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_the_two_back_ends_agree_on_every_kind(
    kind: str, request: pytest.FixtureRequest, rng: np.random.Generator
) -> None:
    if missing := why_unavailable("pinocchio.casadi"):
        pytest.skip(f"pinocchio.casadi cannot be imported: {missing}")
    shared = request.getfixturevalue("shared") if kind == "MMM" else Path()
    first, second = (KINDS[kind](backend, shared) for backend in BACKENDS)
    for q in configurations(first, rng):
        expected = second.mass_matrix(q)
        atol = 1e-11 * np.abs(expected).max()
        assert_allclose(first.mass_matrix(q), expected, rtol=0, atol=atol)
        assert_allclose(first.hand_jacobian(q), second.hand_jacobian(q), rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("name", "hand", "message"),
    [
        ("armar4", "armr_wri2", "link 'armr_sho3', 0.51 kg, has an inertia that is not positive"),
        ("icub_reduced", "r_foot", "link 'r_hip_1', 0.754 kg, has an inertia"),
        ("romeo_laas_small", "l_ankle", "link 'LHipPitch_link', 4.71 kg, .*moments -0.00272"),
        ("panda", "panda_tool", "hand 'panda_tool' is not a frame of 'panda'"),
    ],
)
def test_faulty_robots_are_named(name: str, hand: str, message: str) -> None:
    needed = "armar" if name == "armar4" else "example-robot-data"
    if folder(needed) is None:
        pytest.skip(f"{needed} is not installed (make robots)")
    with pytest.raises(ValueError, match=message):
        go.load_model(name, hand=hand)


def test_massless_fingers_of_a_robot_are_named() -> None:
    if (root := folder("example-robot-data")) is None:
        pytest.skip("example-robot-data is not installed (make robots)")
    file = root / "romeo_description" / "urdf" / "romeo.urdf"
    native = pin.buildModelFromUrdf(str(file))  # which takes mimic joints for ones of their own
    with pytest.raises(
        ValueError, match=r"link 'LFinger2\dLink' moves with joint 'LFinger2\d' and"
    ):
        go.load_model(native, hand="LFinger22Link")
    assert go.load_model(file, hand="l_wrist", base="torso").dof == 7


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"hand": 3}, "hand 3 is not a frame"),
        ({"joints": 1}, "joints must be a sequence of names, got 1"),
        ({"configuration": [0.1]}, "configuration must be a mapping"),
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
