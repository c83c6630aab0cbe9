"""Trajectories in time within all limits, from the paths of synergies."""

from __future__ import annotations

import time
from collections.abc import Sequence

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.clearance_constraint import Clearance
from geodesic_ocp.execution.planned_trajectory import PlannedTrajectory, path_deviations
from geodesic_ocp.execution.program.preconditions import attainable, check_arms
from geodesic_ocp.execution.program.rounds import MOST_ROUNDS, solve_in_rounds
from geodesic_ocp.execution.program.settings import TrajectorySettings
from geodesic_ocp.progress import Progress, no_progress


def plan_trajectory(
    arms: ArmPaths | Sequence[ArmPaths],
    *,
    rest: bool = True,
    tolerance: tuple[float, float] | None = None,
    clearances: Sequence[Clearance] = (),
    deviation_weight: float = 1.0,
    progress: Progress = no_progress,
    throw: bool = True,
) -> PlannedTrajectory:
    """The motion of all arms along their paths, as near to the person's timing as limits allow.

    A cubic spline in time, from a nonlinear program that is solved by Ipopt: positions, velocities
    and accelerations are continuous, and they, jerks and torques (inverse dynamics with gravity)
    are within the limits everywhere. No interval between edges is shorter than the person's. The
    time beyond it is what is minimized, together with the distance from the paths; in corners
    between paths, which the arms pass without stopping, the trajectory leaves them.

    Args:
        arms: one or several, with their paths, limits and gravity; all begin and end at the same
            times.
        rest: whether the trajectory begins and ends at rest; otherwise its speed there is near the
            person's.
        tolerance: of the hand's pose at the ends of paths [m], [rad]; None: the configurations
            there are met exactly.
        clearances: distances to keep.
        deviation_weight: of the squared distance from the paths against the time. At 1, a distance
            of 0.1 rad that is kept up all the time costs as much as doubling the time.
        progress: called in every round; there are at most fifteen, and three as a rule.
        throw: raise if no trajectory within the limits is found; otherwise return the last attempt,
            whose `success` is False.

    Raises:
        ValueError: paths that do not meet, edges that do not increase or differ between arms, a
            configuration beyond its limits, or one that gravity alone makes too heavy to hold.
        NotConverged: no trajectory within the limits was found; `solution` is the last attempt.
    """
    begin = time.perf_counter()
    arms = (arms,) if isinstance(arms, ArmPaths) else tuple(arms)
    clearances = tuple(clearances)
    settings = TrajectorySettings(
        bool(rest), _checked_tolerance(tolerance), as_positive("deviation_weight", deviation_weight)
    )
    check_arms(arms)
    possible, hopeless = attainable(arms, clearances, settings)
    if throw and hopeless:
        raise NotConverged(f"no trajectory keeps the distances: {hopeless}")
    found = solve_in_rounds(
        arms, settings, possible, lambda number: progress("trajectory", number, MOST_ROUNDS)
    )
    times = found.knots.times(found.durations)
    planned = PlannedTrajectory(
        arms=arms,
        edges=found.knots.edges,
        robot_edges=times[found.knots.at_edges],
        splines=tuple(check.spline for check in found.checks),
        usage=tuple(check.shares for check in found.checks),
        path_deviation=tuple(
            path_deviations(check.arm, check.spline, times[found.knots.of(check.arm.edges)])
            for check in found.checks
        ),
        least_distances=found.least_distances,
        success=found.success and not hopeless,
        status=hopeless or found.status,
        iterations=found.iterations,
        seconds=time.perf_counter() - begin,
        rest=settings.rest,
    )
    if throw and not planned.success:
        raise NotConverged(f"no trajectory within the limits was found: {found.status}", planned)
    return planned


def _checked_tolerance(tolerance: tuple[float, float] | None) -> tuple[float, float] | None:
    if tolerance is None:
        return None
    try:
        position, angle = tolerance
    except (TypeError, ValueError):
        raise ValueError(
            f"tolerance must be a distance [m] and an angle [rad], or None, got {tolerance!r}"
        ) from None
    return as_positive("tolerance", position, "m"), as_positive("tolerance", angle, "rad")
