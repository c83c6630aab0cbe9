"""Axes of bases and hands, found from a model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.joint_axes import JointAxes, joint_axes, upward
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.alignment.arm_alignment import axis_name
from geodesic_ocp.retargeting.alignment.landmarks import Landmarks, wrist_centre

_BESIDE = 0.2  # horizontal distance of the shoulder from the base's origin, relative to the length
_VERTICAL = 0.9  # cosine of the angle between an axis and the vertical
_CENTRAL = 0.05  # distance from the body's middle below which an arm is on neither side, likewise
_REVOLUTION = 5.9  # [rad]: the middle of a larger range says nothing about where the front is
_NUM_RANDOM = 64


class BaseAxes(NamedTuple):
    """A person's axes on a robot's base.

    Attributes:
        rotation: (3, 3), its columns are right, forward and up in the base frame.
        side: side of the body.
        reason: what they were taken from, a sentence.
    """

    rotation: Array
    side: Side
    reason: str


def base_axes(robot: Model, found: Landmarks, side: Side | None) -> BaseAxes:
    """Return a person's axes on the base of a robot.

    An arm whose shoulder is beside the base's origin, or behind joints of a torso, belongs to a
    body that stands upright: x forward and y left (ROS REP 103), or x to the right, if the shoulder
    lies along x and its first axis is not vertical. Any other arm is mounted like a shoulder: its
    first axis points to the side, away from the base, and the base's x axis forward, or the axis
    of the base along which the arm reaches in the middle of its first joint's range. If that axis
    is horizontal as it is, up remains up.
    """
    up = upward(robot)
    beside = found.shoulder - up * (up @ found.shoulder)
    offset = float(np.linalg.norm(beside))
    if offset < _BESIDE * found.length and not found.before:
        return _mounted_as_shoulder(robot, found, side or "right")
    vertical = abs(found.first_axis @ up) > _VERTICAL
    forward = _horizontal(np.eye(3)[0], up)
    across = np.cross(forward, up)
    if not vertical and abs(beside @ forward) > 2.0 * abs(beside @ across) and offset > 0.0:
        right, convention = forward, "x to the right, y forward"
    else:
        right, convention = across, "x forward, y left (ROS REP 103)"
    lateral = float(beside @ right)
    central = abs(lateral) < _CENTRAL * found.length
    natural: Side = "right" if central or lateral > 0.0 else "left"
    chosen = natural if side is None else side
    if chosen != natural and not central:
        right, convention = -right, f"{convention}, turned by 180 degrees for the {chosen} arm"
    rotation = np.column_stack([right, np.cross(up, right), up])
    reason = f"the robot stands upright with {convention}"
    if central:
        reason += f"; the arm is on neither side of it and is taken for a {chosen} arm"
    else:
        reason += f"; its shoulder lies {axis_name(beside, 'the base')}: a {chosen} arm"
    return BaseAxes(rotation, chosen, reason)


def _mounted_as_shoulder(robot: Model, found: Landmarks, side: Side) -> BaseAxes:
    outward = found.first_axis
    if found.shoulder @ outward < 0.0:
        outward = -outward
    right = outward if side == "right" else -outward
    up = upward(robot)
    if abs(right @ up) > np.sqrt(0.5):
        forward = _front(robot, found, right)
    else:
        right = _horizontal(right, up)
        forward = np.cross(up, right)
    rotation = np.column_stack([right, forward, np.cross(right, forward)])
    reason = (
        f"a single arm, mounted like a {side} shoulder: its first axis points to the {side}, "
        f"{axis_name(forward, 'the base')} forward and {axis_name(rotation[:, 2], 'the base')} up"
    )
    return BaseAxes(rotation, side, reason)


def _front(robot: Model, found: Landmarks, axis: Array) -> Array:
    """Get the axis of the base at right angles to the first joint's along which the arm reaches."""
    first = found.first_coordinate
    low, high = robot.lower[first], robot.upper[first]
    front = _horizontal(np.eye(3)[0], axis)
    if high - low > _REVOLUTION:
        return front
    random = np.random.default_rng(0).uniform(
        np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi), (_NUM_RANDOM, robot.dof)
    )
    random[:, first] = (low + high) / 2.0
    reached = (robot.hand_pose(random)[1] - found.shoulder).mean(axis=0)
    reached = reached - axis * (axis @ reached)
    others = [each for each in (*np.eye(3), *-np.eye(3)) if abs(each @ axis) < 0.5]
    return _horizontal(max([front, *others], key=lambda each: float(each @ reached)), axis)


