"""An observed motion between its samples."""

from __future__ import annotations

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.trajectory.motion import Motion

_LONGEST = 0.005  # [s]


def parts_of_steps(motion: Motion) -> int:
    """Parts of every step between two samples, so that none is longer than 5 ms."""
    return max(1, int(np.ceil(np.diff(motion.time).max() / _LONGEST - 0.01)))


def nearest_samples(motion: Motion, times: Array) -> list[int]:
    """The samples nearest to these times, in order and without repetition."""
    middles = 0.5 * (motion.time[:-1] + motion.time[1:])
    samples: list[int] = np.unique(np.searchsorted(middles, times)).tolist()
    return samples


def times_between(motion: Motion, parts: int) -> Array:
    """Times (m,) of the samples and, with every step between two in equal parts, between them."""
    steps = np.diff(motion.time)[:, None]
    between = motion.time[:-1, None] + steps * (np.arange(parts) / parts)
    return np.append(between.ravel(), motion.time[-1])


def velocity_between(motion: Motion, velocity: Array, times: Array) -> Array:
    """Velocities (m, n) at these times from those of the samples.

    A filtered motion has no high frequencies, and a cubic spline through its velocities follows it
    closely. Other velocities may jump from one sample to the next: they are interpolated linearly.
    """
    if motion.filter is not None:
        result: Array = scipy.interpolate.CubicSpline(motion.time, velocity)(times)
        return result
    return np.column_stack([np.interp(times, motion.time, column) for column in velocity.T])
