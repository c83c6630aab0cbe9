"""MJCF, the format of MuJoCo, read as a Pinocchio model.

Where mujoco is installed, its compiler reads the file (`compiled_mjcf`). Without it Pinocchio reads
a part of the format. What it ignores or interprets differently from MuJoCo is rewritten here
(includes, default classes, several joints of a body, several bodies in the world, ranges of
prismatic joints and of joints with `ref`, torque limits), or rejected by name. Damping, friction
and springs of joints are no part of a Model.
"""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.formats.compiled_mjcf import compiled_mjcf_model, coupled
from geodesic_ocp.model.formats.file_model import FileModel, Mimic, check_depth, floats
from geodesic_ocp.model.formats.mjcf_source import MjcfSource, installed_mujoco
from geodesic_ocp.model.formats.mjcf_text import numbers_text

_ROOT = "world of bodies"
# Elements, and attributes of <compiler>, that would change the model and are not supported.
_ELEMENTS = ("attach", "replicate", "composite", "flexcomp", "frame")
_COMPILER = ("settotalmass", "boundmass", "boundinertia", "inertiagrouprange", "balanceinertia")
_JOINTS = ("hinge", "slide", "ball", "free")
# All are short forms of <general>, and share its defaults.
_ACTUATORS = (
    *("general", "motor", "position", "velocity", "intvelocity"),
    *("damper", "cylinder", "muscle", "adhesion"),
)
_UNLIMITED = np.array([-np.inf, np.inf])
_Defaults = dict[str, dict[str, dict[str, str]]]  # class -> tag -> attribute -> value


def mjcf_model(root: ET.Element, text: str, name: str, folder: Path | None) -> FileModel:
    """Return the model in an MJCF, read by MuJoCo's compiler if it is installed.

    Args:
        root: the element <mujoco>; it is modified.
        text: text of the file.
        name: name of the file, for messages.
        folder: folder in which included files are searched for.

    Raises:
        ValueError: it cannot be read, or Pinocchio would ignore parts that change the model and
            mujoco, which would not, is not installed.
    """
    title = root.get("model", name.rsplit(".", 1)[0])
    if folder is None and (include := next(root.iter("include"), None)) is not None:
        raise ValueError(f"{name} includes {include.get('file')!r}, which only a file can do")
    if installed_mujoco() is None:
        found = _pinocchio_model(root, name, folder)
    else:
        found = compiled_mjcf_model(MjcfSource(text, name, folder))
    found.pin.name = title
    return found


def _pinocchio_model(root: ET.Element, name: str, folder: Path | None) -> FileModel:
    """Return the model, as Pinocchio reads the rewritten text."""
    if folder is not None:
        _include(root, name, folder, ())
        check_depth(root, name)
    _merge_sections(root)
    _apply_defaults(root, name)
    _reject_unsupported(root, name)
    references = _references(root, name)
    _rewrite(root, name)
    if folder is not None:  # the text can be read from any folder
        compiler = root.find("compiler")
        if compiler is None:
            compiler = ET.SubElement(root, "compiler")
        meshes = compiler.get("meshdir", compiler.get("assetdir", ""))
        compiler.set("meshdir", str(folder.absolute() / meshes))
    text = ET.tostring(root, encoding="unicode")
    with _written(text) as file:
        try:
            model = pin.buildModelFromMJCF(file)
        except Exception as error:
            reason = str(error).replace(file, name)
            raise ValueError(f"{name} is not an MJCF that Pinocchio can read: {reason}") from None
    for option in root.iterfind("option"):
        if gravity := option.get("gravity"):
            model.gravity = pin.Motion(np.array(gravity.split(), dtype=float), np.zeros(3))
    for joint, reference in references.items():
        # Pinocchio's coordinate is MuJoCo's qpos, but it subtracts `ref` from the range.
        row = model.joints[model.getJointId(joint)].idx_q
        model.lowerPositionLimit[row] += reference
        model.upperPositionLimit[row] += reference
    for driven, (lower, upper) in _effort_limits(root, name).items():
        if model.existJointName(driven):
            row = model.joints[model.getJointId(driven)].idx_v
            model.lowerEffortLimit[row] = lower
            model.upperEffortLimit[row] = upper
    mimics, warnings = _equalities(root, references, name)
    return FileModel(model, partial(_geometry, model, text, name), mimics, tuple(warnings))


