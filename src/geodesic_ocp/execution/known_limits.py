"""Limits that the makers of known robots publish, for what their files do not state.

URDF files state no limits on acceleration and jerk, MJCF files none on speed either.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.model.model import Model


@dataclass(frozen=True)
class KnownLimits:
    """Published limits of a robot's joints, in their order from the base.

    Attributes:
        source: the document, and what it states.
        joints: ends of the names of the joints.
        values: by the name of a field of JointLimits.
    """

    source: str
    joints: tuple[str, ...]
    values: Mapping[str, tuple[float, ...]]


_SEVEN = tuple(f"joint{number}" for number in range(1, 8))
_UR = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
_UR_JOINTS = tuple(f"{name}_joint" for name in _UR)
_FRANKA = "joint space limits (https://frankaemika.github.io/docs/control_parameters.html)"
_FRANKA_TORQUES = (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0)


def _degrees(*values: float) -> tuple[float, ...]:
    return tuple(np.deg2rad(values).tolist())


KNOWN_LIMITS = {
    "panda": KnownLimits(
        f"Franka, robot and interface specifications, limits for Panda, {_FRANKA}",
        _SEVEN,
        {
            "velocity": (2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
            "acceleration": (15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),
            "jerk": (7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0),
            "torque": _FRANKA_TORQUES,
        },
    ),
    "fr3": KnownLimits(
        f"Franka, robot and interface specifications, limits for Franka Research 3, {_FRANKA}",
        _SEVEN,
        {
            "velocity": (2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26),
            "acceleration": (10.0,) * 7,
            "jerk": (5000.0,) * 7,
            "torque": _FRANKA_TORQUES,
        },
    ),
    "xarm7": KnownLimits(
        "UFACTORY, xArm user manual, ranges of joint motion: up to 180 deg/s, 1145 deg/s^2 and "
        "28647 deg/s^3",
        _SEVEN,
        {"velocity": _degrees(*[180.0] * 7), "acceleration": (20.0,) * 7, "jerk": (500.0,) * 7},
    ),
    "iiwa14": KnownLimits(
        "KUKA, LBR iiwa 14 R820 data sheet, speeds and torques at rated payload",
        _SEVEN,
        {
            "velocity": _degrees(85.0, 85.0, 100.0, 75.0, 130.0, 135.0, 135.0),
            "torque": (320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0),
        },
    ),
    "ur5e": KnownLimits(
        "Universal Robots, UR5e technical specifications: 180 deg/s for all joints",
        _UR_JOINTS,
        {"velocity": _degrees(*[180.0] * 6)},
    ),
    "ur10e": KnownLimits(
        "Universal Robots, UR10e technical specifications: 120 deg/s for base and shoulder, "
        "180 deg/s for elbow and wrists",
        _UR_JOINTS,
        {"velocity": _degrees(120.0, 120.0, 180.0, 180.0, 180.0, 180.0)},
    ),
}


def known_limits(model: Model) -> KnownLimits | None:
    """The published limits of this robot, known by name and joints; None if there are none."""
    name = re.sub(r" with [0-9.e+-]+ kg$", "", model.name)  # that of a model with a payload
    known = KNOWN_LIMITS.get(name)
    if known is None or model.dof != len(known.joints):
        return None
    pairs = zip(model.joint_names, known.joints, strict=True)
    return known if all(mine.endswith(published) for mine, published in pairs) else None
