"""MJCF as a Pinocchio model. What Pinocchio leaves out and would change the model is an error."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio as pin

from geodesic_ocp.model.mimic import Mimic


def mjcf_model(
    root: ET.Element, name: str, folder: Path | None
) -> tuple[pin.Model, dict[str, Mimic], tuple[str, ...]]:
    """The model, its followers (joint equalities), and what was left out without effect on it.

    Args:
        root: the element <mujoco>; its includes are expanded in place.
        name: of the file, for messages.
        folder: where included files are looked for.

    Raises:
        ValueError: Pinocchio cannot read it, or would leave out what changes the model.
    """
    _include(root, name, folder, ())
    _refuse(root, name)
    for body in list(root.iter("body")):
        _give_each_joint_a_body(body)
    with tempfile.TemporaryDirectory() as scratch:
        written = Path(scratch) / "model.xml"
        ET.ElementTree(root).write(written, encoding="utf-8")
        try:
            model = pin.buildModelFromMJCF(str(written))
        except Exception as error:
            reason = str(error).replace(str(written), name)
            raise ValueError(f"{name} is not an MJCF that Pinocchio can read: {reason}") from None
    for option in root.iterfind("option"):
        if gravity := option.get("gravity"):
            model.gravity = pin.Motion(np.array(gravity.split(), dtype=float), np.zeros(3))
    model.name = root.get("model", name.rsplit(".", 1)[0])
    for joint in root.iter("joint"):
        if joint.get("limited") == "false" and joint.get("name") in model.names:
            start = model.joints[model.getJointId(joint.get("name"))].idx_q
            model.lowerPositionLimit[start] = -np.inf
            model.upperPositionLimit[start] = np.inf
    mimics, warnings = _equalities(root, name)
    return model, mimics, tuple(warnings)


def _include(element: ET.Element, name: str, folder: Path | None, before: tuple[Path, ...]) -> None:
    """Put the contents of included files in the place of <include file="..."/>."""
    for index, child in reversed(list(enumerate(element))):
        if child.tag != "include":
            _include(child, name, folder, before)
            continue
        if folder is None:
            raise ValueError(f"{name} includes {child.get('file')!r}, which only a file can")
        file = folder / child.get("file", "")
        if file in before:
            raise ValueError(f"{name} includes {file.name} in itself")
        try:
            included = ET.parse(file).getroot()
        except (OSError, ET.ParseError) as error:
            raise ValueError(
                f"{name} includes {file.name}, which cannot be read: {error}"
            ) from None
        _include(included, name, folder, (*before, file))
        element.remove(child)
        for offset, part in enumerate(included):
            element.insert(index + offset, part)


def _give_each_joint_a_body(body: ET.Element) -> None:
    """Several joints of a body act one after the other: as those of bodies in each other.

    Pinocchio makes one joint of many degrees of freedom of them.
    """
    joints = body.findall("joint")
    for joint in joints[:-1]:
        inner = ET.Element("body", {"name": body.get("name", "")})
        inner.extend([child for child in body if child is not joint])
        for child in list(inner):
            body.remove(child)
        body.append(inner)
        body.set("name", f"{body.get('name', '')}/{joint.get('name', '')}")
        body = inner


def _refuse(root: ET.Element, name: str) -> None:
    for compiler in root.iterfind("compiler"):
        if float(compiler.get("settotalmass", -1.0)) > 0.0:
            raise ValueError(f"{name}: settotalmass is not read; write the masses")
    for body in root.iter("body"):
        place = f"{name}: body {body.get('name')!r}"
        if body.find("frame") is not None:
            raise ValueError(f"{place} has a <frame>, which Pinocchio does not read")
        meshes = [geom for geom in body.iterfind("geom") if geom.get("mesh") is not None]
        heavy = [geom for geom in meshes if not {geom.get("mass"), geom.get("density")} & {"0"}]
        if heavy and body.find("inertial") is None:
            raise ValueError(
                f"{place} has the inertia of a mesh, which is not read: give <inertial>"
            )
    for worldbody in root.iterfind("worldbody"):
        if worldbody.find("frame") is not None:
            raise ValueError(f"{name}: <worldbody> has a <frame>, which Pinocchio does not read")


def _equalities(root: ET.Element, name: str) -> tuple[dict[str, Mimic], list[str]]:
    mimics, warnings = {}, []
    for equality in root.iterfind("equality/*"):
        if equality.get("active", "true") == "false":
            continue
        if equality.tag != "joint":
            names = [equality.get(key, "") for key in ("body1", "body2") if equality.get(key)]
            warnings.append(f"{name}: the <{equality.tag}> of {' and '.join(names)} is left out")
            continue
        joint, leader = equality.get("joint1", ""), equality.get("joint2")
        place = f"{name}: the equality of joint {joint!r}"
        try:
            coefficients = [float(number) for number in equality.get("polycoef", "0 1").split()]
        except ValueError:
            raise ValueError(f"{place}: polycoef is not numbers") from None
        offset, multiplier, *higher = (*coefficients, *[0.0] * (5 - len(coefficients)))
        if leader is None:
            warnings.append(f"{place} with a constant is left out")
            continue
        if any(higher):
            raise ValueError(f"{place} with {leader!r} is not linear, and not read")
        mimics[joint] = Mimic(leader, multiplier, offset)
    return mimics, warnings