@contextmanager
def _written(text: str) -> Iterator[str]:
    """Yield the path of a file with this text, which exists meanwhile."""
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / "model.xml"
        file.write_text(text, encoding="utf-8")
        yield str(file)


def _geometry(model: pin.Model, text: str, name: str, kind: pin.GeometryType) -> pin.GeometryModel:
    """Return the geometry of the links as Pinocchio reads it.

    Raises:
        ValueError: a mesh is moved or turned.
    """
    for mesh in ET.fromstring(text).iterfind("asset/mesh"):
        if "refpos" in mesh.attrib or "refquat" in mesh.attrib:
            raise ValueError(f"{name}: refpos and refquat of a mesh are not supported")
    with _written(text) as file:
        return pin.buildGeomFromMJCF(model, file, kind)


def _references(root: ET.Element, name: str) -> dict[str, float]:
    """Return `ref` [rad or m] of the hinges and slides that have one, by name."""
    degrees = _in_degrees(root)
    found: dict[str, float] = {}
    for joint in root.iter("joint"):
        kind = joint.get("type", "hinge")
        if kind not in ("hinge", "slide") or joint.get("ref") is None:
            continue
        label = joint.get("name", "")
        (value,) = _numbers(joint.get("ref", ""), 1, f"{name}: ref of joint {label!r}")
        found[label] = float(np.deg2rad(value)) if degrees and kind == "hinge" else value
    return found


def _include(element: ET.Element, name: str, folder: Path, including: tuple[Path, ...]) -> None:
    """Replace <include file="..."/> by the contents of the file."""
    for index, child in reversed(list(enumerate(element))):
        if child.tag != "include":
            _include(child, name, folder, including)
            continue
        file = folder / child.get("file", "")
        if file in including:
            raise ValueError(f"{name} includes {file.name} in itself")
        try:
            included = ET.parse(file).getroot()
        except (OSError, ET.ParseError) as error:
            what = f"{name} includes {file.name}, which cannot be read"
            raise ValueError(f"{what}: {error}") from None
        check_depth(included, file.name)
        _include(included, name, folder, (*including, file))
        element[index : index + 1] = list(included)


def _merge_sections(root: ET.Element) -> None:
    """Merge sections such as <worldbody> that occur several times, as with includes."""
    first: dict[str, ET.Element] = {}
    for section in list(root):
        if section.tag == "default" or section.tag not in first:
            first.setdefault(section.tag, section)
            continue
        first[section.tag].extend(section)
        first[section.tag].attrib.update(section.attrib)
        root.remove(section)


def _apply_defaults(root: ET.Element, name: str) -> None:
    """Yield every element the attributes of its default class."""
    defaults: _Defaults = {"main": defaultdict(dict)}

    def collect(default: ET.Element, above: str) -> None:
        own = default.get("class", "main")
        if own not in defaults:
            inherited = defaults[above].items()
            defaults[own] = defaultdict(dict, {tag: dict(values) for tag, values in inherited})
        for child in default:
            if child.tag == "default":
                continue
            for tag in _ACTUATORS if child.tag in _ACTUATORS else (child.tag,):
                defaults[own][tag].update(child.attrib)
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
    for kind in ("asset", "worldbody", "actuator"):
        for section in root.iterfind(kind):
            write(section, "main")


def _reject_unsupported(root: ET.Element, name: str) -> None:
    for joint in root.iter("joint"):
        if (kind := joint.get("type", "hinge")) not in _JOINTS:
            raise ValueError(f"{name}: joint {joint.get('name')!r} is of the unknown type {kind!r}")
    for what in _unsupported(root):
        advice = "is not supported without MuJoCo: pip install 'geodesic_ocp[robots]'"
        raise ValueError(f"{name}: {what} {advice}")


