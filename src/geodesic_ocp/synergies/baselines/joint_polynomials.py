"""Kinematic baselines in joint space: minimum acceleration and minimum jerk."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.synergies.as_segments import as_segments
from geodesic_ocp.synergies.observed_velocity import observed_velocity
from geodesic_ocp.trajectory.motion import Motion


def minimum_acceleration(motion: Motion, segments: Sequence[tuple[int, int]]) -> Motion:
    """The motion that minimizes int |q''|^2 dt on every segment, between the observed ends.

    With configurations and velocities given at both ends it is a cubic in every joint. A geodesic
    receives less: two configurations and two speeds, but not the directions of the velocities.

    >>> import geodesic_ocp as go
    >>> import numpy as np
    >>> time = np.linspace(0.0, 1.0, 11)
    >>> cubic = go.Motion(time, time[:, None] ** 3, ("joint",), 3.0 * time[:, None] ** 2)
    >>> predicted = go.minimum_acceleration(cubic, [(0, 10)])
    >>> bool(np.allclose(predicted.q, cubic.q))
    True

    Args:
        motion: observed, with velocities.
        segments: (start, stop) sample indices, each starting where the one before stopped, from
            the first sample to the last.

    Returns:
        The predicted motion at the recording's own times, with velocities.

    Raises:
        ValueError: the segments do not cover the motion, or there are no velocities.
    """
    return _polynomials(motion, segments, [motion.q, observed_velocity(motion)])


def minimum_jerk(motion: Motion, segments: Sequence[tuple[int, int]]) -> Motion:
    """The motion that minimizes int |q'''|^2 dt on every segment, between the observed ends.

    With configurations, velocities and accelerations given at both ends it is a quintic in every
    joint (Flash and Hogan, J. Neuroscience 5, 1985, for a hand that starts and ends at rest).
    Accelerations are central differences of the motion's velocities. A geodesic receives less: two
    configurations and two speeds.

    >>> import geodesic_ocp as go
    >>> import numpy as np
    >>> time = np.linspace(0.0, 1.0, 101)
    >>> q = 10.0 * time**3 - 15.0 * time**4 + 6.0 * time**5  # from rest to rest
    >>> reach = go.Motion(time, q[:, None], ("joint",), 30.0 * (time * (1.0 - time))[:, None] ** 2)
    >>> predicted = go.minimum_jerk(reach, [(0, 100)])
    >>> bool(np.allclose(predicted.q, reach.q, atol=1e-3))
    True

    Args:
        motion: observed, with velocities, of at least three samples.
        segments: as in `minimum_acceleration`.

    Returns:
        The predicted motion at the recording's own times, with velocities.

    Raises:
        ValueError: the segments do not cover the motion, there are no velocities, or fewer than
            three samples.
    """
    velocity = observed_velocity(motion)
    return _polynomials(motion, segments, [motion.q, velocity, rates(motion, velocity)])


def rates(motion: Motion, values: Array) -> Array:
    """Derivatives (k, m) of sampled values (k, m) by time: central differences, second order.

    Raises:
        ValueError: the motion has fewer than three samples.
    """
    if len(motion) < 3:
        raise ValueError("accelerations need at least three samples, the motion has two")
    return np.asarray(np.gradient(values, motion.time, axis=0, edge_order=2))


def _polynomials(
    motion: Motion, segments: Sequence[tuple[int, int]], derivatives: Sequence[Array]
) -> Motion:
    """Polynomials on the segments with these derivatives, (k, n) each, at their ends."""
    edges = [0, *(stop for _, stop in as_segments(motion, segments))]
    at_edges = np.stack([values[edges] for values in derivatives], axis=1)
    curve = scipy.interpolate.BPoly.from_derivatives(motion.time[edges], at_edges)
    q, velocity = curve(motion.time), curve(motion.time, 1)
    return Motion(motion.time, q, motion.joint_names, velocity, motion.subject)
