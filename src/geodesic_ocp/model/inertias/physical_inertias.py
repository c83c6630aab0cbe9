"""Checks that the inertias of a model are physical, so that its mass matrix is a metric."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, real_array
from geodesic_ocp.model.joints import configuration, motion_subspace

# Values in files are rounded: principal moments below this fraction of the largest are zero.
_ROUNDING = 1e-9
# Relative size below which an eigenvalue of a mass matrix is zero.
_SINGULAR = 1e-13
_NUM_CONFIGURATIONS = 8


def body_inertia(mass: float, centre: Array, inertia: ArrayLike | None) -> pin.Inertia:
    """Spatial inertia from mass [kg], centre (3,) [m] and inertia about it (3, 3) [kg m^2].

    Raises:
        ValueError: the inertia is not symmetric, or has a negative principal moment.
    """
    try:
        moments = np.zeros((3, 3)) if inertia is None else real_array(inertia)
    except (TypeError, ValueError):
        moments = np.zeros(0)
    if moments.shape != (3, 3) or not np.all(np.isfinite(moments)):
        raise ValueError(f"inertia must be 3 x 3 finite numbers, got {inertia!r}")
    largest = np.abs(moments).max()
    if np.abs(moments - moments.T).max() > _ROUNDING * largest:
        raise ValueError(f"inertia must be symmetric, got {moments.tolist()}")
    if np.linalg.eigvalsh(moments)[0] < -_ROUNDING * largest:
        raise ValueError(f"inertia has a negative principal moment: {moments.tolist()}")
    return pin.Inertia(mass, centre, (moments + moments.T) / 2)


def check_inertias(model: pin.Model) -> None:
    """Reject a model whose mass matrix is not that of solid bodies.

    Every moving link, with all that is fixed to it, must have mass and, if it can rotate, positive
    principal moments of inertia. A link may be massless if a later link of its chain has mass, as
    between the axes of a shoulder, or if its joint has an inertia of its own (armature).

    Raises:
        ValueError: names the link and what is wrong with its inertia.
    """
    carried = _carried_masses(model)
    rotates = [False] * model.njoints
    for index in range(1, model.njoints):
        body, joint = model.inertias[index], model.names[index]
        angular = motion_subspace(model, index)[3:]
        rotates[index] = rotates[model.parents[index]] or bool(np.any(angular))
        link = _link_of(model, index)
        if not np.all(np.isfinite(body.toDynamicParameters())):
            raise ValueError(f"link {link!r}: the inertia is not finite")
        if body.mass < 0.0:
            raise ValueError(f"link {link!r} has a negative mass, {body.mass:.3g} kg")
        moments = np.linalg.eigvalsh(body.inertia)
        # A massless link may have moments, such as those of a rotor, but no negative ones.
        least = _ROUNDING * moments[-1] if body.mass > 0.0 else -_ROUNDING * moments[-1]
        if rotates[index] and (moments[0] < least or (body.mass > 0.0 and moments[-1] <= 0.0)):
            listed = ", ".join(f"{moment:.3g}" for moment in moments)
            raise ValueError(
                f"link {link!r}, {body.mass:.3g} kg, has an inertia that is not positive definite: "
                f"principal moments {listed} kg m^2"
            )
        if carried[index] <= 0.0 and not model.armature[model.joints[index].idx_v]:
            raise ValueError(
                f"link {link!r} moves with joint {joint!r}, but neither it nor any later link "
                "has mass, and the joint has no armature"
            )
    _check_mass_matrix(model)


def _carried_masses(model: pin.Model) -> Array:
    """Mass [kg] that each joint moves: its own link and all later links."""
    carried = np.array([inertia.mass for inertia in model.inertias])
    for index in range(model.njoints - 1, 0, -1):
        carried[model.parents[index]] += carried[index]
    return carried


def _link_of(model: pin.Model, index: int) -> str:
    """Name of the link at the joint, or of the joint if the link has none."""
    for frame in model.frames:
        at_joint = frame.parentJoint == index and frame.placement.isIdentity(_ROUNDING)
        if at_joint and frame.type == pin.FrameType.BODY:
            return str(frame.name)
    return str(model.names[index])


def _check_mass_matrix(model: pin.Model) -> None:
    """Reject a mass matrix that is singular in every configuration: some joint moves no mass."""
    rng, data = np.random.default_rng(0), model.createData()
    weightless = model.copy()
    weightless.gravity = pin.Motion.Zero()
    still, idle = np.zeros(model.nv), np.zeros(model.nv)
    for _ in range(_NUM_CONFIGURATIONS):
        q = configuration(model, rng.uniform(-1.5, 1.5, model.nv))
        # Not crba, which omits entries if joints are not numbered depth first.
        columns = [pin.rnea(weightless, data, q, still, unit) for unit in np.eye(model.nv)]
        sizes = np.sqrt(np.maximum(np.diag(columns), np.finfo(float).tiny))
        values, vectors = np.linalg.eigh(np.array(columns) / np.outer(sizes, sizes))
        if values[0] > _SINGULAR:
            return
        idle = np.maximum(idle, np.abs(vectors[:, 0]))
    joints = list(model.joints)
    index = next(i for i in range(1, model.njoints) if joints[i].idx_v == int(np.argmax(idle)))
    raise ValueError(
        f"link {_link_of(model, index)!r}: the mass matrix is singular in every configuration, as "
        f"joint {model.names[index]!r} can move without moving any mass, and has no armature"
    )
