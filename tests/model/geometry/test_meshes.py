"""Triangle meshes of visual geometry and of capsules, and their decimation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from gadget import MJCF, urdf
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.model.formats.robots import ROBOTS, folder
from geodesic_ocp.model.geometry.meshes import (
    MAX_TRIANGLES,
    Mesh,
    _capsule_surface,
    _clustered,
    _decimated,
    meshes,
)

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


def drawn(link: str, *geometries: str, tag: str = "visual", material: str = "") -> str:
    """The gadget with shapes on one of its links."""
    shapes = "".join(
        f"<{tag}>{ORIGIN}<geometry>{each}</geometry>{material}</{tag}>" for each in geometries
    )
    return urdf().replace(f'<link name="{link}">', f'<link name="{link}">{shapes}')


@pytest.mark.parametrize("kind", SHAPES)
def test_simple_shapes_are_closed_and_have_the_right_size(kind: str) -> None:
    (mesh,) = meshes(go.load_model(drawn("three", SHAPES[kind]), hand="grip"))
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
    (mesh,) = meshes(go.load_model(drawn("one", SHAPES["box"], material=material), hand="grip"))
    assert_allclose(mesh.colour, (1.0, 0.25, 0.0), rtol=0, atol=1e-7)  # single precision


def test_fixed_and_locked_links_have_meshes() -> None:
    text = drawn("lift", SHAPES["box"]).replace(
        '<link name="beside">',
        f'<link name="beside"><visual><geometry>{SHAPES["sphere"]}</geometry></visual>',
    )
    model = go.load_model(text, hand="grip", base="lift")
    assert {mesh.link for mesh in meshes(model)} == {"lift", "beside"}
    assert not model.moves("lift")


def test_visual_geometry_is_preferred_to_collision_geometry() -> None:
    both = drawn("three", SHAPES["sphere"]).replace(
        "<visual>", f"<collision><geometry>{SHAPES['box']}</geometry></collision><visual>"
    )
    (mesh,) = meshes(go.load_model(both, hand="grip"))
    assert volume(mesh) == pytest.approx(VOLUMES["sphere"], rel=ROUND)
    hidden = drawn("three", SHAPES["sphere"], tag="collision")
    (mesh,) = meshes(go.load_model(hidden, hand="grip"))
    assert volume(mesh) == pytest.approx(VOLUMES["sphere"], rel=ROUND)


def test_unreadable_visual_geometry_is_replaced_by_capsules() -> None:
    broken = drawn("one", '<mesh filename="nowhere.stl"/>', SHAPES["box"])
    assert meshes(go.load_model(broken, hand="grip")) == ()
    text = broken.replace(
        '<link name="three">',
        f'<link name="three"><collision><geometry>{SHAPES["sphere"]}</geometry></collision>',
    )
    assert [mesh.link for mesh in meshes(go.load_model(text, hand="grip"))] == ["three"]


def test_without_geometry_there_are_no_meshes() -> None:
    assert meshes(go.load_model(urdf(), hand="grip")) == ()
    assert meshes(go.load_model(pin.buildModelFromXML(urdf()), hand="grip")) == ()


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
        (mesh,) = meshes(go.load_model(file, hand="grip"))
        assert mesh.vertices.shape == (4, 3)
        assert is_closed(mesh)
        assert volume(mesh) == pytest.approx(size / 6.0, rel=1e-6)  # single precision


def test_geometry_of_mjcf_has_meshes() -> None:
    model = go.load_model(MJCF, hand="tip", base="trunk")
    assert {mesh.link for mesh in meshes(model)} == {"trunk", "upper", "fore", "f1", "f2"}


def test_capsules_and_balls_are_closed_around_their_axes(arm: go.Model) -> None:
    for mesh, capsule in zip(meshes(arm), arm.bodies, strict=True):
        assert isinstance(capsule, go.Capsule)
        start, end = np.array(capsule.start), np.array(capsule.end)
        length = float(np.linalg.norm(end - start))
        expected = np.pi * capsule.radius**2 * (length + 4 / 3 * capsule.radius)
        assert mesh.link == capsule.link
        assert is_closed(mesh)
        assert volume(mesh) == pytest.approx(expected, rel=ROUND)
        along = np.clip((mesh.vertices - start) @ (end - start) / length**2, 0.0, 1.0)
        away = np.linalg.norm(mesh.vertices - start - along[:, None] * (end - start), axis=1)
        # Vertices within 1e-5 of the size of the mesh are welded into their mean.
        assert_allclose(away, capsule.radius, rtol=0, atol=1e-5 * length)
    ball = arm.with_bodies(go.Ball((0.1, 0.2, 0.3), 0.2, "hand"))
    (mesh,) = meshes(ball)
    assert is_closed(mesh)
    assert volume(mesh) == pytest.approx(VOLUMES["sphere"], rel=ROUND)


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
    welded = _clustered(many, 1e-5)
    assert len(welded.vertices) == 41**2
    assert len(welded.triangles) == len(many.triangles)
    expected, found = (mesh.vertices[mesh.triangles] for mesh in (many, welded))
    assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("cell", [0.07, 0.1, 0.3])
def test_clustering_changes_the_bounding_box_by_less_than_a_cell(cell: float) -> None:
    points, triangles = _capsule_surface(0.5, 0.7)
    for mesh in (_clustered(wavy_surface(), 1e-5), Mesh("link", points, triangles, (1, 1, 1))):
        fewer = _clustered(mesh, cell, by_normal=True)
        assert len(fewer.triangles) < len(mesh.triangles)
        for side in (np.min, np.max):
            moved = side(fewer.vertices, axis=0) - side(mesh.vertices, axis=0)
            assert np.abs(moved).max() <= cell
        corners = np.sort(fewer.triangles, axis=1)
        assert np.all(np.diff(corners, axis=1) > 0)  # not degenerate
        assert len(np.unique(corners, axis=0)) == len(corners)
        assert np.array_equal(np.unique(corners), np.arange(len(fewer.vertices)))


def test_decimation_reaches_the_requested_number_of_triangles() -> None:
    found = [wavy_surface(), wavy_surface(20)]
    (untouched, _) = _decimated(found, [True, True], 10000)
    assert len(untouched.triangles) == 3200
    fewer = _decimated(found, [True, False], 1000)
    assert 700 <= sum(len(mesh.triangles) for mesh in fewer) <= 1000
    again = _decimated(found, [True, False], 1000)
    for first, second in zip(fewer, again, strict=True):
        assert np.array_equal(first.vertices, second.vertices)
        assert np.array_equal(first.triangles, second.triangles)
    moving, still = (
        len(_decimated([found[0], found[0]], moves, 1500)[0].triangles)
        for moves in ([True, False], [False, True])
    )
    assert moving > 2 * still


@pytest.mark.slow
def test_a_robots_own_meshes() -> None:
    if folder(ROBOTS["panda"].package) is None:
        pytest.skip("example-robot-data is not installed (make robots)")
    model = go.load_model("panda")
    found = meshes(model)
    assert {f"panda_link{number}" for number in range(8)} < {mesh.link for mesh in found}
    assert 0.8 * MAX_TRIANGLES < sum(len(mesh.triangles) for mesh in found) <= MAX_TRIANGLES
    drawing, _ = model.shapes.visual()
    whole = {}
    for shape in drawing.geometryObjects:
        frame = model.shapes.pin.frames[shape.parentFrame]
        place = frame.placement.actInv(shape.placement)
        whole[frame.name] = np.array(shape.geometry.vertices()) @ place.rotation.T
        whole[frame.name] += place.translation
    for mesh in found:
        for side in (np.min, np.max):
            moved = side(mesh.vertices, axis=0) - side(whole[mesh.link], axis=0)
            assert np.abs(moved).max() < 0.01  # one cell, for the fixed base of 0.2 m
