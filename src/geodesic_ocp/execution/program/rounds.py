"""Rounds of the program: solve, check densely, mind what was violated, solve again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.program.dense_check import TOLERANCE, ArmCheck, distances_in_pieces
from geodesic_ocp.execution.program.initial_guess import stretched, through
from geodesic_ocp.execution.program.joint_spline import JointSpline
from geodesic_ocp.execution.program.knots import Knots, union_of_edges
from geodesic_ocp.execution.program.reference import Reference
from geodesic_ocp.execution.program.settings import TrajectorySettings
from geodesic_ocp.execution.program.tightening import tightened, watched_at_first
from geodesic_ocp.execution.program.trajectory_program import KnotStates, TrajectoryProgram
from geodesic_ocp.execution.program.variable_bounds import position_bounds

MOST_ROUNDS = 15
_OTHER_COUNT = 0.15  # change of the number of knots that is worth it, once durations are known
# The nearest points of the paths are found anew until the duration changes by less than this.
_SETTLED = 0.005
# The first guess, and others if Ipopt fails from it: time stretched more, and stops in corners.
_STARTS = ((1.3, False), (2.0, False), (1.3, True), (3.0, True))


@dataclass(frozen=True, eq=False)
class TrajectoryAttempt:
    """Where the rounds ended.

    Attributes:
        knots: in time.
        durations: of the intervals (m,) [s].
        checks: of the arms, with their splines.
        least_distances: of each clearance (m,) [m].
        excess: largest excess over a limit, relative or [rad or m].
        status: in words.
        success: whether all limits are kept.
        iterations: of Ipopt.
    """

    knots: Knots
    durations: Array
    checks: tuple[ArmCheck, ...]
    least_distances: tuple[Array, ...]
    excess: float
    status: str
    success: bool
    iterations: int


def solve_in_rounds(
    arms: Sequence[ArmPaths],
    settings: TrajectorySettings,
    clearances: Sequence[Clearance],
    progress: Callable[[int], object],
) -> TrajectoryAttempt:
    """The trajectory within all limits, or the best attempt."""
    attempts: list[TrajectoryAttempt] = []
    for more, stops in _STARTS:
        attempts.append(_from_start(arms, settings, clearances, progress, (more, stops)))
        if attempts[-1].success:
            break
    best = min(attempts, key=lambda attempt: (not attempt.success, attempt.excess))
    return replace(best, iterations=sum(attempt.iterations for attempt in attempts))


def _from_start(
    arms: Sequence[ArmPaths],
    settings: TrajectorySettings,
    clearances: Sequence[Clearance],
    progress: Callable[[int], object],
    start: tuple[float, bool],
) -> TrajectoryAttempt:
    program, states, references = _first_guess(arms, settings, *start)
    watched, iterations = watched_at_first(program, states.durations, clearances), 0
    kept: TrajectoryAttempt | None = None
    for number in range(MOST_ROUNDS):
        progress(number)
        outcome = program.solve(states, references, watched)
        iterations += outcome.iterations
        before, states = states, program.states(outcome.x)
        checks = tuple(
            ArmCheck(course.arm, spline, position_bounds(course))
            for course, spline in zip(program.courses, _splines(program, states), strict=True)
        )
        splines = [check.spline for check in checks]
        distances = [distances_in_pieces(each, splines) for each in clearances]
        excess, worst = _worst(checks, clearances, distances)
        success = outcome.success and excess <= TOLERANCE
        change = abs(states.durations.sum() / before.durations.sum() - 1.0)
        if not outcome.success and kept is not None:
            return replace(kept, iterations=iterations)
        if success:
            least = tuple(each.min(axis=(0, 1)) for each in distances)
            kept = TrajectoryAttempt(
                *(program.knots, states.durations, checks, least, excess),
                *("within all limits", True, iterations),
            )
        if not outcome.success or (success and change <= _SETTLED):
            break
        watched = tightened(watched, checks, distances)
        if number == 0:
            fitting = Knots.spaced(program.knots.edges, states.durations)
            if abs(fitting.count / program.knots.count - 1.0) > _OTHER_COUNT:
                program = replace(program, knots=fitting)
                states = _at_knots(program, splines, states.durations)
                watched = watched_at_first(program, states.durations, clearances)
        references = [
            course.nearest(q) for course, q in zip(program.courses, states.positions, strict=True)
        ]
    if kept is not None:
        return replace(kept, iterations=iterations)
    status = outcome.status
    if excess > TOLERANCE:
        status = f"{outcome.status}; {worst} by {excess:.2g}"
    least = tuple(each.min(axis=(0, 1)) for each in distances)
    knots = program.knots
    return TrajectoryAttempt(
        knots, states.durations, checks, least, excess, status, success, iterations
    )


def _first_guess(
    arms: Sequence[ArmPaths], settings: TrajectorySettings, more: float, stops: bool
) -> tuple[TrajectoryProgram, KnotStates, list[Reference]]:
    """The paths in time that is stretched until limits are nearly kept, times `more`."""
    edges = union_of_edges(arms)
    coarse = TrajectoryProgram(arms, Knots.spaced(edges, np.diff(edges)), settings)
    references = [course.as_recorded(settings.rest, stops) for course in coarse.courses]
    durations = stretched(arms, references, coarse.knots, settings.rest)
    program = TrajectoryProgram(arms, Knots.spaced(edges, durations), settings)
    references = [course.as_recorded(settings.rest, stops) for course in program.courses]
    states = through(references, program.knots, more * durations, settings.rest)
    return program, states, references


def _at_knots(
    program: TrajectoryProgram, splines: Sequence[JointSpline], durations: Array
) -> KnotStates:
    """States of splines at the knots of another program."""
    time = program.knots.times(durations)
    states = [spline(time)[:3] for spline in splines]
    return KnotStates(durations, *zip(*states, strict=True))


def _worst(
    checks: Sequence[ArmCheck], clearances: Sequence[Clearance], distances: Sequence[Array]
) -> tuple[float, str]:
    """Largest excess over a limit, relative or [rad or m], and a clause that names it."""
    found = [check.worst for check in checks]
    for clearance, values in zip(clearances, distances, strict=True):
        lack = (clearance.lower - values).max(axis=(0, 1))
        index = int(lack.argmax())
        found.append((float(lack[index]), f"the distance {clearance.names[index]} is too small"))
    return max(found, key=lambda pair: pair[0])


def _splines(program: TrajectoryProgram, states: KnotStates) -> list[JointSpline]:
    """Without the rounding that the program's equations leave at the knots."""
    time = program.knots.times(states.durations)
    return [
        JointSpline.through(time, q, v[[0, -1]])
        for q, v in zip(states.positions, states.velocities, strict=True)
    ]
