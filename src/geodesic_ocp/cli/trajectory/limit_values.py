"""Limits of robots' joints from the command line."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from geodesic_ocp.execution.limits import QUANTITIES, JointLimits, joint_limits
from geodesic_ocp.model.model import Model


def given_limits(options: argparse.Namespace, robots: Sequence[Model]) -> list[JointLimits]:
    """The limits of each robot: those of the options, else as `joint_limits` finds them.

    Raises:
        ValueError: an option that is not a number, or names an unknown joint.
    """
    given = {name: _limit(name, getattr(options, name)) for name in QUANTITIES}
    return [joint_limits(robot, **given) for robot in robots]


def _limit(name: str, values: Sequence[str] | None) -> float | dict[str, float] | None:
    """One number for all joints, or numbers by joint."""
    by_joint: dict[str, float] = {}
    for value in values or ():
        joint, _, number = value.rpartition("=")
        try:
            limit = float(number)
        except ValueError:
            raise ValueError(f"--{name} {value}: must be LIMIT or JOINT=LIMIT") from None
        if not joint and len(values or ()) > 1:
            raise ValueError(f"--{name}: several limits must be JOINT=LIMIT each, got {value}")
        if not joint:
            return limit
        by_joint[joint] = limit
    return by_joint or None
