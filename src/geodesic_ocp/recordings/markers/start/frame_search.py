"""Where the fit of a motion to markers starts: pose of the root, and angles frame after frame."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array

_STARTS, _STEPS = 40, 60
_ENOUGH = 1e-6  # relative decrease at which a frame's angles are good enough


def rigid_poses(places: Array, observed: Array, time: Array) -> tuple[Array, Array]:
    """Rotations (k, 3, 3) and positions (k, 3) that place points on a rigid body's observed ones.

    By least squares in every frame with three points seen or more (Kabsch, Acta Crystallographica A
    32, 1976), in the others interpolated.

    Args:
        places: of the points on the body (m, 3) [m].
        observed: (k, m, 3) [m], NaN where missing.
        time: (k,) [s].

    Raises:
        ValueError: no frame shows three points that are not in line.
    """
    rotations, positions = np.zeros((time.size, 3, 3)), np.zeros((time.size, 3))
    known = np.zeros(time.size, dtype=bool)
    for k, seen in enumerate(~np.isnan(observed[:, :, 0])):
        if seen.sum() < 3:
            continue
        own, there = places[seen], observed[k, seen]
        left, right = own - own.mean(axis=0), there - there.mean(axis=0)
        u, sizes, v = np.linalg.svd(left.T @ right)
        if sizes[1] < 1e-4 * sizes[0]:
            continue
        flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))])
        rotations[k] = v.T @ flip @ u.T
        positions[k] = there.mean(axis=0) - rotations[k] @ own.mean(axis=0)
        known[k] = True
    if not known.any():
        raise ValueError(
            "base='free' needs three markers of the thorax (of the model's base) in one frame at "
            "least, not in line; give positions in the base's axes and base='fixed' otherwise"
        )
    at = np.clip(time, time[known][0], time[known][-1])
    if known.sum() == 1:
        return np.repeat(rotations[known], time.size, 0), np.repeat(positions[known], time.size, 0)
    turning = scipy.spatial.transform.Slerp(
        time[known], scipy.spatial.transform.Rotation.from_matrix(rotations[known])
    )
    moving = [np.interp(at, time[known], positions[known, axis]) for axis in range(3)]
    return turning(at).as_matrix(), np.stack(moving, axis=1)


@dataclass(frozen=True, eq=False)
class FrameSearch:
    """Angles of single frames by damped least squares (Levenberg, Marquardt) within bounds.

    Attributes:
        slopes: (z, shared) -> positions (3 m, 1), derivatives by z (3 m, nz).
        shared: values of the shared variables.
        lower, upper: bounds of z (nz,), infinite if there are none.
        joints: which of the z are angles to be sought in all of their range (nz,).
        noise, outlier: [m], see `fit_motion`.
    """

    slopes: ca.Function
    shared: Array
    lower: Array
    upper: Array
    joints: NDArray[np.bool_]
    noise: float
    outlier: float

    def nearest(self, z: Array, observed: Array, pull: float = 1e-2) -> tuple[Array, float]:
        """Angles near z (nz,) for observed positions (m, 3), and their loss per marker [m^2]."""
        seen = ~np.isnan(observed[:, 0])
        rows, wanted = np.repeat(seen, 3), np.where(np.isnan(observed), 0.0, observed).ravel()
        lower, upper, start = self.lower, self.upper, z
        if not seen.any():
            return z, np.inf
        damping, best = 1e-2, np.inf
        step_from: tuple[Array, Array] | None = None
        trial = z
        for _ in range(_STEPS):
            positions, slopes = self.slopes(trial, self.shared)
            residual = np.where(rows, positions.full()[:, 0] - wanted, 0.0)
            squares = (residual.reshape(-1, 3) ** 2).sum(axis=1)
            loss = float(np.sum(squares / (1.0 + squares / self.outlier**2)))
            loss += self.noise**2 * pull * float(((trial - start) ** 2).sum())
            if loss < best:
                decrease, best, z = best - loss, loss, trial
                damping /= 3.0
                weight = np.repeat(seen / (1.0 + squares / self.outlier**2) ** 2, 3)
                jacobian = slopes.full()
                normal = (jacobian.T * weight) @ jacobian
                slope = (jacobian.T * weight) @ residual
                extra = self.noise**2 * pull
                step_from = normal + extra * np.eye(z.size), slope + extra * (z - start)
                if decrease < _ENOUGH * best:
                    break
            else:
                damping *= 4.0
                if damping > 1e6:
                    break
            assert step_from is not None
            matrix, slope = step_from
            size = damping * (1e-3 * np.trace(matrix) / z.size + np.diag(matrix))
            # Joints at a bound that the step would cross are held.
            held = ((z <= lower) & (slope > 0)) | ((z >= upper) & (slope < 0))
            change = np.zeros(z.size)
            if not held.all():
                moving = np.flatnonzero(~held)
                block = matrix[np.ix_(moving, moving)] + np.diag(size[moving])
                change[moving] = -np.linalg.solve(block, slope[moving])
            trial = np.clip(z + change, lower, upper)
        return z, best / float(seen.sum())

    def anew(self, z: Array, observed: Array, seed: int = 0) -> tuple[Array, float]:
        """The best angles from many starts within the bounds."""
        random, columns = np.random.default_rng(seed), np.flatnonzero(self.joints)
        low = np.maximum(self.lower[columns], -np.pi)
        high = np.minimum(self.upper[columns], np.pi)
        found = []
        for index in range(_STARTS):
            start = z.copy()
            # The first starts are near the middle of the ranges, where people's arms mostly are.
            spread = min(1.0, 0.1 + index / _STARTS)
            middle, half = (low + high) / 2.0, (high - low) / 2.0
            start[columns] = middle + spread * half * random.uniform(-1.0, 1.0, columns.size)
            found.append(self.nearest(start, observed))
        return min(found, key=lambda pair: pair[1])

    def along(self, guesses: Array, observed: Array) -> Array:
        """Angles of frames (k, nz), each from its neighbour's, and anew where that is much better.

        `guesses` (k, nz) gives the root.
        """
        seen = ~np.isnan(observed[:, :, 0])
        first = int(np.argmax(seen.sum(axis=1)))
        result = guesses.copy()
        result[first], loss = self.anew(guesses[first], observed[first])
        typical = max(loss, self.noise**2)
        forwards, backwards = range(first + 1, len(guesses)), range(first - 1, -1, -1)
        for order, step in ((forwards, -1), (backwards, 1)):
            for k in order:
                start = np.where(self.joints, result[k + step], guesses[k])
                result[k], loss = self.nearest(start, observed[k])
                if np.isfinite(loss) and loss > 10.0 * typical:
                    other, better = self.anew(start, observed[k], seed=k)
                    if better < 0.3 * loss:
                        result[k] = other
        return result
