"""Shoulder, elbow and wrist of a robot arm, and a person's axes on it, from its joints' axes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.joint_axes import JointAxes, joint_axes, upright, upward
from geodesic_ocp.model.model import Model

AXES = {
    f"{sign}{name}": (1.0 if sign == "+" else -1.0) * axis
    for name, axis in zip("xyz", np.eye(3), strict=True)
    for sign in "+-"
}
_ALONG = np.cos(np.radians(5.0))


def axis_name(direction: ArrayLike, frame: str) -> str:
    """Get such as "along +x of the base", or with components where it is along none of the axes."""
    vector: Array = np.asarray(direction, dtype=float)
    vector = vector / np.linalg.norm(vector)
    for name, axis in AXES.items():
        if axis @ vector >= _ALONG:
            return f"along {name} of {frame}"
    entries = ", ".join(f"{entry:.2f}" for entry in vector + 0.0)
    return f"along ({entries}) of {frame}"


_ARM_JOINTS = 7  # revolute joints of an arm; those before them belong to a torso or collarbone
_MEETING = 0.06  # distance of axes that meet, relative to the length of the chain
_PARALLEL = 0.2  # sine of the angle between axes that have no crossing
_BENDING = 0.1  # least distance of a bending axis from shoulder and hand, relative to the length
_NUM_RANDOM = 256
_NUM_STARTS = 5


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
    home = upright(robot)
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
    across = np.eye(3) - np.einsum("ki,kj->kij", directions, directions)
    mean = origins.mean(axis=0)
    weighted = np.einsum("kij,kj->i", across, origins - mean)
    point = mean + np.linalg.pinv(across.sum(axis=0), rcond=1e-9) @ weighted
    distances = np.linalg.norm(np.einsum("kij,kj->ki", across, point - origins), axis=1)
    return point, float(distances.max())


def wrist_centre(axes: JointAxes, hand: Array) -> Array:
    """Return the point (3,) of the last revolute axis that is nearest to the axis before it.

    The point nearest to the hand, if the two are parallel. It is fixed in the hand.
    """
    *_, before, last = [number for number, rotates in enumerate(axes.rotates) if rotates]
    origin = axes.origins[last]
    axis = axes.directions[last]
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
        if len(group) < 2:
            continue
        pairs = combinations(axes.directions[[*group]], 2)
        if max(np.linalg.norm(np.cross(one, other)) for one, other in pairs) < _PARALLEL:
            continue
        point, distance = nearest_point(axes.origins[[*group]], axes.directions[[*group]])
        if distance <= _MEETING * chain:
            return point, tuple(group)
    return axes.origins[arm[0]], ()


def _stretched(robot: Model, home: Array, held: list[int], shoulder: Array) -> tuple[Array, float]:
    """Return the configuration with the hand farthest from the shoulder, and that distance [m]."""
    low = np.where(np.isfinite(robot.lower), np.maximum(robot.lower, -np.pi), -np.pi)
    high = np.where(np.isfinite(robot.upper), np.minimum(robot.upper, np.pi), np.pi)
    low = np.minimum(low, robot.upper)
    high = np.maximum(high, robot.lower)
    low[held] = high[held] = home[held]

    def negative_square(q: Array) -> tuple[float, Array]:
        arm = robot.hand_pose(q)[1] - shoulder
        return -float(arm @ arm), -2.0 * robot.hand_jacobian(q)[:3].T @ arm

    random = np.random.default_rng(0).uniform(low, high, (_NUM_RANDOM, robot.dof))
    random[0] = home
    distances = np.linalg.norm(robot.hand_pose(random)[1] - shoulder, axis=1)
    best = home
    farthest = -1.0
    for start in random[np.argsort(-distances, kind="stable")[:_NUM_STARTS]]:
        found = scipy.optimize.minimize(
            negative_square, start, jac=True, bounds=scipy.optimize.Bounds(low, high)
        )
        distance = float(np.sqrt(-found.fun))
        if distance > farthest + 1e-6:
            best = found.x
            farthest = distance
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
    along = hand - axes.origins[elbow]
    across = np.sqrt(0.5) * np.linalg.norm(along)  # of axes that bend, rather than turn
    # The elbow's axis is at right angles to the arm; only the distance along the arm counts.
    behind = [
        number
        for number in arm[best + 1 :]
        if distance(axes.origins[elbow], number) > _BENDING * length
        and abs(along @ axes.directions[number]) < across
    ]
    return elbow, behind[0] if behind else None


_BESIDE = 0.2  # horizontal distance of the shoulder from the base's origin, relative to the length
_VERTICAL = 0.9  # cosine of the angle between an axis and the vertical
_CENTRAL = 0.05  # distance from the body's middle below which an arm is on neither side, likewise
_REVOLUTION = 5.9  # [rad]: the middle of a larger range says nothing about where the front is
_NUM_FRONT = 64


def base_axes(robot: Model, found: Landmarks, side: Side | None) -> tuple[Array, Side, str]:
    """Return a person's axes on the base of a robot.

    An arm whose shoulder is beside the base's origin, or behind joints of a torso, belongs to a
    body that stands upright: x forward and y left (ROS REP 103), or x to the right, if the shoulder
    lies along x and its first axis is not vertical. Any other arm is mounted like a shoulder: its
    first axis points to the side, away from the base, and the base's x axis forward, or the axis
    of the base along which the arm reaches in the middle of its first joint's range. If that axis
    is horizontal as it is, up remains up.

    Returns:
        Rotation (3, 3), whose columns are right, forward and up in the base frame; the side of the
        body; what they were taken from, a sentence.
    """
    up = upward(robot)
    beside = found.shoulder - up * (up @ found.shoulder)
    offset = float(np.linalg.norm(beside))
    if offset < _BESIDE * found.length and not found.before:
        return _mounted_as_shoulder(robot, found, side or "right")
    vertical = abs(found.first_axis @ up) > _VERTICAL
    forward = _across(up, *np.eye(3)[:2], least=0.5)
    across = np.cross(forward, up)
    if not vertical and abs(beside @ forward) > 2.0 * abs(beside @ across) and offset > 0.0:
        right = forward
        convention = "x to the right, y forward"
    else:
        right = across
        convention = "x forward, y left (ROS REP 103)"
    lateral = float(beside @ right)
    central = abs(lateral) < _CENTRAL * found.length
    natural: Side = "right" if central or lateral > 0.0 else "left"
    chosen = natural if side is None else side
    if chosen != natural and not central:
        right = -right
        convention = f"{convention}, turned by 180 degrees for the {chosen} arm"
    rotation = np.column_stack([right, np.cross(up, right), up])
    reason = f"the robot stands upright with {convention}"
    if central:
        reason += f"; the arm is on neither side of it and is taken for a {chosen} arm"
    else:
        reason += f"; its shoulder lies {axis_name(beside, 'the base')}: a {chosen} arm"
    return rotation, chosen, reason


def _mounted_as_shoulder(robot: Model, found: Landmarks, side: Side) -> tuple[Array, Side, str]:
    outward = found.first_axis
    if found.shoulder @ outward < 0.0:
        outward = -outward
    right = outward if side == "right" else -outward
    up = upward(robot)
    if abs(right @ up) > np.sqrt(0.5):
        forward = _front(robot, found, right)
    else:
        right = _across(up, right, np.eye(3)[1], least=0.5)
        forward = np.cross(up, right)
    rotation = np.column_stack([right, forward, np.cross(right, forward)])
    reason = (
        f"a single arm, mounted like a {side} shoulder: its first axis points to the {side}, "
        f"{axis_name(forward, 'the base')} forward and {axis_name(rotation[:, 2], 'the base')} up"
    )
    return rotation, side, reason


def _front(robot: Model, found: Landmarks, axis: Array) -> Array:
    """Get the axis of the base at right angles to the first joint's along which the arm reaches."""
    first = found.first_coordinate
    low = robot.lower[first]
    high = robot.upper[first]
    front = _across(axis, *np.eye(3)[:2], least=0.5)
    if high - low > _REVOLUTION:
        return front
    random = np.random.default_rng(0).uniform(
        np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi), (_NUM_FRONT, robot.dof)
    )
    random[:, first] = (low + high) / 2.0
    reached = (robot.hand_pose(random)[1] - found.shoulder).mean(axis=0)
    reached = reached - axis * (axis @ reached)
    others = [each for each in (*np.eye(3), *-np.eye(3)) if abs(each @ axis) < 0.5]
    wanted = max([front, *others], key=lambda each: float(each @ reached))
    return _across(axis, wanted, np.eye(3)[1], least=0.5)


