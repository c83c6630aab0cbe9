"""The geometry of links as MuJoCo compiles it from an MJCF, as shapes of coal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from geodesic_ocp.model.formats.mjcf_source import (
    MjcfSource,
    installed_mujoco,
    name_of,
    placement,
)

_DEFAULT_COLOUR = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)  # any other precedes a material


def compiled_geometry(
    model: pin.Model, source: MjcfSource, kind: pin.GeometryType
) -> pin.GeometryModel:
    """Return the geoms of one kind as MuJoCo compiles them, meshes with their vertices.

    As in Pinocchio, geoms that collide with nothing are visual, those of groups from 3 on are
    collision geometry, and the others both.

    Raises:
        ValueError: MuJoCo refuses the model, as when the file of a mesh is missing.
    """
    native, _ = source.compiled(with_meshes=True)
    result = pin.GeometryModel()
    for geom in range(native.ngeom):
        collides = bool(native.geom_contype[geom] or native.geom_conaffinity[geom])
        if kind == pin.GeometryType.COLLISION:
            is_wanted = collides
        else:
            is_wanted = not collides or native.geom_group[geom] < 3
        body = name_of(native.body(native.geom_bodyid[geom]))
        shape = _shape(native, geom) if is_wanted else None
        if shape is None:
            continue
        frame_id = model.getFrameId(body, pin.FrameType.BODY)
        frame = model.frames[frame_id]
        pose = placement(native.geom_pos[geom], native.geom_quat[geom])
        colour = native.geom_rgba[geom]
        material = native.geom_matid[geom]
        if material >= 0 and np.array_equal(colour, _DEFAULT_COLOUR):
            colour = native.mat_rgba[material]
        each = pin.GeometryObject(
            native.geom(geom).name or f"{body}_{geom}",
            frame.parentJoint,
            frame_id,
            frame.placement * pose,
            shape,
        )
        each.meshColor = np.array(colour, dtype=float)
        result.addGeometryObject(each)
    return result


def _shape(native: Any, geom: int) -> Any:
    """Return a geom as a shape of coal; None for a plane, which is a floor and no link."""
    first, second, third = native.geom_size[geom].tolist()
    kind = installed_mujoco().mjtGeom(native.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
    simple: dict[str, Callable[[], Any]] = {
        "sphere": lambda: pin.coal.Sphere(first),
        "capsule": lambda: pin.coal.Capsule(first, 2.0 * second),
        "cylinder": lambda: pin.coal.Cylinder(first, 2.0 * second),
        "ellipsoid": lambda: pin.coal.Ellipsoid(first, second, third),
        "box": lambda: pin.coal.Box(2.0 * first, 2.0 * second, 2.0 * third),
        "mesh": lambda: _mesh(native, native.geom_dataid[geom]),
    }
    if kind not in simple and kind != "plane":
        body = native.body(native.geom_bodyid[geom]).name
        raise ValueError(
            f"the geometry of {body!r} is of the type {kind}, not one of {', '.join(simple)}"
        )
    return simple[kind]() if kind in simple else None


def _mesh(native: Any, mesh: int) -> Any:
    start = native.mesh_vertadr[mesh]
    count = native.mesh_vertnum[mesh]
    vertices = np.array(native.mesh_vert[start : start + count], dtype=float)
    start = native.mesh_faceadr[mesh]
    count = native.mesh_facenum[mesh]
    triangles = np.array(native.mesh_face[start : start + count], dtype=np.int64)
    shape = pin.coal.BVHModelOBBRSS()
    shape.beginModel(len(triangles), len(vertices))
    shape.addVertices(vertices)
    shape.addTriangles(triangles)
    shape.endModel()
    shape.computeLocalAABB()
    return shape
