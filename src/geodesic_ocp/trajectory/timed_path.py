"""Paths in time: the motion along a path under a time law."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_positive, evaluate
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import Path
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
    q, velocity, _ = states_at(path, law, time)
    names = path.metric.joint_names or tuple(f"q[{index}]" for index in range(path.metric.dim))
    return Motion(time, q, names, velocity)


def states_at(path: Path, law: TimeLaw, t: Array) -> tuple[Array, Array, Array]:
    """Positions, velocities and accelerations, (k, n) each, at times t (k,) [s] of a time law.

    Distances beyond an end of the path are clipped to it; on a path of zero length nothing moves.
    """
    covered, rate, second = (law(t, order) for order in (0, 1, 2))
    if not path.length > 0.0:
        q = np.tile(path.nodes[0], (t.size, 1))
        return q, np.zeros_like(q), np.zeros_like(q)
    s = path.at_length(np.clip(covered, 0.0, path.length))
    q, slope, bend = (path(s, order) for order in (0, 1, 2))
    speed, change = (
        np.asarray(each)[0]
        for each in evaluate(_speed_along(path.metric).map(s.size), q.T, slope.T, bend.T)
    )
    there = speed > 0.0
    per_speed = np.divide(1.0, speed, out=np.zeros_like(speed), where=there)
    rate = rate * per_speed
    second = (second - rate**2 * change) * per_speed
    velocity = slope * rate[:, None]
    return q, velocity, bend * rate[:, None] ** 2 + slope * second[:, None]


@lru_cache(maxsize=32)
def _speed_along(metric: Metric) -> ca.Function:
    """(q, q', q'') by s -> |q'|_G and its derivative by s."""
    q, v, a = (ca.SX.sym(name, metric.dim) for name in "qva")
    square = metric.inner(q, v, v)
    speed = ca.sqrt(square)
    half = ca.jtimes(square, ca.vertcat(q, v), ca.vertcat(v, a)) / 2
    return ca.Function("speed_along", [q, v, a], [speed, ca.if_else(speed > 0, half / speed, 0)])
