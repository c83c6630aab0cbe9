"""Room that a planned trajectory leaves to the interpolation of its samples by a controller.

A plan has constant jerk between knots. Between two samples that have no knot between them, the
quintic of their positions, velocities and accelerations is the plan itself. Around a knot it
differs: its jerk overshoots the step of the plan's jerk, and its acceleration cuts the corner.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.trajectory_rounds import ArmCheck
from geodesic_ocp.trajectory.interpolation import JERK_OVERSHOOT, within_intervals

# Share of the limit of the jerk: a step from one end of it to the other, and the overshoot of a
# quintic over that step, wherever the knot is between two samples and however far these are apart.
JERK_SHARE = 1.0 / (1.0 + 2.0 * JERK_OVERSHOOT)
_PHASES = (np.arange(8.0) + 0.5) / 8.0  # where a knot is between two samples; maxima are flat in it


def with_jerk_left(arm: ArmPaths) -> ArmPaths:
    """Return the arm with so much of its limit of the jerk as a plan may use."""
    return replace(arm, limits=replace(arm.limits, jerk=JERK_SHARE * arm.limits.jerk))


def slower_between(checks: Sequence[ArmCheck], step: float, rest: bool) -> float:
    """Return how many times slower a plan must be for a controller that interpolates its samples.

    The largest of 1 and of the shares of the limits that the quintics use of velocities, the square
    root of accelerations, and the cube root of jerks, wherever the knots are between samples.

    Args:
        checks: checks of the arms, with their splines, under the limits that plans may use.
        step: duration between two samples, or less [s].
        rest: whether the plan begins and ends at rest, and stays there.
    """
    slower = 1.0
    for check in checks:
        limits = check.arm.limits
        allowed = limits.velocity, limits.acceleration, limits.jerk / JERK_SHARE
        knots = check.spline.curve.x[1:]
        begins = (knots[:, None] - step * _PHASES).ravel()
        if not rest:
            begins = begins[(begins >= 0.0) & (begins + step <= check.spline.duration)]
        ends = [_states(check, times) for times in (begins, begins + step)]
        for order, largest in enumerate(allowed, start=1):
            found = within_intervals(np.full((begins.size, 1), step), *ends, order)
            share = np.max(np.abs(found.values) / largest, initial=0.0)
            slower = max(slower, float(share) ** (1.0 / order))
    return slower


def _states(check: ArmCheck, times: Array) -> Array:
    """Return positions, velocities and accelerations (3, k, n), at rest before and afterwards."""
    spline = check.spline
    inside = (times >= 0.0) & (times <= spline.duration)
    states = np.array(spline(np.clip(times, 0.0, spline.duration))[:3])
    states[1:, ~inside] = 0.0
    return states
