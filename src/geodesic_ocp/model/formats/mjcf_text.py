"""A model as MJCF, for MuJoCo."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_vector
from geodesic_ocp.model.joints import frame_index, motion_subspace
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Body, as_capsule

# MuJoCo takes no moving body without inertia: [kg] and [kg m^2], below the accuracy of any result.
_LEAST = 1e-12


def mjcf_text(
    model: Model, gravity: ArrayLike | None = None, torque: ArrayLike | None = None
) -> str:
    """The model as the text of an MJCF file, in the axes of its base.

    Every joint with the links that move with it is a body with its inertia, armature and limits;
    continuous joints have no limits. The links and the hand are sites, `Model.bodies` are geoms of
    the group 3, and every joint has a motor. A massless link weighs 1e-12 kg.

    Args:
        model: the robot; its joints are revolute or prismatic.
        gravity: acceleration of free fall in the axes of the base (3,) [m/s^2]; None: the model's.
        torque: largest magnitudes (n,) that the motors exert [N m or N]; None: the limits of the
            model's file. Infinite for no limit.

    Raises:
        ValueError: a joint is a screw, wrong shapes, or the collision geometry cannot be read.
    """
    native = model.pin
    fall = native.gravity.linear if gravity is None else as_vector("gravity", gravity, 3)
    root = ET.Element("mujoco", model=model.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    ET.SubElement(root, "option", gravity=_numbers(fall))
    world = ET.SubElement(root, "worldbody")
    names = _body_names(native)
    bodies = {0: world}
    for index in range(1, native.njoints):
        placement = native.jointPlacements[index]
        parent = bodies[native.parents[index]]
        bodies[index] = ET.SubElement(parent, "body", {"name": names[index], **_pose(placement)})
        _write_inertia(bodies[index], native.inertias[index])
        _write_joint(bodies[index], model, index)
    sites = Counter[str]()
    for frame in native.frames:
        is_hand = frame.name == model.hand
        if (frame.type == pin.FrameType.BODY or is_hand) and not sites[frame.name]:
            sites[str(frame.name)] += 1
            named = native.frames[frame_index(native, frame.name)]
            attributes = {"name": str(frame.name), **_pose(named.placement)}
            ET.SubElement(bodies[named.parentJoint], "site", attributes)
    _write_geoms(model, bodies)
    contact = ET.SubElement(root, "contact")  # MuJoCo excludes other neighbours by itself
    for index in range(1, native.njoints):
        if native.parents[index] == 0:
            ET.SubElement(contact, "exclude", body1="world", body2=names[index])
    actuators = ET.SubElement(root, "actuator")
    for joint, limits in zip(model.joint_names, _torque_ranges(model, torque), strict=True):
        motor = ET.SubElement(actuators, "motor", name=joint, joint=joint)
        if np.all(np.isfinite(limits)):
            motor.set("ctrlrange", _numbers(limits))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _torque_ranges(model: Model, torque: ArrayLike | None) -> Array:
    """Smallest and largest torque of each joint, (n, 2)."""
    if torque is None:
        return np.column_stack([model.pin.lowerEffortLimit, model.pin.upperEffortLimit])
    largest = np.array(torque, dtype=float)
    if largest.shape != (model.dof,) or not np.all(largest > 0.0):
        raise ValueError(f"torque must be {model.dof} positive numbers, got {torque!r}")
    return np.column_stack([-largest, largest])


def _body_names(native: pin.Model) -> dict[int, str]:
    """A unique name for the body of each joint: that of its link, or of the joint."""
    names: dict[int, str] = {}
    for frame in native.frames:
        name = str(frame.name)
        is_link = frame.type == pin.FrameType.BODY and frame.parentJoint > 0
        if is_link and name != "world" and name not in names.values():
            names.setdefault(int(frame.parentJoint), name)
    for index in range(1, native.njoints):
        names.setdefault(index, f"link of {native.names[index]}")
    return names


def _write_inertia(element: ET.Element, inertia: pin.Inertia) -> None:
    moments = np.array(inertia.inertia)
    if inertia.mass < _LEAST or np.linalg.eigvalsh(moments)[0] < _LEAST:
        moments = moments + _LEAST * np.eye(3)
    entries = [*np.diag(moments), moments[0, 1], moments[0, 2], moments[1, 2]]
    ET.SubElement(
        element,
        "inertial",
        pos=_numbers(inertia.lever),
        mass=repr(max(float(inertia.mass), _LEAST)),
        fullinertia=_numbers(entries),
    )


def _write_joint(element: ET.Element, model: Model, index: int) -> None:
    native, name = model.pin, str(model.pin.names[index])
    linear, angular = np.split(motion_subspace(native, index), 2)
    if np.any(linear) and np.any(angular):
        raise ValueError(f"joint {name!r} is a screw, which MJCF does not have")
    row = native.joints[index].idx_v
    kind, axis = ("hinge", angular) if np.any(angular) else ("slide", linear)
    armature = repr(float(native.armature[row]))
    joint = ET.SubElement(
        element, "joint", name=name, type=kind, axis=_numbers(axis), armature=armature
    )
    limits = [model.lower[row], model.upper[row]]
    if name not in model.continuous and np.all(np.isfinite(limits)):
        joint.set("range", _numbers(limits))


def _write_geoms(model: Model, bodies: dict[int, ET.Element]) -> None:
    seen = Counter[str]()
    for body in model.bodies:
        frame = model.pin.frames[frame_index(model.pin, str(body.link))]
        seen[str(body.link)] += 1
        name = f"{body.link}:{seen[str(body.link)]}"
        geom = ET.SubElement(bodies[frame.parentJoint], "geom", name=name, mass="0", group="3")
        _set_shape(geom, body, frame.placement)


def _set_shape(geom: ET.Element, body: Body, placement: pin.SE3) -> None:
    capsule = as_capsule(body)
    start, end = (placement.act(np.array(point)) for point in (capsule.start, capsule.end))
    geom.set("size", repr(float(body.radius)))
    if np.linalg.norm(end - start) > 1e-9:
        geom.set("type", "capsule")
        geom.set("fromto", _numbers([*start, *end]))
    else:
        geom.set("type", "sphere")
        geom.set("pos", _numbers(start))


def _pose(placement: pin.SE3) -> dict[str, str]:
    x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
    return {"pos": _numbers(placement.translation), "quat": _numbers([w, x, y, z])}


def _numbers(values: ArrayLike) -> str:
    return " ".join(repr(float(value)) for value in np.asarray(values, dtype=float))
