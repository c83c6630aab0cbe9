"""Axes of a person on a robot's base: where right, forward and up are, and the side of the arm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.joint_axes import upward
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.alignment.axis_names import axis_name
from geodesic_ocp.retargeting.alignment.landmarks import Landmarks

_BESIDE = 0.2  # horizontal distance of the shoulder from the base's origin, relative to the length
_VERTICAL = 0.9  # cosine of the angle between an axis and the vertical
_CENTRAL = 0.05  # distance from the body's middle below which an arm is on neither side, likewise
_REVOLUTION = 5.9  # [rad]: the middle of a larger range says nothing about where the front is
_NUM_RANDOM = 64


class BaseAxes(NamedTuple):
    """A person's axes on a robot's base.

    Attributes:
        rotation: (3, 3), its columns are right, forward and up in the base frame.
        side: of the body.
        reason: what they were taken from, a sentence.
    """

    rotation: Array
    side: Side
    reason: str


def base_axes(robot: Model, found: Landmarks, side: Side | None) -> BaseAxes:
    """A person's axes on the base of a robot.

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
    """The axis of the base at right angles to the first joint's along which the arm reaches."""
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
    """The unit vector at right angles to the normal next to the wanted one, or to the y axis."""
    for each in (wanted, np.eye(3)[1]):
        across = each - normal * (normal @ each)
        if np.linalg.norm(across) > 0.5:
            break
    return np.asarray(across / np.linalg.norm(across))
