"""Differences of poses: the rotation logarithm as a CasADi expression, and numeric distances."""

from __future__ import annotations

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.rotations import rotation_vector

_TINY = 1e-12


def rotation_log(rotation: ca.SX) -> ca.SX:
    """Rotation vector (3, 1) [rad], axis times angle, of a rotation (3, 3), up to an angle of pi.

    Computed from the unit quaternion, whose largest entry is found first, so that no division by
    zero occurs (Shepperd, "Quaternion from rotation matrix", J. Guidance and Control 1, 1978). At
    pi, where the axis is defined up to its sign, one of both is returned; the norm is right.
    """
    trace = rotation[0, 0] + rotation[1, 1] + rotation[2, 2]
    diagonal = [trace, rotation[0, 0], rotation[1, 1], rotation[2, 2]]
    skew = [
        rotation[2, 1] - rotation[1, 2],
        rotation[0, 2] - rotation[2, 0],
        rotation[1, 0] - rotation[0, 1],
    ]
    mixed = {(i, j): rotation[i, j] + rotation[j, i] for i, j in ((0, 1), (0, 2), (1, 2))}
    rows: list[list[ca.SX]] = [[ca.SX(0), *skew], [skew[0], ca.SX(0), mixed[0, 1], mixed[0, 2]]]
    rows.append([skew[1], mixed[0, 1], ca.SX(0), mixed[1, 2]])
    rows.append([skew[2], mixed[0, 2], mixed[1, 2], ca.SX(0)])
    candidates = []
    for index, row in enumerate(rows):
        square = 1 + 2 * diagonal[index] - trace if index else 1 + trace
        pivot = ca.sqrt(ca.fmax(square, 0.5)) / 2  # the largest square is at least one
        entries = [pivot if k == index else each / (4 * pivot) for k, each in enumerate(row)]
        candidates.append(ca.vertcat(*entries))
    quaternion, largest = candidates[0], diagonal[0]
    for candidate, square in zip(candidates[1:], diagonal[1:], strict=True):
        quaternion = ca.if_else(square > largest, candidate, quaternion)
        largest = ca.fmax(square, largest)
    quaternion = ca.if_else(quaternion[0] < 0, -quaternion, quaternion)
    square = ca.sumsqr(quaternion[1:])
    sine = ca.sqrt(ca.fmax(square, _TINY))
    factor = ca.if_else(square > _TINY, 2 * ca.atan2(sine, quaternion[0]) / sine, 2 + square / 3)
    return factor * quaternion[1:]


def pose_difference(
    rotation: Array, position: Array, target_rotation: Array, target_position: Array
) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses, given as (3, 3) and (3,) each."""
    vector = rotation_vector(target_rotation.T @ rotation)
    return float(np.linalg.norm(position - target_position)), float(np.linalg.norm(vector))
