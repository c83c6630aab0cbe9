"""Changes of how a robot is mounted for a person's motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment

_SCALES = (0.95, 0.9, 0.85, 0.8, 0.7, 0.6)
_SHIFTS = (0.1, 0.2, 0.3)  # of the arm's length
_TURNS = (30, 60, 90, 180)  # [degrees]
_TILTS = (30, 60, 90)  # [degrees]
_WAYS = (("to the right", "to the left"), ("forward", "backward"), ("up", "down"))


@dataclass(frozen=True, eq=False)
class Mounting:
    """A changed alignment, and a factor of positions.

    Attributes:
        alignment: the changed one.
        factor: of positions, in addition to the present scale.
        change: what is changed, in words; the factor apart.
        arguments: what to pass to `go.alignment`, such as "shoulder=(0.1, 0, 0.3)"; empty if
            only the factor is changed.
    """

    alignment: Alignment
    factor: float
    change: str
    arguments: str

    def poses(self, rotations: Array, positions: Array) -> tuple[Array, Array]:
        """Poses of the robot's hand from those in the person's axes, with the present scale."""
        return self.alignment.to_robot(rotations, positions, scale=self.factor)

    def sentence(self, scale: float | None) -> str:
        """What to do, such as "Scale positions by 0.9 (scale=0.7)"."""
        parts = []
        if self.change:
            parts.append(f"{self.change} (go.alignment(robot, {self.arguments}))")
        if self.factor != 1.0:
            new = "" if scale is None else f" (scale={self.factor * scale:.3g})"
            parts.append(f"scale positions by {self.factor:g}{new}")
        text = " and ".join(parts)
        return text[0].upper() + text[1:]


def mountings(alignment: Alignment, missed: Array) -> Iterator[Mounting]:
    """Mountings to try, the smaller changes first.

    Args:
        alignment: the present one.
        missed: mean vector (3,) [m] from the nearest positions within reach to those out of reach,
            in the robot's base; zero if the positions are within reach.
    """
    back = list(_towards(alignment, missed))
    shifts, turns = list(_shifted(alignment)), list(_turned(alignment))
    yield from back
    for factor in _SCALES[:2]:
        yield Mounting(alignment, factor, "", "")
    yield from shifts
    for factor in _SCALES[2:]:
        yield Mounting(alignment, factor, "", "")
    yield from turns
    for factor in _SCALES[1::2]:
        for each in (*back[-1:], *shifts[:6], *turns):
            yield replace(each, factor=factor)


def _towards(alignment: Alignment, missed: Array) -> Iterator[Mounting]:
    """The person's shoulder moved so that poses out of reach come nearer to the robot."""
    size = float(np.linalg.norm(missed))
    if size > 0.0:
        for part in (_SHIFTS[0] / 2.0, *_SHIFTS):
            yield _moved(alignment, -missed / size * part * alignment.length)


def _shifted(alignment: Alignment) -> Iterator[Mounting]:
    """The person's shoulder elsewhere on the robot, along one axis."""
    base = np.asarray(alignment.base)
    for part in _SHIFTS:
        for axis in base.T:
            for sign in (1.0, -1.0):
                yield _moved(alignment, sign * part * alignment.length * axis)


def _moved(alignment: Alignment, shift: Array) -> Mounting:
    moved = np.round(np.asarray(alignment.shoulder) + shift, 3) + 0.0
    person = (moved - np.asarray(alignment.shoulder)) @ np.asarray(alignment.base)
    steps = [
        f"{abs(distance):.2f} m {names[int(distance < 0.0)]}"
        for distance, names in zip(person, _WAYS, strict=True)
        if abs(distance) >= 0.005
    ]
    return Mounting(
        replace(alignment, shoulder=moved),
        1.0,
        f"move the person's shoulder on the robot {' and '.join(steps)}",
        f"shoulder={_numbers(moved)}",
    )


def _turned(alignment: Alignment) -> Iterator[Mounting]:
    """The robot's base turned about the person's vertical, or tilted."""
    base = np.asarray(alignment.base)
    for axis, degrees, verb in (
        (2, _TURNS, "turn the robot's base about the vertical"),
        (0, _TILTS, "tilt the robot's base about the person's right"),
        (1, _TILTS, "tilt the robot's base about the person's forward axis"),
    ):
        for size in degrees:
            for angle in (size, -size) if size < 180 else (size,):
                new = np.round(base @ _rotation(axis, -np.radians(angle)), 12) + 0.0
                rows = ", ".join(_numbers(row, 6) for row in new)
                yield Mounting(
                    replace(alignment, base=new),
                    1.0,
                    f"{verb} by {angle} degrees",
                    f"base=[{rows}]",
                )


def _rotation(axis: int, angle: float) -> Array:
    """Rotation (3, 3) about a coordinate axis."""
    one, other = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.eye(3)
    rotation[one, one] = rotation[other, other] = np.cos(angle)
    rotation[one, other], rotation[other, one] = -np.sin(angle), np.sin(angle)
    return rotation


def _numbers(values: Array, digits: int = 3) -> str:
    return f"({', '.join(f'{value:.{digits}g}' for value in values)})"
