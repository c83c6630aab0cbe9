"""Simox XML, the format of the Master Motor Map's reference model, as a Pinocchio model.

A robot is a tree of nodes; each has a transformation from its parent's frame, then a joint, then
its inertia in the frame behind the joint (Vahrenkamp et al., "Simox: a robotics toolbox for
simulation, motion and grasp planning", IAS 2012). Lengths without a unit are millimetres.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array, as_positive

DEFAULT_HEIGHT, DEFAULT_MASS = 1.75, 70.0  # [m], [kg]
_LENGTHS = {"mm": 1e-3, "m": 1.0}  # [m]
_ANGLES = {"radian": 1.0, "rad": 1.0, "degree": np.pi / 180.0, "deg": np.pi / 180.0}  # [rad]
_MASSES = {"kg": 1.0, "g": 1e-3}  # [kg]
_INERTIAS = {"kg*m^2": 1.0, "kgm^2": 1.0, "kg*m*m": 1.0}  # [kg m^2]


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
    of_a_person = root.get("Type", root.get("type", "")) == "MMM"
    if not of_a_person and (height is not None or mass is not None):
        raise ValueError(f"height and mass scale MMM models, and {name} is of another type")
    height = as_positive("height", height if height is not None else DEFAULT_HEIGHT, "m")
    mass = as_positive("mass", mass if mass is not None else DEFAULT_MASS, "kg")
    length, weight = (height, mass) if of_a_person else (1.0, 1.0)

    nodes: dict[str, ET.Element] = {}
    for element in root.iterfind("RobotNode"):
        node = element.get("name", "")
        if not node or node in nodes:
            raise ValueError(f"{name}: RobotNode name {node!r} is missing or occurs twice")
        nodes[node] = element
    start = root.get("RootNode", "")
    if start not in nodes:
        raise ValueError(f"{name}: RootNode {start!r} is not one of its RobotNodes")

    model = pin.Model()
    model.name = name.rsplit(".", 1)[0]
    todo = [(start, 0, 0, pin.SE3.Identity())]  # node, parent joint, parent frame, place in it
    seen = set()
    while todo:
        node, joint, frame, place = todo.pop()
        if node in seen:
            raise ValueError(f"{name}: node {node!r} is reached twice")
        seen.add(node)
        try:
            joint, frame, place = _add(model, nodes[node], joint, frame, place, length, weight)
        except (KeyError, ValueError) as error:
            raise ValueError(f"{name}: node {node!r}: {error}") from None
        children = [child.get("name", "") for child in nodes[node].iterfind("Child")]
        if missing := [child for child in children if child not in nodes]:
            raise ValueError(f"{name}: node {node!r} has an unknown child {missing[0]!r}")
        # Depth first, in the file's order.
        todo += [(child, joint, frame, place) for child in reversed(children)]
    return model


def _add(
    model: pin.Model,
    node: ET.Element,
    joint: int,
    frame: int,
    place: pin.SE3,
    length: float,
    weight: float,
) -> tuple[int, int, pin.SE3]:
    """Add a node; returns its joint, its frame, and its place in the joint's frame."""
    name = node.attrib["name"]
    place = place * _transform(node, length)
    movement = node.find("Joint")
    kind = "fixed" if movement is None else movement.get("type", "fixed").lower()
    if movement is not None and kind != "fixed":
        if kind not in ("revolute", "prismatic"):
            raise ValueError(f"its joint is of type {kind!r}, not revolute, prismatic or fixed")
        axis = _xyz(movement, "axis" if kind == "revolute" else "translationdirection", 1.0)
        if not np.any(axis):
            raise ValueError("its joint has no axis")
        units = _ANGLES if kind == "revolute" else {u: v * length for u, v in _LENGTHS.items()}
        lower, upper = _limits(movement, units)
        unlimited = np.array([np.inf])
        joint = model.addJoint(
            joint, _joint(kind, axis), place, name, unlimited, unlimited, lower, upper
        )
        place = pin.SE3.Identity()
        frame = model.addJointFrame(joint, frame)
    else:
        frame = model.addFrame(pin.Frame(name, joint, frame, place, pin.FrameType.BODY))
    if (physics := node.find("Physics")) is not None:
        model.appendBodyToJoint(joint, _inertia(physics, length, weight), place)
    return joint, frame, place


