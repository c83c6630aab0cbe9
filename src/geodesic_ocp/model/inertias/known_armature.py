"""Reflected rotor inertia of robots: what a file states, what is known of a robot, or a default.

The rotor of a motor with inertia I behind a gear of ratio r adds r^2 I to the inertia of its joint.
For the wrist of a robot it is larger than the inertia of the links, and few files state it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array, short_repr
from geodesic_ocp.model.model import Model

DEFAULT_ARMATURE = 0.05  # [kg m^2], of revolute joints of robots of which nothing is known


@dataclass(frozen=True, eq=False, repr=False)
class RobotArmature:
    """Joint inertia of a robot, and where the numbers come from.

    Attributes:
        values: (n,) [kg m^2, kg for prismatic joints], for `Model.with_armature`.
        source: the file, the document or the default, in words.
    """

    values: Array
    source: str

    def __repr__(self) -> str:
        return short_repr(self)


@dataclass(frozen=True)
class _Known:
    """One value for joints whose name, and that of their robot, contain these patterns."""

    joint: str
    robot: str
    value: float  # [kg m^2]
    source: str


_UR = r"(shoulder_pan|shoulder_lift|elbow|wrist_[123])_joint$"
_UR5E = "MuJoCo Menagerie, universal_robots_ur5e/ur5e.xml (armature 0.1 on all joints)"
_KNOWN = (
    _Known(
        r"panda_joint[1-7]$",
        "",
        0.1,
        "MuJoCo Menagerie, franka_emika_panda/panda.xml (armature 0.1 on all joints)",
    ),
    _Known(_UR, r"^ur5e\b", 0.1, _UR5E),
    _Known(_UR, r"^ur5\b", 0.1, f"that of its successor UR5e: {_UR5E}"),
    _Known("", r"^human (left|right) arm\b", 0.0, "a person's arm has no rotors"),
)


def robot_armature(model: Model) -> RobotArmature:
    """Joint inertia of the robot: its model's, the known one, or a default.

    A model with armature on any joint keeps its own on all joints. Otherwise known robots get
    values whose source is named, and all other joints 0.05 kg m^2; prismatic ones the mass that has
    this inertia at the distance of the arm's reach, 0.05 kg m^2 / reach^2.

    >>> import geodesic_ocp as go
    >>> robot_armature(go.human_arm("right", armature=0.2)).source
    'the model'
    """
    if model.armature.any():
        return RobotArmature(model.armature, "the model")
    values, sources = np.zeros(model.dof), []
    for row, (joint, unit) in enumerate(zip(model.joint_names, model.units, strict=True)):
        known = next((entry for entry in _KNOWN if _fits(entry, model.name, joint)), None)
        if known is not None:
            values[row] = known.value
            sources.append(known.source)
        elif unit == "rad":
            values[row] = DEFAULT_ARMATURE
            sources.append(f"default of {DEFAULT_ARMATURE:g} kg m^2")
        else:
            values[row] = DEFAULT_ARMATURE / model.reach**2
            sources.append(
                f"default of {DEFAULT_ARMATURE:g} kg m^2 / reach^2 = {values[row]:.3g} kg"
            )
    values.flags.writeable = False
    return RobotArmature(values, "; ".join(dict.fromkeys(sources)))


def with_rotor_inertia(model: Model) -> Model:
    """The model with the joint inertia of `robot_armature`; the same one if it has its own."""
    if model.armature.any():
        return model
    values = robot_armature(model).values
    return model.with_armature(values) if values.any() else model


def _fits(entry: _Known, robot: str, joint: str) -> bool:
    return bool(re.search(entry.robot, robot) and re.search(entry.joint, joint))
