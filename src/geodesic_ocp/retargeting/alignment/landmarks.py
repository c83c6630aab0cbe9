"""Shoulder, elbow and wrist of a robot arm, found from the axes of its joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.joint_axes import JointAxes, joint_axes
from geodesic_ocp.model.model import Model

_ARM_JOINTS = 7  # revolute joints of an arm; those before them belong to a torso or collarbone
_MEETING = 0.06  # distance of axes that meet, relative to the length of the chain
_PARALLEL = 0.2  # sine of the angle between axes that have no crossing
_BENDING = 0.1  # least distance of a bending axis from shoulder and hand, relative to the length
_NUM_RANDOM, _NUM_STARTS = 256, 5


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Landmarks: where the joints of an arm are.

    Attributes:
        home: configuration (n,): zero, or the nearest to it within the limits.
        stretched: configuration (n,) with the hand farthest from the shoulder.
        before: names of the joints before the shoulder: of a torso, collarbone or lift.
        first_coordinate: index of the shoulder's first joint in the configuration.
        first_axis: its unit direction (3,) in the base frame.
        shoulder: its position in the base frame (3,) [m], with the joints before it at `home`.
        crossing: names of the joints whose axes meet there; empty if no axes do.
        length: largest distance of the hand from the shoulder [m].
        elbow: name of the joint that bends the arm; None: there is none.
        wrist: name of the first joint behind the elbow that bends the hand; None: there is none.
    """

    home: Array
    stretched: Array
    before: tuple[str, ...]
    first_coordinate: int
    first_axis: Array
    shoulder: Array
    crossing: tuple[str, ...]
    length: float
    elbow: str | None
    wrist: str | None


def landmarks(robot: Model) -> Landmarks:
    """Return shoulder, elbow and wrist of an arm.

    The arm is the last seven revolute joints, or fewer. Its shoulder is where the axes of its first
    three joints meet, or of the next three, else where those of two of the first three do. The
    elbow is the joint whose axis is far from the shoulder and from the centre of the wrist at once,
    and the wrist the first joint behind it that bends and whose axis is far from the elbow.

    Raises:
        ValueError: fewer than two revolute joints, or an arm without extent.
    """
    home = np.clip(np.zeros(robot.dof), robot.lower, robot.upper)
    axes = joint_axes(robot, home)
    revolute = [number for number, rotates in enumerate(axes.rotates) if rotates]
    if len(revolute) < 2:
        raise ValueError(
            f"{robot.name!r} has {len(revolute)} revolute joints before its hand {robot.hand!r}: "
            "an alignment cannot be proposed for it; describe it with go.retargeting.Alignment"
        )
    arm = revolute[-_ARM_JOINTS:]
    _, hand = robot.hand_pose(home)
    points = np.vstack([axes.origins[arm], hand])
    chain = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    shoulder, crossing = _shoulder(axes, arm, chain)
    first = crossing[0] if crossing else arm[0]
    arm = [number for number in arm if number >= first]
    held = [axes.coordinates[number] for number in range(first)]
    stretched, length = _stretched(robot, home, held, shoulder)
    if length <= 0.0:
        raise ValueError(f"the hand {robot.hand!r} of {robot.name!r} is at the shoulder throughout")
    elbow, wrist = _elbow_and_wrist(robot, stretched, arm, shoulder, length)
    return Landmarks(
        home,
        stretched,
        axes.names[:first],
        axes.coordinates[first],
        axes.directions[first],
        shoulder,
        tuple(axes.names[number] for number in crossing),
        length,
        None if elbow is None else axes.names[elbow],
        None if wrist is None else axes.names[wrist],
    )


def nearest_point(origins: Array, directions: Array) -> tuple[Array, float]:
    """Return the point (3,) nearest to some lines in the least-squares sense, and its largest
    distance.
    """
    across = [np.eye(3) - np.outer(axis, axis) for axis in directions]
    mean = origins.mean(axis=0)
    weighted = sum(each @ (origin - mean) for each, origin in zip(across, origins, strict=True))
    point = mean + np.linalg.pinv(sum(across), rcond=1e-9) @ weighted
    distances = [
        float(np.linalg.norm(each @ (point - origin)))
        for each, origin in zip(across, origins, strict=True)
    ]
    return point, max(distances)


