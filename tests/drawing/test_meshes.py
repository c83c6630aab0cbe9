"""Triangle meshes of visual geometry and of capsules, and their decimation."""

from __future__ import annotations

import gc
import weakref
from pathlib import Path

import matplotlib.image
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from gadget import MJCF, urdf
from installed_robots import known_robot
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.drawing.look import Mesh
from geodesic_ocp.drawing.meshes import MAX_TRIANGLES, meshes, simplified
from geodesic_ocp.model.link_geometry import triangles_of
from geodesic_ocp.model.link_solids import link_solids

SHAPES = {
    "box": '<box size="0.2 0.4 0.6"/>',
    "cylinder": '<cylinder radius="0.1" length="0.5"/>',
    "sphere": '<sphere radius="0.2"/>',
    "capsule": '<capsule radius="0.1" length="0.5"/>',
}
VOLUMES = {
    "box": 0.2 * 0.4 * 0.6,
    "cylinder": np.pi * 0.1**2 * 0.5,
    "sphere": 4 / 3 * np.pi * 0.2**3,
    "capsule": np.pi * 0.1**2 * (0.5 + 4 / 3 * 0.1),
}
# Chords of an angle t = 2 pi / 32 reduce the area of a circle by a fraction t^2 / 6, and the radius
# along the meridians of a ball by t^2 / 12 on average, its volume by three times that.
ROUND = (2.0 * np.pi / 32) ** 2 * (1 / 6 + 3 / 12)
WHITE = '<material name="white"><color rgba="1 1 1 1"/></material>'
ORIGIN = '<origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/>'


def volume(mesh: Mesh) -> float:
    """By the divergence theorem; positive if triangles are counter-clockwise from outside."""
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return float(np.sum(a * np.cross(b, c)) / 6.0)


