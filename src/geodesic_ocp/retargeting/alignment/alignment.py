"""alignment: of a known robot, or as its kinematics propose it."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np

from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.formats.robots import ROBOTS
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.alignment.arm_length import arm_length
from geodesic_ocp.retargeting.alignment.known_alignments import KNOWN
from geodesic_ocp.retargeting.alignment.propose_alignment import proposal

_HUMAN: dict[str, Side] = {"human right arm": "right", "human left arm": "left"}


def alignment(robot: Model, **changes: Any) -> Alignment:
    """The default alignment of a robot or of a person's arm, with some fields changed.

    Robots that `load_model` offers by name (panda, talos-left-arm, ...) are known by the name of
    the model; of them, single arms (panda, xarm7, ur5) are assumed to be mounted as a right
    shoulder, with the first axis to the right and x forward. That of any other robot is proposed
    from its kinematics (`propose_alignment`).

    Args:
        robot: the arm.
        changes: fields of `Alignment` to be changed.

    Warns:
        UserWarning: the robot is not known; says what was assumed.

    Raises:
        ValueError: nothing can be proposed, or a change is not a field of an alignment.

    >>> import geodesic_ocp as go
    >>> go.alignment(go.human_arm("left")).side
    'left'
    """
    found = known_alignment(as_model(robot))
    if found is None:
        proposed = proposal(robot)
        warnings.warn(
            f"no alignment is known for {robot.name!r}, so it is taken from the kinematics: "
            f"{'; '.join(proposed.assumptions)}. See it with `geodesic-ocp align`, which also "
            "writes a file to edit",
            UserWarning,
            stacklevel=2,
        )
        found = proposed.alignment
    try:
        return replace(found, **changes)
    except TypeError as error:
        raise ValueError(f"alignment: {error}") from None


def known_alignment(robot: Model) -> Alignment | None:
    """The alignment of a known robot or of a person's arm, by the name of the model."""
    name, _, _ = robot.name.partition(" with ")  # a payload
    known = KNOWN.get(name)
    if name in _HUMAN:
        side, axes = _HUMAN[name], np.eye(3)
        joints = (f"{side[0].upper()}{each}_joint" for each in ("Ex", "Wx"))
        return Alignment(np.zeros(3), axes, axes, robot.reach, side, *joints)
    if known is None:
        return None
    usual = ROBOTS[name]
    if not all(robot.pin.existFrame(each) for each in (known.joint, usual.hand, usual.base)):
        return None
    home = np.clip(np.zeros(robot.dof), robot.lower, robot.upper)
    base, hand = (np.array(columns, dtype=float).T for columns in (known.base, known.hand))
    # The model may have been loaded with another base, or another hand.
    base = robot.frame_pose(usual.base, home)[0] @ base
    hand = hand @ robot.frame_pose(usual.hand, home)[0].T @ robot.hand_pose(home)[0]
    _, shoulder = robot.frame_pose(known.joint, home)
    length = arm_length(robot, known.joint)
    return Alignment(shoulder, base, hand, length, known.side, known.elbow, known.wrist)
