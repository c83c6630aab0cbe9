"""A model whose links have other masses and rotational inertias."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pinocchio as pin

from geodesic_ocp.model.model import Model


def scale_inertias(
    model: Model, mass_factors: Sequence[float], inertia_factors: Sequence[float]
) -> Model:
    """The model with every link's mass and rotational inertia multiplied; centres of mass stay.

    Args:
        model: with n joints.
        mass_factors: of the link behind each joint, (n,), in the order of the coordinates.
        inertia_factors: of its rotational inertia about the centre of mass, (n,).
    """
    scaled = model.pin.copy()
    for index in range(1, scaled.njoints):
        body, row = scaled.inertias[index], scaled.joints[index].idx_v
        scaled.inertias[index] = pin.Inertia(
            mass_factors[row] * body.mass, body.lever, inertia_factors[row] * body.inertia
        )
    return replace(model, pin=scaled)
