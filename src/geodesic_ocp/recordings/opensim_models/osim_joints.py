"""The joints of an .osim file, in the layouts of OpenSim 3 and 4."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.opensim_models.osim_model import (
    GROUND,
    OffsetFrame,
    OsimAxis,
    OsimCoordinate,
    OsimJoint,
)
from geodesic_ocp.recordings.opensim_models.osim_xml import flag, numbers, read_function, text_of

# Rotations about (r) and translations along (t) axes of the joint, in the order of the coordinates.
# Source: the classes' documentation in OpenSim's API, https://simtk.org/api_docs/opensim/api_docs/
_JOINTS = {
    "WeldJoint": (),
    "PinJoint": ("rz",),
    "SliderJoint": ("tx",),
    "UniversalJoint": ("rx", "ry"),
    "BallJoint": ("rx", "ry", "rz"),
    "GimbalJoint": ("rx", "ry", "rz"),
    "FreeJoint": ("rx", "ry", "rz", "tx", "ty", "tz"),
    "PlanarJoint": ("rz", "tx", "ty"),
}
_SHORTEST_AXIS = 1e-6


def joint_of_body(body: str, element: ElementTree.Element) -> OsimJoint:
    """The joint within the element Body of this name, as in OpenSim 3.

    Raises:
        RecordingError: an element is missing or malformed; names it.
    """
    parent = text_of(element, "parent_body").rpartition("/")[2]
    if not parent:
        raise RecordingError("<parent_body> is missing")
    return _joint(
        element,
        _offset(parent, element, "location_in_parent", "orientation_in_parent"),
        _offset(body, element, "location", "orientation"),
        _children(element, "CoordinateSet/objects"),
    )


def joint_of_set(
    element: ElementTree.Element, others: Mapping[str, ElementTree.Element]
) -> OsimJoint:
    """A joint of the JointSet, as in OpenSim 4.

    Args:
        element: of the joint.
        others: elements PhysicalOffsetFrame by name, outside of joints.

    Raises:
        RecordingError: an element is missing or malformed; names it.
    """
    frames = {each.get("name", ""): each for each in element.findall("frames/PhysicalOffsetFrame")}
    ends = [_frame(element, f"socket_{end}_frame", frames, others) for end in ("parent", "child")]
    return _joint(element, ends[0], ends[1], _children(element, "coordinates"))


def _children(element: ElementTree.Element, path: str) -> list[ElementTree.Element]:
    return element.findall(f"{path}/Coordinate")


def coordinates_of(element: ElementTree.Element) -> list[OsimCoordinate]:
    """The coordinates of a joint in either layout; a malformed range counts as none."""
    found = []
    for each in (*_children(element, "CoordinateSet/objects"), *_children(element, "coordinates")):
        try:
            lower, upper = numbers(each, "range", 2)
            limits = (float(lower), float(upper)) if upper > lower else None
        except RecordingError:
            limits = None
        default = float(numbers(each, "default_value", 1, np.zeros(1))[0])
        name = each.get("name", "")
        found.append(OsimCoordinate(name, default, limits, flag(each, "locked")))
    return found


def _offset(
    body: str, element: ElementTree.Element, location: str, orientation: str
) -> OffsetFrame:
    angles = numbers(element, orientation, 3, np.zeros(3))
    rotation = scipy.spatial.transform.Rotation.from_euler("XYZ", angles).as_matrix()
    return OffsetFrame(body, rotation, numbers(element, location, 3, np.zeros(3)))


def _frame(
    element: ElementTree.Element,
    socket: str,
    frames: Mapping[str, ElementTree.Element],
    others: Mapping[str, ElementTree.Element],
) -> OffsetFrame:
    """The pose in its body of the frame to which the socket is connected."""
    path = _socket(element, socket)
    rotation, position = np.eye(3), np.zeros(3)
    for _ in range(len(frames) + len(others) + 1):
        holder, _, name = path.rpartition("/")
        is_body = holder.endswith("bodyset") or name == GROUND
        offset = None if is_body else frames.get(name, others.get(name))
        if offset is None:
            return OffsetFrame(name, rotation, position)
        inner = _offset("", offset, "translation", "orientation")
        position = inner.position + inner.rotation @ position
        rotation = inner.rotation @ rotation
        path = _socket(offset, "socket_parent")
    raise RecordingError(f"<{socket}>: the frame {name!r} is in no body")


def _socket(element: ElementTree.Element, tag: str) -> str:
    path = text_of(element, tag) or text_of(element, f"{tag}_connectee_name")
    if not path:
        raise RecordingError(f"<{tag}> of <{element.tag}> is missing")
    return path


def _joint(
    element: ElementTree.Element,
    parent: OffsetFrame,
    child: OffsetFrame,
    coordinates: list[ElementTree.Element],
) -> OsimJoint:
    name = element.get("name", "")
    if child.body == GROUND:
        raise RecordingError("its child frame is in the ground")
    try:
        if flag(element, "reverse"):
            raise RecordingError("it is reversed (from child to parent), which is not read")
        if element.tag == "CustomJoint":
            rotations, translations = _spatial_transform(element)
        else:
            names = [each.get("name", "") for each in coordinates]
            rotations, translations = _simple(element.tag, names)
    except RecordingError as failure:
        return OsimJoint(name, parent, child, refusal=str(failure))
    return OsimJoint(name, parent, child, rotations, translations)


def _simple(kind: str, names: list[str]) -> tuple[tuple[OsimAxis, ...], tuple[OsimAxis, ...]]:
    if kind not in _JOINTS:
        raise RecordingError(f"{kind} is not read; known are CustomJoint, {', '.join(_JOINTS)}")
    motions = _JOINTS[kind]
    if len(names) != len(motions):
        raise RecordingError(f"{kind} must have {len(motions)} coordinates, has {len(names)}")
    axes = {
        motion: OsimAxis(np.eye(3)["xyz".index(motion[1])], (name,), _identity)
        for motion, name in zip(motions, names, strict=True)
    }
    return (
        tuple(axis for motion, axis in axes.items() if motion[0] == "r"),
        tuple(axis for motion, axis in axes.items() if motion[0] == "t"),
    )


def _identity(values: Array) -> Array:
    first: Array = values[0]
    return first


def _spatial_transform(
    element: ElementTree.Element,
) -> tuple[tuple[OsimAxis, ...], tuple[OsimAxis, ...]]:
    transform = element.find("SpatialTransform")
    if transform is None:
        raise RecordingError("<SpatialTransform> is missing")
    rotations: list[OsimAxis] = []
    translations: list[OsimAxis] = []
    for each in transform.findall("TransformAxis"):
        names = tuple(text_of(each, "coordinates").split())
        where = each.get("name", "")
        functions = [child for child in each if child.tag not in ("coordinates", "axis")]
        if len(functions) == 1 and functions[0].tag == "function":  # OpenSim 3
            functions = list(functions[0])
        if not functions and not names:
            continue
        if len(functions) != 1:
            raise RecordingError(f"<TransformAxis name={where!r}> must have one function")
        try:
            axis = numbers(each, "axis", 3)
            function = read_function(functions[0], len(names))
        except RecordingError as failure:
            raise RecordingError(f"<TransformAxis name={where!r}>: {failure}") from None
        length = float(np.linalg.norm(axis))
        if length < _SHORTEST_AXIS:
            raise RecordingError(f"<TransformAxis name={where!r}> has the axis 0 0 0")
        axes = rotations if where.startswith("rotation") else translations
        axes.append(OsimAxis(axis / length, names, function))
    return tuple(rotations), tuple(translations)
