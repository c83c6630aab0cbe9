"""`geodesic-ocp check-trajectory`: whether a robot can execute the trajectory in a file."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.cli.notes import printed_warnings
from geodesic_ocp.cli.trajectory.limit_values import given_limits
from geodesic_ocp.execution.check_trajectory import check_trajectory
from geodesic_ocp.execution.clearance import Clearance, clearance_constraint
from geodesic_ocp.model.formats.load_model import load_model
from geodesic_ocp.model.inertias import with_rotor_inertia
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.alignment.alignment import alignment, read_alignment
from geodesic_ocp.trajectory.read_trajectory import read_trajectory

_FREE_FALL = (0.0, 0.0, -9.81)


def check_trajectory_file(options: argparse.Namespace) -> int:
    """`geodesic-ocp check-trajectory`; returns 0 if all conditions hold, else 1.

    Raises:
        ValueError: a file cannot be read, an unknown robot, other joints, or wrong limits.
    """
    if sum((options.aligned, options.gravity is not None, options.alignment is not None)) > 1:
        raise ValueError("--aligned, --alignment and --gravity exclude each other")
    trajectory = read_trajectory(options.file)
    with printed_warnings():
        robots = [load_model(name, hand=options.hand, base=options.base) for name in options.robot]
    gravity = _gravity(options, robots)
    if options.rotor_inertia:
        robots = [with_rotor_inertia(robot) for robot in robots]
    if options.payload is not None:
        robots = [robot.with_payload(options.payload) for robot in robots]
    limits = given_limits(options, robots)
    check = check_trajectory(
        trajectory,
        robots,
        limits,
        gravity=gravity,
        rest=not options.moving,
        uniform=not options.uneven,
        clearance=_clearance(robots) if options.clearance else None,
    )
    rate = "uneven samples" if trajectory.rate is None else f"{trajectory.rate:.6g} Hz"
    print(f"{options.file}: {len(trajectory.time)} samples, {trajectory.duration:.4g} s, {rate}\n")
    print(check)
    if check.clearance is not None:
        print(f"\nleast distance of links: {check.clearance:.3g} m")
    for robot, of_robot in zip(robots, limits, strict=True):
        print(f"\nlimits of {robot.name}:")
        for name, source in of_robot.sources.items():
            print(f"  {name}: {source}")
    return 0 if check.passed else 1


def _gravity(options: argparse.Namespace, robots: Sequence[Model]) -> Array:
    """Acceleration of free fall in the axes of each robot's base [m/s^2]."""
    if options.alignment is not None:
        if len(options.alignment) != len(robots):
            raise ValueError(f"--alignment: one for each --robot, got {len(options.alignment)}")
        found = [read_alignment(file) for file in options.alignment]
        return np.array([np.asarray(each.base) @ _FREE_FALL for each in found])
    if not options.aligned:
        given = _FREE_FALL if options.gravity is None else options.gravity
        return np.tile(np.asarray(given, dtype=float), (len(robots), 1))
    return np.array([np.asarray(alignment(robot).base) @ _FREE_FALL for robot in robots])


def _clearance(robots: Sequence[Model]) -> Clearance | None:
    """Distances of links from each other; None, with a note, if geometry is not known."""
    reason: object = "the robot has no collision geometry"
    try:
        found = clearance_constraint(robots)
    except ValueError as error:
        found, reason = None, error
    if found is None:
        print(f"note: clearance is not checked: {reason}")
    return found
