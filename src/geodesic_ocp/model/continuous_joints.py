"""Continuous joints as joints with one angle each, within limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from geodesic_ocp.model.joints import motion_subspace

# A continuous joint has no limits; these are wide enough for the shortest rotation between angles.
DEFAULT_LIMIT = 2.0 * np.pi  # [rad]
_AXES = {
    (1.0, 0.0, 0.0): pin.JointModelRX,
    (0.0, 1.0, 0.0): pin.JointModelRY,
    (0.0, 0.0, 1.0): pin.JointModelRZ,
}


def continuous_joints(model: pin.Model) -> tuple[str, ...]:
    """Names of the joints that Pinocchio stores as cosine and sine of their angle."""
    return tuple(
        str(model.names[index])
        for index in range(1, model.njoints)
        if (model.joints[index].nq, model.joints[index].nv) == (2, 1)
    )


def with_angles(model: pin.Model) -> pin.Model:
    """A copy in which the coordinate of every continuous joint is its angle, within +-2 pi rad.

    Joints and frames keep their indices; Pinocchio's configuration vector is then q itself.
    """
    continuous = continuous_joints(model)
    if not continuous:
        return model.copy()
    result = pin.Model()
    result.name = model.name
    result.gravity = model.gravity
    for index in range(1, model.njoints):
        joint, name = model.joints[index], model.names[index]
        revolute = name in continuous
        new_type = _revolute(motion_subspace(model, index)[3:]) if revolute else joint
        placement = model.jointPlacements[index]
        new = result.joints[result.addJoint(model.parents[index], new_type, placement, name)]
        for limits in ("lowerPositionLimit", "upperPositionLimit"):
            sign = -1.0 if limits.startswith("lower") else 1.0
            current = getattr(model, limits)[joint.idx_q : joint.idx_q + joint.nq]
            getattr(result, limits)[new.idx_q : new.idx_q + new.nq] = (
                sign * DEFAULT_LIMIT if revolute else current
            )
    for index in range(model.njoints):
        result.inertias[index] = model.inertias[index]
    for values in _PER_VELOCITY:
        setattr(result, values, getattr(model, values).copy())
    for frame in list(model.frames)[1:]:
        result.addFrame(frame, False)
    return result


_PER_VELOCITY = (  # arrays (nv,), independent of how the coordinates of a joint are stored
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
    aligned = _AXES.get(tuple(axis.tolist()))
    return pin.JointModelRevoluteUnaligned(axis) if aligned is None else aligned()
