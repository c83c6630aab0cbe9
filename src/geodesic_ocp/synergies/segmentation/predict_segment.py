"""The configurations that one segment of a motion predicts, without building its synergy.

What `reconstruct` gives at the observed times, at a third of the cost: a geodesic has constant
speed, so that the configuration at the distance s(t) is the one at the fraction s(t) / length of
its parameter, and neither arc lengths nor velocities are needed.
"""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.logarithm.connecting_geodesic import CHECK_TOLERANCE, ConnectingGeodesic
from geodesic_ocp.logarithm.log import log
from geodesic_ocp.manifold.exp import integrate_geodesic
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.synergies.reconstruct import law_of_segment
from geodesic_ocp.trajectory.motion import Motion

# Accuracy of the interpolated velocity, relative to the largest, as of the paths of `geodesic`.
_RESOLVED = 1e-6


def predict_segment(metric: Metric, motion: Motion, speed: Array, start: int, stop: int) -> Array:
    """Configurations (stop - start + 1, n) at the samples from start to stop.

    Args:
        metric: whose geodesic connects the observed configurations at the two ends.
        motion: observed.
        speed: its speeds |q'|_G at the samples (k,).
        start, stop: indices of the first and the last sample.

    Raises:
        NotConverged, IntegrationFailed: no geodesic was found, or it cannot be sampled.
    """
    q0, q1 = motion.q[start], motion.q[stop]
    velocity = log(metric, q0, q1)
    length = float(metric.norm(q0, velocity))
    samples = motion.time[start : stop + 1]
    if not length > 0.0:
        return np.tile(q0, (samples.size, 1))
    law = law_of_segment(motion, speed, length, start, stop)
    covered = np.clip(law(samples - samples[0]) / length, 0.0, 1.0)
    if metric.has_constant_tensor:
        return np.asarray(q0 + np.outer(covered, velocity))
    return _along(metric, ConnectingGeodesic(q0, q1, velocity), covered)


def _along(metric: Metric, found: ConnectingGeodesic, s: Array) -> Array:
    """Positions (k, n) of a geodesic at parameters s (k,), interpolated between its nodes."""
    for grid in found.grids:
        nodes, velocities = integrate_geodesic(
            metric, found.q0, found.velocity, grid.nodes, CHECK_TOLERANCE
        )
        nodes[-1] = found.q1
        by_segment = grid.in_segments(nodes)
        slopes = grid.differentiation @ by_segment
        error = np.abs(slopes - grid.in_segments(velocities)).max()
        rounding = np.finfo(float).eps * np.abs(grid.differentiation).max() * np.abs(nodes).max()
        if error <= _RESOLVED * np.abs(velocities).max() + 10.0 * rounding:
            return grid.interpolate(by_segment, s)
    raise NotConverged(
        f"the geodesic from {found.q0} to {found.q1} bends too sharply to be sampled"
    )
