"""A control for joint inertia: the same constant on the distal joints alone."""

from __future__ import annotations

from collections.abc import Sequence

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.synergies.joint_inertia import with_joint_inertia

_FOREARM_AND_WRIST = ("Ez_joint", "Wx_joint", "Wy_joint")  # of human_arm, without R or L


def distal_inertia(
    model: Model, joints: Sequence[str] | None = None, *, armature: float | None = None
) -> KineticEnergy:
    """The kinetic energy with joint inertia on the distal joints alone, as a control.

    The kinetic energy makes rotations of the forearm and the wrist nearly cost-free. If making
    them costly were all that joint inertia does, G + diag(a) with a on these joints alone would
    explain recordings as well as G + a I.

    >>> import geodesic_ocp as go
    >>> go.distal_inertia(go.human_arm(), armature=0.1).model.armature.tolist()
    [0.0, 0.0, 0.0, 0.0, 0.1, 0.1, 0.1]

    Args:
        model: the arm.
        joints: names of the distal joints; by default forearm rotation and wrist of `human_arm`.
        armature: their joint inertia [kg m^2]; by default that of the model, if it has any, or
            else `default_joint_inertia`.

    Raises:
        ValueError: no joints are given and the model is not a `human_arm`, there is no such joint,
            or the joint inertia is not positive.
    """
    if joints is None:
        joints = distal_joints(model)
        if not joints:
            raise ValueError(
                f"joints must name the distal ones of {', '.join(model.joint_names)}: forearm "
                "rotation and wrist are known of human_arm only"
            )
    if isinstance(joints, str) or not joints:
        raise ValueError(f"joints must be a sequence of names or None, got {joints!r}")
    if armature is None:
        everywhere = dict(zip(model.joint_names, with_joint_inertia(model).armature, strict=True))
    else:
        everywhere = dict.fromkeys(model.joint_names, as_positive("armature", armature, "kg m^2"))
    if missing := [name for name in joints if name not in everywhere]:
        known = ", ".join(model.joint_names)
        raise ValueError(f"joints: there is no joint {', '.join(missing)}; there are {known}")
    values = [everywhere[name] if name in joints else 0.0 for name in model.joint_names]
    return KineticEnergy(model.with_armature(values))


def distal_joints(model: Model) -> list[str]:
    """Forearm rotation and wrist of `human_arm`; none of other models."""
    return [name for name in model.joint_names if name[1:] in _FOREARM_AND_WRIST]
