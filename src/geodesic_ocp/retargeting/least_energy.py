"""Paths of least energy to hand poses, without building anything anew from one pose to the next.

Where no limit is active a path is smooth, and one polynomial resolves it. Otherwise it consists of
segments, which are halved where a condition is violated between the nodes or where the last term of
a polynomial still carries energy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.nlp.definition import ProblemDefinition
from geodesic_ocp.ocp.nlp.nlp import build_nlp
from geodesic_ocp.ocp.nlp.violations import violation_profile
from geodesic_ocp.ocp.problem.reach import Reach
from geodesic_ocp.ocp.solve.refinement import halved, unresolved_energy
from geodesic_ocp.ocp.solve.solve import FILTER, NEAR, shared_ipopt
from geodesic_ocp.retargeting.targets import Pose
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

_ROUGH = Grid(1, 4)
_SMOOTH = (Grid(1, 8), Grid(1, 14), Grid(1, 20))
_SEGMENTS = (8, 12, 16, 24, 32, 48, 64, 96)  # few numbers, as each has a program of its own
_DEGREE = 4
_WIDEST, _NARROW = 4, 1 / 16  # numbers of segments, and their width where limits become active
# A solution on a coarser grid is nearly one, and so are multipliers that match its distances from
# the bounds.
_REFINED = {
    "bound_mult_init_method": "mu-based",
    "mu_init": 1e-6,
    "slack_bound_push": 1e-6,
    "slack_bound_frac": 1e-6,
}
_HALVINGS = 2  # of a segment, from one grid to the next
_LOOSEST, _ACCURACY = 1e-7, 1e-3  # of Ipopt: the latter times the tolerance
_ROUGH_ACCURACY = 1e-3  # of Ipopt
_ROUGH_VIOLATION = 1e-2  # above which limits are active, each in its unit


@dataclass(frozen=True, eq=False)
class FoundPath:
    """A path, or the last iterate towards one.

    Attributes:
        path: from the start to the pose.
        energy: of the path.
        iterations: of Ipopt, on all grids.
        success: whether it is a solution to the tolerance.
        status: how the solver stopped, a sentence.
    """

    path: Path
    energy: float
    iterations: int
    success: bool
    status: str


def line(metric: Metric, q0: Array, q1: Array) -> Path:
    """The straight line between two configurations."""
    return Path(metric, Grid(1, 2), np.array([q0, (q0 + q1) / 2.0, q1]))


def least_energy_path(
    arm: Model,
    start: Array,
    pose: Pose,
    end: Array,
    *,
    limits: bool,
    speed: Array | None = None,
    tolerance: float,
    after: FoundPath | None = None,
    is_rough: bool = False,
) -> FoundPath:
    """The path of least energy from a configuration to a pose, as `solve` finds it for `Reach`.

    Args:
        arm: the robot.
        start: configuration (n,).
        pose: of the hand at the end.
        end: a configuration (n,) with that pose; the search starts from the straight line to it.
        limits: whether the joints stay within their limits.
        speed: largest |dq_j / ds| (n,); None: no limit.
        tolerance: of the conditions everywhere on the path, each in its unit, and relative of the
            energy.
        after: a rough path to continue from.
        is_rough: return the first path that Ipopt accepts on a coarse grid, however far it is from
            the tolerance; its energy is close to that of the path.
    """
    definition = _definition(arm, start, pose, limits, speed)
    accuracy = _ROUGH_ACCURACY if is_rough else min(_LOOSEST, _ACCURACY * tolerance)
    options = {**FILTER, **NEAR, "tol": accuracy}
    profile = violation_profile(definition.conditions)
    guess, iterations = line(definition.metric, start, end), 0
    near, grid = guess, (_piecewise() if speed is not None else _ROUGH if is_rough else _SMOOTH[0])
    if after is not None:
        near, iterations = after.path, after.iterations
        finer = _finer(near, profile(near), after.energy, tolerance)
        if finer == near.grid:
            return after
        grid = finer or _piecewise()
    while True:
        nlp = build_nlp(definition, grid, near)
        settings = tuple(sorted({**options, **({} if near is guess else _REFINED)}.items()))
        outcome = shared_ipopt(definition.structure, nlp.grid, settings)(**nlp.values)
        iterations += outcome.iterations
        path, energy = nlp.path(outcome.x), outcome.objective * nlp.units.scale
        if not outcome.success:
            finer, near = (_piecewise() if grid in (_ROUGH, *_SMOOTH) else None), guess
        else:
            finer, near = grid, path
            if not is_rough:
                finer = _finer(path, profile(path), energy, tolerance)
            if finer == grid:
                return FoundPath(path, energy, iterations, True, outcome.status)
        if finer is None:
            status = f"not solved to {tolerance:g} on {grid!r}: {outcome.status}"
            return FoundPath(path, energy, iterations, False, status)
        grid = finer


def _piecewise() -> Grid:
    return Grid(_SEGMENTS[0], _DEGREE)


def _finer(
    path: Path, violations: tuple[Array, Array], energy: float, tolerance: float
) -> Grid | None:
    """The grid to solve on next: the path's own if it resolves it, None if there is none."""
    grid, (s, amounts) = path.grid, violations
    if grid == _ROUGH:
        violated = float(amounts.max(initial=0.0)) > _ROUGH_VIOLATION
        return _graded(s[amounts > _ROUGH_VIOLATION]) if violated else _SMOOTH[0]
    unresolved = unresolved_energy(path) / max(energy, np.finfo(float).tiny)
    violated = float(amounts.max(initial=0.0)) > tolerance
    if not violated and unresolved.sum() <= tolerance:
        return grid
    if grid in _SMOOTH:
        level = _SMOOTH.index(grid) + 1
        if violated or level == len(_SMOOTH):
            return _graded(s[amounts > tolerance])
        return _SMOOTH[level]
    segment = np.clip(np.searchsorted(grid.breakpoints, s, side="right") - 1, 0, grid.segments - 1)
    worst = np.zeros(grid.segments)
    np.maximum.at(worst, segment, amounts)
    # How many times a segment's error exceeds what it may be.
    excess = np.maximum(worst, unresolved * grid.segments) / tolerance
    for _ in range(_HALVINGS):  # the error falls by a factor of four or more
        grid = halved(grid, excess > 1.0)
        excess = np.repeat(excess / 4.0, 1 + (excess > 1.0))
    return _padded(grid, excess)