def wrist_centre(axes: JointAxes, hand: Array) -> Array:
    """Return the point (3,) of the last revolute axis that is nearest to the axis before it.

    The point nearest to the hand, if the two are parallel. It is fixed in the hand.
    """
    *_, before, last = [number for number, rotates in enumerate(axes.rotates) if rotates]
    origin, axis = axes.origins[last], axes.directions[last]
    across = np.cross(axes.directions[before], axis)
    if np.linalg.norm(across) < _PARALLEL:
        return np.asarray(origin + axis * (axis @ (hand - origin)))
    normal = np.cross(across, axes.directions[before])
    return np.asarray(origin + axis * (normal @ (axes.origins[before] - origin)) / (normal @ axis))


def _shoulder(axes: JointAxes, arm: list[int], chain: float) -> tuple[Array, tuple[int, ...]]:
    first = arm[:3]
    # One of seven joints may belong to a torso. In shorter arms the axes of the second to fourth
    # joint can meet at the elbow.
    spherical = [first, arm[1:4]] if len(arm) == _ARM_JOINTS else [first]
    for group in (*spherical, *combinations(first, 2)):
        if len(group) < 2 or _spread(axes, group) < _PARALLEL:
            continue
        point, distance = nearest_point(axes.origins[[*group]], axes.directions[[*group]])
        if distance <= _MEETING * chain:
            return point, tuple(group)
    return axes.origins[arm[0]], ()


def _spread(axes: JointAxes, group: Sequence[int]) -> float:
    """Return the largest sine of an angle between two of the axes."""
    return max(
        float(np.linalg.norm(np.cross(axes.directions[one], axes.directions[other])))
        for one, other in combinations(group, 2)
    )


def _stretched(robot: Model, home: Array, held: list[int], shoulder: Array) -> tuple[Array, float]:
    """Return the configuration with the hand farthest from the shoulder, and that distance [m]."""
    low = np.where(np.isfinite(robot.lower), np.maximum(robot.lower, -np.pi), -np.pi)
    high = np.where(np.isfinite(robot.upper), np.minimum(robot.upper, np.pi), np.pi)
    low, high = np.minimum(low, robot.upper), np.maximum(high, robot.lower)
    low[held] = high[held] = home[held]

    def negative_square(q: Array) -> tuple[float, Array]:
        arm = robot.hand_pose(q)[1] - shoulder
        return -float(arm @ arm), -2.0 * robot.hand_jacobian(q)[:3].T @ arm

    random = np.random.default_rng(0).uniform(low, high, (_NUM_RANDOM, robot.dof))
    random[0] = home
    distances = np.linalg.norm(robot.hand_pose(random)[1] - shoulder, axis=1)
    best, farthest = home, -1.0
    for start in random[np.argsort(-distances, kind="stable")[:_NUM_STARTS]]:
        found = scipy.optimize.minimize(
            negative_square,
            start,
            jac=True,
            bounds=list(zip(low, high, strict=True)),
            method="L-BFGS-B",
        )
        distance = float(np.sqrt(-found.fun))
        if distance > farthest + 1e-6:
            best, farthest = found.x, distance
    return best, farthest


def _elbow_and_wrist(
    robot: Model, q: Array, arm: list[int], shoulder: Array, length: float
) -> tuple[int | None, int | None]:
    """Return numbers of the joints in the chain."""
    axes = joint_axes(robot, q)
    _, hand = robot.hand_pose(q)

    def distance(point: Array, number: int) -> float:
        return float(
            np.linalg.norm(np.cross(point - axes.origins[number], axes.directions[number]))
        )

    # An arm of few joints has no wrist: its forearm ends at the hand.
    for end in (wrist_centre(axes, hand), hand):
        levers = [min(distance(shoulder, number), distance(end, number)) for number in arm]
        best = int(np.argmax(levers))
        if levers[best] >= _BENDING * length:
            break
    else:
        return None, None
    elbow = arm[best]
    # The elbow's axis is at right angles to the arm; only the distance along the arm counts.
    behind = [
        number
        for number in arm[best + 1 :]
        if distance(axes.origins[elbow], number) > _BENDING * length
        and _bends(axes, number, elbow, hand)
    ]
    return elbow, behind[0] if behind else None


def _bends(axes: JointAxes, number: int, elbow: int, hand: Array) -> bool:
    """Return whether the axis is across the arm, rather than along it."""
    along = hand - axes.origins[elbow]
    return bool(abs(along @ axes.directions[number]) < np.sqrt(0.5) * np.linalg.norm(along))
