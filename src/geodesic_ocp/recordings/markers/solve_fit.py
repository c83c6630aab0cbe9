"""The solution of a fit: frame after frame, and then from coarse to fine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.markers.fit_program import ROOT, FitProblem
from geodesic_ocp.recordings.markers.trunk import rigid_poses, without_stray
from geodesic_ocp.recordings.markers.uncertainty import undetermined_joints

_STARTS, _STEPS = 40, 60
_ENOUGH = 1e-6  # relative decrease at which a frame's angles are good enough


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


_COARSE_STEP = 0.05  # [s]
_WIDE = 0.2  # outlier size of the first solution, to which few markers are lost [m]
_ROUGHLY, _CLOSELY = 1e-5, 1e-6  # tolerances
_STEEP = 0.8  # sine of the root's angle in the middle, above which other axes are chosen
# Parts of a person that hardly move in the root, if that has fewer than three markers.
_TRUNK = ("pelvis", "abdomen", "thorax")


@dataclass(frozen=True, eq=False)
class FittedVariables:
    """Values of a fit's variables.

    Attributes:
        problem: that they solve.
        z: of the frames (k, nz).
        shared: (ns,).
        predicted: positions of the markers (k, m, 3) [m].
        loose: joints that the markers do not determine (n,).
        success: whether Ipopt converged.
        status: of Ipopt, in words.
        iterations: of Ipopt, in all.
    """

    problem: FitProblem
    z: Array
    shared: Array
    predicted: Array
    loose: NDArray[np.bool_]
    success: bool
    status: str
    iterations: int


def solve_fit(
    problem: FitProblem, time: Array, observed: Array, ipopt: dict[str, Any] | None
) -> FittedVariables:
    """The solution for observed positions (k, m, 3) [m].

    Frames are first fitted one after the other, every 0.05 s; then at these times together, with a
    wide loss and with the one that is asked for, and at last at all times.

    Raises:
        ValueError: the root moves and has too few markers, or markers determine none of the joints.
    """
    coarse = _coarse(time)
    narrow = problem.settings.outlier
    wide = max(_WIDE, narrow)
    problem, start = _root_start(problem, time, observed)
    search = FrameSearch(
        problem.terms.slopes,
        np.zeros(problem.ns),
        *_start_bounds(problem),
        np.arange(problem.nz) >= problem.first_joint,
        problem.settings.noise,
        wide,
    )
    z, shared, iterations = search.along(start[coarse], observed[coarse]), np.zeros(problem.ns), 0
    stages = [(coarse, wide, _ROUGHLY), (coarse, narrow, _ROUGHLY)]
    seen = np.where(np.isnan(observed[coarse, :, 0]), np.nan, 1.0)
    loose = undetermined_joints(problem, z, shared, seen)
    if loose.all():
        unseen = float(np.mean(np.isnan(seen).all(axis=1)))
        gaps = f"; for {unseen:.0%} of the time no marker is seen" if unseen > 0.0 else ""
        raise ValueError(
            f"the markers, on {', '.join(sorted(set(problem.segments)))}, determine none of the "
            f"joints of {problem.body.model.name!r} for half of the time or more{gaps}"
        )
    everything = np.arange(time.size)
    if coarse.size < time.size:
        stages.append((everything, narrow, _CLOSELY))
    else:
        stages[-1] = (coarse, narrow, _CLOSELY)
    before, program = coarse, None
    for rows, outlier, tolerance in stages:
        if program is None or rows is not before:
            program = problem.program(time[rows], observed[rows], loose)
        if rows is not before:
            z = np.stack([np.interp(time[rows], time[before], each) for each in z.T], axis=1)
        outcome = program.solve(np.concatenate([z.ravel(), shared]), outlier, tolerance, ipopt)
        iterations += outcome.iterations
        z = outcome.x[: z.size].reshape(z.shape)
        shared, before = outcome.x[z.size :], rows
    z = np.stack([np.interp(time, time[before], each) for each in z.T], axis=1)
    return FittedVariables(
        problem,
        z,
        shared,
        _predicted(problem, z, shared),
        loose,
        outcome.success,
        outcome.status,
        iterations,
    )


def _coarse(time: Array) -> Any:
    """Indices of samples about 0.05 s apart, the first and the last among them."""
    wanted = np.linspace(time[0], time[-1], int((time[-1] - time[0]) / _COARSE_STEP) + 2)
    found = np.unique(np.clip(np.searchsorted(time, wanted), 0, time.size - 1))
    return found if 4 <= found.size < 0.6 * time.size else np.arange(time.size)


def _start_bounds(problem: FitProblem) -> tuple[Array, Array]:
    none = np.full(problem.first_joint, np.inf)
    model = problem.body.model
    return np.concatenate([-none, model.lower]), np.concatenate([none, model.upper])


def _root_start(problem: FitProblem, time: Array, observed: Array) -> tuple[FitProblem, Array]:
    """First values of the variables, and the problem with axes that suit the root's rotation."""
    z = np.tile(problem.neutral, (time.size, 1))
    if not problem.moves:
        return problem, z
    carried = [problem.body.attachment(segment).joint <= 0 for segment in problem.segments]
    if sum(carried) < 3:
        carried = [segment in _TRUNK for segment in problem.segments]
    columns = np.flatnonzero(carried)
    at_zero = replace(problem, axes=np.eye(3))
    places = at_zero.terms.positions(problem.neutral, np.zeros(problem.ns)).full().T
    columns = columns[without_stray(places[columns], observed[:, columns])]
    rotations, origins = rigid_poses(places[columns], observed[:, columns], time)
    # The angle in the middle of three must stay away from 90 deg: its sine is the component of the
    # root's x axis along the axis of the first angle, which is z if that will do.
    sines = np.abs(rotations[:, :, 0]).max(axis=0)[[2, 0, 1]]
    axis = 0 if sines[0] < _STEEP else int(np.argmin(sines))
    problem = replace(problem, axes=np.roll(np.eye(3), axis, axis=1).T)
    z[:, :3] = origins
    z[:, 3:ROOT] = problem.root_angles(rotations)
    return problem, z


def _predicted(problem: FitProblem, z: Array, shared: Array) -> Array:
    count = len(z)
    stacked = problem.terms.positions.map(count)(z.T, np.repeat(shared[:, None], count, axis=1))
    predicted: Array = stacked.full().reshape(3, count, -1).transpose(1, 2, 0)
    return predicted
