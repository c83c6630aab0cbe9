"""Limits of a spline between its knots: where they are violated, and by how much."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.limits import LimitShares
from geodesic_ocp.execution.program.joint_spline import JointSpline

TOLERANCE = 1e-6  # of limits, relative, or [rad or m] of positions and distances
_SAMPLES, _FEW = 21, 7  # of every piece, both ends included, for torques and for distances


@dataclass(frozen=True, eq=False)
class ArmCheck:
    """Shares of an arm's limits in every piece of its spline.

    Attributes:
        arm: with its limits.
        spline: of its joints.
        position_bounds: (n,) each [rad or m].
    """

    arm: ArmPaths
    spline: JointSpline
    position_bounds: tuple[Array, Array]

    @cached_property
    def pieces(self) -> Mapping[str, Array]:
        """Largest shares in every piece (k, n) by the kind of limit; all are exact.

        Positions count from their bounds: one and the distance beyond them [rad or m].
        """
        spline, limits = self.spline, self.arm.limits
        low, high = spline.extreme_positions
        beyond = np.maximum(self.position_bounds[0] - low, high - self.position_bounds[1])
        growth = np.abs(spline.accelerations) / limits.acceleration
        return {
            "position": 1.0 + beyond,
            "velocity": spline.extreme_velocities / limits.velocity,
            "acceleration": np.maximum(growth[:-1], growth[1:]),
            "jerk": np.abs(spline.jerks) / limits.jerk,
        }

    @cached_property
    def torques(self) -> Array:
        """Shares of the torques at evenly spaced times in every piece, (k, samples, n)."""
        limit = self.arm.limits.torque
        shape = (len(self.spline.jerks), _SAMPLES, limit.size)
        if not np.any(np.isfinite(limit)):
            return np.zeros(shape)
        states = self.spline(self.spline.within_pieces(_SAMPLES).ravel())[:3]
        force = self.arm.robot.inverse_dynamics(*states, self.arm.gravity)
        return np.asarray((np.abs(force) / limit).reshape(shape))

    @property
    def shares(self) -> LimitShares:
        """Largest shares of the whole spline."""
        velocity, acceleration, jerk = (
            self.pieces[kind].max(axis=0) for kind in ("velocity", "acceleration", "jerk")
        )
        return LimitShares(velocity, acceleration, jerk, self.torques.max(axis=(0, 1)))

    @property
    def worst(self) -> tuple[float, str]:
        """By how much the worst limit is exceeded, relative or [rad or m], and a clause on it."""
        excess = {kind: shares.max(axis=0) - 1.0 for kind, shares in self.pieces.items()}
        excess["torque"] = self.torques.max(axis=(0, 1)) - 1.0
        kind = max(excess, key=lambda name: float(excess[name].max()))
        joint = int(excess[kind].argmax())
        name = f"the {kind} of {self.arm.robot.joint_names[joint]} exceeds its limit"
        return float(excess[kind][joint]), name


def distances_in_pieces(clearance: Clearance, splines: Sequence[JointSpline]) -> Array:
    """Distances at evenly spaced times in every piece, (pieces, samples, m) [m]."""
    times = splines[0].within_pieces(_FEW)
    q = np.hstack([spline(times.ravel())[0] for spline in splines])
    function: ca.Function = clearance.function
    found = function.map(len(q))(q.T).full().T
    return np.asarray(found.reshape(*times.shape, -1))
