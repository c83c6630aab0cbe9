"""The joint inertia that an analysis assumes of an arm."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.inertias import inertia_scale
from geodesic_ocp.model.model import Model

# Of m r^2: what `fit_metric` estimates from recordings of the KIT database and the bundled one,
# with 0.02 to 0.04 as its 95 % interval.
FRACTION = 0.03


def default_joint_inertia(model: Model) -> Array:
    """Joint inertia (n,) that `analyse` assumes of an arm [kg m^2, kg for prismatic joints].

    a = 0.03 m r^2 for revolute and 0.03 m for prismatic joints, with the moving mass m and the
    reach r of the model. The geodesics of G(q) + diag(a) depend on the ratio of a and G only, so
    that a constant in kg m^2 would make them depend on the body mass that a recording states, which
    is often a placeholder.

    >>> import geodesic_ocp as go
    >>> go.default_joint_inertia(go.human_arm(height=1.75, mass=70.0)).round(3)
    array([0.044, 0.044, 0.044, 0.044, 0.044, 0.044, 0.044])

    Raises:
        ValueError: the reach is infinite, as a prismatic joint has no limits, or zero.
    """
    if not has_default_joint_inertia(model):
        raise ValueError(
            f"{model.name!r}, with a reach of {model.reach:g} m and {model.mass:g} kg, has no "
            "default joint inertia: limit its joints (Model.with_limits), give the joint inertia "
            "(Model.with_armature), or choose another metric"
        )
    return np.asarray(FRACTION * inertia_scale(model))


def has_default_joint_inertia(model: Model) -> bool:
    """Whether mass and reach of the model are positive and finite, as far as its joints need."""
    scale = inertia_scale(model)
    return bool(np.all(np.isfinite(scale) & (scale > 0.0)))


def with_joint_inertia(model: Model) -> Model:
    """The model with its own armature if it has any, otherwise with the default joint inertia."""
    return model if np.any(model.armature) else model.with_armature(default_joint_inertia(model))