_ROLL = 0.8  # cosine of the angle between the last axis and the approach axis
_SNAP = np.cos(np.radians(35.0))  # axes of the hand's frame nearer than that are taken
_SHORT = 0.01  # shortest hand from which a direction is taken, relative to the length of the arm
_HANGING = np.diag([1.0, -1.0, -1.0])  # hand of a person whose arm hangs down, see human_arm
_STRETCH = 0.97  # of its length


def hand_axes(
    robot: Model, found: Landmarks, base: Array, side: Side
) -> tuple[Array, tuple[str, str]]:
    """Return axes of the hand from the directions of the last two joints.

    The hand reaches from the centre of the wrist to the origin of its frame. The normal of the palm
    is the axis of the second last joint if the last one rolls, as a gripper opens, and otherwise
    the wrist axis with the smaller range, about which a person's hand moves sideways. Both are
    replaced by the nearest axis of the hand's frame, if one is near; a gripper between its axes is
    taken to open along y. The sign of the normal is that
    of a person's hand when the arm hangs down, near to the zero configuration.

    Returns:
        Rotation (3, 3), as in `Alignment`, and what it was taken from, sentences.
    """
    rotation, position = robot.hand_pose(found.home)
    axes = joint_axes(robot, found.home)
    revolute = [number for number, rotates in enumerate(axes.rotates) if rotates]
    last, before = (rotation.T @ axes.directions[number] for number in reversed(revolute[-2:]))
    approach, source = _approach(robot, axes, found, rotation, position, last)
    reach = _nearest_axis(approach)
    rolls = abs(last @ reach) > _ROLL
    if rolls:
        normal = before
        why = "the axis of the second last joint, along which grippers open"
    else:
        low = robot.lower
        high = robot.upper
        span = [high[axes.coordinates[each]] - low[axes.coordinates[each]] for each in revolute]
        sideways = last if span[-1] < span[-2] else before
        normal = sideways
        why = "the wrist axis with the smaller range"
    normal = _across(reach, normal, *np.eye(3))
    palm = _across(reach, _nearest_axis(normal, reach), *np.eye(3))
    if rolls and abs(reach[1]) < 0.5 and np.abs(palm).max() < _SNAP:
        palm = _across(reach, np.eye(3)[1], *np.eye(3))
        why = "as frames of grippers usually have it"
    # Columns: the person's x (normal of the palm), y, z (fingers) in the robot's hand.
    person = np.column_stack([palm, np.cross(reach, palm), reach])
    hanging = _hanging(robot, found, base, reach)
    turned = _HANGING @ base.T @ hanging @ person  # the person's axes, as the robot holds them
    if turned[0, 0] + turned[1, 1] < 0.0:
        person = person @ np.diag([-1.0, -1.0, 1.0])
    frame = robot.hand
    faces = "the back of the hand" if side == "right" else "the palm"
    reasons = (
        f"the hand reaches {axis_name(reach, frame)}: {source}",
        f"{faces} faces {axis_name(person[:, 0], frame)}: {why}; turned by 180 degrees is as good "
        "for a gripper with two fingers",
    )
    return person.T, reasons


