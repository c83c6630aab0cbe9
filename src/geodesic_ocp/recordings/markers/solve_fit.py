"""The solution of a fit: frame after frame, and then from coarse to fine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.recordings.markers.fit_program import ROOT, FitProblem
from geodesic_ocp.recordings.markers.trunk import rigid_poses, without_stray
from geodesic_ocp.recordings.markers.uncertainty import undetermined_joints

_STARTS, _STEPS = 40, 60
_ENOUGH = 1e-6  # relative decrease at which a frame's angles are good enough
_PULL = 1e-2  # towards the start of a search, relative to the markers' weight
_COARSE_STEP = 0.05  # [s]
_WIDE = 0.2  # outlier size of the first solution, to which few markers are lost [m]
_ROUGHLY, _CLOSELY = 1e-5, 1e-6  # tolerances
_STEEP = 0.8  # sine of the root's angle in the middle, above which other axes are chosen
# Parts of a person that hardly move in the root, if that has fewer than three markers.
_TRUNK = ("pelvis", "abdomen", "thorax")


@dataclass(frozen=True, eq=False)
class FrameSearch:
    """Angles of single frames by damped least squares (Levenberg, Marquardt) within the limits.

    The shared variables are zero.

    Attributes:
        problem: of the fit.
        outlier: [m], see `fit_motion`.
    """

    problem: FitProblem
    outlier: float

    def nearest(self, start: Array, observed: Array) -> tuple[Array, float]:
        """Angles near a start (nz,) for observed positions (m, 3), their loss per marker [m^2]."""
        seen = ~np.isnan(observed[:, 0])
        if not seen.any():
            return start, np.inf
        rows, wanted = np.repeat(seen, 3), np.nan_to_num(observed).ravel()
        (lower, upper), pull = self.problem.limits, _PULL * self.problem.settings.noise**2
        shared = np.zeros(self.problem.ns)
        damping, best, z, trial = 1e-2, np.inf, start, start
        for _ in range(_STEPS):
            positions, slopes = self.problem.slopes(trial, shared)
            residual = np.where(rows, positions.full()[:, 0] - wanted, 0.0)
            squares = (residual.reshape(-1, 3) ** 2).sum(axis=1)
            loss = float(np.sum(squares / (1.0 + squares / self.outlier**2)))
            loss += pull * float(((trial - start) ** 2).sum())
            if loss < best:
                decrease, best, z = best - loss, loss, trial
                if decrease < _ENOUGH * best:
                    break
                damping /= 3.0
                jacobian, weight = slopes.full(), seen / (1.0 + squares / self.outlier**2) ** 2
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
            moving, change = np.flatnonzero(~held), np.zeros(z.size)
            block = matrix[np.ix_(moving, moving)] + np.diag(size[moving])
            change[moving] = -np.linalg.solve(block, slope[moving])
            trial = np.clip(z + change, lower, upper)
        return z, best / float(seen.sum())

    def anew(self, z: Array, observed: Array, seed: int = 0) -> tuple[Array, float]:
        """The best angles from many starts within the limits."""
        random, first = np.random.default_rng(seed), self.problem.first_joint
        low, high = np.clip(self.problem.limits[:, first:], -np.pi, np.pi)
        found = []
        for index in range(_STARTS):
            # The first starts are near the middle of the ranges, where people's arms mostly are.
            spread = min(1.0, 0.1 + index / _STARTS) * random.uniform(-1.0, 1.0, low.size)
            joints = (low + high) / 2.0 + spread * (high - low) / 2.0
            found.append(self.nearest(np.concatenate([z[:first], joints]), observed))
        return min(found, key=lambda pair: pair[1])

    def along(self, guesses: Array, observed: Array) -> Array:
        """Angles of frames (k, nz), each from its neighbour's, and anew where that is much better.

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


@dataclass(frozen=True, eq=False)
class FittedVariables:
    """Values of a fit's variables.

    Attributes:
        problem: that they solve.
        z: of the frames (k, nz).
        shared: (ns,).
        loose: joints that the markers do not determine (n,).
        iterations: of Ipopt, in all.
    """

    problem: FitProblem
    z: Array
    shared: Array
    loose: NDArray[np.bool_]
    iterations: int


