"""The angles of single frames, each from its neighbour's: where the fit of all frames starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.markers.fit_program import FitProblem

_STARTS = 40
_STEPS = 60
_ENOUGH = 1e-6  # relative decrease at which a frame's angles are good enough
_PULL = 1e-2  # towards the start of a search, relative to the markers' weight


@dataclass(frozen=True, eq=False)
class FrameSearch:
    """Angles of single frames by damped least squares (Levenberg, Marquardt) within the limits.

    The shared variables are zero.
    """

    problem: FitProblem
    outlier: float  # [m], see `fit_markers`

    def nearest(self, start: Array, observed: Array) -> tuple[Array, float]:
        """Return angles near a start (nz,) for observed positions (m, 3), their loss per marker
        [m^2].
        """
        seen = ~np.isnan(observed[:, 0])
        if not seen.any():
            return start, np.inf
        rows = np.repeat(seen, 3)
        wanted = np.nan_to_num(observed).ravel()
        (lower, upper) = self.problem.limits
        pull = _PULL * self.problem.settings.noise**2
        shared = np.zeros(self.problem.ns)
        damping = 1e-2
        best = np.inf
        z = start
        trial = start
        for _ in range(_STEPS):
            positions, slopes = self.problem.slopes(trial, shared)
            residual = np.where(rows, positions.full()[:, 0] - wanted, 0.0)
            squares = (residual.reshape(-1, 3) ** 2).sum(axis=1)
            loss = float(np.sum(squares / (1.0 + squares / self.outlier**2)))
            loss += pull * float(((trial - start) ** 2).sum())
            if loss < best:
                decrease = best - loss
                best = loss
                z = trial
                if decrease < _ENOUGH * best:
                    break
                damping /= 3.0
                jacobian = slopes.full()
                weight = seen / (1.0 + squares / self.outlier**2) ** 2
                weighted = jacobian.T * np.repeat(weight, 3)
                matrix = weighted @ jacobian + pull * np.eye(z.size)
                slope = weighted @ residual + pull * (z - start)
            else:
                damping *= 4.0
                if damping > 1e6:
                    break
            size = damping * (1e-3 * np.trace(matrix) / z.size + np.diag(matrix))
            # Joints at a bound that the step would cross are held.
            held = ((z <= lower) & (slope > 0)) | ((z >= upper) & (slope < 0))
            moving = np.flatnonzero(~held)
            change = np.zeros(z.size)
            block = matrix[np.ix_(moving, moving)] + np.diag(size[moving])
            change[moving] = -np.linalg.solve(block, slope[moving])
            trial = np.clip(z + change, lower, upper)
        return z, best / float(seen.sum())

    def anew(self, z: Array, observed: Array, seed: int = 0) -> tuple[Array, float]:
        """Return the best angles from many starts within the limits."""
        random = np.random.default_rng(seed)
        first = self.problem.first_joint
        low, high = np.clip(self.problem.limits[:, first:], -np.pi, np.pi)
        found = []
        for index in range(_STARTS):
            # The first starts are near the middle of the ranges, where people's arms mostly are.
            spread = min(1.0, 0.1 + index / _STARTS) * random.uniform(-1.0, 1.0, low.size)
            joints = (low + high) / 2.0 + spread * (high - low) / 2.0
            found.append(self.nearest(np.concatenate([z[:first], joints]), observed))
        return min(found, key=lambda pair: pair[1])

    def along(self, guesses: Array, observed: Array) -> Array:
        """Return angles of frames (k, nz), each from its neighbour's, and anew where that is much
        better.

        `guesses` (k, nz) gives the root.
        """
        seen = ~np.isnan(observed[:, :, 0])
        first = int(np.argmax(seen.sum(axis=1)))
        result = guesses.copy()
        result[first], loss = self.anew(guesses[first], observed[first])
        typical = max(loss, self.problem.settings.noise**2)
        of_root = slice(self.problem.first_joint)
        for k in [*range(first + 1, len(guesses)), *range(first - 1, -1, -1)]:
            start = result[k - 1 if k > first else k + 1].copy()
            start[of_root] = guesses[k, of_root]
            result[k], loss = self.nearest(start, observed[k])
            if np.isfinite(loss) and loss > 10.0 * typical:
                other, better = self.anew(start, observed[k], seed=k)
                if better < 0.3 * loss:
                    result[k] = other
        return result
