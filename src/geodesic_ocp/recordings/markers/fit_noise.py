"""Errors of fitted angles that the markers' own errors make: surrogates of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.recordings.markers.fit_program import FitProblem

_HELD = 1e8  # stiffness of a joint at its limit, relative to that of the markers [1/rad^2]
_AT_LIMIT = 1e-4  # [rad or m]


@dataclass(frozen=True, eq=False, repr=False)
class FitNoise(ShortRepr):
    """Errors of fitted angles, of which each marker makes its share.

    The distances of a marker from its fitted places, r_m(t) without their mean, are skin that moves
    and noise of the cameras, with their own course in time. In the fit the pulls of all markers
    cancel. With other signs they do not: to first order, the fit to the fitted places plus s_m r_m,
    s_m = +1 or -1, differs by sum_m s_m times the response of the angles to r_m, as smooth as the
    fit is (wild bootstrap; Wu, The Annals of Statistics 14, 1986).

    Attributes:
        responses: of the angles to the errors of each marker (k, n, m) [rad or m].
    """

    responses: Array

    def draw(self, random: np.random.Generator) -> Array:
        """Return errors of the angles (k, n), others at each call."""
        result: Array = self.responses @ random.choice([-1.0, 1.0], self.responses.shape[2])
        return result


def fit_noise(
    problem: FitProblem,
    time: Array,
    z: Array,
    shared: Array,
    residuals: Array,
    weights: Array,
    loose: NDArray[np.bool_],
) -> FitNoise:
    """Return the errors of the angles that residuals stand for, the shared variables as they are.

    Args:
        problem: problem of the fit.
        time: (k,) [s].
        z: variables of the frames (k, nz).
        shared: variables of all frames (ns,).
        residuals: fitted minus observed positions (k, m, 3) [m], NaN where missing.
        weights: that the markers kept (k, m); NaN where missing.
        loose: joints that the markers do not determine (n,).
    """
    count, markers = weights.shape
    changing = np.nan_to_num(residuals - np.nanmean(residuals, axis=0))
    # Least squares leave less than there was, by the degrees of freedom.
    seen = 3.0 * float(np.sum(np.nan_to_num(weights))) / count
    changing *= np.sqrt(seen / max(seen - problem.nz, 0.1 * seen))
    shares = np.convolve(np.diff(time), [0.5, 0.5])
    weighted = np.nan_to_num(weights) * shares[:, None] / problem.settings.noise**2
    blocks = np.empty((count, problem.nz, problem.nz))
    pulls = np.empty((count, problem.nz, markers))
    for k in range(count):
        slopes = problem.slopes(z[k], shared)[1].full().reshape(markers, 3, problem.nz)
        blocks[k] = np.einsum("m,mdi,mdj->ij", weighted[k], slopes, slopes)
        pulls[k] = np.einsum("m,mdi,md->im", weighted[k], slopes, changing[k])
    lower, upper = problem.limits
    if problem.settings.limits:
        at_limit = (z < lower + _AT_LIMIT) | (z > upper - _AT_LIMIT)
        blocks += at_limit[:, :, None] * np.eye(problem.nz) * _HELD * shares[:, None, None]
    matrix = scipy.sparse.block_diag(blocks) + problem.stiffness(time, loose)[0]
    moved = scipy.sparse.linalg.splu(matrix.tocsc()).solve(pulls.reshape(-1, markers))
    return FitNoise(moved.reshape(count, problem.nz, markers)[:, problem.first_joint :])
