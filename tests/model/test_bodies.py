"""Capsules and balls of links: made of points, of a table, of files."""

from __future__ import annotations

from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from gadget import MJCF, urdf
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

import geodesic_ocp as go
from geodesic_ocp.model.formats.robots import folder, locate
from geodesic_ocp.model.primitives import distances_to_segment

COLLISION = """
<collision><origin xyz="0.1 0 0" rpy="0 1.5707963267948966 0"/>
  <geometry><cylinder radius="0.05" length="0.4"/></geometry></collision>
<collision><geometry><sphere radius="0.07"/></geometry></collision>
<collision><origin xyz="0 0 0.2"/><geometry><box size="0.1 0.2 0.3"/></geometry></collision>
"""


def within(points: np.ndarray, body: go.Capsule) -> bool:
    away = distances_to_segment(points, np.array(body.start), np.array(body.end))
    return bool(np.all(away <= body.radius))


def volume(body: go.Capsule) -> float:
    length = float(np.linalg.norm(np.subtract(body.end, body.start)))
    return np.pi * body.radius**2 * (length + 4.0 / 3.0 * body.radius)


@given(st.integers(0, 10_000), st.integers(2, 60), st.sampled_from([1e-3, 1.0, 1e3]))
def test_an_enclosing_capsule_holds_all_points(seed: int, count: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    points = size * rng.normal(size=(count, 3)) * rng.uniform(0.05, 1.0, 3) + size
    assert within(points, go.enclosing_capsule(points))


def test_an_enclosing_capsule_is_small(rng: np.random.Generator) -> None:
    """Of points on a slanted capsule: the capsule itself, within a few percent."""
    start, end, radius = np.array([0.1, 0.2, 0.3]), np.array([0.6, -0.2, 0.5]), 0.12
    shares, normals = rng.uniform(size=(4000, 1)), rng.normal(size=(4000, 3))
    on_balls = start + (shares > 0.5) * (end - start)
    points = on_balls + radius * normals / np.linalg.norm(normals, axis=1, keepdims=True)
    found = go.enclosing_capsule(points)
    exact = go.Capsule(tuple(start), tuple(end), radius)
    assert ConvexHull(points).volume < volume(found) < 1.02 * volume(exact)


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.zeros((3, 2)), [[0, 0, np.nan]]])
def test_points_must_be_points(points: object) -> None:
    with pytest.raises(ValueError, match="points must be finite, of shape"):
        go.enclosing_capsule(points)


def test_bodies_say_what_is_wrong_with_them(arm: go.Model) -> None:
    with pytest.raises(ValueError, match="points must not all be one"):
        go.enclosing_capsule(np.ones((4, 3)))
    with pytest.raises(ValueError, match="radius must be positive"):
        go.Ball((0.0, 0.0, 0.0), 0.0)
    with pytest.raises(ValueError, match=r"start must have shape \(3,\)"):
        go.Capsule((0.0, 0.0), (0.0, 0.0, 1.0), 0.1)
    with pytest.raises(ValueError, match="normal must not be zero"):
        go.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="with a link"):
        arm.with_bodies(go.Ball((0.0, 0.0, 0.0), 0.1))
    with pytest.raises(ValueError, match="no frame 'elbow'"):
        arm.with_bodies(go.Ball((0.0, 0.0, 0.0), 0.1, "elbow"))
    assert arm.with_bodies(go.Ball((0.0, 0.0, 0.0), 0.1, "hand")).bodies[0].radius == 0.1


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_persons_bodies_go_from_joint_to_joint(side: str) -> None:
    arm = go.human_arm(side, height=1.8, mass=80.0)
    upper, fore, hand = arm.bodies
    q = np.array([0.4, 0.1, 0.0, 0.9, 0.0, 0.0, 0.0])
    ends = []
    for body in (upper, fore, hand):
        rotation, position = arm.frame_pose(str(body.link), q)
        ends.append([position + rotation @ np.array(end) for end in (body.start, body.end)])
    assert np.allclose(ends[0][0], 0.0, atol=1e-15)
    assert np.allclose(ends[0][1], ends[1][0], atol=1e-12)
    assert np.allclose(ends[1][1], ends[2][0], atol=1e-12)
    # A cylinder of the segment's mass and density: 0.027 of the mass, 1070 kg/m^3.
    length = np.linalg.norm(np.subtract(upper.end, upper.start))
    assert np.pi * upper.radius**2 * length * 1070.0 == pytest.approx(0.027 * 80.0)
    assert hand.end[2] == pytest.approx(-0.108 * 1.8)