def _padded(grid: Grid, priority: Array) -> Grid | None:
    """With further segments halved, those of the highest priority, up to the next number."""
    target = next((count for count in _SEGMENTS if count >= grid.segments), None)
    if target is None:
        return None
    while grid.segments < target:
        chosen: NDArray[np.bool_] = np.zeros(grid.segments, dtype=bool)
        chosen[np.argmax(priority)] = True
        grid, priority = (
            halved(grid, chosen),
            np.repeat(priority * (1.0 - 0.75 * chosen), 1 + chosen),
        )
    return grid


def _graded(points: Array) -> Grid:
    """Segments that are short around these s, where limits become active."""
    grid = Grid(_WIDEST, _DEGREE)
    while True:
        index = np.searchsorted(grid.breakpoints, points, side="right") - 1
        around = np.isin(np.arange(grid.segments), index)
        wide = around & (grid.widths > 1.01 * _NARROW)
        if not np.any(wide):
            break
        grid = halved(grid, wide)
    index = np.searchsorted(grid.breakpoints, points, side="right") - 1
    around = np.isin(np.arange(grid.segments), index)
    return _padded(grid, grid.widths * np.where(around, 2.0, 1.0)) or grid


def _definition(
    arm: Model, start: Array, pose: Pose, limits: bool, speed: Array | None
) -> ProblemDefinition:
    """That of `Reach` with these numbers."""
    parts = pose.position is not None, pose.rotation is not None
    template = _template(arm, *parts, limits, speed is not None)
    conditions = template.conditions
    values = [each.ravel(order="F") for each in (pose.position, pose.rotation) if each is not None]
    numbers: dict[str, Any] = {
        "fixed": tuple(replace(each, lower=start, upper=start) for each in conditions.fixed),
        "p_values": np.concatenate(values),
    }
    if speed is not None:
        (along,) = conditions.along_qv
        numbers["along_qv"] = (replace(along, lower=-speed, upper=speed),)
    return replace(template, conditions=replace(conditions, **numbers))


@lru_cache(maxsize=32)
def _template(
    arm: Model, placed: bool, rotated: bool, limits: bool, limited_speed: bool
) -> ProblemDefinition:
    return Reach(
        arm,
        np.zeros(arm.dof),
        np.zeros(3) if placed else None,
        np.eye(3) if rotated else None,
        limits=limits,
        speed=1.0 if limited_speed else None,
    ).definition()
