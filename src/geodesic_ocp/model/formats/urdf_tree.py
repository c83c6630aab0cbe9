"""The tree of a URDF before Pinocchio reads it: faults are named, what is left out is filled in."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter, defaultdict

import numpy as np

from geodesic_ocp.model.formats.file_model import floats

# Joints that the format wants to have a <limit>.
_LIMITED = ("revolute", "prismatic")
# What an <inertial> must state.
_INERTIAL = {"mass": ("value",), "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}


def check_tree(root: ET.Element, name: str) -> None:
    """Check that links and joints are a tree, and that axes, limits and masses are numbers.

    Raises:
        ValueError: names the link or joint, and what is wrong with it.
    """
    if not root.get("name"):
        raise ValueError(f"{name}: <robot> has no name")
    for joint in root.iterfind("joint"):
        if joint.get("type") == "fixed":
            continue
        location = f"{name}: joint {joint.get('name')!r}"
        limit = joint.find("limit")
        axis = joint.find("axis")
        if limit is not None:
            lower = number(limit, "lower", 0.0, location)
            upper = number(limit, "upper", 0.0, location)
            for key in {"effort", "velocity"} & set(limit.attrib):
                not_negative(limit, key, f"{location}: {key}")
            if lower > upper:
                what = f"its lower limit {lower:g} lies above the upper {upper:g}"
                raise ValueError(f"{location}: {what}")
        numbers = [] if axis is None else floats(axis.get("xyz", "1 0 0"))
        if numbers and not any(numbers):  # what else is wrong with it Pinocchio reports
            raise ValueError(f"{location}: its axis is zero")
    for link in root.iterfind("link"):
        if (inertial := link.find("inertial")) is not None:
            _check_inertial(inertial, f"{name}: link {link.get('name')!r}")
    _check_parents(root, name)


def _check_inertial(inertial: ET.Element, location: str) -> None:
    """Check that mass and moments are stated: the parser would leave out the whole element."""
    origin = inertial.find("origin")
    for key, given in origin.attrib.items() if origin is not None else ():
        if key in ("xyz", "rpy") and len(floats(given)) != 3:
            raise ValueError(f"{location}: <inertial>: {key} is {given!r}, not three numbers")
    for tag, keys in _INERTIAL.items():
        for stated in inertial.findall(tag):
            for key in keys:
                if stated.get(key) is None:
                    raise ValueError(f"{location}: <{tag}> has no {key}")
                number(stated, key, 0.0, f"{location}: <{tag}>")
    if inertial.find("mass") is None:
        raise ValueError(f"{location}: <inertial> has no <mass>")


def _check_parents(root: ET.Element, name: str) -> None:
    """Check that every link but one is the child of one joint."""
    links = [link.get("name", "") for link in root.iterfind("link")]
    for link, count in Counter(links).items():
        if count > 1:
            raise ValueError(f"{name}: {count} links are named {link!r}: give each its own name")
    above: dict[str, list[str]] = defaultdict(list)  # link -> joints of which it is the child
    below: dict[str, list[str]] = defaultdict(list)  # link -> its children
    for joint in root.iterfind("joint"):
        label = joint.get("name", "")
        ends = []
        for tag in ("parent", "child"):
            end = joint.find(tag)
            link = "" if end is None else end.get("link", "")
            if link not in links:
                raise ValueError(
                    f"{name}: joint {label!r} has the {tag} {link!r}, which is no link"
                )
            ends.append(link)
        parent, child = ends
        above[child].append(label)
        below[parent].append(child)
    for link, joints in above.items():
        if len(joints) > 1:
            named = " and ".join(map(repr, joints))
            raise ValueError(
                f"{name}: link {link!r} has {len(joints)} parents, by the joints {named}: closed "
                "chains are not supported; leave out all of these joints but one"
            )
    roots = [link for link in links if link not in above]
    if len(roots) > 1:
        named = ", ".join(map(repr, roots))
        raise ValueError(f"{name}: {len(roots)} links have no parent, and one must be: {named}")
    reached = list(roots)
    for link in reached:  # which grows
        reached += below[link]
    if lost := [link for link in links if link not in reached]:
        raise ValueError(
            f"{name}: links {', '.join(map(repr, lost))} form a closed chain without a root, as "
            "each is the child of another; closed chains are not supported"
        )


def complete_tree(root: ET.Element, name: str) -> dict[str, str]:
    """Fill in what the parser wants and the file does not state; the tree is modified.

    A limit on effort or speed that is left out becomes 0, which stands for an unknown one. A joint
    without the <limit> that it must have gets an empty range. Returns these joints, which cannot
    move, each with the reason.
    """
    for dynamics in root.iterfind("joint/dynamics"):
        # The parser rejects the element unless it has one of its standard attributes.
        if not {"damping", "friction"} & set(dynamics.attrib):
            dynamics.set("damping", "0")
    immovable: dict[str, str] = {}
    for joint in root.iterfind("joint"):
        limit = joint.find("limit")
        kind = joint.get("type", "")
        if limit is None and kind in _LIMITED:
            limit = ET.SubElement(joint, "limit")
            label = joint.get("name", "")
            immovable[label] = f"{name}: joint {label!r} is {kind} and has no <limit>"
        if limit is not None:
            for key in ("effort", "velocity"):
                limit.set(key, limit.get(key, "0"))
    return immovable


def number(element: ET.Element, key: str, default: float, location: str) -> float:
    """Return the finite number in an attribute; ValueError if it is none, which names the
    location.
    """
    text = element.get(key, str(default))
    if len(numbers := floats(text)) != 1 or not np.isfinite(numbers[0]):
        raise ValueError(f"{location}: {key} is {text!r}, not a finite number")
    return numbers[0]


def not_negative(element: ET.Element, key: str, location: str) -> float:
    """Return the finite number in an attribute; ValueError if it is negative or none."""
    text = element.get(key)
    if len(numbers := floats(text)) != 1 or not 0.0 <= numbers[0] < np.inf:
        raise ValueError(f"{location} must be a finite number >= 0, is {text!r}")
    return numbers[0]
