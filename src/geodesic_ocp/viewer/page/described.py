"""A playback as data for the page's scripts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.styles import ROLES, SURROUNDINGS
from geodesic_ocp.model.look import Mesh
from geodesic_ocp.scenes.actor import Actor
from geodesic_ocp.scenes.markings import Trail
from geodesic_ocp.scenes.plain_text import plain_text
from geodesic_ocp.scenes.playback import PARAMETER, Playback
from geodesic_ocp.scenes.scene import Scene
from geodesic_ocp.viewer.page.extremes import extremes
from geodesic_ocp.viewer.page.packed import encoded, packed
from geodesic_ocp.viewer.video.drawing.part import smooth_surface
from geodesic_ocp.viewer.video.drawing.scene_parts import role_tint

_FINEST, _FEWEST, _MOST = 0.004, 8, 900  # [m] between points of a drawn trail, and their number

Shapes = dict[tuple[bytes, bytes], int]  # numbers of the meshes that were met so far


def described(playback: Playback) -> dict[str, Any]:
    """Everything that is drawn in three dimensions, and the spans; see scripts/page.js."""
    shapes: Shapes = {}
    bodies: list[dict[str, Any]] = []
    scenes = [_scene(scene, shapes, bodies) for scene in playback.scenes]
    data = {
        "range": playback.range,
        "parameter": playback.time_label == PARAMETER,
        "azimuth": playback.azimuth,
        "elevation": playback.elevation,
        "layers": [[layer, layer not in playback.hidden] for layer in playback.layers],
        "spans": [
            [name, [[span.name, span.start, span.stop, span.text] for span in spans]]
            for name, spans in playback.spans.items()
        ],
        "roles": {role: _look(role, style) for role, style in ROLES.items()},
        "colours": SURROUNDINGS,
        "bodies": bodies,
        "scenes": scenes,
    }
    return {name: _plain(value) for name, value in data.items()}


def _plain(data: Any) -> Any:
    """The same with all texts, most of which are names from files, as `plain_text`."""
    if isinstance(data, str):
        return plain_text(data)
    if isinstance(data, dict):
        return {name: _plain(value) for name, value in data.items()}
    return [_plain(value) for value in data] if isinstance(data, list | tuple) else data


def _look(role: str, style: Mapping[str, Any]) -> dict[str, Any]:
    """Colours of lines and bodies, and lengths of dash and gap in widths of the line."""
    line = style.get("linestyle")
    body = [round(each, 4) for each in role_tint(role)]
    return {"colour": style["color"], "body": body, "dash": line[1] if line else None}


def _scene(scene: Scene, shapes: Shapes, bodies: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "time": encoded(np.asarray(scene.time, dtype="<f8")),
        "extremes": packed(extremes(scene)),
        "actors": [_actor(actor, shapes, bodies) for actor in scene.actors],
        "trails": [_trail(trail) for trail in scene.trails],
        "solids": [
            {
                **{"name": solid.name, "layer": solid.layer, "unbounded": solid.unbounded},
                "body": _body(solid.vertices, solid.triangles, shapes, bodies),
            }
            for solid in scene.solids
        ],
        "frames": [
            {"name": f.name, "layer": f.layer, **_poses(f.rotations, f.positions)}
            for f in scene.frames
        ],
        "ellipsoids": [
            {
                **{"name": each.name, "layer": each.layer, "positions": packed(each.centres)},
                "axes": packed(each.axes.transpose(0, 2, 1).reshape(-1, 9)),
            }
            for each in scene.ellipsoids
        ],
        "gaps": [
            {
                **{"name": gap.name, "layer": gap.layer},
                "ends": packed(np.concatenate([gap.starts, gap.ends], axis=1)),
                "distances": packed(gap.distances[:, None]),
            }
            for gap in scene.gaps
        ],
        "clouds": [
            {
                **{"name": cloud.name, "layer": cloud.layer, "labels": cloud.labels},
                "role": cloud.role,
                "positions": packed(cloud.positions.reshape(len(cloud.positions), -1)),
            }
            for cloud in scene.clouds
        ],
    }


def _actor(actor: Actor, shapes: Shapes, bodies: list[dict[str, Any]]) -> dict[str, Any]:
    links: dict[str, list[Mesh]] = {}
    for mesh in actor.meshes:
        links.setdefault(mesh.link, []).append(mesh)
    return {
        **{"name": actor.name, "role": actor.role, "layer": actor.layer},
        "translucent": actor.translucent,
        "links": [
            {
                "name": link,
                **_poses(actor.rotations[link], actor.positions[link]),
                "parts": [
                    {
                        "body": _body(part.vertices, part.triangles, shapes, bodies),
                        "colour": [round(float(each), 4) for each in part.colour],
                    }
                    for part in parts
                ],
            }
            for link, parts in links.items()
        ],
    }


def _body(vertices: Array, triangles: Any, shapes: Shapes, bodies: list[dict[str, Any]]) -> int:
    """Number of a body, which is stored once however often it is shown.

    Its faces share vertices where it looks smooth.
    """
    corners = np.asarray(triangles, dtype=np.int64)
    key = (np.asarray(vertices, dtype=float).tobytes(), corners.tobytes())
    if key not in shapes:
        shapes[key] = len(bodies)
        points, _, faces = smooth_surface(np.asarray(vertices), np.asarray(triangles), len(corners))
        corners = np.ascontiguousarray(faces, dtype="<u4" if len(points) > 2**16 else "<u2")
        bodies.append(
            {
                "vertices": packed(points),
                "triangles": encoded(corners),
                "bits": 8 * corners.itemsize,
            }
        )
    return shapes[key]


def _poses(rotations: Array, positions: Array) -> dict[str, Any]:
    """Positions, and unit quaternions (x, y, z, w) whose signs do not jump."""
    turns = Rotation.from_matrix(rotations).as_quat()
    flips = np.where(np.sum(turns[1:] * turns[:-1], axis=1) < 0.0, -1.0, 1.0)
    turns[1:] *= np.cumprod(flips)[:, None]
    return {"positions": packed(positions), "turns": packed(turns)}


def _trail(trail: Trail) -> dict[str, Any]:
    return {
        **{"name": trail.name, "role": trail.role, "layer": trail.layer},
        "points": packed(_even(trail.points)),
        "dot": None if trail.dot is None else packed(trail.dot),
    }


def _even(points: Array) -> Array:
    """Points at even distances along a line, which rests and detours do not crowd."""
    known = points[np.isfinite(points).all(axis=1)]
    if len(known) < 2:
        return known
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(known, axis=0), axis=1)))
    count = int(np.clip(length[-1] / _FINEST, _FEWEST, _MOST))
    at = np.linspace(0.0, length[-1], count)
    return np.column_stack([np.interp(at, length, column) for column in known.T])
