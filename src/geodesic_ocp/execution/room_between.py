"""Room that a planned trajectory leaves to the interpolation of its samples by a controller.

A plan has constant jerk between knots. Between two samples that have no knot between them, the
quintic of their positions, velocities and accelerations is the plan itself. Around a knot it
differs: its jerk overshoots the step of the plan's jerk, for which the program leaves room, and its
acceleration cuts the corner, by the more the longer the interval is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.trajectory_rounds import ArmCheck
from geodesic_ocp.trajectory.interpolation import within_intervals


def slower_between(checks: Sequence[ArmCheck], step: float, rest: bool) -> float:
    """Return how many times slower a plan must be for a controller that interpolates its samples.

    The largest of 1 and of the shares of the limits that the quintics use of velocities, the square
    root of accelerations, and the cube root of jerks, wherever the knots are between samples.

    Args:
        checks: checks of the arms, with their splines.
        step: duration between two samples, or less [s].
        rest: whether the plan begins and ends at rest, and stays there.
    """
    slower = 1.0
    # Where a knot is between two samples: maxima are flat in it.
    phases = (np.arange(8.0) + 0.5) / 8.0
    for check in checks:
        limits = check.arm.limits
        knots = check.spline.curve.x[1:]
        begins = (knots[:, None] - step * phases).ravel()
        if not rest:
            begins = begins[(begins >= 0.0) & (begins + step <= check.spline.duration)]
        steps = np.full((begins.size, 1), step)
        start = _states(check, begins)
        end = _states(check, begins + step)
        for order, largest in enumerate((limits.velocity, limits.acceleration, limits.jerk), 1):
            found = within_intervals(steps, start, end, order)
            share = float(np.max(np.abs(found.values) / largest, initial=0.0))
            slower = max(slower, share ** (1.0 / order))
    return slower


def _states(check: ArmCheck, times: Array) -> Array:
    """Return positions, velocities and accelerations (3, k, n), at rest before and afterwards."""
    spline = check.spline
    inside = (times >= 0.0) & (times <= spline.duration)
    states = np.array(spline(np.clip(times, 0.0, spline.duration))[:3])
    states[1:, ~inside] = 0.0
    return states
