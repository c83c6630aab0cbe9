"""How far the samples of a trajectory contradict each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

# Files round numbers to six digits or so: that is no contradiction.
ROUNDING = (1e-6, 1e-5, 1e-4)  # of positions [rad], velocities [rad/s], accelerations [rad/s^2]
_NEIGHBOURS = 1  # steps on either side over which the jerk is estimated


@dataclass(frozen=True, eq=False)
class SampleConsistency:
    """Differences between samples less the trapezoidal integral of their derivatives.

    Attributes:
        positions: q_(i+1) - q_i - h (v_i + v_(i+1)) / 2, (k - 1, n) [rad or m].
        velocities: v_(i+1) - v_i - h (a_i + a_(i+1)) / 2, (k - 1, n) [rad/s or m/s].
        position_bounds, velocity_bounds: largest magnitudes that consistent samples can have.
    """

    positions: Array
    velocities: Array
    position_bounds: Array
    velocity_bounds: Array

    def shares(self) -> tuple[Array, Array]:
        """Largest magnitude over its bound, of positions and of velocities, by joint (n,)."""
        return (
            np.max(np.abs(self.positions) / self.position_bounds, axis=0, initial=0.0),
            np.max(np.abs(self.velocities) / self.velocity_bounds, axis=0, initial=0.0),
        )


def sample_consistency(trajectory: JointTrajectory) -> SampleConsistency:
    """Whether velocities are the derivatives of positions, and accelerations of velocities.

    The trapezoidal rule over a step h is wrong by at most J h^3 / 12 for positions and J h^2 / 4
    for velocities where the jerk is at most J, and by at most J h^3 / 8 and J h^2 / 2 where the
    acceleration jumps by J h within the step. The bounds are the latter, with the J that the
    accelerations in the file show in this step and its neighbours, plus rounding to six digits.
    They are of third and second order in h.
    """
    h = np.diff(trajectory.time)[:, None]
    q, v, a = trajectory.positions, trajectory.velocities, trajectory.accelerations
    jumps = np.abs(np.diff(a, axis=0))
    padded = np.pad(jumps / h, ((_NEIGHBOURS, _NEIGHBOURS), (0, 0)), mode="edge")
    count = len(jumps)
    jerk = np.max([padded[k : k + count] for k in range(2 * _NEIGHBOURS + 1)], axis=0)
    return SampleConsistency(
        np.diff(q, axis=0) - h * (v[1:] + v[:-1]) / 2.0,
        np.diff(v, axis=0) - h * (a[1:] + a[:-1]) / 2.0,
        jerk * h**3 / 8.0 + ROUNDING[0],
        jerk * h**2 / 2.0 + ROUNDING[1],
    )