def solve_fit(problem: FitProblem, time: Array, ipopt: dict[str, Any] | None) -> FittedVariables:
    """The solution for the observed positions of the chosen markers.

    Frames are first fitted one after the other, every 0.05 s; then at these times together, with a
    wide loss and with the one that is asked for, and at last at all times.

    Raises:
        ValueError: the root moves and has too few markers, or markers determine none of the joints.
        NotConverged: Ipopt did not find a solution.
    """
    observed, narrow = problem.chosen.observed, problem.settings.outlier
    rows, everything, wide = _coarse(time), np.arange(time.size), max(_WIDE, narrow)
    problem, start = _root_start(problem, time)
    z, shared = FrameSearch(problem, wide).along(start[rows], observed[rows]), np.zeros(problem.ns)
    seen = ~np.isnan(observed[rows, :, 0])
    loose = undetermined_joints(problem, z, shared, seen)
    if loose.all():
        unseen = float(np.mean(~seen.any(axis=1)))
        gaps = f"; for {unseen:.0%} of the time no marker is seen" if unseen > 0.0 else ""
        raise ValueError(
            f"the markers, on {', '.join(sorted(set(problem.chosen.segments)))}, determine none of "
            f"the joints of {problem.body.model.name!r} for half of the time or more{gaps}"
        )
    stages = [(rows, wide, _ROUGHLY), (rows, narrow, _ROUGHLY), (everything, narrow, _CLOSELY)]
    if rows.size == time.size:
        del stages[1]
    program, iterations = problem.program(time[rows], observed[rows], loose), 0
    for next_rows, outlier, tolerance in stages:
        if next_rows.size != rows.size:
            program = problem.program(time[next_rows], observed[next_rows], loose)
            z = scipy.interpolate.make_interp_spline(time[rows], z, k=1)(time[next_rows])
            rows = next_rows
        outcome = program.solve(np.concatenate([z.ravel(), shared]), outlier, tolerance, ipopt)
        iterations += outcome.iterations
        z, shared = outcome.x[: z.size].reshape(z.shape), outcome.x[z.size :]
    if not outcome.success:
        raise NotConverged(f"no motion was fitted to the markers: {outcome.status}", outcome)
    return FittedVariables(problem, z, shared, loose, iterations)


def _coarse(time: Array) -> NDArray[np.int64]:
    """Indices of samples about 0.05 s apart, the first and the last among them."""
    wanted = np.linspace(time[0], time[-1], int((time[-1] - time[0]) / _COARSE_STEP) + 2)
    found = np.unique(np.clip(np.searchsorted(time, wanted), 0, time.size - 1))
    return found if 4 <= found.size < 0.6 * time.size else np.arange(time.size)


def _root_start(problem: FitProblem, time: Array) -> tuple[FitProblem, Array]:
    """First values of the variables, and the problem with axes that suit the root's rotation."""
    z = np.tile(problem.neutral, (time.size, 1))
    if not problem.moves:
        return problem, z
    segments, observed = problem.chosen.segments, problem.chosen.observed
    carried = [problem.body.attachment(segment).joint <= 0 for segment in segments]
    if sum(carried) < 3:
        carried = [segment in _TRUNK for segment in segments]
    columns = np.flatnonzero(carried)
    (places,) = problem.positions(problem.neutral[None], np.zeros(problem.ns))
    columns = columns[without_stray(places[columns], observed[:, columns])]
    rotations, z[:, :3] = rigid_poses(places[columns], observed[:, columns], time)
    # The angle in the middle of three must stay away from 90 deg: its sine is the component of the
    # root's x axis along the axis of the first angle, which is z if that will do.
    sines = np.abs(rotations[:, :, 0]).max(axis=0)[[2, 0, 1]]
    axis = 0 if sines[0] < _STEEP else int(np.argmin(sines))
    problem = replace(problem, axes=np.roll(np.eye(3), axis, axis=1).T)
    z[:, 3:ROOT] = problem.root_angles(rotations)
    return problem, z
