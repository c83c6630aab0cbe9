"""OsimModel: the bodies, joints and coordinates of an OpenSim model, and how they move."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.continuous_angles import axis_rotation

GROUND = "ground"
_COUPLED = 100  # coordinates one after the other


@dataclass(frozen=True, eq=False)
class OffsetFrame:
    """A frame at a fixed pose in a body: rotation (3, 3) to the body's axes, position (3,) [m]."""

    body: str
    rotation: Array
    position: Array


@dataclass(frozen=True, eq=False)
class OsimFunction:
    """A function of n coordinates, at k samples: (n, k) to (k,)."""

    coordinates: tuple[str, ...]
    function: Callable[[Array], Array]

    def __call__(self, values: Mapping[str, Array], count: int) -> Array:
        """Return the values (k,) by those of the coordinates, (k,) or (1,) each."""
        arguments = [np.broadcast_to(values[name], count) for name in self.coordinates]
        return self.function(np.array(arguments).reshape(len(arguments), count))


@dataclass(frozen=True, eq=False)
class OsimAxis:
    """A rotation about an axis (3,), or a translation along it, by a function of coordinates."""

    axis: Array
    amount: OsimFunction


@dataclass(frozen=True)
class OsimCoordinate:
    """A coordinate: its default value, its range [rad or m] if it has one, and whether locked."""

    name: str
    default: float = 0.0
    range: tuple[float, float] | None = None
    locked: bool = False


@dataclass(frozen=True, eq=False)
class OsimJoint:
    """A joint: where its child frame is in its parent frame.

    The rotation is the product of the rotations about the axes, each turned by those before it; the
    position is the sum of the translations along axes of the parent frame.
    """

    name: str
    parent: OffsetFrame  # frame in the parent body
    child: OffsetFrame  # frame in the child body
    rotations: tuple[OsimAxis, ...] = ()  # in their order
    translations: tuple[OsimAxis, ...] = ()  # in any order
    refusal: str = ""  # why the joint's motion cannot be computed, if it cannot

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of all coordinates that the joint moves with."""
        return _coordinates((*self.rotations, *self.translations))


def _coordinates(axes: Iterable[OsimAxis]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for axis in axes for name in axis.amount.coordinates))


@dataclass(frozen=True, eq=False, repr=False)
class OsimModel:
    """A model's tree of bodies.

    Attributes:
        bodies: names, without the ground.
        joints: joints by the body that they carry.
        couplers: functions of other coordinates by dependent coordinate.
        gravity: (3,) [m/s^2] in axes of the ground.
    """

    file: Path
    bodies: tuple[str, ...]
    joints: Mapping[str, OsimJoint]
    coordinates: Mapping[str, OsimCoordinate]
    couplers: Mapping[str, OsimFunction] = field(default_factory=dict)
    gravity: Array = field(default_factory=lambda: np.zeros(3))

    def path(self, body: str, start: str = GROUND) -> tuple[OsimJoint, ...]:
        """Return the joints from a body that carries another one (or the ground) to that other one.

        Raises:
            RecordingError: there is no such way, or one of its joints cannot be computed.
        """
        way: list[OsimJoint] = []
        at = body
        while at != start:
            joint = self.joints.get(at)
            if joint is None or len(way) > len(self.joints):
                raise RecordingError(f"no joints lead from the body {start!r} to the body {body!r}")
            if joint.refusal:
                raise RecordingError(f"joint {joint.name!r}: {joint.refusal}")
            way.append(joint)
            at = joint.parent.body
        return tuple(reversed(way))

    def independent(self, joints: tuple[OsimJoint, ...]) -> tuple[str, ...]:
        """Return the coordinates that move these joints; in place of coupled ones, those that move
        them.

        Raises:
            RecordingError: couplers depend on one another in a circle, or a coordinate is missing.
        """
        found: dict[str, None] = {}
        followed: set[str] = set()

        def follow(name: str, depth: int = 0) -> None:
            if depth > _COUPLED:
                raise RecordingError(f"the coordinate {name!r} is coupled to itself")
            if name in self.couplers and name not in followed:
                for other in self.couplers[name].coordinates:
                    follow(other, depth + 1)
            elif name not in self.couplers:
                if name not in self.coordinates:
                    raise RecordingError(f"there is no coordinate {name!r}")
                found[name] = None
            followed.add(name)

        for joint in joints:
            for name in joint.coordinates:
                follow(name)
        return tuple(found)

    @property
    def rotations(self) -> tuple[str, ...]:
        """Coordinates that rotate."""
        return _coordinates(axis for joint in self.joints.values() for axis in joint.rotations)

    @property
    def translations(self) -> tuple[str, ...]:
        """Coordinates that translate and do not rotate."""
        moving = _coordinates(axis for joint in self.joints.values() for axis in joint.translations)
        return tuple(name for name in moving if name not in self.rotations)

    @property
    def zero(self) -> dict[str, Array]:
        """All independent coordinates zero, one sample."""
        return {name: np.zeros(1) for name in self.coordinates if name not in self.couplers}


def body_poses(
    model: OsimModel, values: Mapping[str, Array], bodies: Iterable[str]
) -> dict[str, tuple[Array, Array]]:
    """Return rotations (k, 3, 3) to the ground and positions (k, 3) [m] of bodies.

    Coordinates without values follow their couplers, or have their default values.

    Args:
        model: model of the bodies.
        values: values by coordinate, (k,) [rad or m].
        bodies: names.

    Raises:
        RecordingError: a body is not connected to the ground, or a joint on the way cannot be
            computed.
    """
    count = max((len(each) for each in values.values()), default=1)
    complete = dict(values)
    still = np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3))
    poses: dict[str, tuple[Array, Array]] = {GROUND: still}

    def complete_with(name: str) -> None:
        """Add the values of a coordinate, after those that it depends on."""
        if name in complete:
            return
        if name not in model.couplers:
            complete[name] = np.full(count, model.coordinates[name].default)
            return
        for other in model.couplers[name].coordinates:
            complete_with(other)
        complete[name] = model.couplers[name](complete, count)

    for body in bodies:
        way = model.path(body)
        model.independent(way)  # refuses couplers in circles
        for joint in way:
            if joint.child.body not in poses:
                for name in joint.coordinates:
                    complete_with(name)
                poses[joint.child.body] = _moved(joint, complete, *poses[joint.parent.body])
    return {body: poses[body] for body in bodies}


def _moved(
    joint: OsimJoint, values: Mapping[str, Array], rotation: Array, position: Array
) -> tuple[Array, Array]:
    """Return the pose of the child body from that of the parent body."""
    count = len(position)
    position = position + rotation @ joint.parent.position
    rotation = rotation @ joint.parent.rotation
    for each in joint.translations:
        position = position + (rotation @ each.axis) * each.amount(values, count)[:, None]
    for each in joint.rotations:
        rotation = rotation @ axis_rotation(each.axis, each.amount(values, count))
    rotation = rotation @ joint.child.rotation.T
    return rotation, position - rotation @ joint.child.position


def point_in(
    model: OsimModel, pose: Mapping[str, Array], body: str, other: str, point: Array
) -> Array:
    """Return a point (3,) of another body in the axes of this one, at one sample of coordinates."""
    poses = body_poses(model, pose, (body, other))
    (rotation, origin), (turned, place) = ((r[0], p[0]) for r, p in (poses[body], poses[other]))
    return np.asarray(rotation.T @ (place + turned @ point - origin))
