"""Descriptions of robots in any format, and their reduction to an arm."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array, as_number
from geodesic_ocp.model.formats.file_model import Mimic, apply_mimics, check_depth
from geodesic_ocp.model.formats.mjcf import mjcf_model
from geodesic_ocp.model.formats.simox import simox_model
from geodesic_ocp.model.formats.urdf import srdf_disabled_collisions, urdf_model
from geodesic_ocp.model.joints import (
    frame_index,
    motion_subspace,
    restore_frames,
    with_distinct_frames,
)
from geodesic_ocp.model.link_geometry import LinkGeometry
from geodesic_ocp.model.primitives import Bodies

_DECLARATION = re.compile(r"^\s*<\?xml[^>]*\?>")
_ENCODING = re.compile(rb"""^\s*<\?xml[^>]*encoding\s*=\s*["']([\w.-]+)["']""")
_MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}


@dataclass(frozen=True, eq=False)
class Description:
    """A model as read from a file, with what a Pinocchio model does not store.

    Attributes:
        pin: the model, with all joints of the file.
        mimics: joints that mimic another, by name.
        warnings: faults in the text and how they were resolved, one sentence each.
        immovable: joints that the file describes too badly to move, each with the reason.
        shapes: collision bodies of the links, or a function that reads them from the file.
    """

    pin: pin.Model
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    immovable: Mapping[str, str] = field(default_factory=dict)
    shapes: Bodies = ()


def read_file(file: Path, height: float | None, mass: float | None) -> Description:
    """Read the model in a file; see `read_description`.

    Raises:
        ValueError: the file cannot be read or is not valid; names the file.
    """
    try:
        content = file.read_bytes()
        declared = _ENCODING.match(content)
        encodings = [name for mark, name in _MARKS.items() if content.startswith(mark)]
        encodings.append(declared.group(1).decode() if declared else "utf-8")
        text = content.decode(encodings[0])
    except (OSError, ValueError, LookupError) as error:
        raise ValueError(f"{file} cannot be read: {error}") from None
    return read_description(text, file.name, height, mass, file.parent)


def read_description(
    text: str, name: str, height: float | None, mass: float | None, folder: Path | None = None
) -> Description:
    """Read the model in an XML text.

    Args:
        text: a URDF, MJCF or Simox document, distinguished by the root element.
        name: name of the file or text, for messages.
        height, mass: body height [m] and mass [kg], for MMM models, which are per unit of both.
        folder: folder of the file, for formats that refer to other files.

    Raises:
        ValueError: the text is in another format or not valid; names the location, if known.
    """
    folder = folder and folder.absolute()
    # The text is already decoded: ElementTree rejects a declared encoding.
    text = _DECLARATION.sub("", text.removeprefix("\ufeff"), count=1)
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise ValueError(f"{name} is not well-formed XML: {error}") from None
    check_depth(root, name)
    if root.tag == "Robot":
        return Description(simox_model(root, name, height, mass))
    if height is not None or mass is not None:
        raise ValueError(f"height and mass scale MMM models, but {name} is not one")
    disabled: Mapping[frozenset[str], str] = {}
    if root.tag == "robot":
        disabled = {} if folder is None else srdf_disabled_collisions(folder / name)
        found = urdf_model(root, text, name, folder)
    elif root.tag == "mujoco":
        found = mjcf_model(root, text, name, folder)
    else:
        raise ValueError(
            f"{name} is neither URDF (<robot>), MJCF (<mujoco>) nor Simox (<Robot>): its root "
            f"element is <{root.tag}>"
        )
    shapes = LinkGeometry(found.pin, text, name, found.geometry, disabled)
    return Description(
        found.pin,
        mimics=found.mimics,
        warnings=found.warnings,
        immovable=found.immovable,
        shapes=shapes,
    )


_LIMIT_TOLERANCE = 1e-6  # [rad or m]: limits in files are rounded


