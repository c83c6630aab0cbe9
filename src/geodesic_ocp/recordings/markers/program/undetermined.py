"""Joints whose angles the markers do not determine."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.markers.program.fit_problem import FitProblem

_LEVER = 0.004  # [m/rad]: what moves no marker by more is not determined
_PART = 0.3  # of a joint in such a motion of unit length
_FRAMES = 50


def undetermined_joints(
    problem: FitProblem, z: Array, shared: Array, weights: Array
) -> NDArray[np.bool_]:
    """Which joints (n,) can move, alone or along with others, without moving the markers.

    Joints that do so in at least half of the frames, of which up to 50 are considered.

    Args:
        problem: of the fit.
        z: variables of the frames (k, nz).
        shared: variables of all frames (ns,).
        weights: of the markers (k, m); NaN where missing.
    """
    rows = np.unique(np.linspace(0, len(weights) - 1, _FRAMES).round().astype(int))
    votes = np.zeros(problem.body.model.dof)
    for row in rows:
        weight = np.repeat(np.nan_to_num(weights[row]), 3)
        jacobian = problem.terms.slopes(z[row], shared)[1].full()
        moves, vectors = np.linalg.eigh((jacobian.T * weight) @ jacobian)
        free = vectors[problem.first_joint :, moves < _LEVER**2]
        votes += np.linalg.norm(free, axis=1) > _PART
    return np.asarray(votes >= rows.size / 2)
