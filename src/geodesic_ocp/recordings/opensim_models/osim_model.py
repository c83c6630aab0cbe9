"""OsimModel: the bodies, joints and coordinates of an OpenSim model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError

#: A function of n coordinates at k samples: (n, k) to (k,).
OsimFunction: TypeAlias = Callable[[Array], Array]

GROUND = "ground"
_COUPLED = 100  # coordinates one after the other


@dataclass(frozen=True, eq=False, repr=False)
class OffsetFrame:
    """A frame at a fixed pose in a body: rotation (3, 3) to the body's axes, position (3,) [m]."""

    body: str
    rotation: Array
    position: Array

    def __repr__(self) -> str:
        return f"OffsetFrame(in {self.body!r} at {self.position.tolist()})"


@dataclass(frozen=True, eq=False, repr=False)
class OsimAxis:
    """A rotation about an axis (3,), or a translation along it, by a function of coordinates."""

    axis: Array
    coordinates: tuple[str, ...]
    function: OsimFunction

    def __repr__(self) -> str:
        return f"OsimAxis({self.axis.tolist()} of {', '.join(self.coordinates) or 'nothing'})"


@dataclass(frozen=True)
class OsimCoordinate:
    """A coordinate: its default value, its range [rad or m] if it has one, and whether locked."""

    name: str
    default: float = 0.0
    range: tuple[float, float] | None = None
    locked: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class OsimJoint:
    """A joint: where its child frame is in its parent frame.

    The rotation is the product of the rotations about the axes, each turned by those before it; the
    position is the sum of the translations along axes of the parent frame.

    Attributes:
        name: of the joint.
        parent: frame in the parent body.
        child: frame in the child body.
        rotations: in their order.
        translations: in any order.
        refusal: why the joint's motion cannot be computed, if it cannot.
    """

    name: str
    parent: OffsetFrame
    child: OffsetFrame
    rotations: tuple[OsimAxis, ...] = ()
    translations: tuple[OsimAxis, ...] = ()
    refusal: str = ""

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of all coordinates that the joint moves with."""
        axes = (*self.rotations, *self.translations)
        return tuple(dict.fromkeys(name for axis in axes for name in axis.coordinates))

    def __repr__(self) -> str:
        return f"OsimJoint({self.name!r}: {self.parent.body} to {self.child.body})"


@dataclass(frozen=True, eq=False, repr=False)
class OsimCoupler:
    """A coordinate that is a function of others."""

    independent: tuple[str, ...]
    function: OsimFunction

    def __repr__(self) -> str:
        return f"OsimCoupler(of {', '.join(self.independent)})"


@dataclass(frozen=True, eq=False, repr=False)
class OsimModel:
    """A model's tree of bodies.

    Attributes:
        file: that it is from, for messages.
        bodies: names, without the ground.
        joints: by the body that they carry.
        coordinates: by name.
        couplers: by dependent coordinate.
        gravity: (3,) [m/s^2] in axes of the ground.
    """

    file: Path
    bodies: tuple[str, ...]
    joints: Mapping[str, OsimJoint]
    coordinates: Mapping[str, OsimCoordinate]
    couplers: Mapping[str, OsimCoupler] = field(default_factory=dict)
    gravity: Array = field(default_factory=lambda: np.zeros(3))

    def path(self, body: str, start: str = GROUND) -> tuple[OsimJoint, ...]:
        """The joints from a body that carries another one (or the ground) to that other one.

        Raises:
            RecordingError: there is no such way, or one of its joints cannot be computed.
        """
        way: list[OsimJoint] = []
        at = body
        while at != start:
            joint = self.joints.get(at)
            if joint is None or len(way) > len(self.joints):
                raise RecordingError(
                    f"{self.file}: no joints lead from the body {start!r} to the body {body!r}"
                )
            if joint.refusal:
                raise RecordingError(f"{self.file}: joint {joint.name!r}: {joint.refusal}")
            way.append(joint)
            at = joint.parent.body
        return tuple(reversed(way))

    def independent(self, joints: tuple[OsimJoint, ...]) -> tuple[str, ...]:
        """The coordinates that move these joints; in place of coupled ones, those that move them.

        Raises:
            RecordingError: couplers depend on one another in a circle, or a coordinate is missing.
        """
        found: dict[str, None] = {}
        followed: set[str] = set()

        def follow(name: str, behind: tuple[str, ...]) -> None:
            if name in behind or len(behind) > _COUPLED:
                raise RecordingError(f"{self.file}: the coordinate {name!r} is coupled to itself")
            if name in followed:
                return
            if name in self.couplers:
                for other in self.couplers[name].independent:
                    follow(other, (*behind, name))
            elif name not in self.coordinates:
                raise RecordingError(f"{self.file}: there is no coordinate {name!r}")
            else:
                found[name] = None
            followed.add(name)

        for joint in joints:
            for name in joint.coordinates:
                follow(name, ())
        return tuple(found)

    @property
    def rotations(self) -> tuple[str, ...]:
        """Coordinates that rotate."""
        axes = [axis for joint in self.joints.values() for axis in joint.rotations]
        return tuple(dict.fromkeys(name for axis in axes for name in axis.coordinates))

    @property
    def translations(self) -> tuple[str, ...]:
        """Coordinates that translate and do not rotate."""
        axes = [axis for joint in self.joints.values() for axis in joint.translations]
        moving = dict.fromkeys(name for axis in axes for name in axis.coordinates)
        return tuple(name for name in moving if name not in self.rotations)

    def __repr__(self) -> str:
        return (
            f"OsimModel({self.file.name!r}: {len(self.bodies)} bodies, "
            f"{len(self.coordinates)} coordinates)"
        )