def lock_joints(
    description: Description, moving: Sequence[str], configuration: Mapping[str, float]
) -> pin.Model:
    """Return the model with all joints locked except those in `moving`.

    Raises:
        ValueError: a moving joint does not have one degree of freedom of its own, a locked joint
            mimics a moving one, or the configuration is outside the limits of the locked joints.
    """
    model = description.pin
    for name in moving:
        if name in description.immovable:
            advice = "give it one, or leave it out with base=... or joints=[...]"
            raise ValueError(f"{description.immovable[name]}; {advice}")
        if name in description.mimics:
            leader = description.mimics[name].leader
            raise ValueError(f"joint {name!r} mimics {leader!r}: it cannot move independently")
        try:
            motion_subspace(model, model.getJointId(name))
        except ValueError as error:
            raise ValueError(f"{error}; leave it out with base=... or joints=[...]") from None
    for name, joint in zip(model.names, model.joints, strict=True):
        if joint.shortname() == "JointModelMimic":
            raise ValueError(
                f"joint {name!r} of the pin.Model is a JointModelMimic, which cannot be locked; "
                "build the model without mimic joints"
            )
    for name, mimic in description.mimics.items():
        if mimic.leader in moving and name not in configuration:
            raise ValueError(
                f"joint {name!r} mimics {mimic.leader!r}, which moves; lock it with "
                f"configuration={{{name!r}: ...}}, or leave {mimic.leader!r} out of joints"
            )
    q = _locked_configuration(description, moving, configuration)
    others = [index for index in range(1, model.njoints) if model.names[index] not in moving]
    if not others:
        return model.copy()
    (distinct,), original = with_distinct_frames(model)
    reduced = pin.buildReducedModel(distinct, others, q)
    restore_frames(reduced, original)
    reduced.name = model.name
    return reduced


def _locked_configuration(
    description: Description, moving: Sequence[str], configuration: Mapping[str, float]
) -> Array:
    """Return Pinocchio's configuration (nq,) of the locked joints; the others are neutral."""
    model = description.pin
    joints = dict(zip(list(model.names)[1:], list(model.joints)[1:], strict=True))
    if not isinstance(configuration, Mapping):
        raise ValueError(f"configuration must map names of joints to values, got {configuration!r}")
    for name, value in configuration.items():
        location = f"configuration: {name!r}"
        if name not in joints or name in moving:
            why = "moves" if name in joints else f"is not a joint of {model.name!r}"
            raise ValueError(f"{location} {why}")
        as_number(location, value)
        if joints[name].nv != 1:
            raise ValueError(f"{location} is a {joints[name].shortname()}, not one number")
    values = {}
    for name, joint in joints.items():
        lower = -np.inf
        upper = np.inf
        if joint.nq == 1:
            row = joint.idx_q
            lower = model.lowerPositionLimit[row]
            upper = model.upperPositionLimit[row]
        default = np.clip(0.0, lower, upper) if lower <= upper else 0.0
        values[name] = value = float(configuration.get(name, default))
        within = lower - _LIMIT_TOLERANCE <= value <= upper + _LIMIT_TOLERANCE
        if name in configuration and not within:
            outside = f"lies outside its limits {lower:.6g} to {upper:.6g}"
            raise ValueError(f"configuration: {name!r} = {value:.6g} {outside}")
    free = {name: mimic for name, mimic in description.mimics.items() if name not in configuration}
    apply_mimics(free, values)
    q = pin.neutral(model)
    for name, joint in joints.items():
        if joint.nv == 1 and name not in moving:
            angle = values[name]
            coordinates = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
            q[joint.idx_q : joint.idx_q + joint.nq] = coordinates
    return np.asarray(q)


def change_base(model: pin.Model, base: str) -> pin.Model:
    """Return the model, including gravity, expressed in another fixed frame.

    Raises:
        ValueError: the frame moves with one of the joints.
    """
    frame = model.frames[frame_index(model, base)]
    if frame.parentJoint > 0:
        raise ValueError(f"base {base!r} moves with joint {model.names[frame.parentJoint]!r}")
    result = model.copy()
    inverse = frame.placement.inverse()
    for index in range(1, model.njoints):
        if model.parents[index] == 0:
            result.jointPlacements[index] = inverse * model.jointPlacements[index]
    for index in range(1, model.nframes):  # frame 0 is the universe, now the base
        if model.frames[index].parentJoint == 0:
            result.frames[index].placement = inverse * model.frames[index].placement
    result.inertias[0] = inverse.act(model.inertias[0])
    gravity = inverse.rotation @ model.gravity.linear
    result.gravity = pin.Motion(gravity, np.zeros(3))
    return result
