"""Shooting for a pose by the gradient of Klein, Jaquier, Meixner, Asfour (2022), section V.

The hand's miss goes through the pseudo-inverse of its Jacobian, and is carried back along the
geodesic in parallel, in place of the derivative of the exponential map.
"""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.geodesics.log import geodesic_from_velocity
from geodesic_ocp.geodesics.pose_target import Found, Target
from geodesic_ocp.manifold.exp import exp
from geodesic_ocp.manifold.parallel_transport import parallel_transport
from geodesic_ocp.trajectory.path import Path

_ITERATIONS = 2000
_DONE = 1e-9  # the miss, or what a step gains of it
_HALVINGS = 30
_CUT = 1e-3  # of the Jacobian's largest singular value: what the pseudo-inverse leaves alone


def descended(target: Target, v: Array) -> Found:
    """Steps along the miss, by the pseudo-inverse and parallel transport, that make it smaller."""
    metric, q0 = target.metric, target.q0
    end = exp(metric, q0, v)
    missed = target.miss(end)
    rows = np.repeat(target.weights, 3)
    for iteration in range(_ITERATIONS):
        size = float(np.linalg.norm(missed))
        if size <= _DONE:
            return Found(v, iteration, True, "the hand is at the pose")
        jacobian = rows[:, None] * target.model.hand_jacobian(end)
        step = np.linalg.pinv(jacobian, rcond=_CUT) @ missed
        if np.any(v):
            path = geodesic_from_velocity(metric, q0, v)
            back = Path(metric, path.grid, path.nodes[::-1])  # its grids are symmetric
            step = parallel_transport(metric, back, step)
        share = 1.0
        for _ in range(_HALVINGS):
            try:
                new = exp(metric, q0, v + share * step)
                new_missed = target.miss(new)
            except IntegrationFailed:
                new_missed = np.full(6, np.inf)
            if np.linalg.norm(new_missed) < size:
                break
            share /= 2.0
        else:
            return Found(v, iteration, False, "no step along the gradient brings the hand nearer")
        v, end, missed = v + share * step, new, new_missed
        if size - np.linalg.norm(missed) <= _DONE * size:
            return Found(v, iteration + 1, True, "the hand comes no nearer")
    return Found(v, _ITERATIONS, False, "too many iterations")
