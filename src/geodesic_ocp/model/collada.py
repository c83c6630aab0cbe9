"""Colours of the materials in Collada files (.dae), which Pinocchio's geometry does not keep."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Colour: TypeAlias = tuple[float, float, float]  # red, green and blue, from 0 to 1
_LOST = 0.01  # share of triangles, degenerate ones, that a reader of the file may leave out


def collada_runs(file: str, triangles: NDArray[np.int64]) -> list[tuple[slice, Colour]]:
    """Return which of the triangles (m, 3) that were read from a file have which colour.

    A reader takes the nodes of the scene in order, and in each node the groups of triangles, whose
    vertices are apart from those of other groups. A file with other features, such as textures or
    references to nodes, has no runs.
    """
    if Path(file).suffix.lower() != ".dae":
        return []
    try:
        groups = list(_groups(ET.parse(file).getroot()))
    except (ET.ParseError, OSError, KeyError, ValueError):
        return []
    total = sum(count for count, _ in groups)
    if not groups or not 0 <= total - len(triangles) <= _LOST * total:
        return []
    # Where no later triangle has a vertex of an earlier one.
    before = np.maximum.accumulate(triangles.max(axis=1))
    after = np.minimum.accumulate(triangles.min(axis=1)[::-1])[::-1]
    apart = np.concatenate([[0], np.flatnonzero(before[:-1] < after[1:]) + 1, [len(triangles)]])
    expected = np.cumsum([0, *(count for count, _ in groups)]) * len(triangles) / total
    ends = [int(apart[np.argmin(np.abs(apart - each))]) for each in expected]
    return [
        (slice(start, stop), colour)
        for start, stop, (_, colour) in zip(ends, ends[1:], groups, strict=False)
        if start < stop
    ]


def _groups(root: ET.Element) -> Iterator[tuple[int, Colour]]:
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


def _colour(material: ET.Element, by_id: dict[str | None, ET.Element]) -> Colour:
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
