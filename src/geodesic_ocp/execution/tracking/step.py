"""One step of inverse kinematics as a quadratic program, and its solution without a package."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.tracking.box_least_squares import box_least_squares


@dataclass(frozen=True)
class Weights:
    """Weights of what a step minimizes besides the error of the hand's velocity.

    Attributes:
        posture: of the difference from the speeds towards the posture.
        change: of the change of the speeds from the step before.
    """

    posture: float
    change: float


@dataclass(frozen=True, eq=False)
class Step:
    """min |J v - w|^2 + posture |v - u|^2 + change |v - v_before|^2 + damping |v|^2, in bounds.

    Attributes:
        q: configuration (n,).
        jacobian: J, tracked rows (r, n) of the hand's Jacobian.
        velocity: w, of the hand (r,) [m/s, rad/s].
        posture: u, speeds towards the posture (n,).
        before: speeds in the step before (n,).
        damping: weight of the speeds.
        lower, upper: bounds of the speeds (n,).
    """

    q: Array
    jacobian: Array
    velocity: Array
    posture: Array
    before: Array
    damping: float
    lower: Array
    upper: Array

    def solve(self, weights: Weights) -> Array:
        """Speeds (n,)."""
        total = weights.posture + weights.change + self.damping
        pulled = weights.posture * self.posture + weights.change * self.before
        return box_least_squares(
            self.jacobian.T @ self.jacobian + total * np.eye(self.q.size),
            -(self.jacobian.T @ self.velocity + pulled),
            self.lower,
            self.upper,
        )
