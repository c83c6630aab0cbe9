"""Descriptions of robots and people in XML, as Pinocchio models: URDF, MJCF, Simox (MMM)."""

from __future__ import annotations

import re
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pinocchio as pin

from geodesic_ocp.model.simox import simox_model

# <origin rpy="1.57, 0 0"/>: numbers of a vector are separated by blanks alone.
_VECTOR = re.compile(r"""\b(rpy|xyz)\s*=\s*(["'])([^"']*,[^"']*)\2""")


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: q = multiplier * leader + offset."""

    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class Description:
    """What was read: the model, and what its joints are that Pinocchio's model does not tell.

    Attributes:
        pin: the model, with all joints of the file.
        mimics: by name, the joints that follow another.
        repairs: what was wrong in the text and how it was read, one sentence each.
    """

    pin: pin.Model
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    repairs: tuple[str, ...] = ()


def read_description(
    text: str, name: str, height: float | None, mass: float | None, file: Path | None = None
) -> Description:
    """The model in an XML text; `name` stands for it in messages.

    Args:
        text: of a URDF, MJCF or Simox document, told apart by the root element.
        name: of the file, or what the text is.
        height, mass: of the person [m], [kg], for Simox models, which are per unit of both.
        file: where the text was read, for formats that refer to other files.

    Raises:
        ValueError: it is none of these, or faulty; names the place where it is known.
    """
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise ValueError(f"{name} is not well-formed XML: {error}") from None
    if root.tag == "Robot":
        return Description(simox_model(root, name, height, mass))
    if height is not None or mass is not None:
        raise ValueError(f"height and mass scale MMM models, and {name} is not one")
    if root.tag == "robot":
        return _urdf(root, text, name)
    if root.tag == "mujoco":
        return _mjcf(root, text, name, file)
    raise ValueError(
        f"{name} is neither URDF (<robot>), MJCF (<mujoco>) nor Simox (<Robot>): its root element "
        f"is <{root.tag}>"
    )


def _urdf(root: ET.Element, text: str, name: str) -> Description:
    if any(element.tag.startswith("{") and "xacro" in element.tag for element in root.iter()):
        raise ValueError(f"{name} is a xacro file; expand it to URDF first")
    repairs = tuple(_repair(match, text, name) for match in _VECTOR.finditer(text))
    try:
        model = pin.buildModelFromXML(_VECTOR.sub(lambda m: m.group().replace(",", " "), text))
    except Exception as error:
        raise ValueError(f"{name} is not a URDF that Pinocchio can read: {error}") from None
    mimics = {}
    for joint in root.iter("joint"):
        if (mimic := joint.find("mimic")) is not None:
            figures = (float(mimic.get(key, value)) for key, value in _MIMIC.items())
            mimics[joint.get("name", "")] = Mimic(mimic.get("joint", ""), *figures)
    moving = {joint: leader for joint, leader in mimics.items() if joint in model.names}
    return Description(model, moving, repairs)


_MIMIC = {"multiplier": "1", "offset": "0"}


def _repair(match: re.Match[str], text: str, name: str) -> str:
    line = text.count("\n", 0, match.start()) + 1
    return f"{name}, line {line}: the comma in {match.group()} is read as a blank"


def _mjcf(root: ET.Element, text: str, name: str, file: Path | None) -> Description:
    try:
        if file is not None:
            model = pin.buildModelFromMJCF(str(file))
        else:
            with tempfile.TemporaryDirectory() as folder:
                written = Path(folder) / "model.xml"
                written.write_text(text, encoding="utf-8")
                model = pin.buildModelFromMJCF(str(written))
    except Exception as error:
        raise ValueError(f"{name} is not an MJCF that Pinocchio can read: {error}") from None
    mimics = {}
    for equality in root.iterfind("equality/joint"):
        if (leader := equality.get("joint2")) is not None:
            offset, factor = (*map(float, equality.get("polycoef", "0 1").split()), 1.0)[:2]
            mimics[equality.get("joint1", "")] = Mimic(leader, factor, offset)
    return Description(model, mimics)
