"""What the next round of a program has to mind, from a dense check of the round before."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Indices
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.program.dense_check import TOLERANCE, ArmCheck
from geodesic_ocp.execution.program.trajectory_program import TrajectoryProgram
from geodesic_ocp.execution.program.variable_bounds import INSIDE
from geodesic_ocp.execution.program.watched import Watched, WatchedArm, WatchedDistances

# Shares of the limits, one and [rad] for positions, from which on a limit is minded as well where
# it is exceeded elsewhere.
_NEAR = {"velocity": 0.98, "position": 1.0 - 0.01, "jerk": 0.2}
_NEAR_TORQUE, _NEAR_DISTANCE = 0.85, 0.01  # a share, and [m]
_MORE, _ROUNDING = 1.2, 2e-6  # what lies between knots is corrected by a little more


def watched_at_first(
    program: TrajectoryProgram, durations: Array, clearances: Sequence[Clearance]
) -> Watched:
    """Jerks of joints that take longer than a piece to reach their accelerations, and no more.

    Args:
        program: with its knots.
        durations: of the intervals (m,) [s].
        clearances: distances to be kept.
    """
    count, given = program.knots.count + 1, program.fixed_knots[:, None]
    steps, arms = np.diff(program.knots.times(durations))[:, None], []
    for terms in program.terms:
        slow = np.argwhere(terms.arm.limits.jerk * steps < terms.acceleration_unit)
        pieces = {"jerk": slow} if slow.size else {}
        shares = np.full((count, terms.dof), 1.0 - INSIDE)
        arms.append(WatchedArm(pieces, np.zeros(0, dtype=np.int64), shares))
    distances = [
        WatchedDistances(each, {}, np.where(given, -np.inf, each.lower)) for each in clearances
    ]
    return Watched(tuple(arms), tuple(distances))


def tightened(watched: Watched, checks: Sequence[ArmCheck], distances: Sequence[Array]) -> Watched:
    """The constraints of the next round.

    Args:
        watched: those of the last round.
        checks: of its result.
        distances: in every piece (pieces, samples, m) [m], of each clearance.
    """
    arms = [_arm(each, check) for each, check in zip(watched.arms, checks, strict=True)]
    kept = [_kept(each, at) for each, at in zip(watched.clearances, distances, strict=True)]
    return Watched(tuple(arms), tuple(kept))


def _arm(watched: WatchedArm, check: ArmCheck) -> WatchedArm:
    pieces = dict(watched.pieces)
    for kind, near in _NEAR.items():
        shares = check.pieces[kind]
        if shares.max() > 1.0 + TOLERANCE:
            known = pieces.get(kind, np.zeros((0, 2), dtype=np.int64))
            pieces[kind] = np.unique(np.vstack([known, np.argwhere(shares > near)]), axis=0)
    largest = check.torques.max(axis=1)  # of pieces (k, n)
    if largest.max() <= 1.0 + TOLERANCE:
        return WatchedArm(pieces, watched.torques, watched.torque_shares)
    at_knots = np.concatenate([check.torques[:, 0], check.torques[-1:, -1]])
    between = np.flatnonzero(largest.max(axis=1) > 1.0)
    close = np.flatnonzero(at_knots.max(axis=1) > _NEAR_TORQUE)
    knots = np.unique(np.concatenate([watched.torques, close, between, between + 1]))
    # Torques at knots will keep the limit; what is larger in between has to be taken off.
    ends = np.maximum(np.maximum(at_knots[:-1], at_knots[1:]), 1.0 - INSIDE)
    excess = np.where(largest > 1.0, _MORE * (largest - ends) + _ROUNDING, 0.0)
    less = 1.0 - np.minimum(_at_both_ends(excess), 0.5)
    return WatchedArm(pieces, knots, watched.torque_shares * less)


def _kept(watched: WatchedDistances, found: Array) -> WatchedDistances:
    """Distances to keep from now on, given those that were found (pieces, samples, m)."""
    wanted, least = watched.clearance.lower, found.min(axis=1)
    at_knots = np.concatenate([found[:, 0], found[-1:, -1]])
    short = least < wanted - TOLERANCE
    near = (at_knots < wanted + _NEAR_DISTANCE) | (_at_both_ends(short) > 0.0)
    knots = dict(watched.knots)
    for index in np.flatnonzero(short.any(axis=0)).tolist():
        known: Indices = knots.get(index, np.zeros(0, dtype=np.int64))
        knots[index] = np.union1d(known, np.flatnonzero(near[:, index]))
    # Distances at knots will keep their bounds; what is smaller in between is added to these.
    ends = np.minimum(np.minimum(at_knots[:-1], at_knots[1:]), wanted)
    lack = np.where(short, _MORE * (ends - least) + _ROUNDING, 0.0)
    return WatchedDistances(watched.clearance, knots, watched.lower + _at_both_ends(lack))


def _at_both_ends(of_pieces: Array) -> Array:
    """At the knots, the larger one of two successive pieces."""
    none = np.zeros((1, of_pieces.shape[1]))
    return np.maximum(np.vstack([of_pieces, none]), np.vstack([none, of_pieces]))
