"""URDF: read as a Pinocchio model, with faults repaired or named; mimic joints and rotors.

A rotor of inertia I behind a gear of ratio r adds r^2 I to the inertia of its joint. Pinocchio
reads armature from MJCF, but not from URDF.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import numpy as np
import pinocchio as pin

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
# <origin rpy="1.57, 0 0"/>: in a valid vector, numbers are separated by spaces only.
_VECTOR = re.compile(r"""\b(rpy|xyz)\s*=\s*(["'])([^"']*,[^"']*)\2""")
# The parser of URDF rejects the element unless it has one of its standard attributes.
_DYNAMICS = re.compile(r"<dynamics\b(?![^>]*\b(?:damping|friction)\b)")


@dataclass(frozen=True)
class Mimic:
    """A joint that mimics another: q = multiplier * leader + offset."""

    leader: str
    multiplier: float
    offset: float


def apply_mimics(mimics: Mapping[str, Mimic], values: dict[str, float]) -> None:
    """Set the values of mimic joints from those of their leaders, which may mimic others.

    Raises:
        ValueError: joints mimic each other in a cycle.
    """
    leaders = {name: [mimic.leader] for name, mimic in mimics.items()}
    try:
        order = [*TopologicalSorter(leaders).static_order()]
    except CycleError as error:
        raise ValueError(f"joints mimic each other: {' and '.join(error.args[1][1:])}") from None
    for name in order:
        if (mimic := mimics.get(name)) is not None:
            values[name] = mimic.multiplier * values[mimic.leader] + mimic.offset


def urdf_model(
    root: ET.Element, text: str, name: str
) -> tuple[pin.Model, dict[str, Mimic], tuple[str, ...], str]:
    """Return the model, its mimic joints, warnings, and the repaired text.

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
    _check(root, name)
    text = _VECTOR.sub(lambda m: m.group().replace(",", " "), text)
    text = _DYNAMICS.sub('<dynamics damping="0"', text)
    try:
        model = pin.buildModelFromXML(text)
    except Exception as error:
        raise ValueError(f"{name} is not a URDF that Pinocchio can read: {error}") from None
    set_armature(model, urdf_armature(root, name))
    moving = [joint for joint in root.iter("joint") if joint.get("name") in model.names]
    warnings += _zero_range_warnings(moving, name)
    mimics = _mimics(moving, name)
    lost = [joint for joint, mimic in mimics.items() if mimic.leader not in model.names]
    for joint in lost:
        leader = mimics.pop(joint).leader
        warnings.append(f"{name}: joint {joint!r} mimics {leader!r}, which is not a moving joint")
    return model, mimics, tuple(warnings), text


def _check(root: ET.Element, name: str) -> None:
    if not root.get("name"):
        raise ValueError(f"{name}: <robot> has no name")
    for joint in root.iterfind("joint"):
        if joint.get("type") == "fixed":
            continue
        location = f"{name}: joint {joint.get('name')!r}"
        limit, axis = joint.find("limit"), joint.find("axis")
        if limit is None and joint.get("type") in ("revolute", "prismatic"):
            raise ValueError(f"{location} is {joint.get('type')} and has no <limit>")
        if limit is not None:
            lower, upper = (_number(limit, key, 0.0, location) for key in ("lower", "upper"))
            if lower > upper:
                what = f"its lower limit {lower:g} lies above the upper {upper:g}"
                raise ValueError(f"{location}: {what}")
        numbers = [] if axis is None else floats(axis.get("xyz", "1 0 0").replace(",", " "))
        if numbers and not any(numbers):  # what else is wrong with it Pinocchio reports
            raise ValueError(f"{location}: its axis is zero")
    for mass in root.iterfind("link/inertial/mass"):
        _number(mass, "value", 0.0, f"{name}: a link's mass")


def _zero_range_warnings(joints: list[ET.Element], name: str) -> Iterator[str]:
    """Yield warnings about joints whose limits are both zero, usually because they were omitted."""
    for joint in joints:
        limit = joint.find("limit")
        if joint.get("type") in ("revolute", "prismatic") and joint.find("mimic") is None:
            given = [] if limit is None else [limit.get("lower"), limit.get("upper")]
            if all(float(value or 0.0) == 0.0 for value in given):
                yield f"{name}: joint {joint.get('name')!r} has no range: its limits are 0 and 0"


def _mimics(joints: list[ET.Element], name: str) -> dict[str, Mimic]:
    mimics = {}
    for joint in joints:
        if (mimic := joint.find("mimic")) is not None:
            location = f"{name}: the mimic of joint {joint.get('name')!r}"
            leader = mimic.get("joint", "")
            multiplier = _number(mimic, "multiplier", 1.0, location)
            offset = _number(mimic, "offset", 0.0, location)
            mimics[joint.get("name", "")] = Mimic(leader, multiplier, offset)
    return mimics


def _number(element: ET.Element, key: str, default: float, location: str) -> float:
    text = element.get(key, str(default))
    if len(numbers := floats(text)) != 1:
        raise ValueError(f"{location}: {key} is {text!r}, not a number")
    return numbers[0]


def _not_negative(element: ET.Element, key: str, location: str) -> float:
    text = element.get(key)
    if len(numbers := floats(text)) != 1 or not 0.0 <= numbers[0] < np.inf:
        raise ValueError(f"{location} must be a number >= 0, is {text!r}")
    return numbers[0]


def floats(text: str | None) -> list[float]:
    """Return the numbers in a text; none if one of its words is not a number."""
    try:
        return [float(word) for word in (text or "").split()]
    except ValueError:
        return []


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
            rotor = _not_negative(values["rotor_inertia"], "value", f"{location}: rotor_inertia")
            ratio = 1.0
            if "gear_ratio" in values:
                ratio = _not_negative(values["gear_ratio"], "value", f"{location}: gear_ratio")
            found[joints[0]] = found.get(joints[0], 0.0) + ratio**2 * rotor
    for joint in root.iterfind("joint"):
        dynamics = joint.find("dynamics")
        if dynamics is not None and dynamics.get("armature") is not None:
            location = f"{name}: joint {joint.get('name')!r}"
            found[joint.get("name", "")] = _not_negative(
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
            rotor = _not_negative(joint, "mass", f"{location}: mass")
            ratio = _not_negative(joint, "gear_ratio", f"{location}: gear_ratio")
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
