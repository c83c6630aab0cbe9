"""Shooting for a pose by the gradient of Klein, Jaquier, Meixner, Asfour (2022), section V.

The pose error is multiplied by the pseudo-inverse of the hand's Jacobian, and the result is
parallel-transported back along the geodesic, instead of using the derivative of the exponential
map.
"""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.logarithm.geodesic import geodesic_from_velocity
from geodesic_ocp.logarithm.to_pose.pose_target import PoseTarget, ShootingResult
from geodesic_ocp.manifold.exp import exp
from geodesic_ocp.manifold.parallel_transport import parallel_transport
from geodesic_ocp.trajectory.path import Path

_MAX_ITERATIONS = 2000
_CONVERGED = 1e-9  # the pose error, or its relative decrease in one step
_MAX_HALVINGS = 30
_CUTOFF = 1e-3  # of the pseudo-inverse, relative to the Jacobian's largest singular value


def descend_transported_gradient(target: PoseTarget, velocity: Array) -> ShootingResult:
    """Steps along the transported gradient, halved until they decrease the pose error."""
    metric, q0, v = target.metric, target.q0, velocity
    end = exp(metric, q0, v)
    error = target.pose_error(end)
    rows = np.repeat(target.weights, 3)
    for iteration in range(_MAX_ITERATIONS):
        size = float(np.linalg.norm(error))
        if size <= _CONVERGED:
            return ShootingResult(v, iteration, True, "the hand is at the pose")
        jacobian = rows[:, None] * target.model.hand_jacobian(end)
        step = np.linalg.pinv(jacobian, rcond=_CUTOFF) @ error
        if np.any(v):
            path = geodesic_from_velocity(metric, q0, v)
            backwards = Path(metric, path.grid, path.nodes[::-1])  # its grids are symmetric
            step = parallel_transport(metric, backwards, step)
        damping = 1.0
        for _ in range(_MAX_HALVINGS):
            try:
                new = exp(metric, q0, v + damping * step)
                new_error = target.pose_error(new)
            except IntegrationFailed:
                new_error = np.full(6, np.inf)
            if np.linalg.norm(new_error) < size:
                break
            damping /= 2.0
        else:
            status = "no step along the gradient decreases the pose error"
            return ShootingResult(v, iteration, False, status)
        v, end, error = v + damping * step, new, new_error
        if size - np.linalg.norm(error) <= _CONVERGED * size:
            return ShootingResult(v, iteration + 1, True, "the pose error no longer decreases")
    return ShootingResult(v, _MAX_ITERATIONS, False, "the maximum number of iterations is reached")
