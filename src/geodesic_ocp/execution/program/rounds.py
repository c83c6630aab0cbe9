"""Rounds of the program: solve, check densely, mind what was violated, solve again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.clearance_constraint import Clearance
from geodesic_ocp.execution.program.dense_check import TOLERANCE, ArmCheck
from geodesic_ocp.execution.program.initial_guess import stretched, through
from geodesic_ocp.execution.program.joint_spline import JointSpline
from geodesic_ocp.execution.program.knots import Knots, union_of_edges
from geodesic_ocp.execution.program.settings import TrajectorySettings
from geodesic_ocp.execution.program.tightening import Tightening
from geodesic_ocp.execution.program.trajectory_program import (
    INSIDE,
    KnotStates,
    TrajectoryProgram,
    position_bounds,
)
from geodesic_ocp.execution.program.watched import Watched

_MOST_ROUNDS = 15
_REFERENCES = 2  # rounds in which the nearest points of the paths are found anew
# The first guess, and others if Ipopt fails from it: time stretched more, and stops in corners.
_STARTS = ((1.3, False), (2.0, False), (1.3, True), (3.0, True))


@dataclass(frozen=True, eq=False)
class Attempt:
    """Where the rounds ended.

    Attributes:
        knots: in time.
        iterate: values at the knots.
        splines: of the arms.
        checks: of the arms.
        excess: largest excess over a limit, relative or [rad or m].
        status: in words.
        success: whether all limits are kept.
        iterations: of Ipopt.
    """

    knots: Knots
    iterate: KnotStates
    splines: tuple[JointSpline, ...]
    checks: tuple[ArmCheck, ...]
    excess: float
    status: str
    success: bool
    iterations: int


def solve_in_rounds(
    arms: Sequence[ArmPaths],
    settings: TrajectorySettings,
    clearances: Sequence[Clearance],
    progress: Callable[[int], object],
) -> Attempt:
    """The trajectory within all limits, or the best attempt."""
    best: Attempt | None = None
    iterations = 0
    for more, stops in _STARTS:
        found = _from_start(arms, settings, clearances, progress, more, stops)
        iterations += found.iterations
        if best is None or found.success or found.excess < best.excess:
            best = found
        if found.success:
            break
    assert best is not None
    return replace(best, iterations=iterations)


def _from_start(
    arms: Sequence[ArmPaths],
    settings: TrajectorySettings,
    clearances: Sequence[Clearance],
    progress: Callable[[int], object],
    more: float,
    stops: bool,
) -> Attempt:
    edges, nothing = union_of_edges(arms), Watched.nothing(len(arms))
    knots = Knots.spaced(edges, np.diff(edges))
    program = TrajectoryProgram(arms, knots, settings, nothing)
    references = [course.as_recorded(settings.rest, stops) for course in program.courses]
    durations = stretched(references, program.functions, knots, settings.rest)
    knots = Knots.spaced(edges, durations)
    program = TrajectoryProgram(arms, knots, settings, nothing)
    tightening = Tightening(
        nothing,
        tuple(np.full((knots.count + 1, arm.robot.dof), 1.0 - INSIDE) for arm in arms),
        tuple(np.where(program.fixed_knots[:, None], -np.inf, each.lower) for each in clearances),
    )
    references = [course.as_recorded(settings.rest, stops) for course in program.courses]
    iterate = through(references, knots, more * durations, settings.rest)
    iterations, success, worst, excess = 0, False, "", np.inf
    for number in range(_MOST_ROUNDS):
        progress(number)
        outcome = program.solve(iterate, references, tightening.torque_shares)
        iterations += outcome.iterations
        iterate = program.iterate(outcome.x)
        splines = _splines(knots, iterate)
        checks = tuple(
            ArmCheck(course.arm, spline, position_bounds(course))
            for course, spline in zip(program.courses, splines, strict=True)
        )
        tightening, excess, worst = tightening.after(checks, splines, clearances)
        success = outcome.success and excess <= TOLERANCE
        if not outcome.success or (success and number + 1 >= _REFERENCES):
            break
        program = replace(program, watched=tightening.watched)
        references = [
            course.nearest(q) for course, q in zip(program.courses, iterate.positions, strict=True)
        ]
    status = "within all limits" if success else _failure(outcome.status, excess, worst)
    return Attempt(knots, iterate, splines, checks, excess, status, success, iterations)


def _failure(status: str, excess: float, worst: str) -> str:
    if excess <= TOLERANCE:
        return status
    return f"{status}; {worst} exceeds its limit by {excess:.2g}"


def _splines(knots: Knots, iterate: KnotStates) -> tuple[JointSpline, ...]:
    """Without the rounding that the program's equations leave at the knots."""
    time: Array = knots.times(iterate.durations)
    return tuple(
        JointSpline.through(time, q, v[[0, -1]])
        for q, v in zip(iterate.positions, iterate.velocities, strict=True)
    )
