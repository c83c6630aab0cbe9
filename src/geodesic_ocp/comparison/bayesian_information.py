"""How many synergies are worth having: the Bayesian information criterion of a reconstruction."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.trajectory.motion import Motion

_LEAST_NOISE = 1e-6  # [rad or m]: the rounding of recordings
_NORMAL_MEDIAN = 0.6745  # median of the absolute value of a standard normal variable


def bayesian_information(
    residuals: Array, segments: int, noise: Array, independent_samples: float
) -> float:
    """BIC of a motion that is reconstructed from segments; the smallest of several is best.

    M sum_j (log s_j^2 + mean(r_j^2) / s_j^2) + k (n + 2) log(M n)

    for Gaussian residuals r_j of joint j with variance s_j^2 = max(mean(r_j^2), sigma_j^2), where
    nothing below the noise sigma_j counts as explained. The k segments have n + 2 parameters each:
    the configuration, the time and the speed at their ends (Schwarz, "Estimating the dimension of a
    model", The Annals of Statistics 6, 1978).

    Args:
        residuals: predicted minus observed coordinates (samples, n).
        segments: their number k.
        noise: standard deviations sigma (n,) of the noise in the observed coordinates.
        independent_samples: M, of every joint, which is less than the number of samples after a
            low-pass filter.
    """
    joints = residuals.shape[1]
    squares = np.mean(residuals**2, axis=0)
    variances = np.maximum(squares, noise**2)
    misfit = independent_samples * float(np.sum(np.log(variances) + squares / variances))
    parameters = segments * (joints + 2)
    return float(misfit + parameters * np.log(independent_samples * joints))


def noise_left(motion: Motion, noise: ArrayLike | None, frequency: float) -> Array:
    """Standard deviations (n,) of the noise in the coordinates: as given, or estimated.

    White noise of standard deviation sigma before a filter of bandwidth f leaves
    sigma sqrt(2 f / rate). Without a record of the filter, sigma comes from second differences of
    the coordinates, as they are.

    Raises:
        ValueError: noise is neither one nor n numbers, or not positive.
    """
    joints = len(motion.joint_names)
    if noise is not None:
        given = np.asarray(noise, dtype=float)
        if given.shape not in ((), (joints,)) or not np.all(np.isfinite(given) & (given > 0.0)):
            raise ValueError(f"noise must be one or {joints} positive numbers, got {noise!r}")
        return np.asarray(np.broadcast_to(given, joints), dtype=float)
    if motion.filter is not None:
        left = motion.filter.noise * np.sqrt(min(1.0, 2.0 * frequency / motion.rate))
    else:
        second = np.abs(np.diff(motion.q, 2, axis=0))
        left = np.median(second, axis=0) / (_NORMAL_MEDIAN * np.sqrt(6.0))
    return np.asarray(np.maximum(left, _LEAST_NOISE))
