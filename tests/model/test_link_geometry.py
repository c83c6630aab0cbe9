"""Collision bodies of the links in URDF and MJCF files."""

from __future__ import annotations

import sys
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from gadget import MJCF, urdf
from installed_robots import known_robot
from known_models import capsule_volume, contains
from scipy.spatial import ConvexHull

import geodesic_ocp as go
from geodesic_ocp.model.formats.robots import locate

COLLISION = """
<collision><origin xyz="0.1 0 0" rpy="0 1.5707963267948966 0"/>
  <geometry><cylinder radius="0.05" length="0.4"/></geometry></collision>
<collision><geometry><sphere radius="0.07"/></geometry></collision>
<collision><origin xyz="0 0 0.2"/><geometry><box size="0.1 0.2 0.3"/></geometry></collision>
"""


def test_urdf_shapes_become_capsules() -> None:
    text = urdf().replace('<link name="two">', f'<link name="two">{COLLISION}')
    robot = go.load_model(text, hand="grip", joints=["j_one", "j_two"])
    cylinder, ball, box = robot.bodies
    assert {body.link for body in robot.bodies} == {"two"}
    assert (ball.centre, ball.radius) == ((0.0, 0.0, 0.0), 0.07)
    angles = np.linspace(0.0, 2.0 * np.pi, 100)
    rim = 0.05 * np.column_stack([0.0 * angles, np.cos(angles), np.sin(angles)])
    points = np.concatenate([rim + np.array([0.3, 0.0, 0.0]), rim - np.array([0.1, 0.0, 0.0])])
    assert contains(cylinder, points)
    assert capsule_volume(cylinder) < 1.6 * np.pi * 0.05**2 * 0.4
    corners = np.array(np.meshgrid([-0.05, 0.05], [-0.1, 0.1], [0.05, 0.35])).reshape(3, -1).T
    assert contains(box, corners)


def test_bodies_of_locked_links_are_kept() -> None:
    """They move with the link that carries them."""
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
    one = go.distances.signed_distances(moving, q, [ball], links=["three"])
    other = go.distances.signed_distances(locked, q[:2], [ball], links=["three"])
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
    assert contains(body, points)


def test_meshes_of_panda_are_inside_its_capsules() -> None:
    robot = known_robot("panda")
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
            assert contains(body, points)
            assert capsule_volume(body) < 8.0 * ConvexHull(points).volume


def test_capsules_of_a_urdf_are_read_beside_other_shapes() -> None:
    shapes = (
        '<visual><geometry><capsule radius="0.05" length="0.4"/></geometry></visual>'
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


@pytest.mark.parametrize("reader", ["MuJoCo", "Pinocchio"])
def test_the_scale_of_a_mesh_may_be_a_default(
    reader: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if reader == "MuJoCo":
        pytest.importorskip("mujoco")
    else:
        monkeypatch.setitem(sys.modules, "mujoco", None)
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
    assert 0.1 < capsule_volume(body) ** (1.0 / 3.0) < 0.3
    if reader == "MuJoCo":
        return  # which reads refpos
    file.write_text(text.replace('file="wedge.obj"', 'file="wedge.obj" refpos="0 0 1"'))
    with pytest.raises(ValueError, match="refpos and refquat of a mesh are not supported"):
        assert go.load_model(file, hand="a").bodies


def test_meshes_are_found_from_another_working_directory(
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
