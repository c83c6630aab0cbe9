"""What the readers of URDF and MJCF return, and joints that mimic others."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter

import pinocchio as pin

# TINYXML2_MAX_ELEMENT_DEPTH of TinyXML2, which parses MJCF for MuJoCo and URDF for Pinocchio.
_DEEPEST = 500


@dataclass(frozen=True)
class Mimic:
    """A joint that mimics another: q = multiplier * leader + offset."""

    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class FileModel:
    """A model as read from a file.

    Attributes:
        pin: the model, with all joints of the file.
        geometry: a function that reads the geometry of its links, of one of the two kinds.
        mimics: joints that mimic another, by name.
        warnings: faults in the text and how they were resolved, one sentence each.
        immovable: joints that the file describes too badly to move, each with the reason.
    """

    pin: pin.Model
    geometry: Callable[[pin.GeometryType], pin.GeometryModel]
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    immovable: Mapping[str, str] = field(default_factory=dict)


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


def floats(text: str | None) -> list[float]:
    """Return the numbers in a text; none if one of its words is not a number."""
    try:
        return [float(word) for word in (text or "").split()]
    except ValueError:
        return []


def check_depth(root: ET.Element, name: str) -> None:
    """Reject a tree of elements nested more deeply than MuJoCo and Pinocchio read.

    Raises:
        ValueError: names the file and the limit.
    """
    level = [root]
    for _ in range(_DEEPEST):
        level = [child for element in level for child in element]
    if level:
        raise ValueError(
            f"{name}: elements are nested more than {_DEEPEST} deep, which is the limit of the "
            "parser of MuJoCo and Pinocchio"
        )
