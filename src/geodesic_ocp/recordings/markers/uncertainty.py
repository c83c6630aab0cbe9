"""What the markers leave open: joints that they do not determine, and constant errors."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.markers.fit_program import LOOSE_SPREAD, PRIOR_TIME, FitProblem
from geodesic_ocp.recordings.markers.markers import evenly

_FRAMES = 50  # that are considered
_LEVER = 0.004  # [m/rad]: what moves no marker by more is not determined
_PART = 0.3  # of a joint in such a motion of unit length


def undetermined_joints(
    problem: FitProblem, z: Array, shared: Array, seen: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which joints (n,) can move, alone or along with others, without moving the markers.

    Joints that do so in at least half of the frames, of which up to 50 are considered.

    Args:
        problem: of the fit.
        z: variables of the frames (k, nz).
        shared: variables of all frames (ns,).
        seen: which markers are (k, m).
    """
    rows = evenly(len(z), _FRAMES)
    votes = np.zeros(problem.body.model.dof)
    for row in rows:
        jacobian = problem.slopes(z[row], shared)[1].full()[np.repeat(seen[row], 3)]
        moves, vectors = np.linalg.eigh(jacobian.T @ jacobian)
        free = vectors[problem.first_joint :, moves < _LEVER**2]
        votes += np.linalg.norm(free, axis=1) > _PART
    return np.asarray(votes >= rows.size / 2)


def constant_errors(
    problem: FitProblem, time: Array, z: Array, shared: Array, weights: Array
) -> Array:
    """Standard deviations [rad] of the mean over time of the joints' errors (n,).

    They follow, to first order, from the uncertainty of the places of markers in the marker set:
    as it is where offsets are not estimated, else as the fit leaves it. Up to 50 frames are
    considered.

    Args:
        problem: of the fit.
        time: (k,) [s].
        z: variables of the frames (k, nz).
        shared: variables of all frames (ns,).
        weights: of the markers (k, m); NaN where missing.
    """
    noise, estimated = problem.settings.noise, problem.settings.offsets
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
    carried, told = np.zeros((problem.nz, problem.ns)), np.zeros((problem.ns, problem.ns))
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
