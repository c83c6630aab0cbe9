"""A control for joint inertia: the same constant on the distal joints alone."""

from __future__ import annotations

from collections.abc import Sequence

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.manifold.metrics.kinetic_energy import KineticEnergy
from geodesic_ocp.model.model import Model

_FOREARM_AND_WRIST = ("Ez_joint", "Wx_joint", "Wy_joint")  # of human_arm, without R or L


def distal_inertia(
    model: Model, joints: Sequence[str] | None = None, *, armature: float = 0.05
) -> KineticEnergy:
    """The kinetic energy with joint inertia on the distal joints alone, as a control.

    The kinetic energy makes rotations of the forearm and the wrist nearly cost-free. If making
    them costly were all that joint inertia does, G + diag(a) with a on these joints alone would
    explain recordings as well as G + a I.

    >>> import geodesic_ocp as go
    >>> go.distal_inertia(go.human_arm()).model.armature.tolist()
    [0.0, 0.0, 0.0, 0.0, 0.05, 0.05, 0.05]

    Args:
        model: the arm.
        joints: names of the distal joints; by default forearm rotation and wrist of `human_arm`.
        armature: their joint inertia [kg m^2].

    Raises:
        ValueError: no joints are given and the model is not a `human_arm`, there is no such joint,
            or the joint inertia is not positive.
    """
    armature = as_positive("armature", armature, "kg m^2")
    if joints is None:
        joints = [name for name in model.joint_names if name[1:] in _FOREARM_AND_WRIST]
        if not joints:
            raise ValueError(
                f"joints must name the distal ones of {', '.join(model.joint_names)}: forearm "
                "rotation and wrist are known of human_arm only"
            )
    if isinstance(joints, str) or not joints:
        raise ValueError(f"joints must be a sequence of names or None, got {joints!r}")
    alone = model.with_armature(0.0).with_armature(dict.fromkeys(joints, armature))
    return KineticEnergy(alone)
