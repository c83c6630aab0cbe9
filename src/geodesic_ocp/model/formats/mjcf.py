"""MJCF, the format of MuJoCo: read as a Pinocchio model, and written.

Pinocchio reads a part of the format. What it ignores or interprets differently from MuJoCo is
rewritten here (includes, default classes, several joints of a body, several bodies in the world,
ranges of prismatic joints, torque limits), or rejected by name. Damping, friction and springs of
joints are no part of a Model.
"""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.formats.urdf import Mimic, floats
from geodesic_ocp.model.joints import frame_index, motion_subspace
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import as_capsule

# MuJoCo takes no moving body without inertia: [kg] and [kg m^2], below the accuracy of any result.
_LEAST = 1e-12
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
    ET.SubElement(root, "option", gravity=_text(native.gravity.linear))
    names, bodies = _body_names(native), {0: ET.SubElement(root, "worldbody")}
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
            motor.set("ctrlrange", _text(limits))
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
    moments, mass = np.array(inertia.inertia), repr(max(float(inertia.mass), _LEAST))
    if inertia.mass < _LEAST or np.linalg.eigvalsh(moments)[0] < _LEAST:
        moments = moments + _LEAST * np.eye(3)
    entries = _text([*np.diag(moments), moments[0, 1], moments[0, 2], moments[1, 2]])
    ET.SubElement(element, "inertial", pos=_text(inertia.lever), mass=mass, fullinertia=entries)


def _write_joint(element: ET.Element, model: Model, index: int) -> None:
    native, name = model.pin, str(model.pin.names[index])
    linear, angular = np.split(motion_subspace(native, index), 2)
    if np.any(linear) and np.any(angular):
        raise ValueError(f"joint {name!r} is a screw, which MJCF does not have")
    row = native.joints[index].idx_v
    kind, axis = ("hinge", angular) if np.any(angular) else ("slide", linear)
    joint = ET.SubElement(element, "joint", name=name, type=kind, axis=_text(axis))
    joint.set("armature", repr(float(native.armature[row])))
    limits = [model.lower[row], model.upper[row]]
    if name not in model.continuous and np.all(np.isfinite(limits)):
        joint.set("range", _text(limits))


def _write_geoms(model: Model, bodies: dict[int, ET.Element]) -> None:
    seen = Counter[str]()
    for body in map(as_capsule, model.bodies):
        frame = model.pin.frames[frame_index(model.pin, str(body.link))]
        start, end = (frame.placement.act(np.array(point)) for point in (body.start, body.end))
        seen[str(body.link)] += 1
        shape = {"type": "sphere", "pos": _text(start)}
        if np.linalg.norm(end - start) > 1e-9:
            shape = {"type": "capsule", "fromto": _text([*start, *end])}
        name, size = f"{body.link}:{seen[str(body.link)]}", repr(float(body.radius))
        attributes = {"name": name, "mass": "0", "group": "3", "size": size, **shape}
        ET.SubElement(bodies[frame.parentJoint], "geom", attributes)


def _pose(placement: pin.SE3) -> dict[str, str]:
    x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
    return {"pos": _text(placement.translation), "quat": _text([w, x, y, z])}


def _text(values: ArrayLike) -> str:
    return " ".join(repr(float(value)) for value in np.asarray(values, dtype=float))


def mjcf_model(
    root: ET.Element, name: str, folder: Path | None
) -> tuple[pin.Model, dict[str, Mimic], tuple[str, ...], str]:
    """Return the model, its mimic joints (joint equalities), warnings, and the rewritten text.

    Args:
        root: the element <mujoco>; it is modified.
        name: name of the file, for messages.
        folder: folder in which included files are searched for.

    Raises:
        ValueError: Pinocchio cannot read it, or would ignore parts that change the model.
    """
    _include(root, name, folder, ())
    _merge_sections(root)
    _apply_defaults(root, name)
    _reject_unsupported(root, name)
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
    for driven, (lower, upper) in _effort_limits(root, name).items():
        if model.existJointName(driven):
            row = model.joints[model.getJointId(driven)].idx_v
            model.lowerEffortLimit[row], model.upperEffortLimit[row] = lower, upper
    mimics, warnings = _equalities(root, name)
    if folder is not None:  # the text can be read from any folder
        compiler = root.find("compiler")
        if compiler is None:
            compiler = ET.SubElement(root, "compiler")
        meshes = compiler.get("meshdir", compiler.get("assetdir", ""))
        compiler.set("meshdir", str(folder.absolute() / meshes))
    return model, mimics, tuple(warnings), ET.tostring(root, encoding="unicode")


