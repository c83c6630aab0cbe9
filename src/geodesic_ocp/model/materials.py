"""Materials of Collada (.dae) and Wavefront (.obj) files, which Pinocchio does not keep."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array

_Colour: TypeAlias = tuple[float, float, float]  # red, green and blue, from 0 to 1
# Triangles (m, 3), their colour, and whether it is of a texture, which another colour tints.
_Part: TypeAlias = tuple[NDArray[np.int64], _Colour | None, bool]
_SHADES = 8  # into which a texture is divided
_LOST = 0.01  # share of triangles, degenerate ones, that a reader of the file may leave out


def material_parts(
    file: str, points: Array, triangles: NDArray[np.int64], scale: Array
) -> tuple[Array, list[_Part]]:
    """Return vertices (k, 3) of a mesh, and triangles and colour of each material in its file.

    coal 3 numbers the vertices of each material of an object from the same one on, which is
    corrected here. A texture becomes a few materials: each triangle has the colour in its middle.

    Args:
        file: path of the file of the mesh.
        points: vertices as read, scaled (k, 3) [m].
        triangles: indices of vertices as read (m, 3).
        scale: factors along the axes of the file (3,).
    """
    suffix = Path(file).suffix.lower()
    if suffix == ".obj" and b"usemtl" in Path(file).read_bytes():
        return _wavefront(file, scale)
    parts: list[_Part] = []
    if suffix == ".dae":
        parts += [(*each, False) for each in _collada(file, triangles, len(points))]
    return points, parts or [(triangles, None, False)]


def _wavefront(file: str, scale: Array) -> tuple[Array, list[_Part]]:
    import trimesh
    from PIL import Image

    parts: list[_Part] = []
    points = [np.empty((0, 3))]
    for mesh in trimesh.load_scene(file, process=False).geometry.values():
        triangles = mesh.faces + sum(map(len, points))
        points.append(mesh.vertices * scale)
        material: Any = getattr(mesh.visual, "material", None)
        if getattr(material, "image", None) is None:
            colour = None if material is None else tuple((material.main_color[:3] / 255.0).tolist())
            parts.append((triangles, colour, False))
            continue
        seen = material.to_color(mesh.visual.uv[mesh.faces].mean(axis=1))[None, :, :3]
        few = Image.fromarray(seen).quantize(_SHADES, Image.Quantize.FASTOCTREE)
        palette = np.reshape(few.getpalette() or (), (-1, 3)) / 255.0
        (which,) = np.asarray(few)
        for each in np.unique(which):
            parts.append((triangles[which == each], tuple(palette[each].tolist()), True))
    return np.concatenate(points), parts


def _collada(
    file: str, triangles: NDArray[np.int64], count: int
) -> list[tuple[NDArray[np.int64], _Colour]]:
    """Return triangles and colour of each material; none for a file with other features, such as
    textures or references to nodes.

    A reader takes the nodes of the scene in order, and in each node the groups of triangles, whose
    vertices follow each other.
    """
    try:
        groups = list(_groups(ET.parse(file).getroot()))
    except (ET.ParseError, OSError, KeyError, ValueError):
        return []
    expected = np.cumsum([0, *(number for number, _ in groups)])
    lost = int(expected[-1]) - len(triangles)
    if not groups or not 0 <= lost <= _LOST * expected[-1]:
        return []
    before = np.maximum.accumulate(triangles.max(axis=1))
    low = triangles.min(axis=1)
    after = np.minimum.accumulate(low[::-1])[::-1]
    ends = [0]
    for end in expected[1:-1]:
        places = np.arange(max(end - lost, ends[-1] + 1), min(end + 1, len(triangles)))
        if not len(places):
            return []
        # No later triangle has a vertex of an earlier one; or else the numbers begin again.
        apart = places[before[places - 1] < after[places]]
        again = places[np.argmax(triangles.max(axis=1)[places - 1] - low[places])]
        ends.append(int(apart[-1] if len(apart) else again))
    pieces = [triangles[each] for each in map(slice, ends, [*ends[1:], len(triangles)])]
    sizes = [int(np.ptp(piece)) + 1 for piece in pieces]
    if sum(sizes) == count:
        starts = np.cumsum([0, *sizes[:-1]])
        pieces = [piece - piece.min() + at for piece, at in zip(pieces, starts, strict=True)]
    return [(piece, colour) for piece, (_, colour) in zip(pieces, groups, strict=True)]


def _groups(root: ET.Element) -> Iterator[tuple[int, _Colour]]:
    """Yield number and colour of the triangles of each group, in the order of the scene."""
    by_id = {each.get("id"): each for each in root.iter() if each.get("id")}
    scene = root.find("{*}scene/{*}instance_visual_scene")
    if scene is None:
        raise ValueError("no scene")
    for shown in by_id[_target(scene)].iter():
        if shown.tag.endswith("}instance_node") or shown.tag.endswith("}instance_controller"):
            raise ValueError("parts from elsewhere")
        if not shown.tag.endswith("}instance_geometry"):
            continue
        bound = {
            each.get("symbol"): by_id[_target(each, "target")]
            for each in shown.iterfind("{*}bind_material/{*}technique_common/{*}instance_material")
        }
        for group in by_id[_target(shown)].iterfind("{*}mesh/*"):
            kind = group.tag.rpartition("}")[2]
            count = int(group.get("count", 0))
            if kind == "polylist":
                corners = np.array((group.findtext("{*}vcount") or "").split(), dtype=int)
                count = int((corners - 2).sum())
            elif kind in ("polygons", "trifans", "tristrips"):
                raise ValueError(kind)
            if kind in ("triangles", "polylist"):
                yield count, _colour(bound[group.get("material")], by_id)


def _colour(material: ET.Element, by_id: dict[str | None, ET.Element]) -> _Colour:
    effect = material.find("{*}instance_effect")
    if effect is None:
        raise ValueError("a material without an effect")
    text = by_id[_target(effect)].findtext(".//{*}diffuse/{*}color")
    if text is None:
        raise ValueError("a texture in place of a colour")
    red, green, blue = np.clip(np.array(text.split()[:3], dtype=float), 0.0, 1.0).tolist()
    return red, green, blue


def _target(element: ET.Element, attribute: str = "url") -> str:
    return element.get(attribute, "").removeprefix("#")
