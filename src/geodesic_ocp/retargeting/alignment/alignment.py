"""alignment: of a known robot, or as its kinematics propose it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from geodesic_ocp.model.human.anthropometry import Side
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.alignment.arm_length import arm_length
from geodesic_ocp.retargeting.alignment.known_alignments import KNOWN

_HUMAN: dict[str, Side] = {"human right arm": "right", "human left arm": "left"}


def alignment(robot: Model, **changes: Any) -> Alignment:
    """The default alignment of a known robot or of a person's arm, with some fields changed.

    Known are the robots that `load_model` offers by name (panda, talos-left-arm, ...), by the
    name of the model. Single arms (panda, xarm7, ur5) are assumed to be mounted as a right
    shoulder, with the first axis to the right and x forward.

    Args:
        robot: the arm.
        changes: fields of `Alignment` to be changed.

    Raises:
        ValueError: the robot is not known, or a change is not a field of an alignment.

    >>> import geodesic_ocp as go
    >>> go.alignment(go.human_arm("left")).side
    'left'
    """
    name, _, _ = robot.name.partition(" with ")  # a payload
    known = KNOWN.get(name)
    if name in _HUMAN:
        axes = np.eye(3)
        joints = (f"{name[6].upper()}{each}_joint" for each in ("Ex", "Wx"))
        found = Alignment(np.zeros(3), axes, axes, robot.reach, _HUMAN[name], *joints)
    elif known is None or not robot.pin.existFrame(known.joint):
        raise ValueError(
            f"there is no default alignment for {robot.name!r}, only for {', '.join(KNOWN)}; "
            "describe how its axes correspond to a person's with go.Alignment(shoulder, base, "
            "hand, length)"
        )
    else:
        home = np.clip(np.zeros(robot.dof), robot.lower, robot.upper)
        base, hand = (np.array(columns, dtype=float).T for columns in (known.base, known.hand))
        _, shoulder = robot.frame_pose(known.joint, home)
        found = Alignment(shoulder, base, hand, arm_length(robot, known.joint), known.side)
        found = replace(found, elbow=known.elbow, wrist=known.wrist)
    try:
        return replace(found, **changes)
    except TypeError as error:
        raise ValueError(f"alignment: {error}") from None
