"""What markers leave open: joints that they do not determine, constant errors, and noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.recordings.markers.fit_program import LOOSE_SPREAD, PRIOR_TIME, FitProblem
from geodesic_ocp.recordings.markers.markers import evenly

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


_FRAMES = 50  # that are considered
_LEVER = 0.004  # [m/rad]: what moves no marker by more is not determined
_PART = 0.3  # of a joint in such a motion of unit length


def undetermined_joints(
    problem: FitProblem, z: Array, shared: Array, kept: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which joints (n,) can move, alone or with others, without moving the markers that are
    kept.

    Joints that do so in at least half of the frames, of which up to 50 are considered.

    Args:
        z: variables of the frames (k, nz).
        shared: variables of all frames (ns,).
        kept: which markers are seen and near their places (k, m).
    """
    rows = evenly(len(z), _FRAMES)
    votes = np.zeros(problem.body.model.dof)
    for row in rows:
        jacobian = problem.slopes(z[row], shared)[1].full()[np.repeat(kept[row], 3)]
        moves, vectors = np.linalg.eigh(jacobian.T @ jacobian)
        free = vectors[problem.first_joint :, moves < _LEVER**2]
        votes += np.linalg.norm(free, axis=1) > _PART
    return np.asarray(votes >= rows.size / 2)


def constant_errors(
    problem: FitProblem, time: Array, z: Array, shared: Array, weights: Array
) -> Array:
    """Return standard deviations [rad] of the mean over time of the joints' errors (n,).

    They follow, to first order, from the uncertainty of the places of markers in the marker set:
    as it is where offsets are not estimated, else as the fit leaves it. Up to 50 frames are
    considered.

    Args:
        time: (k,) [s].
        z: variables of the frames (k, nz).
        shared: variables of all frames (ns,).
        weights: weights of the markers (k, m); NaN where missing.
    """
    noise = problem.settings.noise
    estimated = problem.settings.offsets
    if not estimated:
        problem = replace(problem, settings=replace(problem.settings, offsets=True))
        shared = np.concatenate([shared, np.zeros(problem.ns - shared.size)])
    if not problem.ns:
        return np.zeros(problem.body.model.dof)
    *symbols, points = problem.frame
    slopes = [ca.densify(ca.jacobian(ca.vec(points), each)) for each in symbols]
    at = ca.Function("slopes", symbols, [ca.cse(each) for each in slopes])
    weak = np.full(problem.nz, (noise / LOOSE_SPREAD) ** 2)
    weak[: problem.first_joint] = 1e-12
    carried = np.zeros((problem.nz, problem.ns))
    told = np.zeros((problem.ns, problem.ns))
    rows = evenly(len(z), _FRAMES)
    for row in rows:
        by_z, by_shared = (each.full() for each in at(z[row], shared))
        weight = np.repeat(np.nan_to_num(weights[row]), 3)[:, None]
        normal = by_z.T @ (weight * by_z) + np.diag(weak)
        # The angles follow a change of the shared variables so that markers stay where they are.
        follow = np.linalg.solve(normal, by_z.T @ (weight * by_shared))
        carried += follow / rows.size
        told += by_shared.T @ (weight * (by_shared - by_z @ follow)) / rows.size
    information = problem.priors
    if estimated:
        scale = float(time[-1] - time[0]) / PRIOR_TIME / noise**2
        information = information + scale * (told + told.T) / 2.0
    variance = np.einsum("is,si->i", carried, np.linalg.solve(information, carried.T))
    return np.asarray(np.sqrt(variance[problem.first_joint :]))
