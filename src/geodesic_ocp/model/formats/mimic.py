"""Mimic joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Mimic:
    """A joint that mimics another: q = multiplier * leader + offset."""

    leader: str
    multiplier: float
    offset: float


def apply_mimics(mimics: Mapping[str, Mimic], values: Mapping[str, float]) -> dict[str, float]:
    """The values of all joints, with those of mimic joints computed from their leaders.

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
