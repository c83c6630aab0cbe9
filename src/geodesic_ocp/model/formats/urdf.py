"""URDF: read as a Pinocchio model, with faults repaired or named; joints that mimic others."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import pinocchio as pin

from geodesic_ocp.model.formats.robots import set_armature, urdf_armature

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


def apply_mimics(mimics: Mapping[str, Mimic], values: Mapping[str, float]) -> dict[str, float]:
    """Return the values of all joints, with those of mimic joints computed from their leaders.

    Args:
        mimics: mimic joints by name; a leader may itself mimic another joint.
        values: values of all joints; those of mimic joints are ignored.

    Raises:
        ValueError: joints mimic each other in a cycle.
    """
    found = {name: value for name, value in values.items() if name not in mimics}

    def value(name: str, visited: tuple[str, ...]) -> float:
        if name in visited:
            raise ValueError(f"joints mimic each other: {' and '.join(visited)}")
        if name not in found:
            mimic = mimics[name]
            found[name] = mimic.multiplier * value(mimic.leader, (*visited, name)) + mimic.offset
        return found[name]

    return {name: value(name, ()) for name in values}


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
        if axis is not None and not any(map(_nonzero, axis.get("xyz", "1 0 0").split())):
            raise ValueError(f"{location}: its axis is zero")
    for mass in root.iterfind("link/inertial/mass"):
        _number(mass, "value", 0.0, f"{name}: a link's mass")


def _nonzero(text: str) -> bool:
    try:
        return float(text.strip(",")) != 0.0
    except ValueError:
        return True  # Pinocchio reports it


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
    try:
        return float(element.get(key, default))
    except ValueError:
        raise ValueError(f"{location}: {key} is {element.get(key)!r}, not a number") from None