def _unsupported(root: ET.Element) -> Iterator[str]:
    """Yield what Pinocchio would ignore, although it changes the model."""
    for tag in _ELEMENTS:
        if next(root.iter(tag), None) is not None:
            yield f"<{tag}>"
    for compiler in root.iterfind("compiler"):
        for key in _COMPILER:
            if compiler.get(key, "0") not in ("0", "false", "-1", "0 5"):
                yield f"{key} of <compiler>"
        if compiler.get("coordinate", "local") != "local":
            yield "coordinate of <compiler>"
        if not compiler.get("eulerseq", "xyz").islower():
            yield "eulerseq with capitals, about fixed axes,"
        is_stated = next(root.iter("inertial"), None) is not None
        if is_stated and compiler.get("inertiafromgeom") == "true":
            yield "inertiafromgeom in place of given <inertial>s"
    for section in ("actuator", "tendon"):
        for element in root.iterfind(f"{section}/*"):
            if element.get("armature", "0") != "0":
                yield f"armature of the <{element.tag}> {element.get('name')!r}"
    for body in root.iter("body"):
        meshes = [geom for geom in body.iterfind("geom") if geom.get("mesh") is not None]
        heavy = [geom for geom in meshes if not {geom.get("mass"), geom.get("density")} & {"0"}]
        if heavy and body.find("inertial") is None:
            yield f"the inertia of a mesh of body {body.get('name')!r}, which has no <inertial>,"


def _rewrite(root: ET.Element, name: str) -> None:
    degrees = _in_degrees(root)
    for element in root.iter():
        if (given := element.get("axisangle")) is not None:
            *axis, angle = _numbers(given, 4, f"{name}: axisangle")
            length = float(np.linalg.norm(axis)) or 1.0
            element.set("axisangle", numbers_text([*(number / length for number in axis), angle]))
        if element.tag == "joint" and not _has_limits(element, name):
            element.attrib.pop("range", None)  # Pinocchio would apply it
        is_slide = element.tag == "joint" and element.get("type") == "slide"
        if degrees and is_slide and (given := element.get("range")) is not None:
            metres = _numbers(given, 2, f"{name}: range of joint {element.get('name')!r}")
            element.set("range", numbers_text(np.rad2deg(metres)))  # Pinocchio reads degrees
    world = root.find("worldbody")
    if world is None or world.find("body") is None:
        raise ValueError(f"{name} has no <body>")
    # Pinocchio reads only one body of the world, and ignores its pose if it has no joint.
    whole = ET.Element("body", {"name": _ROOT})
    whole.extend(world)
    world[:] = [whole]
    for body in list(root.iter("body")):
        _give_each_joint_a_body(body)


def _has_limits(joint: ET.Element, name: str) -> bool:
    """Return whether a joint is limited by its range, if it has one.

    Raises:
        ValueError: the range is not two numbers, or the lower one is above the upper.
    """
    if joint.get("limited") == "false" or (given := joint.get("range")) is None:
        return False
    location = f"{name}: range of joint {joint.get('name')!r}"
    limits = _numbers(given, 2, location)
    span = limits[1] - limits[0]
    if span < 0.0 or (span == 0.0 and joint.get("limited") == "true"):
        raise ValueError(
            f"{location}: the lower limit {limits[0]:g} must be below the upper {limits[1]:g}"
        )
    return span > 0.0


def _in_degrees(root: ET.Element) -> bool:
    compiler = root.find("compiler")
    return compiler is None or compiler.get("angle", "degree") == "degree"


def _numbers(text: str, count: int, location: str) -> list[float]:
    """Return the numbers in a text: as many as the count, any if it is 0."""
    numbers = floats(text)
    if not numbers or (count and len(numbers) != count):
        wanted = f"{count} numbers" if count else "numbers"
        raise ValueError(f"{location} must be {wanted}, is {text!r}")
    return numbers


def _give_each_joint_a_body(body: ET.Element) -> None:
    """Split a body with several joints, which act in sequence, into nested bodies.

    Pinocchio would combine them into one joint with several degrees of freedom.
    """
    joints = body.findall("joint")
    for joint in joints[:-1]:
        inner = ET.Element("body", {"name": body.get("name", "")})
        inner.extend([child for child in body if child is not joint])
        body[:] = [joint, inner]
        body.set("name", f"{body.get('name', '')}/{joint.get('name', '')}")
        body = inner


