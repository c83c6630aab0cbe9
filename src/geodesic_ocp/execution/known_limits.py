"""Limits that the makers of known robots publish and that their URDF files do not state."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from geodesic_ocp.model.model import Model


@dataclass(frozen=True)
class KnownLimits:
    """Published limits of a robot's joints, in their order from the base.

    Attributes:
        source: the document, and what it states.
        values: by the name of a field of JointLimits.
    """

    source: str
    values: Mapping[str, tuple[float, ...]]


_FRANKA = "https://frankaemika.github.io/docs/control_parameters.html"

KNOWN_LIMITS = {
    "panda": KnownLimits(
        f"Franka, Robot and interface specifications, limits for Panda, joint space ({_FRANKA})",
        {
            "velocity": (2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
            "acceleration": (15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),
            "jerk": (7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0),
            "torque": (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0),
        },
    ),
    "xarm7": KnownLimits(
        "UFACTORY, xArm user manual, ranges of joint motion: up to 1145 deg/s^2 and 28647 deg/s^3",
        {"acceleration": (20.0,) * 7, "jerk": (500.0,) * 7},
    ),
}


def known_limits(model: Model) -> KnownLimits | None:
    """The published limits of this robot, known by name and joints; None if there are none."""
    name = re.sub(r" with [0-9.e+-]+ kg$", "", model.name)  # that of a model with a payload
    known = KNOWN_LIMITS.get(name)
    if known is None:
        return None
    numbers = [int(found[1]) for j in model.joint_names if (found := re.search(r"joint(\d+)$", j))]
    (count,) = {len(values) for values in known.values.values()}
    return known if numbers == list(range(1, count + 1)) else None
