"""Descriptions of robots and people in XML, as Pinocchio models: URDF, MJCF, Simox (MMM)."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pinocchio as pin

from geodesic_ocp.model.formats.mimic import Mimic
from geodesic_ocp.model.formats.mjcf import mjcf_model
from geodesic_ocp.model.formats.simox import simox_model
from geodesic_ocp.model.formats.urdf import urdf_model
from geodesic_ocp.model.geometry.link_geometry import Shapes
from geodesic_ocp.model.primitives import Bodies

_DECLARATION = re.compile(r"^\s*<\?xml[^>]*\?>")
_ENCODING = re.compile(rb"""^\s*<\?xml[^>]*encoding\s*=\s*["']([\w.-]+)["']""")
_MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}


@dataclass(frozen=True, eq=False)
class Description:
    """What was read: the model, and what its joints are that Pinocchio's model does not tell.

    Attributes:
        pin: the model, with all joints of the file.
        mimics: by name, the joints that follow another.
        warnings: what was wrong in the text and how it was read, one sentence each.
        shapes: bodies of the links, or a function that reads them from the file.
    """

    pin: pin.Model
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    shapes: Bodies = ()


def read_file(file: Path, height: float | None, mass: float | None) -> Description:
    """The model in a file: see `read_description`.

    Raises:
        ValueError: it cannot be read, or is not what it should be; names the file.
    """
    try:
        content = file.read_bytes()
    except (OSError, ValueError) as error:
        raise ValueError(f"{file} cannot be read: {error}") from None
    declared = _ENCODING.match(content)
    encoding = declared.group(1).decode() if declared else "utf-8"
    encoding = next((name for mark, name in _MARKS.items() if content.startswith(mark)), encoding)
    try:
        text = content.decode(encoding)
    except (UnicodeDecodeError, LookupError) as error:
        raise ValueError(f"{file} cannot be read: {error}") from None
    return read_description(text, file.name, height, mass, file.parent)


def read_description(
    text: str, name: str, height: float | None, mass: float | None, folder: Path | None = None
) -> Description:
    """The model in an XML text; `name` stands for it in messages.

    Args:
        text: of a URDF, MJCF or Simox document, told apart by the root element.
        name: of the file, or what the text is.
        height, mass: of the person [m], [kg], for Simox models, which are per unit of both.
        folder: where the text was read, for formats that refer to other files.

    Raises:
        ValueError: it is none of these, or faulty; names the place where it is known.
    """
    # In a text there is nothing left to decode.
    text = _DECLARATION.sub("", text.removeprefix("\ufeff"), count=1)
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise ValueError(f"{name} is not well-formed XML: {error}") from None
    if root.tag == "Robot":
        return Description(simox_model(root, name, height, mass))
    if height is not None or mass is not None:
        raise ValueError(f"height and mass scale MMM models, and {name} is not one")
    if root.tag == "robot":
        return _with_shapes(urdf_model(root, text, name), name, folder)
    if root.tag == "mujoco":
        return _with_shapes(mjcf_model(root, name, folder), name, folder)
    raise ValueError(
        f"{name} is neither URDF (<robot>), MJCF (<mujoco>) nor Simox (<Robot>): its root element "
        f"is <{root.tag}>"
    )


def _with_shapes(
    read: tuple[pin.Model, Mapping[str, Mimic], tuple[str, ...], str],
    name: str,
    folder: Path | None,
) -> Description:
    model, mimics, warnings, text = read
    return Description(
        model, mimics, warnings, Shapes(model, text, name, folder and folder.absolute())
    )