def is_closed(mesh: Mesh) -> bool:
    """Whether every edge has two triangles, with opposite orientations of the edge."""
    edges = np.concatenate([mesh.triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    there, count = np.unique(edges, axis=0, return_counts=True)
    return bool(np.all(count == 1)) and np.array_equal(there, np.unique(edges[:, ::-1], axis=0))


def of_link(link: str, model: go.Model) -> Mesh:
    """The only mesh of a link."""
    (mesh,) = [mesh for mesh in meshes(model) if mesh.link == link]
    return mesh


def drawn(link: str, *geometries: str, tag: str = "visual", material: str = "") -> str:
    """The gadget with shapes on one of its links."""
    shapes = "".join(
        f"<{tag}>{ORIGIN}<geometry>{each}</geometry>{material}</{tag}>" for each in geometries
    )
    return urdf().replace(f'<link name="{link}">', f'<link name="{link}">{shapes}')


@pytest.mark.parametrize("kind", SHAPES)
def test_simple_shapes_are_closed_and_have_the_right_size(kind: str) -> None:
    mesh = of_link("three", go.load_model(drawn("three", SHAPES[kind]), hand="grip"))
    assert mesh.link == "three"
    assert is_closed(mesh)
    assert volume(mesh) == pytest.approx(VOLUMES[kind], rel=1e-12 if kind == "box" else ROUND)
    assert volume(mesh) <= VOLUMES[kind] * (1 + 1e-12)
    middle = (mesh.vertices.max(axis=0) + mesh.vertices.min(axis=0)) / 2.0
    assert_allclose(middle, [0.1, 0.2, 0.3], rtol=0, atol=1e-12)
    turn = pin.rpy.rpyToMatrix(0.4, 0.5, 0.6)
    sizes = np.ptp((mesh.vertices - middle) @ turn, axis=0)
    wide = {"box": (0.2, 0.4, 0.6), "sphere": (0.4,) * 3, "cylinder": (0.2, 0.2, 0.5)}
    # The polygons around the axis of a capsule may have any orientation.
    atol = 0.2 * (1.0 - np.cos(np.pi / 32)) if kind == "capsule" else 1e-12
    assert_allclose(sizes, wide.get(kind, (0.2, 0.2, 0.7)), rtol=0, atol=atol)


def test_colours_are_read_from_the_file() -> None:
    material = '<material name="red"><color rgba="1 0.25 0 1"/></material>'
    mesh = of_link(
        "one", go.load_model(drawn("one", SHAPES["box"], material=material), hand="grip")
    )
    assert_allclose(mesh.colour, (1.0, 0.25, 0.0), rtol=0, atol=1e-7)  # single precision


def test_fixed_and_locked_links_have_meshes() -> None:
    text = drawn("lift", SHAPES["box"]).replace(
        '<link name="beside">',
        f'<link name="beside"><visual><geometry>{SHAPES["sphere"]}</geometry></visual>',
    )
    model = go.load_model(text, hand="grip", base="lift")
    assert {"lift", "beside"} <= {mesh.link for mesh in meshes(model)}
    assert not model.moves("lift")


def test_visual_geometry_is_preferred_to_collision_geometry() -> None:
    both = drawn("three", SHAPES["sphere"]).replace(
        "<visual>", f"<collision><geometry>{SHAPES['box']}</geometry></collision><visual>"
    )
    mesh = of_link("three", go.load_model(both, hand="grip"))
    assert volume(mesh) == pytest.approx(VOLUMES["sphere"], rel=ROUND)
    hidden = drawn("three", SHAPES["sphere"], tag="collision")
    mesh = of_link("three", go.load_model(hidden, hand="grip"))
    assert volume(mesh) == pytest.approx(VOLUMES["sphere"], rel=ROUND)


def test_parts_of_a_collada_file_have_the_colours_of_their_materials(tmp_path: Path) -> None:
    paints = {"red": "1 0 0 1", "blue": "0 0 1 1"}
    effects = "".join(
        f'<effect id="{name}-fx"><profile_COMMON><technique sid="t"><lambert><diffuse>'
        f"<color>{value}</color></diffuse></lambert></technique></profile_COMMON></effect>"
        for name, value in paints.items()
    )
    materials, bound, groups = (
        "".join(text.format(name) for name in paints)
        for text in (
            '<material id="{0}-m"><instance_effect url="#{0}-fx"/></material>',
            '<instance_material symbol="{0}" target="#{0}-m"/>',
            '<triangles material="{0}" count="2"><input semantic="VERTEX" source="#v" offset="0"/>'
            "<p>0 1 2 0 2 3</p></triangles>",
        )
    )
    groups = groups.replace("0 1 2 0 2 3", "4 5 6 4 6 7", 1)  # the first, red, is above
    corners = [f"{x} {y} {z}" for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    (tmp_path / "two.dae").write_text(
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
        f"<asset><up_axis>Z_UP</up_axis></asset><library_effects>{effects}</library_effects>"
        f"<library_materials>{materials}</library_materials><library_geometries>"
        '<geometry id="g"><mesh><source id="s"><float_array id="a" count="24">'
        f'{" ".join(corners)}</float_array><technique_common><accessor source="#a" count="8" '
        'stride="3"><param name="X" type="float"/><param name="Y" type="float"/>'
        '<param name="Z" type="float"/></accessor></technique_common></source><vertices id="v">'
        f'<input semantic="POSITION" source="#s"/></vertices>{groups}</mesh></geometry>'
        '</library_geometries><library_visual_scenes><visual_scene id="all"><node id="n">'
        '<instance_geometry url="#g"><bind_material><technique_common>'
        f"{bound}</technique_common></bind_material></instance_geometry></node></visual_scene>"
        '</library_visual_scenes><scene><instance_visual_scene url="#all"/></scene></COLLADA>'
    )
    check_parts(tmp_path / "two.dae")
    painted = drawn("three", f'<mesh filename="{tmp_path / "two.dae"}"/>', material=WHITE)
    parts = [m for m in meshes(go.load_model(painted, hand="grip")) if m.link == "three"]
    assert {mesh.colour for mesh in parts} == {(1.0, 1.0, 1.0)}  # the URDF comes first


def check_parts(file: Path) -> None:
    """A red square is above a blue one, in what is seen and in what collides."""
    shown = drawn("three", f'<mesh filename="{file}"/>').replace(ORIGIN, "")
    parts = [m for m in meshes(go.load_model(shown, hand="grip")) if m.link == "three"]
    heights = {mesh.colour: np.unique(mesh.vertices[:, 2].round(6)).tolist() for mesh in parts}
    assert heights == {(1.0, 0.0, 0.0): [1.0], (0.0, 0.0, 1.0): [0.0]}
    solid = drawn("three", f'<mesh filename="{file}"/>', tag="collision")
    solids = {each.link: each for each in link_solids(go.load_model(solid, hand="grip"))}
    ((shape, _),) = solids["three"].shapes  # distances see both parts
    heights = {round(float(shape.vertices()[k][2]), 6) for k in np.unique(triangles_of(shape))}
    assert heights == {0.0, 1.0}


@pytest.mark.parametrize("textured", [False, True])
def test_parts_of_a_wavefront_file_have_the_colours_of_their_materials(
    textured: bool, tmp_path: Path
) -> None:
    corners = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    lines = ["mtllib two.mtl", *(f"v {x} {y} {z}" for x, y, z in corners)]
    lines += [f"vt {u} 0.5" for u in (0.2, 0.8)]  # left in the picture, and right
    lines += ["usemtl red", "f 5/1 6/1 7/1 8/1", "usemtl blue", "f 1/2 2/2 3/2 4/2"]
    (tmp_path / "two.obj").write_text("\n".join(lines))
    paint = {"red": "Kd 1 0 0", "blue": "Kd 0 0 1"}
    if textured:
        pixels = np.repeat(np.array([[[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]]), 8, axis=1)
        matplotlib.image.imsave(tmp_path / "two.png", pixels)
        paint = dict.fromkeys(paint, "map_Kd two.png")
    text = "".join(f"newmtl {name}\n{line}\n" for name, line in paint.items())
    (tmp_path / "two.mtl").write_text(text)
    check_parts(tmp_path / "two.obj")


def test_unreadable_visual_geometry_is_replaced_by_capsules() -> None:
    broken = drawn("one", '<mesh filename="nowhere.stl"/>', SHAPES["box"])
    chain = meshes(go.load_model(urdf(), hand="grip"))
    with pytest.warns(UserWarning, match="without its visual geometry.*nowhere.stl"):
        same = meshes(go.load_model(broken, hand="grip"))
    assert [mesh.link for mesh in same] == [mesh.link for mesh in chain]
    text = broken.replace(
        '<link name="three">',
        f'<link name="three"><collision><geometry>{SHAPES["sphere"]}</geometry></collision>',
    )
    with pytest.warns(UserWarning, match="without its visual geometry"):
        mesh = of_link("three", go.load_model(text, hand="grip"))
    assert volume(mesh) == pytest.approx(VOLUMES["sphere"], rel=ROUND)


def test_a_mesh_of_a_file_is_scaled_and_mirrored(tmp_path: Path) -> None:
    """A tetrahedron in STL, which repeats vertices for each triangle."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    lines = ["solid a"]
    for face in faces:
        points = "".join(f"vertex {x} {y} {z}\n" for x, y, z in corners[list(face)])
        lines.append(f"facet normal 0 0 0\nouter loop\n{points}endloop\nendfacet")
    (tmp_path / "a.stl").write_text("\n".join([*lines, "endsolid a\n"]))
    file = tmp_path / "gadget.urdf"
    for scale, size in (("1 1 1", 1.0), ("0.5 -2 1", 1.0)):
        file.write_text(drawn("two", f'<mesh filename="a.stl" scale="{scale}"/>'))
        mesh = of_link("two", go.load_model(file, hand="grip"))
        assert mesh.vertices.shape == (4, 3)
        assert is_closed(mesh)
        assert volume(mesh) == pytest.approx(size / 6.0, rel=1e-6)  # single precision


def test_geometry_of_mjcf_has_meshes() -> None:
    model = go.load_model(MJCF, hand="tip", base="trunk")
    assert {mesh.link for mesh in meshes(model)} == {"trunk", "upper", "fore", "f1", "f2"}


def test_other_bodies_of_a_person_are_drawn_as_they_are(arm: go.Model) -> None:
    ball = arm.with_bodies(go.Ball((0.1, 0.2, 0.3), 0.2, "right hand"))
    drawn_ball = max((m for m in meshes(ball) if m.link == "right hand"), key=volume)
    assert is_closed(drawn_ball)
    assert volume(drawn_ball) == pytest.approx(VOLUMES["sphere"], rel=ROUND)


@pytest.mark.slow
def test_meshes_are_kept_with_the_model_but_do_not_keep_it_alive() -> None:
    model = go.human_arm("left")
    assert meshes(model) is meshes(model)
    here = weakref.ref(model)
    del model
    gc.collect()
    assert here() is None


def wavy_surface(count: int = 40) -> Mesh:
    """A surface of 2 count^2 triangles without shared vertices."""
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, count + 1), np.linspace(-1.0, 1.0, count + 1))
    points = np.column_stack([x.ravel(), y.ravel(), 0.2 * np.sin(3.0 * x * y).ravel()])
    a = (np.arange(count) + (count + 1) * np.arange(count)[:, None]).ravel()
    b, c, d = a + 1, a + count + 1, a + count + 2
    triangles = np.concatenate([np.column_stack([a, b, d]), np.column_stack([a, d, c])])
    return Mesh(
        "link", points[triangles].reshape(-1, 3), np.arange(6 * count**2).reshape(-1, 3), (1, 1, 1)
    )


def test_welding_does_not_change_the_surface() -> None:
    many = wavy_surface()
    (welded,) = simplified([many], [True], 10000)
    assert len(welded.vertices) == 41**2
    assert_allclose(
        welded.vertices[welded.triangles], many.vertices[many.triangles], rtol=0, atol=1e-5
    )


def test_fewer_triangles_stay_close_to_the_surface() -> None:
    (fewer,) = simplified([wavy_surface()], [True], 800)
    assert 700 < len(fewer.triangles) <= 800
    for points, tolerance in (
        (fewer.vertices, 1e-12),
        (fewer.vertices[fewer.triangles].mean(axis=1), 5e-3),
    ):
        x, y, z = points.T
        assert np.abs(z - 0.2 * np.sin(3.0 * x * y)).max() < tolerance
    assert fewer.vertices[:, :2].min() == -1.0  # its corners stay
    normals = np.cross(*np.diff(fewer.vertices[fewer.triangles], axis=1).transpose(1, 0, 2))
    assert np.all(normals[:, 2] > 0.0)  # none is turned over


@pytest.mark.slow
def test_links_that_move_get_more_triangles_and_the_result_is_deterministic() -> None:
    found = [wavy_surface(), wavy_surface()]
    moving, still = simplified(found, [True, False], 1500)
    assert len(moving.triangles) > 1.1 * len(still.triangles)
    for first, second in zip((moving, still), simplified(found, [True, False], 1500), strict=True):
        assert np.array_equal(first.vertices, second.vertices)
        assert np.array_equal(first.triangles, second.triangles)


@pytest.mark.slow
def test_an_open_tube_stays_open_and_whole() -> None:
    """Collapses in the plane of its rim, which is a surface of its own, would close the opening."""
    tube = trimesh.creation.annulus(0.9, 1.0, 2.0, sections=64).subdivide().subdivide()
    flat = np.abs(tube.face_normals[:, 2]) > 0.5
    parts = [tube.faces[flat], tube.faces[~flat]]
    points = np.concatenate([tube.vertices, tube.vertices + np.array([0.0, 0.0, 1e-3])])
    shells = np.concatenate([parts[0], parts[1] + len(tube.vertices)])
    found = Mesh("link", points, shells, (1, 1, 1))
    (fewer,) = simplified([found], [True], len(shells) // 10)
    middles = fewer.vertices[fewer.triangles].mean(axis=1)
    distance = np.linalg.norm(middles[:, :2], axis=1)
    assert len(fewer.triangles) <= len(shells) // 10
    assert distance.min() > 0.8
    assert distance.max() <= 1.0
    assert np.all(fewer.vertices >= found.vertices.min(axis=0) - 1e-9)
    assert np.all(fewer.vertices <= found.vertices.max(axis=0) + 1e-9)


@pytest.mark.slow
def test_a_robots_own_meshes() -> None:
    model = known_robot("panda")
    found = meshes(model)
    assert {f"panda_link{number}" for number in range(8)} < {mesh.link for mesh in found}
    assert 0.8 * MAX_TRIANGLES < sum(len(mesh.triangles) for mesh in found) <= MAX_TRIANGLES
    whole = {}
    for shape, place, link in model.shapes.visual():
        whole[link] = np.array(shape.geometry.vertices()) @ place.rotation.T + place.translation
    for link in {mesh.link for mesh in found}:  # of one or more colours
        vertices = np.concatenate([mesh.vertices for mesh in found if mesh.link == link])
        for side in (np.min, np.max):
            moved = side(vertices, axis=0) - side(whole[link], axis=0)
            assert np.abs(moved).max() < 0.005
