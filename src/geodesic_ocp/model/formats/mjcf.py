"""MJCF as a Pinocchio model.

Pinocchio reads a part of the format. What it leaves out or reads otherwise than MuJoCo is written
in its terms here (includes, default classes, several joints of a body, several bodies in the world,
ranges of slides), or refused by name.
"""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from collections import defaultdict
from pathlib import Path

import numpy as np
import pinocchio as pin

from geodesic_ocp.model.formats.mimic import Mimic

_ROOT = "world of bodies"
# What changes bodies and is not read, as elements and as attributes of <compiler>.
_ELEMENTS = ("attach", "replicate", "composite", "flexcomp", "frame")
_COMPILER = ("settotalmass", "boundmass", "boundinertia", "inertiagrouprange", "balanceinertia")
_JOINTS = ("hinge", "slide", "ball", "free")
_Defaults = dict[str, dict[str, dict[str, str]]]  # class -> tag -> attribute -> value


def mjcf_model(
    root: ET.Element, name: str, folder: Path | None
) -> tuple[pin.Model, dict[str, Mimic], tuple[str, ...], str]:
    """The model, its followers (joint equalities), what was left out, and the text as rewritten.

    Args:
        root: the element <mujoco>; it is changed.
        name: of the file, for messages.
        folder: where included files are looked for.

    Raises:
        ValueError: Pinocchio cannot read it, or would leave out what changes the model.
    """
    _include(root, name, folder, ())
    _merge_sections(root)
    _write_defaults_out(root, name)
    _refuse(root, name)
    _rewrite(root, name)
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
    if folder is not None:
        _find_meshes(root, folder.absolute())
    return model, mimics, tuple(warnings), ET.tostring(root, encoding="unicode")


def _find_meshes(root: ET.Element, folder: Path) -> None:
    """Write down where meshes are, wherever the text may go."""
    compiler = root.find("compiler")
    if compiler is None:
        compiler = ET.SubElement(root, "compiler")
    for key in ("meshdir", "assetdir"):
        if key in compiler.attrib or key == "meshdir":
            compiler.set(key, str(folder / compiler.get(key, compiler.get("assetdir", ""))))


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


def _merge_sections(root: ET.Element) -> None:
    """Sections such as <worldbody> may occur several times, as with includes."""
    first: dict[str, ET.Element] = {}
    for section in list(root):
        if section.tag == "default" or section.tag not in first:
            first.setdefault(section.tag, section)
            continue
        first[section.tag].extend(section)
        first[section.tag].attrib.update(section.attrib)
        root.remove(section)


def _write_defaults_out(root: ET.Element, name: str) -> None:
    """Give every element the attributes of its default class."""
    defaults: _Defaults = {"main": defaultdict(dict)}

    def collect(default: ET.Element, above: str) -> None:
        own = default.get("class", "main")
        if own not in defaults:
            inherited = defaults[above].items()
            defaults[own] = defaultdict(dict, {tag: dict(values) for tag, values in inherited})
        for child in default:
            if child.tag != "default":
                defaults[own][child.tag].update(child.attrib)
        for child in default.iterfind("default"):
            collect(child, own)

    def write(element: ET.Element, above: str) -> None:
        own = element.get("class", above)
        if own not in defaults:
            raise ValueError(f"{name}: <{element.tag}> is of an unknown class {own!r}")
        for key, value in defaults[own][element.tag].items():
            element.attrib.setdefault(key, value)
        element.attrib.pop("class", None)
        below = element.attrib.pop("childclass", above)
        for child in element:
            write(child, below)

    for default in root.findall("default"):
        collect(default, "main")
        root.remove(default)
    for section in (*root.iterfind("asset"), *root.iterfind("worldbody")):
        write(section, "main")


def _refuse(root: ET.Element, name: str) -> None:
    for tag in _ELEMENTS:
        if next(root.iter(tag), None) is not None:
            raise ValueError(f"{name} has a <{tag}>, which is not read")
    for compiler in root.iterfind("compiler"):
        for key in _COMPILER:
            if compiler.get(key, "0") not in ("0", "false", "-1", "0 5"):
                raise ValueError(f"{name}: {key} of <compiler> is not read")
        if compiler.get("coordinate", "local") != "local":
            raise ValueError(f"{name}: global coordinates are not read")
        if not compiler.get("eulerseq", "xyz").islower():
            raise ValueError(f"{name}: eulerseq with capitals, about fixed axes, is not read")
        if compiler.get("inertiafromgeom") == "true" and next(root.iter("inertial"), None):
            raise ValueError(f"{name}: inertiafromgeom over given <inertial>s is not read")
    for joint in root.iter("joint"):
        if joint.get("type", "hinge") not in _JOINTS:
            raise ValueError(
                f"{name}: joint {joint.get('name')!r} is of the unknown type {joint.get('type')!r}"
            )
    for body in root.iter("body"):
        place = f"{name}: body {body.get('name')!r}"
        meshes = [geom for geom in body.iterfind("geom") if geom.get("mesh") is not None]
        heavy = [geom for geom in meshes if not {geom.get("mass"), geom.get("density")} & {"0"}]
        if heavy and body.find("inertial") is None:
            raise ValueError(
                f"{place} has the inertia of a mesh, which is not read: give <inertial>"
            )


def _rewrite(root: ET.Element, name: str) -> None:
    compiler = root.find("compiler")
    degrees = compiler is None or compiler.get("angle", "degree") == "degree"
    for element in root.iter():
        if (given := element.get("axisangle")) is not None:
            x, y, z, angle = _numbers(given, 4, f"{name}: axisangle")
            length = float(np.linalg.norm([x, y, z])) or 1.0
            axis = " ".join(repr(float(number / length)) for number in (x, y, z))
            element.set("axisangle", f"{axis} {angle!r}")
        if degrees and element.tag == "joint" and element.get("type") == "slide":
            place = f"{name}: range of joint {element.get('name')!r}"
            # Pinocchio takes it for degrees.
            metres = _numbers(element.get("range", "0 0"), 2, place)
            element.set("range", " ".join(repr(float(number)) for number in np.rad2deg(metres)))
    world = root.find("worldbody")
    if world is None or world.find("body") is None:
        raise ValueError(f"{name} has no <body>")
    # Pinocchio reads one body of the world, and not where it is if it has no joint.
    whole = ET.Element("body", {"name": _ROOT})
    whole.extend(list(world))
    for child in list(world):
        world.remove(child)
    world.append(whole)
    for body in list(root.iter("body")):
        _give_each_joint_a_body(body)


def _numbers(text: str, count: int, place: str) -> list[float]:
    try:
        numbers = [float(number) for number in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count:
        raise ValueError(f"{place} must be {count} numbers, is {text!r}")
    return numbers


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