def test_urdf_shapes_become_capsules() -> None:
    text = urdf().replace('<link name="two">', f'<link name="two">{COLLISION}')
    robot = go.load_model(text, hand="grip", joints=["j_one", "j_two"])
    cylinder, ball, box = robot.bodies
    assert {body.link for body in robot.bodies} == {"two"}
    assert (ball.centre, ball.radius) == ((0.0, 0.0, 0.0), 0.07)
    angles = np.linspace(0.0, 2.0 * np.pi, 100)
    rim = 0.05 * np.column_stack([0.0 * angles, np.cos(angles), np.sin(angles)])
    points = np.concatenate([rim + np.array([0.3, 0.0, 0.0]), rim - np.array([0.1, 0.0, 0.0])])
    assert within(points, cylinder)
    assert volume(cylinder) < 1.6 * np.pi * 0.05**2 * 0.4
    corners = np.array(np.meshgrid([-0.05, 0.05], [-0.1, 0.1], [0.05, 0.35])).reshape(3, -1).T
    assert within(corners, box)


def test_a_link_that_is_locked_keeps_its_place() -> None:
    """Bodies of links behind locked joints move with what carries them."""
    collision = '<collision><geometry><sphere radius="0.07"/></geometry></collision>'
    text = urdf().replace('<link name="three">', f'<link name="three">{collision}')
    moving, locked = (
        go.load_model(text, hand="grip", joints=joints, configuration=configuration, base="base")
        for joints, configuration in (
            (["j_lift", "j_two", "j_three"], {"j_one": 0.5}),
            (["j_lift", "j_two"], {"j_one": 0.5, "j_three": 0.4}),
        )
    )
    q = np.array([0.3, 0.7, 0.4])
    ball = go.Ball((0.5, 0.1, 0.2), 0.05)
    one = go.signed_distances(moving, q, [ball], links=["three"])
    other = go.signed_distances(locked, q[:2], [ball], links=["three"])
    assert one["three to obstacle 0"] == pytest.approx(other["three to obstacle 0"], abs=1e-12)


def test_mjcf_shapes_become_capsules(tmp_path: Path) -> None:
    for source in (MJCF, tmp_path / "two.xml"):
        if isinstance(source, Path):
            source.write_text(MJCF)
        robot = go.load_model(source, hand="tip", joints=["a", "b"])
        upper = next(body for body in robot.bodies if body.link == "upper")
        assert isinstance(upper, go.Capsule)
        assert sorted([upper.start[2], upper.end[2]]) == pytest.approx([0.0, 0.5], abs=1e-9)
        assert upper.radius == 0.02


def test_a_mesh_in_a_file(tmp_path: Path) -> None:
    mesh = (
        '<collision><geometry><mesh filename="package://gadget/wedge.obj"/></geometry></collision>'
    )
    text = urdf().replace('<link name="two">', f'<link name="two">{mesh}')
    place = tmp_path / "gadget" / "robots"
    place.mkdir(parents=True)
    file = place / "gadget.urdf"
    file.write_text(text)
    robot = go.load_model(file, hand="grip")
    with pytest.raises(ValueError, match=r"gadget.urdf: its collision geometry .*wedge.obj"):
        assert robot.bodies
    corners = "v 0 0 0\nv 0.2 0 0\nv 0 0.1 0\nv 0 0 0.3\n"
    (tmp_path / "gadget" / "wedge.obj").write_text(corners + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    (body,) = go.load_model(file, hand="grip").bodies
    points = np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.1, 0], [0, 0, 0.3]])
    assert within(points, body)


