"""What the next round of a program has to mind, from a dense check of the round before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.clearance_constraint import Clearance
from geodesic_ocp.execution.program.blocks import Indices
from geodesic_ocp.execution.program.dense_check import TOLERANCE, ArmCheck, distances
from geodesic_ocp.execution.program.joint_spline import JointSpline
from geodesic_ocp.execution.program.watched import Watched, WatchedDistance

_NEAR = {"velocity": 0.98, "position": 1.0 - 0.01, "jerk": 0.5}
_NEAR_TORQUE = 0.85
_NEAR_DISTANCE = 0.01  # [m]
_MORE, _ROUNDING = 1.2, 2e-6


@dataclass(frozen=True, eq=False)
class Tightening:
    """Constraints of a program, and bounds that keep what lies between knots within the limits.

    Attributes:
        watched: constraints.
        torque_shares: of the limits that torques may reach at the knots, (knots, n) of each arm.
        lower: bounds of distances at the knots (knots, m) [m], of each clearance.
    """

    watched: Watched
    torque_shares: tuple[Array, ...]
    lower: tuple[Array, ...]

    def after(
        self,
        checks: Sequence[ArmCheck],
        splines: Sequence[JointSpline],
        clearances: Sequence[Clearance],
    ) -> tuple[Tightening, float, str]:
        """The next round's, the largest excess over any limit, and what exceeds it."""
        pieces, torques, shares = [], [], []
        worst = max((check.worst for check in checks), key=lambda pair: pair[0])
        for k, check in enumerate(checks):
            kinds = dict(self.watched.pieces[k])
            for kind, near in _NEAR.items():
                values = check.pieces[kind]
                if values.max() > 1.0 + TOLERANCE:
                    kinds[kind] = _united(kinds.get(kind), np.argwhere(values > near))
            pieces.append(kinds)
            knots, share = self._of_torques(k, check)
            torques.append(knots)
            shares.append(share)
        watched, lower = list(self.watched.distances), []
        for clearance, bounds in zip(clearances, self.lower, strict=True):
            found = distances(clearance, splines)
            lack = (clearance.lower - found).max(axis=(0, 1))
            if lack.max() > worst[0]:
                worst = float(lack.max()), f"the distance {clearance.names[int(lack.argmax())]}"
            more, bounds = _of_distances(clearance, found, bounds, watched)
            watched = more
            lower.append(bounds)
        after = Tightening(
            Watched(tuple(pieces), tuple(torques), tuple(watched)), tuple(shares), tuple(lower)
        )
        return after, *worst

    def _of_torques(self, k: int, check: ArmCheck) -> tuple[Indices, Array]:
        knots, shares = self.watched.torques[k], self.torque_shares[k]
        torques = check.torques
        inside = torques.max(axis=1)  # of pieces (k, n)
        if inside.max() <= 1.0 + TOLERANCE:
            return knots, shares
        at_knots = np.concatenate([torques[:, 0], torques[-1:, -1]])
        near = np.flatnonzero(at_knots.max(axis=1) > _NEAR_TORQUE)
        between = np.flatnonzero(inside.max(axis=1) > 1.0)
        near = _union(near, np.concatenate([between, between + 1]))
        excess = np.where(inside > 1.0, _MORE * (inside - 1.0) + _ROUNDING, 0.0)
        # Where the torque was not limited yet, only what the middle has beyond both knots counts.
        ends = np.maximum(at_knots[:-1], at_knots[1:])
        beyond = np.where(inside > 1.0, _MORE * (inside - np.maximum(ends, 1.0)) + _ROUNDING, 0.0)
        known = np.isin(np.arange(len(inside)), knots) & np.isin(np.arange(len(inside)) + 1, knots)
        excess = np.where(known[:, None], excess, beyond)
        less = np.zeros_like(shares)
        less[:-1] = excess
        less[1:] = np.maximum(less[1:], excess)
        return _union(knots, near), shares * (1.0 - np.minimum(less, 0.5))


def _of_distances(
    clearance: Clearance, found: Array, bounds: Array, watched: Sequence[WatchedDistance]
) -> tuple[list[WatchedDistance], Array]:
    """Distances to keep, and their bounds at the knots (knots, m)."""
    at_knots = np.concatenate([found[:, 0], found[-1:, -1]])
    lack = clearance.lower - found.min(axis=1)  # of pieces
    near = at_knots < clearance.lower + _NEAR_DISTANCE
    short = lack > TOLERANCE
    near[:-1] |= short
    near[1:] |= short
    ends = np.minimum(at_knots[:-1], at_knots[1:])
    # What the middle lacks beyond both knots; these will keep their bounds.
    deeper = np.minimum(ends, clearance.lower) - found.min(axis=1)
    more = np.where(short, _MORE * np.maximum(deeper, 0.0) + _ROUNDING, 0.0)
    raised = np.zeros_like(bounds)
    raised[:-1] = more
    raised[1:] = np.maximum(raised[1:], more)
    bounds = bounds + raised
    others = [each for each in watched if each.clearance is not clearance]
    own = {each.index: each.knots for each in watched if each.clearance is clearance}
    for index in np.flatnonzero(short.any(axis=0)):
        own[int(index)] = _union(own.get(int(index)), np.flatnonzero(near[:, index]))
    kept = [
        WatchedDistance(clearance, index, knots, bounds[knots, index])
        for index, knots in own.items()
    ]
    return others + kept, bounds


def _united(first: Indices | None, second: Indices) -> Indices:
    """Pairs (k, 2) in either of two sets."""
    return second if first is None else np.unique(np.concatenate([first, second]), axis=0)


def _union(first: Indices | None, second: Indices) -> Indices:
    return second if first is None else np.union1d(first, second)
