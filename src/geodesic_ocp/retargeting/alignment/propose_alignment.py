"""propose_alignment: an alignment found from the kinematics of a robot alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.alignment.base_axes import base_axes
from geodesic_ocp.retargeting.alignment.hand_axes import hand_axes
from geodesic_ocp.retargeting.alignment.landmarks import landmarks


@dataclass(frozen=True, eq=False)
class Proposal:
    """An alignment found from the kinematics, and what it assumes.

    Attributes:
        alignment: the proposed one.
        assumptions: sentences about what was taken from where.
    """

    alignment: Alignment
    assumptions: tuple[str, ...]


def propose_alignment(robot: Model, *, side: Side | None = None) -> Alignment:
    """An alignment of a robot's arm with a person's, from the chain of its joints alone.

    The shoulder is where the axes of the first joints of the arm meet; joints of a torso before
    them do not count. The hand reaches away from the centre of the wrist, and a single arm is
    assumed to be mounted like a shoulder, with its first axis to the right and x forward.
    `geodesic-ocp align` shows all that was assumed, and writes a file to edit.

    >>> import geodesic_ocp as go
    >>> found = go.propose_alignment(go.human_arm("right"))
    >>> found.elbow, found.wrist, abs(found.shoulder).round(6).tolist()
    ('REx_joint', 'RWx_joint', [0.0, 0.0, 0.0])

    Args:
        robot: the arm.
        side: of the body; None: where the shoulder is, or right for a single arm.

    Raises:
        ValueError: fewer than two revolute joints, or an unknown side.
    """
    return proposal(robot, side).alignment


def proposal(robot: Model, side: Side | None = None) -> Proposal:
    """`propose_alignment` with its assumptions."""
    robot = as_model(robot)
    if side is not None and side not in get_args(Side):
        raise ValueError(f"side must be 'right', 'left' or None, got {side!r}")
    found = landmarks(robot)
    base = base_axes(robot, found, side)
    hand = hand_axes(robot, found, base.rotation, base.side)
    if found.crossing:
        where = f"where the axes of {', '.join(found.crossing)} meet"
    else:
        where = "at the first joint of the arm, as no axes meet near it"
    shoulder = f"the shoulder is {where}"
    if found.before:
        shoulder += f"; {', '.join(found.before)} before it, at zero, not counted"
    aligned = Alignment(
        _rounded(found.shoulder),
        base.rotation,
        hand.rotation,
        found.length,
        base.side,
        found.elbow,
        found.wrist,
    )
    return Proposal(aligned, (shoulder, base.reason, *hand.reasons))


def _rounded(point: Array) -> Array:
    """Without rounding errors, as it is to be read in a file."""
    return np.round(point, 9) + 0.0
