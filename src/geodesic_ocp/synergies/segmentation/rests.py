"""Where an observed motion rests."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.synergies.segmentation.cuts_by_transport import IN_LONG_REST
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import speeds_at

# Below twice the speed of the noise, the direction of a velocity says next to nothing.
_OF_NOISE = 2.0
_SAMPLES = 32  # at which the speed of the noise is averaged


def noise_speed(metric: Metric, motion: Motion) -> float:
    """Root mean square speed |q'|_G of the noise that the filter left; 0 if it is not known.

    With noise of standard deviations sigma_i of the joints' velocities, independent of each other,
    its mean square is sum_i G_ii sigma_i^2.
    """
    if motion.filter is None:
        return 0.0
    at = np.unique(np.linspace(0, len(motion) - 1, _SAMPLES).round().astype(int))
    each = [
        speeds_at(metric, motion.q[at], np.tile(vector, (at.size, 1)))
        for vector in np.diag(motion.filter.velocity_noise)
    ]
    return float(np.sqrt(np.mean(np.sum(np.square(each), axis=0))))


def states(times: Array, speed: Array, level: float, rest_duration: float) -> np.ndarray:
    """State (m,) of every instant: moving, at rest at most at this speed, or in a long rest."""
    at_rest = speed <= level
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at_rest.astype(int), [0]])))
    result = at_rest.astype(np.uint8)
    for first, after in edges.reshape(-1, 2):
        if times[min(after, times.size - 1)] - times[first] >= rest_duration:
            result[first:after] = IN_LONG_REST
    return result


def rest_level(metric: Metric, motion: Motion, speed: Array, rest: float) -> float:
    """Speed up to which the motion rests."""
    level = rest * float(speed.max())
    return max(level, _OF_NOISE * noise_speed(metric, motion)) if rest > 0.0 else level