def test_both_arms_have_the_bodies_of_both() -> None:
    arms = go.combine(
        go.human_arm("left"), go.human_arm("right"), placements=((-0.2, 0, 0), (0.2, 0, 0))
    )
    links = [body.link for body in arms.bodies]
    assert links == [
        f"{side} {part}" for side in ("left", "right") for part in ("upper arm", "forearm", "hand")
    ]
    hanging = go.signed_distances(arms, np.zeros(14), pairs=[("left hand", "right hand")])
    hand = arms.bodies[2]
    assert hanging["left hand to right hand"] == pytest.approx(0.4 - 2.0 * hand.radius)
    twice = go.combine(go.human_arm("left"), go.human_arm("left"))
    assert "human left arm 1/left hand" in {body.link for body in twice.bodies}


def test_pandas_meshes_lie_in_its_capsules() -> None:
    if folder("example-robot-data") is None:
        pytest.skip("example-robot-data is not installed here")
    robot = go.load_model("panda")
    file = locate("panda")
    assert file is not None
    whole = pin.buildModelFromUrdf(str(file))
    geometry = pin.buildGeomFromUrdf(
        whole, str(file), pin.GeometryType.COLLISION, package_dirs=[str(p) for p in file.parents]
    )
    assert len(geometry.geometryObjects) == len(robot.bodies)
    for shape, body in zip(geometry.geometryObjects, robot.bodies, strict=True):
        if isinstance(shape.geometry, coal.BVHModelOBBRSS):
            vertices = np.array(shape.geometry.vertices())
            frame = whole.frames[shape.parentFrame]
            at_link = frame.placement.actInv(shape.placement)
            points = vertices @ at_link.rotation.T + at_link.translation
            assert frame.name == body.link
            assert within(points, body)
            assert volume(body) < 8.0 * ConvexHull(points).volume


def test_a_urdfs_capsule_is_one_beside_others() -> None:
    shapes = (
        '<collision><geometry><sphere radius="0.07"/></geometry></collision>'
        '<collision><origin xyz="0.1 0 0" rpy="0 1.5707963267948966 0"/>'
        '<geometry><capsule radius="0.05" length="0.4"/></geometry></collision>'
    )
    text = urdf().replace('<link name="two">', f'<link name="two">{shapes}')
    ball, capsule = go.load_model(text, hand="grip").bodies
    assert isinstance(ball, go.Ball)
    assert isinstance(capsule, go.Capsule)
    assert sorted([capsule.start[0], capsule.end[0]]) == pytest.approx([-0.1, 0.3])
    assert (capsule.radius, capsule.link) == (0.05, "two")
    strange = text.replace("capsule", "cone")
    with pytest.raises(ValueError, match="collision geometry of 'two' is cone, not one of box"):
        assert go.load_model(strange, hand="grip").bodies


def test_a_meshs_scale_may_be_a_default(tmp_path: Path) -> None:
    points = "v 0 0 0\nv 200 0 0\nv 0 100 0\nv 0 0 300\n"
    (tmp_path / "wedge.obj").write_text(points + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    text = """<mujoco model="m"><compiler angle="radian"/>
      <default><mesh scale="0.001 0.001 0.001"/></default>
      <asset><mesh name="wedge" file="wedge.obj"/></asset>
      <worldbody><geom type="plane" size="1 1 1"/><body name="a"><joint name="j"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="mesh" mesh="wedge"/></body>
      </worldbody></mujoco>"""
    file = tmp_path / "wedge.xml"
    file.write_text(text)
    (body,) = go.load_model(file, hand="a").bodies
    assert 0.1 < volume(body) ** (1.0 / 3.0) < 0.3
    file.write_text(text.replace('file="wedge.obj"', 'file="wedge.obj" refpos="0 0 1"'))
    with pytest.raises(ValueError, match="refpos and refquat of a mesh are not read"):
        assert go.load_model(file, hand="a").bodies


def test_meshes_are_found_from_another_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = '<collision><geometry><mesh filename="package://gadget/w.obj"/></geometry></collision>'
    (tmp_path / "gadget").mkdir()
    (tmp_path / "gadget" / "w.obj").write_text(
        "v 0 0 0\nv 0.2 0 0\nv 0 0.1 0\nv 0 0 0.3\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    (tmp_path / "gadget" / "g.urdf").write_text(
        urdf().replace('<link name="two">', f'<link name="two">{mesh}')
    )
    monkeypatch.chdir(tmp_path)
    robot = go.load_model("gadget/g.urdf", hand="grip")
    monkeypatch.chdir(tmp_path.parent)
    assert len(robot.bodies) == 1