def _horizontal(wanted: Array, normal: Array) -> Array:
    """Return the unit vector at right angles to the normal next to the wanted one, or to the y
    axis.
    """
    for each in (wanted, np.eye(3)[1]):
        across = each - normal * (normal @ each)
        if np.linalg.norm(across) > 0.5:
            break
    return np.asarray(across / np.linalg.norm(across))


_ROLL = 0.8  # cosine of the angle between the last axis and the approach axis
_SNAP = np.cos(np.radians(35.0))  # axes of the hand's frame nearer than that are taken
_SHORT = 0.01  # shortest hand from which a direction is taken, relative to the length of the arm
_HANGING = np.diag([1.0, -1.0, -1.0])  # hand of a person whose arm hangs down, see human_arm
_STRETCH = 0.97  # of its length


class HandAxes(NamedTuple):
    """A robot hand's axes in those of a person's hand.

    Attributes:
        rotation: (3, 3), as in `Alignment`.
        reasons: what they were taken from, sentences.
    """

    rotation: Array
    reasons: tuple[str, ...]


def hand_axes(robot: Model, found: Landmarks, base: Array, side: Side) -> HandAxes:
    """Return axes of the hand from the directions of the last two joints.

    The hand reaches from the centre of the wrist to the origin of its frame. The normal of the palm
    is the axis of the second last joint if the last one rolls, as a gripper opens, and otherwise
    the wrist axis with the smaller range, about which a person's hand moves sideways. Both are
    replaced by the nearest axis of the hand's frame, if one is near; a gripper between its axes is
    taken to open along y. The sign of the normal is that
    of a person's hand when the arm hangs down, near to the zero configuration.
    """
    rotation, position = robot.hand_pose(found.home)
    axes = joint_axes(robot, found.home)
    revolute = [number for number, rotates in enumerate(axes.rotates) if rotates]
    last, before = (rotation.T @ axes.directions[number] for number in reversed(revolute[-2:]))
    approach, source = _approach(robot, axes, found, rotation, position, last)
    reach = _nearest_axis(approach)
    rolls = abs(last @ reach) > _ROLL
    if rolls:
        normal, why = before, "the axis of the second last joint, along which grippers open"
    else:
        low, high = robot.lower, robot.upper
        span = [high[axes.coordinates[each]] - low[axes.coordinates[each]] for each in revolute]
        sideways = last if span[-1] < span[-2] else before
        normal, why = sideways, "the wrist axis with the smaller range"
    normal = _across(normal, reach)
    palm = _across(_nearest_axis(normal, reach), reach)
    if rolls and abs(reach[1]) < 0.5 and np.abs(palm).max() < _SNAP:
        palm, why = _across(np.eye(3)[1], reach), "as frames of grippers usually have it"
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
    return HandAxes(person.T, reasons)


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


def _across(direction: Array, normal: Array) -> Array:
    """Return the unit vector at right angles to the normal next to a direction."""
    for each in (direction, *np.eye(3)):
        across = each - normal * (normal @ each)
        if np.linalg.norm(across) > 0.1:
            break
    return np.asarray(across / np.linalg.norm(across))


def _hanging(robot: Model, found: Landmarks, base: Array, reach: Array) -> Array:
    """Get rotation (3, 3) of the hand with the arm hanging down, as near as joint limits permit."""
    down = -base[:, 2]
    target = found.shoulder + _STRETCH * found.length * down
    low, high = robot.lower, robot.upper

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
