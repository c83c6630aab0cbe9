"""The geometry of the links in a URDF, as Pinocchio reads it, with capsules."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pinocchio as pin

from geodesic_ocp.model.formats.urdf_parser import parsed

_SUPPORTED = ("box", "cylinder", "sphere", "capsule", "mesh")


def urdf_geometry(
    model: pin.Model, text: str, folder: Path | None, kind: pin.GeometryType
) -> pin.GeometryModel:
    """Return the geometry of one kind of all links.

    Args:
        model: the model of the whole file.
        text: text of the file, as Pinocchio reads it.
        folder: folder of the file; meshes are searched for in it and all its parents.
        kind: visual or collision geometry.

    Raises:
        ValueError: a shape is of an unknown type or not complete, or a mesh is missing or cannot be
            read.
    """
    root = ET.fromstring(text)
    if kind == pin.GeometryType.COLLISION:
        _check_shapes(root)
    wanted = kind.name.lower()
    other = "visual" if wanted == "collision" else "collision"
    capsules: list[str] = []
    for link in root.iterfind("link"):
        for shape in link.findall(other):
            link.remove(shape)
        for number, shape in enumerate(link.iterfind(wanted)):
            # The parser does not know capsules, and would drop all shapes of the link.
            if (capsule := shape.find("geometry/capsule")) is not None:
                capsule.tag = "cylinder"
                capsules.append(f"{link.get('name')}_{number}")
    folders = [] if folder is None else [folder, *folder.parents]
    bare = ET.tostring(root, encoding="unicode")
    directories = [str(each) for each in folders]
    found = parsed(lambda: pin.buildGeomFromUrdfString(model, bare, kind, package_dirs=directories))
    if found.messages and kind == pin.GeometryType.COLLISION:  # the parser left out these shapes
        raise ValueError("; ".join(found.messages))
    geometry = found.value
    for name in capsules:
        if not geometry.existGeometryName(name):
            raise ValueError(f"the capsule of {name.rpartition('_')[0]!r} is not complete")
        each = geometry.geometryObjects[geometry.getGeometryId(name)]
        length = 2.0 * each.geometry.halfLength  # which excludes the caps
        each.geometry = pin.coal.Capsule(each.geometry.radius, length)
    return geometry


def _check_shapes(root: ET.Element) -> None:
    for link in root.iterfind("link"):
        for shape in link.iterfind("collision"):
            kinds = [child.tag for child in shape.iterfind("geometry/*")]
            if len(kinds) != 1 or kinds[0] not in _SUPPORTED:
                what = " and ".join(kinds) or "empty"
                known = ", ".join(_SUPPORTED)
                raise ValueError(
                    f"the collision geometry of {link.get('name')!r} is {what}, not one of {known}"
                )
