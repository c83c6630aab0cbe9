"""Simox XML, the format of the Master Motor Map's reference model, as a Pinocchio model.

A robot is a tree of nodes; each has a transformation from its parent's frame, then a joint, then
its inertia in the frame behind the joint (Vahrenkamp et al., "Simox: a robotics toolbox for
simulation, motion and grasp planning", IAS 2012). Lengths without a unit are millimetres. What is
not understood and would change the model is an error.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.human_arm import DEFAULT_HEIGHT, DEFAULT_MASS, as_stature

_LENGTHS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}  # [m]
_ANGLES = {"radian": 1.0, "rad": 1.0, "degree": np.pi / 180.0, "deg": np.pi / 180.0}  # [rad]
_MASSES = {"kg": 1.0, "g": 1e-3}  # [kg]
_INERTIAS = {"kg*m^2": 1.0, "kgm^2": 1.0, "kg*m*m": 1.0}  # [kg m^2]
# Children that are read, and those that change neither place nor inertia.
_OF_NODE = {"transform", "joint", "physics", "child"}
_BESIDE_NODE = {"sensor", "visualization", "collisionmodel", "graspset", "primitivemodel"}
_OF_JOINT = {"axis", "translationdirection", "limits"}
_BESIDE_JOINT = {"maxacceleration", "maxvelocity", "maxtorque"}
_OF_TRANSFORM = {"matrix4x4", "translation", "rollpitchyaw"}
_OF_PHYSICS = {"mass", "com", "inertiamatrix"}
_BESIDE_PHYSICS = {"simulationtype", "ignorecollision", "friction"}
_ROTATION = 1e-3  # figures are printed with six digits


def simox_model(root: ET.Element, name: str, height: float | None, mass: float | None) -> pin.Model:
    """All joints of the file; every node is a frame of its own name.

    Args:
        root: the element <Robot>.
        name: of the file, for messages.
        height, mass: of the person [m], [kg], 1.75 m and 70 kg by default: a robot of type MMM is
            per unit of both. Others are what they are, and take neither.

    Raises:
        ValueError: names the node and what is wrong with it.
    """
    _lower(root)
    of_a_person = root.get("type", "") == "MMM"
    if not of_a_person and (height is not None or mass is not None):
        raise ValueError(f"height and mass scale MMM models, and {name} is of another type")
    units = _Units(1.0, 1.0)
    if of_a_person:
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
    todo = [(start, _Place(0, 0, pin.SE3.Identity()))]
    seen = set()
    while todo:
        node, place = todo.pop()
        if node in seen:
            raise ValueError(f"{name}: node {node!r} is reached twice")
        seen.add(node)
        try:
            place = _add(model, nodes[node], place, units)
        except ValueError as error:
            raise ValueError(f"{name}: node {node!r}: {error}") from None
        children = [child.get("name", "") for child in nodes[node].iterfind("child")]
        if missing := [child for child in children if child not in nodes]:
            raise ValueError(f"{name}: node {node!r} has an unknown child {missing[0]!r}")
        todo += [(child, place) for child in reversed(children)]  # depth first, as in the file
    return model


@dataclass(frozen=True)
class _Units:
    """What the file's metre and kilogram are."""

    length: float
    mass: float


@dataclass(frozen=True, eq=False)
class _Place:
    """Where a node is: its joint, its frame, and its place in the joint's frame."""

    joint: int
    frame: int
    within: pin.SE3


def _lower(element: ET.Element) -> None:
    """Tags and names of attributes in small letters: files differ in them."""
    for each in element.iter():
        each.tag = each.tag.lower()
        attributes = {key.lower(): value for key, value in each.attrib.items()}
        each.attrib.clear()
        each.attrib.update(attributes)


def _add(model: pin.Model, node: ET.Element, before: _Place, units: _Units) -> _Place:
    """Add a node behind another; returns its place."""
    _known(node, _OF_NODE, _BESIDE_NODE)
    name, joint, frame = node.attrib["name"], before.joint, before.frame
    place = before.within * _transform(node.find("transform"), units)
    movement = node.find("joint")
    kind = "fixed" if movement is None else movement.get("type", "fixed").lower()
    if movement is not None and kind != "fixed":
        if kind not in ("revolute", "prismatic"):
            raise ValueError(f"its joint is of type {kind!r}, not revolute, prismatic or fixed")
        if float(movement.get("offset", 0.0)) != 0.0:
            raise ValueError("its joint has an offset, which is not read")
        _known(movement, _OF_JOINT, _BESIDE_JOINT)
        lower, upper = _limits(movement, kind, units)
        free = np.array([np.inf])
        joint = model.addJoint(joint, _joint(movement, kind), place, name, free, free, lower, upper)
        place = pin.SE3.Identity()
        frame = model.addJointFrame(joint, frame)
    else:
        frame = model.addFrame(pin.Frame(name, joint, frame, place, pin.FrameType.BODY))
    if (physics := node.find("physics")) is not None:
        model.appendBodyToJoint(joint, _inertia(physics, units), place)
    return _Place(joint, frame, place)


def _known(element: ET.Element, read: set[str], ignored: set[str]) -> None:
    """Refuse children that are not understood, or occur twice where one is meant."""
    tags = [child.tag for child in element]
    for tag in tags:
        if tag not in read | ignored:
            raise ValueError(f"<{element.tag}> has a <{tag}>, which is not read")
        if tag in read - {"child"} and tags.count(tag) > 1:
            raise ValueError(f"<{element.tag}> has more than one <{tag}>")


