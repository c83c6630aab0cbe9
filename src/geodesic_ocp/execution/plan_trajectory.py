"""Trajectories in time within all limits, from the paths of synergies."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geodesic_ocp.arrays import Array, as_positive, as_vector
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.clearance_constraint import Clearance
from geodesic_ocp.execution.planned_trajectory import PlannedTrajectory, path_deviations
from geodesic_ocp.execution.program.dense_check import TOLERANCE, distances
from geodesic_ocp.execution.program.reference import path_ends
from geodesic_ocp.execution.program.rounds import solve_in_rounds
from geodesic_ocp.execution.program.settings import TrajectorySettings
from geodesic_ocp.progress import Progress, no_progress

_MEET = 1e-6  # [rad or m]; successive paths meet, and begin within the limits, up to this
_SAME = 1e-6  # [s]


def plan_trajectory(
    arms: Sequence[ArmPaths],
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
        arms: their paths, limits and gravity; all begin and end at the same times.
        rest: whether the trajectory begins and ends at rest; otherwise its speed there is near the
            person's.
        tolerance: of the hand's pose at the ends of paths [m], [rad]; None: the configurations
            there are met exactly.
        clearances: distances to keep.
        deviation_weight: of the squared distance from the paths against the time. At 1, a distance
            of 0.1 rad that is kept up all the time costs as much as doubling the time.
        progress: called in every round.
        throw: raise if no trajectory within the limits is found; otherwise return the last attempt,
            whose `success` is False.

    Raises:
        ValueError: paths that do not meet, edges that do not increase or differ between arms, a
            configuration beyond its limits, or one that gravity alone makes too heavy to hold.
        NotConverged: no trajectory within the limits was found; `solution` is the last attempt.
    """
    begin = time.perf_counter()
    arms, clearances = tuple(arms), tuple(clearances)
    settings = TrajectorySettings(
        bool(rest), _checked_tolerance(tolerance), as_positive("deviation_weight", deviation_weight)
    )
    _check(arms)
    possible, hopeless = _attainable(arms, clearances, settings)
    if throw and hopeless:
        raise NotConverged(f"no trajectory keeps the distances: {hopeless}")
    found = solve_in_rounds(
        arms, settings, possible, lambda number: progress("trajectory", number, 0)
    )
    times = found.knots.times(found.iterate.durations)
    robot_edges = times[found.knots.at_edges]
    deviations = tuple(
        path_deviations(arm, spline, times[found.knots.of(arm.edges)])
        for arm, spline in zip(arms, found.splines, strict=True)
    )
    planned = PlannedTrajectory(
        arms=arms,
        edges=found.knots.edges,
        robot_edges=robot_edges,
        splines=found.splines,
        usage=tuple(check.shares for check in found.checks),
        path_deviation=deviations,
        least_distances=tuple(
            distances(clearance, found.splines).min(axis=(0, 1)) for clearance in clearances
        ),
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


def _attainable(
    arms: tuple[ArmPaths, ...], clearances: tuple[Clearance, ...], settings: TrajectorySettings
) -> tuple[tuple[Clearance, ...], str]:
    """Clearances without the distances that given configurations violate, and a sentence on these.

    Raises:
        ValueError: a clearance is a function of another number of joints.
    """
    dof = sum(arm.robot.dof for arm in arms)
    for clearance in clearances:
        if clearance.dof != dof:
            raise ValueError(
                f"clearances must be functions of the {dof} joints of all arms, got {clearance!r}"
            )
    if settings.tolerance is not None:
        return clearances, ""
    # Configurations of all arms are given together only where paths of all of them end.
    shared = [
        instant
        for instant in arms[0].edges
        if all(np.abs(arm.edges - instant).min() <= _SAME for arm in arms)
    ]
    attainable, sentence = [], ""
    for clearance in clearances:
        lower = clearance.lower.copy()
        for instant in shared:
            q = np.concatenate(
                [path_ends(arm)[int(np.abs(arm.edges - instant).argmin())] for arm in arms]
            )
            lack = clearance.lower - clearance.function(q).full()[:, 0]
            worst = int(lack.argmax())
            if lack[worst] > TOLERANCE and not sentence:
                sentence = (
                    f"{clearance.names[worst]} is {clearance.lower[worst] - lack[worst]:.3g} m at "
                    f"{instant:.4g} s, where the paths fix the configuration, and has to be "
                    f"{clearance.lower[worst]:.3g} m"
                )
            lower[lack > TOLERANCE] = -np.inf
        attainable.append(replace(clearance, lower=lower))
    return tuple(attainable), sentence


def _check(arms: tuple[ArmPaths, ...]) -> None:
    if not arms:
        raise ValueError("arms must be at least one, got none")
    for number, arm in enumerate(arms):
        name = f"arms[{number}]"
        edges = np.asarray(arm.edges, dtype=float)
        if edges.shape != (len(arm.paths) + 1,) or edges.size < 2 or not np.all(np.diff(edges) > 0):
            raise ValueError(
                f"{name}.edges must be {len(arm.paths) + 1} increasing times for "
                f"{len(arm.paths)} paths, got {edges}"
            )
        first, last = arms[0].edges[0], arms[0].edges[-1]
        if abs(edges[0] - first) > _SAME or abs(edges[-1] - last) > _SAME:
            raise ValueError(
                f"all arms must begin and end at the same times: {name} from {edges[0]:.6g} to "
                f"{edges[-1]:.6g} s, arms[0] from {first:.6g} to {last:.6g} s"
            )
        as_vector(f"{name}.gravity", arm.gravity, 3)
        _check_limits(name, arm)
        _check_junctions(name, arm)


def _check_limits(name: str, arm: ArmPaths) -> None:
    for kind in ("velocity", "acceleration", "jerk", "torque"):
        limit = np.asarray(getattr(arm.limits, kind), dtype=float)
        if limit.shape != (arm.robot.dof,) or not np.all(limit > 0.0):
            raise ValueError(
                f"{name}.limits.{kind} must be {arm.robot.dof} positive numbers, got {limit}"
            )


def _check_junctions(name: str, arm: ArmPaths) -> None:
    """That paths meet within the limits, where the arm can be held against gravity."""
    robot = arm.robot
    for number, path in enumerate(arm.paths):
        if path.metric.dim != robot.dof:
            raise ValueError(f"{name}.paths[{number}] is not a path of {robot.dof} joints")
    ends = path_ends(arm)
    for number, path in enumerate(arm.paths[:-1]):
        gap = float(np.abs(path(1.0) - ends[number + 1]).max())
        if gap > _MEET:
            raise ValueError(
                f"{name}.paths[{number + 1}] must begin where the one before ends; the distance is "
                f"{gap:.3g} in the worst joint"
            )
    beyond = np.maximum(robot.lower - ends, ends - robot.upper)
    if beyond.max() > _MEET:
        edge, joint = np.unravel_index(beyond.argmax(), beyond.shape)
        raise ValueError(
            f"{name} is beyond its limits at the end of a path: {robot.joint_names[joint]} by "
            f"{beyond[edge, joint]:.3g} {robot.units[joint]} at {arm.edges[edge]:.4g} s"
        )
    still: Array = np.zeros_like(ends)
    shares = np.abs(robot.inverse_dynamics(ends, still, still, arm.gravity)) / arm.limits.torque
    if shares.max() > 1.0:
        edge, joint = np.unravel_index(shares.argmax(), shares.shape)
        limit = float(arm.limits.torque[joint])
        unit = "N m" if robot.units[joint] == "rad" else "N"
        raise ValueError(
            f"{name} is too weak for its own weight at {arm.edges[edge]:.4g} s, however slowly it "
            f"moves: {robot.joint_names[joint]} has to bear {shares[edge, joint] * limit:.4g}, and "
            f"its limit is {limit:.4g} {unit}"
        )
