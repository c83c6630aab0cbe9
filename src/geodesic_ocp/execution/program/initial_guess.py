"""Where the program of a trajectory starts: the paths in stretched time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.program.knots import Knots
from geodesic_ocp.execution.program.reference import Reference
from geodesic_ocp.execution.program.trajectory_program import KnotStates

_ROUNDS, _AT_MOST = 8, 1.5  # how often time is stretched, and by how much at once
_CORNERS = 3.0  # times the limit that accelerations may have in corners, which will be rounded


def through(
    references: Sequence[Reference], knots: Knots, durations: Array, rest: bool
) -> KnotStates:
    """Cubic splines through the references for durations of the intervals."""
    time = knots.times(durations)
    ends = "clamped" if rest else "natural"
    splines = [CubicSpline(time, each.positions, bc_type=ends) for each in references]
    return KnotStates(
        durations,
        tuple(each.positions for each in references),
        tuple(spline(time, 1) for spline in splines),
        tuple(spline(time, 2) for spline in splines),
    )


def stretched(
    arms: Sequence[ArmPaths], references: Sequence[Reference], knots: Knots, rest: bool
) -> Array:
    """Durations (m,) of the intervals in which the references nearly keep the limits [s]."""
    durations = knots.person
    for _ in range(_ROUNDS):
        guess = through(references, knots, durations, rest)
        ratio = np.zeros(knots.count + 1)
        for k, arm in enumerate(arms):
            speed = np.abs(guess.velocities[k]) / arm.limits.velocity
            growth = np.abs(guess.accelerations[k]) / (_CORNERS * arm.limits.acceleration)
            ratio = np.maximum(ratio, np.maximum(speed, np.sqrt(growth)).max(axis=1))
        needed = np.array(
            [
                ratio[first : last + 1].max()
                for first, last in zip(knots.at_edges[:-1], knots.at_edges[1:], strict=True)
            ]
        )
        if np.all(needed <= 1.0):
            break
        durations = durations * np.clip(1.05 * needed, 1.0, _AT_MOST)
    return durations
