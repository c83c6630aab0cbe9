"""Reading of XML model descriptions as Pinocchio models: URDF, MJCF, Simox (MMM)."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pinocchio as pin

from geodesic_ocp.model.formats.mjcf import mjcf_model
from geodesic_ocp.model.formats.simox import simox_model
from geodesic_ocp.model.formats.urdf import Mimic, urdf_model
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
        shapes: collision bodies of the links, or a function that reads them from the file.
    """

    pin: pin.Model
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
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
    # The text is already decoded: ElementTree rejects a declared encoding.
    text = _DECLARATION.sub("", text.removeprefix("\ufeff"), count=1)
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise ValueError(f"{name} is not well-formed XML: {error}") from None
    if root.tag == "Robot":
        return Description(simox_model(root, name, height, mass))
    if height is not None or mass is not None:
        raise ValueError(f"height and mass scale MMM models, but {name} is not one")
    if root.tag == "robot":
        model, mimics, faults, text = urdf_model(root, text, name)
    elif root.tag == "mujoco":
        model, mimics, faults, text = mjcf_model(root, name, folder)
    else:
        raise ValueError(
            f"{name} is neither URDF (<robot>), MJCF (<mujoco>) nor Simox (<Robot>): its root "
            f"element is <{root.tag}>"
        )
    shapes = LinkGeometry(model, text, name, folder and folder.absolute())
    return Description(model, mimics, faults, shapes)
