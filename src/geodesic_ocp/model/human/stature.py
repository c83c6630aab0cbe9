"""The body height to which the model of a person is scaled."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.model.human.anthropometry import anthropometry
from geodesic_ocp.model.model import Model

# The proportions of the tables differ by more than a hundredth from each other only in part: the
# nearest table is taken.
_TABLES = (("winter", None), ("de_leva", "male"), ("de_leva", "female"))


def stature(model: Model) -> float | None:
    """Body height [m] of a model with the joints of `human_arm`; None for other models.

    It is read from the lengths of upper arm and forearm, by the anthropometric table whose
    proportion of the two is nearest.
    """
    for side in ("R", "L"):
        names = [f"{side}{joint}_joint" for joint in ("Sx", "Sz", "Sy", "Ex", "Ez", "Wx", "Wy")]
        if not all(model.pin.existJointName(name) for name in names):
            continue
        upper, fore = (
            float(np.linalg.norm(model.pin.jointPlacements[model.pin.getJointId(name)].translation))
            for name in (names[3], names[5])
        )
        if min(upper, fore) <= 0.0:
            continue
        tables = [anthropometry("right", table, sex) for table, sex in _TABLES]  # type: ignore[arg-type]
        nearest = min(
            tables, key=lambda t: abs(np.log(upper / fore * t.forearm_length / t.upper_arm_length))
        )
        return (upper + fore) / (nearest.upper_arm_length + nearest.forearm_length)
    return None
