"""Models written as MJCF, the format of MuJoCo."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from geodesic_ocp.model.joints import frame_index, motion_subspace
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import as_capsule

# MuJoCo takes no moving body without inertia: [kg] and [kg m^2], below the accuracy of any result.
_LEAST = 1e-12


def mjcf_text(model: Model) -> str:
    """Return the model as the text of an MJCF file, in the axes of its base.

    Every joint with the links that move with it is a body with its inertia, armature and limits;
    continuous joints have no limits. The links and the hand are sites, `Model.bodies` are geoms of
    the group 3, and every joint has a motor with the torque limits of the model's file. A massless
    link weighs 1e-12 kg.

    Raises:
        ValueError: a joint is a screw, or the collision geometry cannot be read.
    """
    native = model.pin
    root = ET.Element("mujoco", model=model.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    ET.SubElement(root, "option", gravity=numbers_text(native.gravity.linear))
    names = _body_names(native)
    bodies = {0: ET.SubElement(root, "worldbody")}
    for index in range(1, native.njoints):
        placement = native.jointPlacements[index]
        parent = bodies[native.parents[index]]
        bodies[index] = ET.SubElement(parent, "body", {"name": names[index], **_pose(placement)})
        _write_inertia(bodies[index], native.inertias[index])
        _write_joint(bodies[index], model, index)
    links = (frame for frame in native.frames if frame.type == pin.FrameType.BODY)
    for name in dict.fromkeys([*(str(frame.name) for frame in links), model.hand]):
        named = native.frames[frame_index(native, name)]
        attributes = {"name": name, **_pose(named.placement)}
        ET.SubElement(bodies[named.parentJoint], "site", attributes)
    _write_geoms(model, bodies)
    contact = ET.SubElement(root, "contact")  # MuJoCo excludes other neighbours by itself
    for index in range(1, native.njoints):
        if native.parents[index] == 0:
            ET.SubElement(contact, "exclude", body1="world", body2=names[index])
    actuators = ET.SubElement(root, "actuator")
    torques = np.column_stack([native.lowerEffortLimit, native.upperEffortLimit])
    for joint, limits in zip(model.joint_names, torques, strict=True):
        motor = ET.SubElement(actuators, "motor", name=joint, joint=joint)
        if np.all(np.isfinite(limits)):
            motor.set("ctrlrange", numbers_text(limits))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _body_names(native: pin.Model) -> dict[int, str]:
    """Return a unique name for the body of each joint: that of its link, or of the joint."""
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
    mass = repr(max(float(inertia.mass), _LEAST))
    if inertia.mass < _LEAST or np.linalg.eigvalsh(moments)[0] < _LEAST:
        moments = moments + _LEAST * np.eye(3)
    entries = numbers_text([*np.diag(moments), moments[0, 1], moments[0, 2], moments[1, 2]])
    ET.SubElement(
        element, "inertial", pos=numbers_text(inertia.lever), mass=mass, fullinertia=entries
    )


def _write_joint(element: ET.Element, model: Model, index: int) -> None:
    native = model.pin
    name = str(model.pin.names[index])
    linear, angular = np.split(motion_subspace(native, index), 2)
    if np.any(linear) and np.any(angular):
        raise ValueError(f"joint {name!r} is a screw, which MJCF does not have")
    row = native.joints[index].idx_v
    kind, axis = ("hinge", angular) if np.any(angular) else ("slide", linear)
    joint = ET.SubElement(element, "joint", name=name, type=kind, axis=numbers_text(axis))
    joint.set("armature", repr(float(native.armature[row])))
    limits = [model.lower[row], model.upper[row]]
    if name not in model.continuous and np.all(np.isfinite(limits)):
        joint.set("range", numbers_text(limits))


def _write_geoms(model: Model, bodies: dict[int, ET.Element]) -> None:
    seen = Counter[str]()
    for body in map(as_capsule, model.bodies):
        frame = model.pin.frames[frame_index(model.pin, str(body.link))]
        start, end = (frame.placement.act(np.array(point)) for point in (body.start, body.end))
        seen[str(body.link)] += 1
        shape = {"type": "sphere", "pos": numbers_text(start)}
        if np.linalg.norm(end - start) > 1e-9:
            shape = {"type": "capsule", "fromto": numbers_text([*start, *end])}
        name = f"{body.link}:{seen[str(body.link)]}"
        size = repr(float(body.radius))
        attributes = {"name": name, "mass": "0", "group": "3", "size": size, **shape}
        ET.SubElement(bodies[frame.parentJoint], "geom", attributes)


def _pose(placement: pin.SE3) -> dict[str, str]:
    x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
    return {"pos": numbers_text(placement.translation), "quat": numbers_text([w, x, y, z])}


def numbers_text(values: ArrayLike) -> str:
    """Return numbers as the text of an attribute, with all digits."""
    return " ".join(repr(float(value)) for value in np.asarray(values, dtype=float))
