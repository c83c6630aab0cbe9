"""The arms and the trunk of a person in a model, such as one of `human_arm` or several combined."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import get_args

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.human.anthropometry import Side
from geodesic_ocp.model.joints import frame_index
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Capsule

_FITS = 0.1  # [length of the segment], by which a capsule's end may miss a joint


@dataclass(frozen=True, eq=False)
class PersonArm:
    """An arm of a person: upper arm, forearm and hand.

    Attributes:
        side: "right" or "left".
        joints: indices in `pin` of the joints that carry the three, at shoulder, elbow and wrist.
        bodies: the three capsules, each from its joint to the next or to the fingertips.
        lengths: of the three [m].
    """

    side: Side
    joints: tuple[int, int, int]
    bodies: tuple[Capsule, Capsule, Capsule]
    lengths: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class PersonTrunk:
    """A trunk of a person with both arms.

    Attributes:
        lumbar: index in `pin` of the first joint between pelvis and abdomen.
        bodies: capsules of abdomen, thorax and head.
        half_width: from the middle to a shoulder [m].
    """

    lumbar: int
    bodies: tuple[Capsule, Capsule, Capsule]
    half_width: float


def person_arms(model: Model) -> tuple[PersonArm, ...]:
    """The arms of people in a model, right ones first.

    An arm has links "right upper arm", "right forearm" and "right hand" (or left; a prefix that
    ends in "/" is ignored), seven joints in a row, and a capsule along each of the links that ends
    at the next joint. A model whose bodies were replaced by others has none.
    """
    return tuple(_arms(model))


def person_trunks(model: Model) -> tuple[PersonTrunk, ...]:
    """The trunks of people with both arms in a model, by their links as for `person_arms`."""
    arms = person_arms(model)
    found = []
    for thorax in _capsules(model, "thorax"):
        joint = model.joint_of(str(thorax.link))
        shoulders = [_above(model, arm.joints[0], 3) == joint for arm in arms]
        own = [arm for arm, fits in zip(arms, shoulders, strict=True) if fits]
        above = _above(model, joint, 3)
        below = [b for b in _capsules(model, "abdomen") if model.joint_of(str(b.link)) == above]
        heads = [b for b in _capsules(model, "head") if model.joint_of(str(b.link)) == joint]
        if sorted(arm.side for arm in own) == ["left", "right"] and len(below) == len(heads) == 1:
            right, left = (_offset(model, arm.joints[0], 2) for arm in own)
            half_width = float(np.linalg.norm(right - left)) / 2.0
            lumbar = _above(model, above, 2)
            found.append(PersonTrunk(lumbar, (below[0], thorax, heads[0]), half_width))
    return tuple(found)


def shoulder_joint(model: Model, arm: PersonArm) -> str:
    """Name of the first joint of an arm."""
    return str(model.pin.names[_above(model, arm.joints[0], 2)])


def _arms(model: Model) -> Iterator[PersonArm]:
    for side in get_args(Side):
        for upper in _capsules(model, f"{side} upper arm"):
            for fore in _capsules(model, f"{side} forearm"):
                for hand in _capsules(model, f"{side} hand"):
                    arm = _arm(model, side, (upper, fore, hand))
                    if arm is not None:
                        yield arm


def _arm(model: Model, side: Side, bodies: tuple[Capsule, Capsule, Capsule]) -> PersonArm | None:
    """The arm of these capsules; None if they are not along a chain of seven joints."""
    shoulder, elbow, wrist = (model.joint_of(str(body.link)) for body in bodies)
    # Elbow and wrist have two coordinates each, of which the second carries the segment.
    if (_above(model, wrist, 2), _above(model, elbow, 2)) != (elbow, shoulder):
        return None
    if 0 in (shoulder, _above(model, shoulder, 2)):
        return None
    ends = [_offset(model, elbow, 1), _offset(model, wrist, 1), None]
    lengths = []
    for body, next_joint in zip(bodies, ends, strict=True):
        place = model.pin.frames[frame_index(model.pin, str(body.link))].placement
        start, end = (place.act(np.array(point)) for point in (body.start, body.end))
        target = end if next_joint is None else next_joint
        length = float(np.linalg.norm(target))
        straight = np.array([0.0, 0.0, -length])
        if max(np.abs(start).max(), *np.abs(end - target), *np.abs(target - straight)) > (
            _FITS * length
        ):
            return None
        lengths.append(length)
    return PersonArm(side, (shoulder, elbow, wrist), bodies, (lengths[0], lengths[1], lengths[2]))


def _capsules(model: Model, part: str) -> list[Capsule]:
    """The capsules on links of this name, if a link has one only."""
    if not any(str(frame.name).rpartition("/")[2] == part for frame in model.pin.frames):
        return []
    try:
        bodies = model.bodies
    except ValueError:  # the geometry of a file that cannot be read: not a person
        return []
    found = [body for body in bodies if str(body.link).rpartition("/")[2] == part]
    return [body for body in found if isinstance(body, Capsule)]


def _above(model: Model, joint: int, count: int) -> int:
    """The joint that is this many joints before another; 0 for the base."""
    for _ in range(count):
        joint = int(model.pin.parents[joint])
    return joint


def _offset(model: Model, joint: int, before: int) -> Array:
    """Translation (3,) [m] of the joint that is some joints before another, from its parent."""
    return np.array(model.pin.jointPlacements[_above(model, joint, before)].translation)
