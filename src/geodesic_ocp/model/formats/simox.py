"""Simox XML, the format of the reference model of the Master Motor Map, as a Pinocchio model.

A robot is a tree of nodes. Each has a transformation from the frame of its parent, then a joint,
then its inertia in the frame after the joint (Vahrenkamp et al., "Simox: a robotics toolbox for
simulation, motion and grasp planning", IAS 2012). Lengths without a unit are in millimetres.
Unknown elements that may change the model are errors.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.human import DEFAULT_HEIGHT, DEFAULT_MASS, as_stature
from geodesic_ocp.model.joints import joint_along

_LENGTHS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}  # [m]
_ANGLES = {"radian": 1.0, "rad": 1.0, "degree": np.pi / 180.0, "deg": np.pi / 180.0}  # [rad]
_MASSES = {"kg": 1.0, "g": 1e-3}  # [kg]
_INERTIAS = {"kg*m^2": 1.0, "kgm^2": 1.0, "kg*m*m": 1.0}  # [kg m^2]
# Children that are read, and those that are ignored, as they change neither pose nor inertia.
_READ = {
    "robotnode": {"transform", "joint", "physics", "child"},
    "joint": {"axis", "translationdirection", "limits"},
    "transform": {"matrix4x4", "translation", "rollpitchyaw"},
    "physics": {"mass", "com", "inertiamatrix"},
}
_IGNORED = {
    *("sensor", "visualization", "collisionmodel", "graspset", "primitivemodel"),
    *("maxacceleration", "maxvelocity", "maxtorque"),
    *("simulationtype", "ignorecollision", "friction"),
}
_ROTATION = 1e-3  # numbers are printed with six digits


def simox_model(root: ET.Element, name: str, height: float | None, mass: float | None) -> pin.Model:
    """Return the model with all joints of the file; every node becomes a frame with its name.

    Args:
        root: the element <Robot>.
        name: name of the file, for messages.
        height, mass: body height [m] and mass [kg], 1.75 m and 70 kg by default, for robots of type
            MMM, which are per unit of both; must be None for other types.

    Raises:
        ValueError: names the node and what is wrong with it.
    """
    for element in root.iter():  # files differ in case
        element.tag = element.tag.lower()
        element.attrib = {key.lower(): value for key, value in element.attrib.items()}
    is_mmm = root.get("type", "") == "MMM"
    if not is_mmm and (height is not None or mass is not None):
        raise ValueError(f"height and mass scale MMM models, but {name} is of another type")
    units = _Units(1.0, 1.0)
    if is_mmm:
        given = DEFAULT_HEIGHT if height is None else height, DEFAULT_MASS if mass is None else mass
        units = _Units(*as_stature(*given))

    nodes: dict[str, ET.Element] = {}
    for element in root.iterfind("robotnode"):
        node = element.get("name", "")
        if not node or node in nodes:
            raise ValueError(f"{name}: RobotNode name {node!r} is missing or occurs twice")
        nodes[node] = element
    start = root.get("rootnode", "")
    if start not in nodes:
        raise ValueError(f"{name}: RootNode {start!r} is not one of its RobotNodes")

    model = pin.Model()
    model.name = name.rsplit(".", 1)[0]
    seen = set()
    waiting: list[tuple[str, _Node]] = [(start, (0, 0, pin.SE3.Identity()))]  # the next one last
    while waiting:
        node, parent = waiting.pop()
        if node in seen:
            raise ValueError(f"{name}: node {node!r} is reached twice")
        seen.add(node)
        try:
            added = _add_node(model, nodes[node], parent, units)
        except ValueError as error:
            raise ValueError(f"{name}: node {node!r}: {error}") from None
        children = [child.get("name", "") for child in nodes[node].iterfind("child")]
        for child in reversed(children):
            if child not in nodes:
                raise ValueError(f"{name}: node {node!r} has an unknown child {child!r}")
            waiting.append((child, added))
    return model


class _Units(NamedTuple):
    """Metres and kilograms per unit of length and mass of the file."""

    length: float
    mass: float


# A node in the model: indices of its joint and frame, and its placement in the joint frame.
_Node: TypeAlias = tuple[int, int, pin.SE3]


def _add_node(model: pin.Model, node: ET.Element, parent: _Node, units: _Units) -> _Node:
    """Add a child node to a parent."""
    _check_children(node)
    name = node.attrib["name"]
    (joint, frame, placement) = parent
    placement = placement * _transform(node.find("transform"), units)
    movement = node.find("joint")
    kind = "fixed" if movement is None else movement.get("type", "fixed").lower()
    if movement is not None and kind != "fixed":
        if kind not in ("revolute", "prismatic"):
            raise ValueError(f"its joint is of type {kind!r}, not revolute, prismatic or fixed")
        if float(movement.get("offset", 0.0)) != 0.0:
            raise ValueError("its joint has an offset, which is not supported")
        _check_children(movement)
        limits = [np.array([limit]) for limit in _limits(movement, kind, units)]
        child = movement.find("axis" if kind == "revolute" else "translationdirection")
        axis = np.zeros(3) if child is None else _numbers(child, "xyz")
        if not np.any(axis):
            raise ValueError("its joint has no axis")
        free = np.array([np.inf])
        along = joint_along(axis / np.linalg.norm(axis), kind)
        joint = model.addJoint(joint, along, placement, name, free, free, *limits)
        placement = pin.SE3.Identity()
        frame = model.addJointFrame(joint, frame)
    else:
        frame = model.addFrame(pin.Frame(name, joint, frame, placement, pin.FrameType.BODY))
    if (physics := node.find("physics")) is not None:
        model.appendBodyToJoint(joint, _inertia(physics, units), placement)
    return joint, frame, placement


def _check_children(element: ET.Element) -> None:
    """Reject children that are unknown, or occur more than once where only one is allowed."""
    tags = [child.tag for child in element]
    read = _READ[element.tag]
    for tag in tags:
        if tag not in read | _IGNORED:
            raise ValueError(f"<{element.tag}> has a <{tag}>, which is not supported")
        if tag in read - {"child"} and tags.count(tag) > 1:
            raise ValueError(f"<{element.tag}> has more than one <{tag}>")


def _unit(element: ET.Element, default: str, units: dict[str, float], kind: str = "") -> float:
    names = [f"units{kind}", "unit", "units"]
    given = next((element.attrib[name] for name in names if name in element.attrib), default)
    if given not in units:
        raise ValueError(f"<{element.tag}> is in {given!r}, not in {' or '.join(units)}")
    return units[given]


def _metres(element: ET.Element, units: _Units) -> float:
    return _unit(element, "mm", _LENGTHS, "length") * units.length


def _numbers(element: ET.Element, names: Sequence[str]) -> Array:
    try:
        numbers = np.array([float(element.attrib[name]) for name in names])
    except KeyError as error:
        raise ValueError(f"<{element.tag}> has no {error.args[0]}") from None
    if not np.all(np.isfinite(numbers)):
        raise ValueError(f"<{element.tag}> has a number that is not finite")
    return numbers


def _transform(transform: ET.Element | None, units: _Units) -> pin.SE3:
    if transform is None:
        return pin.SE3.Identity()
    _check_children(transform)
    if (matrix := transform.find("matrix4x4")) is not None:
        if len(transform) > 1:
            raise ValueError("<transform> has a <matrix4x4> and other elements")
        rows = _rows(matrix, 4)
        return pin.SE3(_rotation(rows[:3, :3]), _metres(matrix, units) * rows[:3, 3])
    translation = transform.find("translation")
    angles = transform.find("rollpitchyaw")
    position = np.zeros(3)
    rotation = np.eye(3)
    if translation is not None:
        position = _metres(translation, units) * _numbers(translation, "xyz")
    if angles is not None:
        unit = _unit(angles, "radian", _ANGLES, "angle")
        rotation = pin.rpy.rpyToMatrix(*(unit * _numbers(angles, ("roll", "pitch", "yaw"))))
    return pin.SE3(rotation, position)


def _rows(matrix: ET.Element, size: int) -> Array:
    """Return the first three rows of a matrix, (3, size)."""
    columns = [f"c{number}" for number in range(1, size + 1)]
    rows = {row.tag: _numbers(row, columns) for row in matrix}
    needed = [f"row{number}" for number in range(1, 4)]
    if not set(needed) <= set(rows) <= {*needed, "row4"}:
        raise ValueError(f"<{matrix.tag}> needs row1, row2, row3, has {', '.join(rows)}")
    return np.array([rows[row] for row in needed])


def _rotation(rows: Array) -> Array:
    """Return the rotation closest to a printed matrix."""
    if np.allclose(rows @ rows.T, np.eye(3), rtol=0.0, atol=1e-14) and np.linalg.det(rows) > 0:
        return rows
    left, stretch, right = np.linalg.svd(rows)
    if np.abs(stretch - 1.0).max() > _ROTATION or np.linalg.det(rows) < 0.0:
        raise ValueError("<matrix4x4> is not a rotation and a translation")
    return np.asarray(left @ right)


def _limits(joint: ET.Element, kind: str, units: _Units) -> tuple[float, float]:
    limits = joint.find("limits")
    free = {"true", "1"} & {joint.get("limitless", "").lower()}
    if limits is None or free or limits.get("limitless", "").lower() == "true":
        return -np.inf, np.inf
    angular = kind == "revolute"
    unit = _unit(limits, "radian", _ANGLES, "angle") if angular else _metres(limits, units)
    lower, upper = unit * _numbers(limits, ("lo", "hi"))
    if lower > upper:
        raise ValueError(f"its lower limit {lower:g} lies above the upper {upper:g}")
    return lower, upper


def _inertia(physics: ET.Element, units: _Units) -> pin.Inertia:
    _check_children(physics)
    mass, centre, tensor = (physics.find(tag) for tag in ("mass", "com", "inertiamatrix"))
    if mass is None:
        raise ValueError("its <Physics> has no <Mass>")
    (value,) = _numbers(mass, ("value",)) * _unit(mass, "kg", _MASSES, "weight") * units.mass
    lever = np.zeros(3)
    moments = np.zeros((3, 3))
    if centre is not None:
        location = centre.get("location", "Custom").lower()
        if location not in ("custom", "joint"):
            raise ValueError(f"its centre of mass is at {location!r}, which only meshes define")
        if location == "custom":
            lever = _metres(centre, units) * _numbers(centre, "xyz")
    if tensor is not None:
        scale = _unit(tensor, "kg*m^2", _INERTIAS) * units.mass * units.length**2
        moments = scale * _rows(tensor, 3)
    if not np.allclose(moments, moments.T, rtol=1e-6, atol=0.0):
        raise ValueError("its <InertiaMatrix> is not symmetric")
    return pin.Inertia(value, lever, (moments + moments.T) / 2.0)