def _include(
    element: ET.Element, name: str, folder: Path | None, including: tuple[Path, ...]
) -> None:
    """Replace <include file="..."/> by the contents of the file."""
    for index, child in reversed(list(enumerate(element))):
        if child.tag != "include":
            _include(child, name, folder, including)
            continue
        if folder is None:
            raise ValueError(f"{name} includes {child.get('file')!r}, which only a file can do")
        file = folder / child.get("file", "")
        if file in including:
            raise ValueError(f"{name} includes {file.name} in itself")
        try:
            included = ET.parse(file).getroot()
        except (OSError, ET.ParseError) as error:
            what = f"{name} includes {file.name}, which cannot be read"
            raise ValueError(f"{what}: {error}") from None
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
    for tag in _ELEMENTS:
        if next(root.iter(tag), None) is not None:
            raise ValueError(f"{name} has a <{tag}>, which is not supported")
    for compiler in root.iterfind("compiler"):
        for key in _COMPILER:
            if compiler.get(key, "0") not in ("0", "false", "-1", "0 5"):
                raise ValueError(f"{name}: {key} of <compiler> is not supported")
        if compiler.get("coordinate", "local") != "local":
            raise ValueError(f"{name}: global coordinates are not supported")
        if not compiler.get("eulerseq", "xyz").islower():
            raise ValueError(f"{name}: eulerseq with capitals, about fixed axes, is not supported")
        if compiler.get("inertiafromgeom") == "true" and next(root.iter("inertial"), None):
            given = "inertiafromgeom in place of given <inertial>s"
            raise ValueError(f"{name}: {given} is not supported")
    for joint in root.iter("joint"):
        if (kind := joint.get("type", "hinge")) not in _JOINTS:
            raise ValueError(f"{name}: joint {joint.get('name')!r} is of the unknown type {kind!r}")
    for body in root.iter("body"):
        location = f"{name}: body {body.get('name')!r}"
        meshes = [geom for geom in body.iterfind("geom") if geom.get("mesh") is not None]
        heavy = [geom for geom in meshes if not {geom.get("mass"), geom.get("density")} & {"0"}]
        if heavy and body.find("inertial") is None:
            what = "has the inertia of a mesh, which is not supported: give <inertial>"
            raise ValueError(f"{location} {what}")


def _rewrite(root: ET.Element, name: str) -> None:
    compiler = root.find("compiler")
    degrees = compiler is None or compiler.get("angle", "degree") == "degree"
    for element in root.iter():
        if (given := element.get("axisangle")) is not None:
            *axis, angle = _numbers(given, 4, f"{name}: axisangle")
            length = float(np.linalg.norm(axis)) or 1.0
            element.set("axisangle", _text([*(number / length for number in axis), angle]))
        if element.tag == "joint" and element.get("limited") == "false":
            element.attrib.pop("range", None)  # Pinocchio would apply it
        if degrees and element.tag == "joint" and element.get("type") == "slide":
            location = f"{name}: range of joint {element.get('name')!r}"
            # Pinocchio reads it as degrees.
            metres = _numbers(element.get("range", "0 0"), 2, location)
            element.set("range", _text(np.rad2deg(metres)))
    world = root.find("worldbody")
    if world is None or world.find("body") is None:
        raise ValueError(f"{name} has no <body>")
    # Pinocchio reads only one body of the world, and ignores its pose if it has no joint.
    whole = ET.Element("body", {"name": _ROOT})
    whole.extend(world)
    world[:] = [whole]
    for body in list(root.iter("body")):
        _give_each_joint_a_body(body)


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
    given, limited = element.get(f"{kind}range"), element.get(f"{kind}limited", "auto")
    if given is None or limited == "false" or (limited == "auto" and not automatic):
        return _UNLIMITED
    if len(numbers := floats(given)) != 2 or not numbers[0] < numbers[1]:
        raise ValueError(f"{location}: {kind}range must be two increasing numbers, is {given!r}")
    return np.array(numbers)


def _first(element: ET.Element, key: str, location: str) -> float:
    """Return the first number of the attribute, 1 by default."""
    return _numbers(element.get(key, "1"), 0, f"{location}: {key}")[0]


def _equalities(root: ET.Element, name: str) -> tuple[dict[str, Mimic], list[str]]:
    mimics, warnings = {}, []
    for equality in root.iterfind("equality/*"):
        if equality.get("active", "true") == "false":
            continue
        if equality.tag != "joint":
            names = [equality.get(key, "") for key in ("body1", "body2") if equality.get(key)]
            warnings.append(f"{name}: the <{equality.tag}> of {' and '.join(names)} is ignored")
            continue
        joint, leader = equality.get("joint1", ""), equality.get("joint2")
        location = f"{name}: the equality of joint {joint!r}"
        coefficients = _numbers(equality.get("polycoef", "0 1"), 0, f"{location}: polycoef")
        offset, multiplier, *higher = (*coefficients, 0.0, 0.0)
        if leader is None:
            warnings.append(f"{location} with a constant is ignored")
            continue
        if any(higher):
            raise ValueError(f"{location} with {leader!r} is not linear, which is not supported")
        mimics[joint] = Mimic(leader, multiplier, offset)
    return mimics, warnings
