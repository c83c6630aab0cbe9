"""Joints that follow another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: q = multiplier * leader + offset."""

    leader: str
    multiplier: float
    offset: float


def follow(mimics: Mapping[str, Mimic], values: Mapping[str, float]) -> dict[str, float]:
    """The values of all joints when followers take theirs from their leaders'.

    Args:
        mimics: followers by name, whose leaders may follow others.
        values: of all joints; of followers they do not count.

    Raises:
        ValueError: joints follow each other in a circle.
    """
    found = {name: value for name, value in values.items() if name not in mimics}

    def value(name: str, before: tuple[str, ...]) -> float:
        if name in before:
            raise ValueError(f"joints mimic each other: {' and '.join(before)}")
        if name not in found:
            mimic = mimics[name]
            found[name] = mimic.multiplier * value(mimic.leader, (*before, name)) + mimic.offset
        return found[name]

    return {name: value(name, ()) for name in values}
