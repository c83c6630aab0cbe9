"""URDF: read as a Pinocchio model, with faults repaired or named; mimic joints and rotors.

A rotor of inertia I behind a gear of ratio r adds r^2 I to the inertia of its joint. Pinocchio
reads armature from MJCF, but not from URDF.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from copy import deepcopy
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin

from geodesic_ocp.model.formats.file_model import FileModel, Mimic, floats
from geodesic_ocp.model.formats.urdf_geometry import urdf_geometry
from geodesic_ocp.model.formats.urdf_parser import Parsed, parsed
from geodesic_ocp.model.formats.urdf_tree import (
    check_tree,
    complete_tree,
    not_negative,
    number,
)

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
# <origin rpy="1.57, 0 0"/>: in a valid vector, numbers are separated by spaces only.
_VECTOR = re.compile(r"""\b(rpy|xyz)\s*=\s*(["'])([^"']*,[^"']*)\2""")


def urdf_model(root: ET.Element, text: str, name: str, folder: Path | None) -> FileModel:
    """Return the model in a URDF.

    Args:
        root: its root element.
        text: text of the file.
        name: name of the file, for messages.
        folder: folder of the file.

    Raises:
        ValueError: Pinocchio cannot read it, or a joint is invalid; names the location, if known.
    """
    if any(element.tag.startswith("{") and "xacro" in element.tag for element in root.iter()):
        raise ValueError(f"{name} is a xacro file; expand it to URDF first")
    # Comments are blanked, not removed, to keep line numbers.
    text = _COMMENT.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), text)
    warnings = []
    for match in _VECTOR.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        if len(match.group(3).split()) != 3 and match.group(3).count(",") != 2:
            raise ValueError(f"{name}, line {line}: {match.group()} is not three numbers")
        warnings.append(f"{name}, line {line}: the comma in {match.group()} is read as a space")
    tree = ET.fromstring(_VECTOR.sub(lambda m: m.group().replace(",", " "), text))
    check_tree(tree, name)
    immovable = complete_tree(tree, name)
    text = ET.tostring(tree, encoding="unicode")
    found = _parsed(tree, name)
    model = found.value
    for joint in immovable:
        row = model.joints[model.getJointId(joint)].idx_q
        model.lowerPositionLimit[row] = -np.inf
        model.upperPositionLimit[row] = np.inf
    set_armature(model, urdf_armature(tree, name))
    moving = [joint for joint in tree.iter("joint") if joint.get("name") in model.names]
    limited = [joint for joint in moving if joint.get("name") not in immovable]
    if found.messages:
        warnings.append(f"{name}: {'; '.join(found.messages)}")
    warnings += _zero_range_warnings(limited, name)
    warnings += _large_angle_warnings(tree, name)
    mimics = _mimics(moving, name)
    lost = [joint for joint, mimic in mimics.items() if mimic.leader not in model.names]
    for joint in lost:
        leader = mimics.pop(joint).leader
        warnings.append(f"{name}: joint {joint!r} mimics {leader!r}, which is not a moving joint")
    return FileModel(
        model,
        geometry=partial(urdf_geometry, model, text, folder),
        mimics=mimics,
        warnings=tuple(warnings),
        immovable=immovable,
    )


def _parsed(tree: ET.Element, name: str) -> Parsed[pin.Model]:
    """Return the model as Pinocchio reads it, and the errors that did not keep it from doing so.

    Raises:
        ValueError: Pinocchio cannot read it, with the reasons.
    """
    bare = deepcopy(tree)  # geometry is read when it is needed
    for link in bare.iterfind("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    text = ET.tostring(bare, encoding="unicode")
    try:
        return parsed(lambda: pin.buildModelFromXML(text))
    except ValueError as error:
        raise ValueError(f"{name} is not a URDF that Pinocchio can read: {error}") from None


def _zero_range_warnings(joints: list[ET.Element], name: str) -> Iterator[str]:
    """Yield warnings about joints whose limits are both zero, usually because they were omitted."""
    for joint in joints:
        limit = joint.find("limit")
        if joint.get("type") in ("revolute", "prismatic") and joint.find("mimic") is None:
            given = [] if limit is None else [limit.get("lower"), limit.get("upper")]
            if all(float(value or 0.0) == 0.0 for value in given):
                yield f"{name}: joint {joint.get('name')!r} has no range: its limits are 0 and 0"


def _large_angle_warnings(tree: ET.Element, name: str) -> Iterator[str]:
    """Yield warnings about placements that are turned by more than a revolution."""
    placed = [*tree.iterfind("joint"), *tree.iterfind("link")]
    for element in placed:
        for origin in (*element.iterfind("origin"), *element.iterfind("inertial/origin")):
            if any(abs(angle) > 2.0 * np.pi for angle in floats(origin.get("rpy"))):
                where = f"{name}: {element.tag} {element.get('name')!r}"
                yield f"{where}: rpy is {origin.get('rpy')!r} rad; are these degrees?"


def _mimics(joints: list[ET.Element], name: str) -> dict[str, Mimic]:
    mimics = {}
    for joint in joints:
        if (mimic := joint.find("mimic")) is not None:
            location = f"{name}: the mimic of joint {joint.get('name')!r}"
            leader = mimic.get("joint", "")
            multiplier = number(mimic, "multiplier", 1.0, location)
            offset = number(mimic, "offset", 0.0, location)
            mimics[joint.get("name", "")] = Mimic(leader, multiplier, offset)
    return mimics


def urdf_armature(root: ET.Element, name: str) -> dict[str, float]:
    """Return joint inertias [kg m^2 or kg] that a URDF states, by joint name.

    They are `<dynamics armature="..."/>` of a joint, or `<drake:rotor_inertia value="..."/>` and
    `<drake:gear_ratio value="..."/>` (default 1) of the actuators of its transmission, which are
    extensions of the format. A joint that has both takes the former.

    Raises:
        ValueError: a value is not a finite number that is not negative; names the joint.
    """
    found: dict[str, float] = {}
    for transmission in root.iterfind("transmission"):
        joints = [joint.get("name", "") for joint in transmission.iterfind("joint")]
        for actuator in transmission.iterfind("actuator"):
            values = {child.tag.rsplit("}", 1)[-1]: child for child in actuator}  # no namespace
            if "rotor_inertia" not in values or not joints:
                continue
            location = f"{name}: the actuator of joint {joints[0]!r}"
            rotor = not_negative(values["rotor_inertia"], "value", f"{location}: rotor_inertia")
            ratio = 1.0
            if "gear_ratio" in values:
                ratio = not_negative(values["gear_ratio"], "value", f"{location}: gear_ratio")
            found[joints[0]] = found.get(joints[0], 0.0) + ratio**2 * rotor
    for joint in root.iterfind("joint"):
        dynamics = joint.find("dynamics")
        if dynamics is not None and dynamics.get("armature") is not None:
            location = f"{name}: joint {joint.get('name')!r}"
            found[joint.get("name", "")] = not_negative(
                dynamics, "armature", f"{location}: armature"
            )
    return found


def srdf_armature(urdf: Path) -> dict[str, float]:
    """Return joint inertias [kg m^2 or kg] from the SRDF that a package has for a URDF, by joint
    name.

    It is in the folder `srdf` beside that of the URDF, is for a robot of the same name, and has a
    group `rotor_params` with the inertia of each rotor (its attribute is called mass) and the gear
    ratio, as read by Pinocchio's `loadRotorParameters`.

    Raises:
        ValueError: a value is not a finite number that is not negative; names the joint.
    """
    found: dict[str, float] = {}
    for file, root in _srdf_files(urdf):
        for joint in root.iterfind("rotor_params/joint"):
            location = f"{file.name}: rotor_params of joint {joint.get('name')!r}"
            rotor = not_negative(joint, "mass", f"{location}: mass")
            ratio = not_negative(joint, "gear_ratio", f"{location}: gear_ratio")
            found.setdefault(joint.get("name", ""), ratio**2 * rotor)
    return found


def srdf_disabled_collisions(urdf: Path) -> dict[frozenset[str], str]:
    """Return the pairs of links whose collisions the SRDF for a URDF disables, each with its file.

    Those disabled for the reason "Default" are left out: they touch in one configuration, the
    default one, which says nothing of the others.

    The SRDF is found as in `srdf_armature`.
    """
    return {
        pair: file.name for file, root in _srdf_files(urdf) for pair in _disabled_collisions(root)
    }


def disabled_collisions(srdf: Path, robot: pin.Model) -> dict[frozenset[str], str]:
    """Return the pairs of links whose collisions a given SRDF disables, as
    `srdf_disabled_collisions`.

    Raises:
        ValueError: it cannot be read, is for another robot, or disables no collisions of its links.
    """
    root = _root(srdf)
    if root is None or root.get("name") != robot.name:
        whose = "no file of XML" if root is None else f"for the robot {root.get('name')!r}"
        raise ValueError(f"srdf: {srdf} is {whose}, and must be an SRDF for {robot.name!r}")
    pairs = [pair for pair in _disabled_collisions(root) if all(map(robot.existFrame, pair))]
    if not pairs:
        raise ValueError(f"srdf: {srdf} disables no collisions of links of {robot.name!r}")
    return dict.fromkeys(pairs, srdf.name)


def _disabled_collisions(srdf: ET.Element) -> Iterator[frozenset[str]]:
    for pair in srdf.iterfind("disable_collisions"):
        if pair.get("reason") != "Default":
            yield frozenset((pair.get("link1", ""), pair.get("link2", "")))


def _srdf_files(urdf: Path) -> Iterator[tuple[Path, ET.Element]]:
    """Yield the files in the folder `srdf` beside that of a URDF that are for the same robot."""
    robot = _root(urdf)
    for file in sorted(urdf.parent.parent.glob("srdf/*.srdf")):
        root = _root(file)
        if robot is not None and root is not None and root.get("name") == robot.get("name"):
            yield file, root


def set_armature(model: pin.Model, armature: Mapping[str, float]) -> None:
    """Set the armature of joints with one degree of freedom that have none yet."""
    values = np.array(model.armature)
    for index in range(1, model.njoints):
        joint = model.joints[index]
        if joint.nv == 1 and values[joint.idx_v] == 0.0:
            values[joint.idx_v] = armature.get(str(model.names[index]), 0.0)
    model.armature = values


def _root(file: Path) -> ET.Element | None:
    try:
        return ET.parse(file).getroot()
    except (OSError, ET.ParseError):
        return None