def _approach(
    robot: Model, axes: JointAxes, found: Landmarks, rotation: Array, position: Array, last: Array
) -> tuple[Array, str]:
    """Return unit direction (3,) in which the hand reaches, in its frame, and what it was taken
    from.
    """
    from_wrist = rotation.T @ (position - wrist_centre(axes, position))
    size = float(np.linalg.norm(from_wrist))
    if size > _SHORT * found.length:
        along = float(last @ from_wrist) / size
        if abs(along) > _ROLL:
            return last * np.sign(along), "along the axis of the last joint, away from the wrist"
        return from_wrist / size, "from the centre of the wrist to the frame of the hand"
    elbow = axes.origins[axes.names.index(found.elbow)] if found.elbow else found.shoulder
    forearm = rotation.T @ (position - elbow)
    if np.linalg.norm(forearm) > _SHORT * found.length:
        return forearm / np.linalg.norm(forearm), (
            "as the forearm does at the zero configuration, because the frame of the hand is at "
            "the centre of the wrist"
        )
    return last, "along the axis of the last joint, with a sign that is a guess"


def _nearest_axis(direction: Array, excluded: Array | None = None) -> Array:
    """Get the axis of the frame nearest to a direction, if one is near, otherwise the direction."""
    candidates = np.vstack([np.eye(3), -np.eye(3)])
    if excluded is not None:
        candidates = candidates[np.abs(candidates @ excluded) < np.sqrt(0.5)]
    best = candidates[int(np.argmax(candidates @ direction))]
    return best if best @ direction > _SNAP else direction


def _across(normal: Array, *directions: Array, least: float = 0.1) -> Array:
    """Return the unit vector at right angles to a normal next to the first direction that has one.

    Args:
        normal: unit vector (3,).
        directions: unit vectors (3,).
        least: sine of the angle between the normal and a direction that has one.
    """
    parts = [each - normal * (normal @ each) for each in directions]
    chosen = next((each for each in parts if np.linalg.norm(each) > least), parts[-1])
    return np.asarray(chosen / np.linalg.norm(chosen))


def _hanging(robot: Model, found: Landmarks, base: Array, reach: Array) -> Array:
    """Get rotation (3, 3) of the hand with the arm hanging down, as near as joint limits permit."""
    down = -base[:, 2]
    target = found.shoulder + _STRETCH * found.length * down
    low = robot.lower
    high = robot.upper

    def residuals(q: Array) -> Array:
        rotation, position = robot.hand_pose(q)
        return np.concatenate(
            [
                (position - target) / found.length,
                0.3 * (rotation @ reach - down),
                0.03 * (q - found.home),
            ]
        )

    starts = [np.clip(start, low, high) for start in (found.home, found.stretched)]
    fits = [
        scipy.optimize.least_squares(residuals, start, bounds=(low - 1e-9, high + 1e-9))
        for start in starts
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    return np.asarray(robot.hand_pose(best.x)[0])