def _joint(movement: ET.Element, kind: str) -> object:
    child = movement.find("axis" if kind == "revolute" else "translationdirection")
    axis = np.zeros(3) if child is None else _numbers(child, "xyz")
    if not np.any(axis):
        raise ValueError("its joint has no axis")
    axis = axis / np.linalg.norm(axis)
    along = int(np.argmax(axis))
    if np.array_equal(axis, np.eye(3)[along]):
        letter = "XYZ"[along]
        return getattr(pin, f"JointModel{'R' if kind == 'revolute' else 'P'}{letter}")()
    unaligned = {
        "revolute": pin.JointModelRevoluteUnaligned,
        "prismatic": pin.JointModelPrismaticUnaligned,
    }
    return unaligned[kind](axis)


def _unit(element: ET.Element, default: str, units: dict[str, float], kind: str = "") -> float:
    names = [f"units{kind}", "unit", "units"]
    given = next((element.attrib[name] for name in names if name in element.attrib), default)
    if given not in units:
        raise ValueError(f"<{element.tag}> is in {given!r}, not in {' or '.join(units)}")
    return units[given]


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
    _known(transform, _OF_TRANSFORM, set())
    if (matrix := transform.find("matrix4x4")) is not None:
        if len(transform) > 1:
            raise ValueError("<transform> has a <matrix4x4> and more")
        rows = _rows(matrix, 4)
        scale = _unit(matrix, "mm", _LENGTHS, "length") * units.length
        return pin.SE3(_rotation(rows[:3, :3]), scale * rows[:3, 3])
    translation, turn = transform.find("translation"), transform.find("rollpitchyaw")
    place, rotation = np.zeros(3), np.eye(3)
    if translation is not None:
        scale = _unit(translation, "mm", _LENGTHS, "length") * units.length
        place = scale * _numbers(translation, "xyz")
    if turn is not None:
        unit = _unit(turn, "radian", _ANGLES, "angle")
        rotation = pin.rpy.rpyToMatrix(*(unit * _numbers(turn, ("roll", "pitch", "yaw"))))
    return pin.SE3(rotation, place)


def _rows(matrix: ET.Element, size: int) -> Array:
    """The first three rows of a matrix, (3, size)."""
    columns = [f"c{number}" for number in range(1, size + 1)]
    rows = {row.tag: _numbers(row, columns) for row in matrix}
    needed = [f"row{number}" for number in range(1, 4)]
    if not set(needed) <= set(rows) <= {*needed, "row4"}:
        raise ValueError(f"<{matrix.tag}> needs row1, row2, row3, has {', '.join(rows)}")
    return np.array([rows[row] for row in needed])


def _rotation(rows: Array) -> Array:
    """The rotation that is nearest to printed figures."""
    if np.allclose(rows @ rows.T, np.eye(3), rtol=0.0, atol=1e-14) and np.linalg.det(rows) > 0:
        return rows
    left, stretch, right = np.linalg.svd(rows)
    if np.abs(stretch - 1.0).max() > _ROTATION or np.linalg.det(rows) < 0.0:
        raise ValueError("<matrix4x4> is no rotation with a translation")
    return np.asarray(left @ right)


def _limits(joint: ET.Element, kind: str, units: _Units) -> tuple[Array, Array]:
    limits = joint.find("limits")
    free = {"true", "1"} & {joint.get("limitless", "").lower()}
    if limits is None or free or limits.get("limitless", "").lower() == "true":
        return np.array([-np.inf]), np.array([np.inf])
    if kind == "revolute":
        unit = _unit(limits, "radian", _ANGLES, "angle")
    else:
        unit = _unit(limits, "mm", _LENGTHS, "length") * units.length
    lower, upper = unit * _numbers(limits, ("lo", "hi"))
    if lower > upper:
        raise ValueError(f"its lower limit {lower:g} lies above the upper {upper:g}")
    return np.array([lower]), np.array([upper])


def _inertia(physics: ET.Element, units: _Units) -> pin.Inertia:
    _known(physics, _OF_PHYSICS, _BESIDE_PHYSICS)
    mass, centre, tensor = (physics.find(tag) for tag in ("mass", "com", "inertiamatrix"))
    if mass is None:
        raise ValueError("its <Physics> has no <Mass>")
    (heavy,) = _numbers(mass, ("value",)) * _unit(mass, "kg", _MASSES, "weight") * units.mass
    lever, moments = np.zeros(3), np.zeros((3, 3))
    if centre is not None:
        where = centre.get("location", "Custom").lower()
        if where not in ("custom", "joint"):
            raise ValueError(f"its centre of mass is at {where!r}, which only meshes tell")
        if where == "custom":
            scale = _unit(centre, "mm", _LENGTHS, "length") * units.length
            lever = scale * _numbers(centre, "xyz")
    if tensor is not None:
        scale = _unit(tensor, "kg*m^2", _INERTIAS) * units.mass * units.length**2
        moments = scale * _rows(tensor, 3)
    if not np.allclose(moments, moments.T, rtol=1e-6, atol=0.0):
        raise ValueError("its <InertiaMatrix> is not symmetric")
    return pin.Inertia(heavy, lever, (moments + moments.T) / 2.0)
