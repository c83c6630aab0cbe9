"""Axes of a robot's hand: where it reaches, and the normal of its palm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.joint_axes import JointAxes, joint_axes
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.alignment.axis_names import axis_name
from geodesic_ocp.retargeting.alignment.landmarks import Landmarks, wrist_centre

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
    """Axes of the hand from the directions of the last two joints.

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
    """Unit direction (3,) in which the hand reaches, in its frame, and what it was taken from."""
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
    """The axis of the frame nearest to a direction, if one is near, otherwise the direction."""
    candidates = np.vstack([np.eye(3), -np.eye(3)])
    if excluded is not None:
        candidates = candidates[np.abs(candidates @ excluded) < np.sqrt(0.5)]
    best = candidates[int(np.argmax(candidates @ direction))]
    return best if best @ direction > _SNAP else direction


def _across(direction: Array, normal: Array) -> Array:
    """The unit vector at right angles to the normal next to a direction."""
    for each in (direction, *np.eye(3)):
        across = each - normal * (normal @ each)
        if np.linalg.norm(across) > 0.1:
            break
    return np.asarray(across / np.linalg.norm(across))


def _hanging(robot: Model, found: Landmarks, base: Array, reach: Array) -> Array:
    """Rotation (3, 3) of the hand with the arm hanging down, as near as joint limits permit."""
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
