"""Continuous joints as angles: one coordinate each, with limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from geodesic_ocp.model.joints import motion_subspace

# A continuous joint has no limits; these are far enough that none is in the way of a shorter turn.
DEFAULT_LIMIT = 2.0 * np.pi  # [rad]
_AXES = {
    (1.0, 0.0, 0.0): pin.JointModelRX,
    (0.0, 1.0, 0.0): pin.JointModelRY,
    (0.0, 0.0, 1.0): pin.JointModelRZ,
}


def continuous_joints(model: pin.Model) -> tuple[str, ...]:
    """Names of the joints that Pinocchio stores as (cos, sin) of their angle."""
    return tuple(
        str(model.names[index])
        for index in range(1, model.njoints)
        if (model.joints[index].nq, model.joints[index].nv) == (2, 1)
    )


def with_angles(model: pin.Model) -> pin.Model:
    """A copy in which every continuous joint has its angle for coordinate, within +-2 pi rad.

    Joints and frames keep their numbers; Pinocchio's configuration vector is then q itself.
    """
    continuous = continuous_joints(model)
    if not continuous:
        return model.copy()
    result = pin.Model()
    result.name = model.name
    result.gravity = model.gravity
    for index in range(1, model.njoints):
        joint, name = model.joints[index], model.names[index]
        kind, placement = joint, model.jointPlacements[index]
        if name in continuous:
            kind = _revolute(motion_subspace(model, index)[3:])
        added = result.addJoint(model.parents[index], kind, placement, name)
        now = result.joints[added]
        for limits in ("lowerPositionLimit", "upperPositionLimit"):
            sign = -1.0 if limits.startswith("lower") else 1.0
            old = getattr(model, limits)[joint.idx_q : joint.idx_q + joint.nq]
            getattr(result, limits)[now.idx_q : now.idx_q + now.nq] = (
                sign * DEFAULT_LIMIT if name in continuous else old
            )
    for index in range(model.njoints):
        result.inertias[index] = model.inertias[index]
    for figures in _PER_VELOCITY:
        setattr(result, figures, getattr(model, figures).copy())
    for frame in list(model.frames)[1:]:
        result.addFrame(frame, False)
    return result


_PER_VELOCITY = (  # arrays (nv,) that do not care how a joint's coordinates are stored
    "armature",
    "damping",
    "lowerDryFrictionLimit",
    "lowerEffortLimit",
    "lowerVelocityLimit",
    "rotorGearRatio",
    "rotorInertia",
    "upperDryFrictionLimit",
    "upperEffortLimit",
    "upperVelocityLimit",
)


def _revolute(axis: Any) -> Any:
    along = _AXES.get(tuple(axis.tolist()))
    return pin.JointModelRevoluteUnaligned(axis) if along is None else along()
