"""Where the elbow is beside the line from shoulder to wrist: the arm's swivel, without an angle.

The offset is the part of shoulder to elbow that is perpendicular to shoulder to wrist, relative to
the length of the arm. It turns with the swivel angle (Tolani, Goswami, Badler, Graphical Models 62,
2000) and vanishes with the straight arm, where that angle is not defined.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.poses.pose_mapping import PoseMapping

_SHORTEST = 1e-4  # [m^2], squared distance from the shoulder to the wrist


def has_elbow(model: Model, alignment: Alignment) -> bool:
    """Whether the alignment names joints of the model as its elbow and its wrist."""
    names = alignment.elbow, alignment.wrist
    return all(name is not None and model.pin.existFrame(name) for name in names)


def elbow_offset(model: Model, alignment: Alignment, q: Any) -> ca.SX:
    """Offset (3, 1) of the elbow in the axes of the base, in lengths of the arm."""
    shoulder = ca.DM(np.asarray(alignment.shoulder))
    _, elbow = model.frame_pose(str(alignment.elbow), q)
    _, wrist = model.frame_pose(str(alignment.wrist), q)
    upper, whole = elbow - shoulder, wrist - shoulder
    along = ca.dot(upper, whole) / (ca.sumsqr(whole) + _SHORTEST)
    offset: ca.SX = (upper - along * whole) / alignment.length
    return offset


def mapped_offsets(mapping: PoseMapping, q: Array) -> Array:
    """The person's elbow offsets (k, 3), in the axes of the robot's base, at q (k, n)."""
    source, target = mapping.source, mapping.target
    symbol = ca.SX.sym("q", mapping.model.dof)
    function = ca.Function("offset", [symbol], [elbow_offset(mapping.model, source, symbol)])
    offsets = np.atleast_2d(function(q.T).full().T)
    in_person = offsets @ np.asarray(source.base)
    if mapping.mirror:
        in_person = in_person * np.array([-1.0, 1.0, 1.0])
    return np.asarray(in_person @ np.asarray(target.base).T)