def _joint(kind: str, axis: Array) -> object:
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


def _child(element: ET.Element, name: str) -> ET.Element | None:
    """The child of that name; files differ in capitals."""
    return next((child for child in element if child.tag.lower() == name.lower()), None)


def _unit(element: ET.Element, default: str, units: dict[str, float]) -> float:
    given = element.get("unit", element.get("units", default))
    if given not in units:
        raise ValueError(f"<{element.tag}> is in {given!r}, not in {' or '.join(units)}")
    return units[given]


def _numbers(element: ET.Element, names: Sequence[str]) -> Array:
    try:
        return np.array([float(element.attrib[name]) for name in names])
    except KeyError as error:
        raise ValueError(f"<{element.tag}> has no {error.args[0]}") from None


def _xyz(element: ET.Element, name: str, scale: float) -> Array:
    child = _child(element, name)
    return np.zeros(3) if child is None else scale * _numbers(child, "xyz")


def _transform(node: ET.Element, length: float) -> pin.SE3:
    transform = _child(node, "Transform")
    if transform is None:
        return pin.SE3.Identity()
    if (matrix := _child(transform, "Matrix4x4")) is not None:
        rows = np.array([_numbers(row, ("c1", "c2", "c3", "c4")) for row in matrix])
        scale = _unit(matrix, "mm", _LENGTHS) * length
        # Printed with six digits: the nearest rotation.
        left, _, right = np.linalg.svd(rows[:3, :3])
        rotation = rows[:3, :3] if _is_rotation(rows[:3, :3]) else left @ right
        return pin.SE3(rotation, scale * rows[:3, 3])
    translation, turn = _child(transform, "Translation"), _child(transform, "rollpitchyaw")
    place, rotation = np.zeros(3), np.eye(3)
    if translation is not None:
        place = _unit(translation, "mm", _LENGTHS) * length * _numbers(translation, "xyz")
    if turn is not None:
        angles = _numbers(turn, ("roll", "pitch", "yaw")) * _unit(turn, "radian", _ANGLES)
        rotation = pin.rpy.rpyToMatrix(*angles)
    return pin.SE3(rotation, place)


def _is_rotation(matrix: Array) -> bool:
    return bool(np.allclose(matrix @ matrix.T, np.eye(3), rtol=0.0, atol=1e-14))


def _limits(joint: ET.Element, units: dict[str, float]) -> tuple[Array, Array]:
    limits = _child(joint, "Limits")
    if limits is None:
        return np.array([-np.inf]), np.array([np.inf])
    default = "radian" if "radian" in units else "mm"
    lower, upper = _numbers(limits, ("lo", "hi")) * _unit(limits, default, units)
    return np.array([lower]), np.array([upper])


def _inertia(physics: ET.Element, length: float, weight: float) -> pin.Inertia:
    mass, centre, tensor = (_child(physics, tag) for tag in ("Mass", "CoM", "InertiaMatrix"))
    if mass is None:
        raise ValueError("its <Physics> has no <Mass>")
    heavy = float(mass.get("value", "nan")) * _unit(mass, "kg", _MASSES) * weight
    lever, moments = np.zeros(3), np.zeros((3, 3))
    if centre is not None:
        where = centre.get("location", "Custom")
        if where.lower() not in ("custom", "joint"):
            raise ValueError(f"its centre of mass is at {where!r}, which only meshes tell")
        if where.lower() == "custom":
            lever = _unit(centre, "mm", _LENGTHS) * length * _numbers(centre, "xyz")
    if tensor is not None:
        rows = [_numbers(row, ("c1", "c2", "c3")) for row in tensor]
        moments = _unit(tensor, "kg*m^2", _INERTIAS) * weight * length**2 * np.array(rows)
    if moments.shape != (3, 3) or not np.all(np.isfinite([heavy, *lever, *moments.ravel()])):
        raise ValueError("its <Physics> is not a mass, a centre of mass and 3 x 3 moments")
    return pin.Inertia(heavy, lever, moments)
