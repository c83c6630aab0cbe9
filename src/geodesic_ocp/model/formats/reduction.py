"""Reduction of a Pinocchio model: locked joints, and another base frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array, as_number
from geodesic_ocp.model.formats.description import Description
from geodesic_ocp.model.formats.urdf import apply_mimics
from geodesic_ocp.model.joints import (
    frame_index,
    motion_subspace,
    restore_frames,
    with_distinct_frames,
)

_LIMIT_TOLERANCE = 1e-6  # [rad or m]: limits in files are rounded


def lock_joints(
    description: Description, moving: Sequence[str], configuration: Mapping[str, float]
) -> pin.Model:
    """The model with all joints locked except those in `moving`.

    Raises:
        ValueError: a moving joint does not have one degree of freedom of its own, a locked joint
            mimics a moving one, or the configuration is outside the limits of the locked joints.
    """
    model = description.pin
    for name in moving:
        if name in description.mimics:
            leader = description.mimics[name].leader
            raise ValueError(f"joint {name!r} mimics {leader!r}: it cannot move independently")
        try:
            motion_subspace(model, model.getJointId(name))
        except ValueError as error:
            raise ValueError(f"{error}; leave it out with base=... or joints=[...]") from None
    for name, joint in zip(model.names, model.joints, strict=True):
        if joint.shortname() == "JointModelMimic":
            raise ValueError(
                f"joint {name!r} of the pin.Model is a JointModelMimic, which cannot be locked; "
                "build the model without mimic joints"
            )
    for name, mimic in description.mimics.items():
        if mimic.leader in moving and name not in configuration:
            raise ValueError(
                f"joint {name!r} mimics {mimic.leader!r}, which moves; lock it with "
                f"configuration={{{name!r}: ...}}, or leave {mimic.leader!r} out of joints"
            )
    q = _locked_configuration(description, moving, configuration)
    others = [index for index in range(1, model.njoints) if model.names[index] not in moving]
    if not others:
        return model.copy()
    (distinct,), original = with_distinct_frames(model)
    reduced = pin.buildReducedModel(distinct, others, q)
    restore_frames(reduced, original)
    reduced.name = model.name
    return reduced


def _locked_configuration(
    description: Description, moving: Sequence[str], configuration: Mapping[str, float]
) -> Array:
    """Pinocchio's configuration (nq,) of the locked joints; the others are neutral."""
    model = description.pin
    q: Array = pin.neutral(model)
    limits = np.column_stack([model.lowerPositionLimit, model.upperPositionLimit])
    values = {str(name): 0.0 for name in list(model.names)[1:]}
    if not isinstance(configuration, Mapping):
        raise ValueError(f"configuration must map names of joints to values, got {configuration!r}")
    for name, value in configuration.items():
        if name not in values or name in moving:
            why = "moves" if name in values else f"is not a joint of {model.name!r}"
            raise ValueError(f"configuration: {name!r} {why}")
        as_number(f"configuration: {name!r}", value)
    locked = {
        str(name): joint
        for name, joint in list(zip(model.names, model.joints, strict=True))[1:]
        if name not in moving
    }
    for name, joint in locked.items():
        if joint.nv != 1 and name in configuration:
            raise ValueError(f"configuration: {name!r} is a {joint.shortname()}, not one number")
        lower, upper = -np.inf, np.inf
        if joint.nq == 1:
            lower, upper = limits[joint.idx_q]
        default = np.clip(0.0, lower, upper) if lower <= upper else 0.0
        values[name] = value = float(configuration.get(name, default))
        if name in configuration and not (
            lower - _LIMIT_TOLERANCE <= value <= upper + _LIMIT_TOLERANCE
        ):
            raise ValueError(
                f"configuration: {name!r} = {value:.6g} lies outside its limits {lower:.6g} to "
                f"{upper:.6g}"
            )
    free = {name: mimic for name, mimic in description.mimics.items() if name not in configuration}
    values = apply_mimics(free, values)
    for name, joint in locked.items():
        if joint.nv == 1:
            value = values[name]
            coordinates = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
            q[joint.idx_q : joint.idx_q + joint.nq] = coordinates
    return q


def change_base(model: pin.Model, base: str) -> pin.Model:
    """The model, including gravity, expressed in another fixed frame.

    Raises:
        ValueError: the frame moves with one of the joints.
    """
    frame = model.frames[frame_index(model, base)]
    if frame.parentJoint > 0:
        raise ValueError(f"base {base!r} moves with joint {model.names[frame.parentJoint]!r}")
    result = model.copy()
    inverse = frame.placement.inverse()
    for index in range(1, model.njoints):
        if model.parents[index] == 0:
            result.jointPlacements[index] = inverse * model.jointPlacements[index]
    for index in range(1, model.nframes):  # frame 0 is the universe, now the base
        if model.frames[index].parentJoint == 0:
            result.frames[index].placement = inverse * model.frames[index].placement
    result.inertias[0] = inverse.act(model.inertias[0])
    gravity = inverse.rotation @ model.gravity.linear
    result.gravity = pin.Motion(gravity, np.zeros(3))
    return result
