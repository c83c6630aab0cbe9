"""The size of a model's inertia, to which joint inertia is compared."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.joints import frame_index
from geodesic_ocp.model.max_reach import max_reach
from geodesic_ocp.model.model import Model


def inertia_scale(model: Model) -> Array:
    """Moving mass times squared reach [kg m^2] for revolute joints, (n,); for prismatic ones, mass.

    The mass is that of the joint's own tree, as both arms of a person are two. The reach is the
    largest distance of the hand from the first joint, and is taken for all trees. A joint inertia
    in this unit has the same effect on the geodesics of large and small, heavy and light arms.

    Of a model with several hands, the joints that move the same hands belong together, such as
    those of an arm or of the trunk: mass and reach are those from the first of them on.
    """
    joints = sorted(range(1, model.pin.njoints), key=lambda index: model.pin.joints[index].idx_v)
    several = len(model.hands) > 1
    result, found = [], dict[tuple[int, ...], tuple[float, float]]()
    for joint, unit in zip(joints, model.units, strict=True):
        hands = _hands_behind(model, joint) if several else ()
        if (key := hands or (-_root(model, joint),)) not in found:
            start = _first(model, joint, hands) if hands else _root(model, joint)
            reach = _reach(model, start, hands) if hands else model.reach
            found[key] = _mass_behind(model, start), reach
        mass, reach = found[key]
        result.append(mass * reach**2 if unit == "rad" else mass)
    return np.array(result)


def _root(model: Model, joint: int) -> int:
    """The first joint of a joint's tree."""
    return int(list(model.pin.supports[joint])[1])


def _hands_behind(model: Model, joint: int) -> tuple[int, ...]:
    """Frames of the hands that a joint moves."""
    frames = [frame_index(model.pin, hand) for hand in model.hands]
    return tuple(
        frame
        for frame in frames
        if joint in list(model.pin.supports[model.pin.frames[frame].parentJoint])
    )


def _first(model: Model, joint: int, hands: tuple[int, ...]) -> int:
    """The first joint, from the base on, that moves the same hands."""
    chain = [int(index) for index in list(model.pin.supports[joint])[1:]]
    return next(index for index in chain if _hands_behind(model, index) == hands)


def _mass_behind(model: Model, joint: int) -> float:
    """Mass [kg] that a joint moves."""
    return sum(
        float(model.pin.inertias[index].mass)
        for index in range(1, model.pin.njoints)
        if joint in list(model.pin.supports[index])
    )


def _reach(model: Model, joint: int, hands: tuple[int, ...]) -> float:
    """Largest distance [m] of any of these hands from a joint."""
    start = None if joint == _root(model, joint) else joint
    return max(max_reach(model.pin, hand, model.lower, model.upper, start) for hand in hands)