def _effort_limits(root: ET.Element, name: str) -> dict[str, Array]:
    """Return smallest and largest torque [N m] or force [N] of each driven joint, by its name.

    That of an actuator lies within its force range, and that of a motor within its control range
    times its gain, each times its gear ratio; the actuators of a joint add up. The joint's own
    actuatorfrcrange limits the sum. Joints without an actuator or such a range are left out.

    Args:
        root: the element <mujoco>, whose default classes have been applied.
        name: name of the file, for messages.

    Raises:
        ValueError: a range is not two increasing numbers, or a gear ratio or gain is not a number.
    """
    compiler = root.find("compiler")
    automatic = compiler is None or compiler.get("autolimits", "true") == "true"
    found: dict[str, Array] = {}
    for actuator in root.iterfind("actuator/*"):
        joint = actuator.get("joint") or actuator.get("jointinparent")
        if joint is None or actuator.tag not in _ACTUATORS:
            continue
        location = f"{name}: the <{actuator.tag}> of joint {joint!r}"
        if gear := _first(actuator, "gear", location):
            limits = np.sort(gear * _force_range(actuator, automatic, location))
            found[joint] = found.get(joint, np.zeros(2)) + limits
    for element in root.iter("joint"):
        joint = element.get("name", "")
        own = _range(element, "actuatorfrc", automatic, f"{name}: joint {joint!r}")
        if np.isfinite(own).any():
            found[joint] = _overlap(own, found.get(joint, _UNLIMITED))
    return found


def _force_range(actuator: ET.Element, automatic: bool, location: str) -> Array:
    """Return smallest and largest force of the actuator, before its gear."""
    limits = _range(actuator, "force", automatic, location)
    kinds = actuator.tag, actuator.get("gaintype", "fixed"), actuator.get("biastype", "none")
    if actuator.tag == "motor":
        gain = 1.0
    elif kinds == ("general", "fixed", "none"):
        gain = _first(actuator, "gainprm", location)
    else:  # the control is a position, a speed or an activation
        return limits
    driven = np.sort(gain * _range(actuator, "ctrl", automatic, location)) if gain else np.zeros(2)
    return _overlap(limits, driven)


def _overlap(one: Array, other: Array) -> Array:
    return np.array([max(one[0], other[0]), min(one[1], other[1])])


def _range(element: ET.Element, kind: str, automatic: bool, location: str) -> Array:
    """Return the range of the attribute `kind`range, infinite if it is not limited."""
    given = element.get(f"{kind}range")
    limited = element.get(f"{kind}limited", "auto")
    if given is None or limited == "false" or (limited == "auto" and not automatic):
        return _UNLIMITED
    if len(numbers := floats(given)) != 2 or not numbers[0] < numbers[1]:
        raise ValueError(f"{location}: {kind}range must be two increasing numbers, is {given!r}")
    return np.array(numbers)


def _first(element: ET.Element, key: str, location: str) -> float:
    """Return the first number of the attribute, 1 by default."""
    return _numbers(element.get(key, "1"), 0, f"{location}: {key}")[0]


def _equalities(
    root: ET.Element, references: Mapping[str, float], name: str
) -> tuple[dict[str, Mimic], list[str]]:
    """Return mimic joints, from equalities of joints, and warnings about other equalities."""
    mimics: dict[str, Mimic] = {}
    warnings: list[str] = []
    for equality in root.iterfind("equality/*"):
        if equality.get("active", "true") == "false":
            continue
        if equality.tag != "joint":
            names = [equality.get(key, "") for key in ("body1", "body2") if equality.get(key)]
            warnings.append(f"{name}: the <{equality.tag}> of {' and '.join(names)} is ignored")
            continue
        joint = equality.get("joint1", "")
        leader = equality.get("joint2")
        location = f"{name}: the equality of joint {joint!r}"
        coefficients = _numbers(equality.get("polycoef", "0 1"), 0, f"{location}: polycoef")
        if leader is None:
            warnings.append(f"{location} with a constant is ignored")
            continue
        zeros = [references.get(each, 0.0) for each in (joint, leader)]
        mimics[joint] = coupled(leader, coefficients, references=zeros, location=location)
    return mimics, warnings
