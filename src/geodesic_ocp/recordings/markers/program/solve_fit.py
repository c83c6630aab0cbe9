"""The solution of a fit, from coarse to fine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.markers.program.fit_problem import ROOT, FitProblem
from geodesic_ocp.recordings.markers.program.undetermined import undetermined_joints
from geodesic_ocp.recordings.markers.start.frame_search import FrameSearch, rigid_poses
from geodesic_ocp.recordings.markers.start.rigid_markers import without_stray

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
