"""A path travelled in time."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_positive, evaluate
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import Path, speeds_at
from geodesic_ocp.trajectory.time_law import TimeLaw, time_law

_SAME = 1e-6  # of lengths, relative


def motion_along(path: Path, timing: float | TimeLaw, rate: float = 100.0) -> Motion:
    """The motion along a path under a time law, or from rest to rest in a duration [s].

    Raises:
        ValueError: a duration or rate that is not positive, a path of zero length, or a time law
            for another length.
    """
    rate, length = as_positive("rate", rate, "Hz"), path.length
    if not length > 0.0:
        raise ValueError("the path has zero length, so there is no motion along it")
    if isinstance(timing, TimeLaw):
        law = timing
        if abs(law.length - length) > _SAME * length:
            raise ValueError(
                f"the time law covers a length of {law.length:.6g}, the path has {length:.6g}"
            )
    else:
        law = time_law(length, as_positive("duration", timing, "s"), 0.0, 0.0)
    count = max(1, round(law.duration * rate))
    time = np.linspace(0.0, law.duration, count + 1)
    covered = law(time)
    if np.any(covered < -_SAME * length) or np.any(covered > (1.0 + _SAME) * length):
        raise ValueError("the time law leaves the path at one of its ends")
    q, velocity = states_at(path, law, time, 1)
    names = path.metric.joint_names or tuple(f"q[{index}]" for index in range(path.metric.dim))
    return Motion(time, q, names, velocity)


def states_at(path: Path, law: TimeLaw, t: Array, order: int = 2) -> tuple[Array, ...]:
    """Positions, velocities and accelerations, (k, n) each, at times t (k,) [s] of a time law.

    Distances beyond an end of the path are clipped to it; on a path of zero length nothing moves.
    Derivatives above the given order are left out.
    """
    if not path.length > 0.0:
        q = np.tile(path.nodes[0], (t.size, 1))
        return (q, np.zeros_like(q), np.zeros_like(q))[: order + 1]
    s = path.at_length(np.clip(law(t), 0.0, path.length))
    curve = path.derivatives(s, order)
    if order == 0:
        return tuple(curve)
    if order == 1:
        speed, change = speeds_at(path.metric, *curve), np.zeros(0)
    else:
        function = _speed_along(path.metric).map(s.size)
        speed, change = (each[0] for each in evaluate(function, *(each.T for each in curve)))
    per_speed = np.divide(1.0, speed, out=np.zeros_like(speed), where=speed > 0.0)
    rate = law(t, 1) * per_speed
    states = [curve[0], curve[1] * rate[:, None]]
    if order == 2:
        second = (law(t, 2) - rate**2 * change) * per_speed
        states.append(curve[2] * rate[:, None] ** 2 + curve[1] * second[:, None])
    return tuple(states)


@lru_cache(maxsize=32)
def _speed_along(metric: Metric) -> ca.Function:
    """(q, q', q'') by s -> |q'|_G and its derivative by s."""
    q, v, a = (ca.SX.sym(name, metric.dim) for name in "qva")
    square = metric.inner(q, v, v)
    speed = ca.sqrt(square)
    half = ca.jtimes(square, ca.vertcat(q, v), ca.vertcat(v, a)) / 2
    return ca.Function("speed_along", [q, v, a], [speed, ca.if_else(speed > 0, half / speed, 0)])
