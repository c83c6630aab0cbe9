"""The size of a model's inertia, to which joint inertia is compared."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model


def inertia_scale(model: Model) -> Array:
    """Moving mass times squared reach [kg m^2] for revolute joints, (n,); for prismatic ones, mass.

    The reach is the largest distance of the hand from the first joint. A joint inertia in this unit
    has the same effect on the geodesics of large and small, heavy and light arms.
    """
    rotational = model.mass * model.reach**2
    return np.array([rotational if unit == "rad" else model.mass for unit in model.units])
