"""The size of a model's inertia, to which joint inertia is compared."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model


def inertia_scale(model: Model) -> Array:
    """Moving mass times squared reach [kg m^2] for revolute joints, (n,); for prismatic ones, mass.

    The mass is that of the joint's own tree, as both arms of a person are two. The reach is the
    largest distance of the hand from the first joint, and is taken for all trees. A joint inertia
    in this unit has the same effect on the geodesics of large and small, heavy and light arms.
    """
    joints = sorted(range(1, model.pin.njoints), key=lambda index: model.pin.joints[index].idx_v)
    roots = [int(list(model.pin.supports[joint])[1]) for joint in joints]
    masses = dict.fromkeys(roots, 0.0)
    for joint, root in zip(joints, roots, strict=True):
        masses[root] += float(model.pin.inertias[joint].mass)
    lengths = [model.reach if unit == "rad" else 1.0 for unit in model.units]
    return np.array([masses[root] * r**2 for root, r in zip(roots, lengths, strict=True)])
