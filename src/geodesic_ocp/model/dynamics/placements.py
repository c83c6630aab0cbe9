"""Symbolic placements of the joints of a pin.Model, relative to their parents."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.joints import motion_subspace, without_noise


def constant(matrix: Array) -> ca.SX:
    """Numbers as an expression."""
    return ca.SX(np.asarray(matrix, dtype=float))


@dataclass(frozen=True)
class Placement:
    """Rotation (3, 3) and translation (3, 1) of a frame relative to its parent."""

    rotation: ca.SX
    translation: ca.SX

    def __matmul__(self, other: Placement) -> Placement:
        return Placement(
            self.rotation @ other.rotation, self.rotation @ other.translation + self.translation
        )


def constant_placement(placement: pin.SE3) -> Placement:
    """A fixed placement, without rounding errors in its rotation."""
    clean = without_noise(placement)
    return Placement(constant(clean.rotation), constant(clean.translation))


def joint_placements(model: pin.Model, q: ca.SX) -> list[Placement]:
    """Placement of every joint relative to its parent; index 0 is the universe."""
    placements = [constant_placement(pin.SE3.Identity())]
    for index in range(1, model.njoints):
        fixed = without_noise(model.jointPlacements[index])
        coordinate = q[model.joints[index].idx_v]
        placements.append(_moved(fixed, motion_subspace(model, index), coordinate))
    return placements


def _moved(fixed: pin.SE3, subspace: Array, q: ca.SX) -> Placement:
    """A fixed placement times exp(S q) for a constant twist S = (linear, angular)."""
    linear, angular = subspace[:3], subspace[3:]
    start, origin = fixed.rotation, constant(fixed.translation)
    rate = float(np.linalg.norm(angular))
    if rate == 0.0:
        return Placement(constant(start), origin + constant(start @ linear) * q)
    axis, angle = angular / rate, rate * q
    cos, sin = ca.cos(angle), ca.sin(angle)
    # Rodrigues' formula a a' + cos (1 - a a') + sin [a], with exact zeros for a coordinate axis.
    along = start @ np.outer(axis, axis)
    across, turned = start - along, start @ pin.skew(axis)
    rotation = constant(along) + cos * constant(across) + sin * constant(turned)
    if np.any(linear):
        slide = linear / rate
        origin += angle * constant(along @ slide)
        origin += sin * constant(across @ slide) + (1 - cos) * constant(turned @ slide)
    return Placement(rotation, origin)
