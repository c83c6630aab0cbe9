"""The logarithm of rotations as a CasADi expression, and distances of poses."""

from __future__ import annotations

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array

_TINY = 1e-12


def rotation_log(turn: ca.SX) -> ca.SX:
    """Axis times angle (3, 1) [rad] of a rotation (3, 3), right up to an angle of pi.

    By the unit quaternion, whose largest entry is computed first, so that none is divided by zero
    (Shepperd, "Quaternion from rotation matrix", J. Guidance and Control 1, 1978). At pi, where the
    axis has two signs, it has one of them, and the norm is right.
    """
    trace = turn[0, 0] + turn[1, 1] + turn[2, 2]
    squares = [trace, turn[0, 0], turn[1, 1], turn[2, 2]]
    skew = [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    mixed = {(i, j): turn[i, j] + turn[j, i] for i, j in ((0, 1), (0, 2), (1, 2))}
    rows: list[list[ca.SX]] = [[ca.SX(0), *skew], [skew[0], ca.SX(0), mixed[0, 1], mixed[0, 2]]]
    rows.append([skew[1], mixed[0, 1], ca.SX(0), mixed[1, 2]])
    rows.append([skew[2], mixed[0, 2], mixed[1, 2], ca.SX(0)])
    candidates = []
    for place, row in enumerate(rows):
        square = 1 + 2 * squares[place] - trace if place else 1 + trace
        large = ca.sqrt(ca.fmax(square, 0.5)) / 2  # the largest square is one at least
        entries = [large if k == place else each / (4 * large) for k, each in enumerate(row)]
        candidates.append(ca.vertcat(*entries))
    quaternion, largest = candidates[0], squares[0]
    for candidate, square in zip(candidates[1:], squares[1:], strict=True):
        quaternion = ca.if_else(square > largest, candidate, quaternion)
        largest = ca.fmax(square, largest)
    quaternion = ca.if_else(quaternion[0] < 0, -quaternion, quaternion)
    square = ca.sumsqr(quaternion[1:])
    sine = ca.sqrt(ca.fmax(square, _TINY))
    factor = ca.if_else(square > _TINY, 2 * ca.atan2(sine, quaternion[0]) / sine, 2 + square / 3)
    return factor * quaternion[1:]


def pose_miss(
    rotation: Array, position: Array, wanted_rotation: Array, wanted_position: Array
) -> tuple[float, float]:
    """Distance [m] and angle [rad] of two poses, from (3, 3) and (3,) each."""
    turn = wanted_rotation.T @ rotation
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    angle = np.arctan2(np.linalg.norm(vector), np.trace(turn) - 1.0)  # of twice sine, twice cosine
    return float(np.linalg.norm(position - wanted_position)), float(angle)
