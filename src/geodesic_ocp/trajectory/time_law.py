"""The temporal path s(t): distance covered along a geodesic as a function of time.

min int_0^T s''(t)^2 dt with s(0) = 0, s(T) = l and given end speeds (Klein et al. 2022; the
minimum-acceleration counterpart of the minimum-jerk model of Flash and Hogan, J. Neuroscience 5,
1985), in closed form. The four end conditions determine the solution without inequalities, a cubic.

With the bound s' >= 0, the speed u = s' satisfies u'' = c with one constant c wherever it is
positive, and u' = 0 where it reaches zero, as the multiplier of the bound is not negative. So if
the cubic moves backwards, the motion brakes along u_0 (1 - t/a)^2, rests, and accelerates along
u_1 (1 - (T - t)/b)^2. Both have u'' = c, hence a : b = sqrt(u_0) : sqrt(u_1), and they cover
(u_0 a + u_1 b)/3 = l. A bound s' <= u_max is the same for the speed u_max - u. The two are never
active together: where the cubic falls below zero its largest speed is at an end, and vice versa.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_number, as_positive, as_vector, settle
from geodesic_ocp.blocks import at_rows
from geodesic_ocp.manifold.metric import Metric, speeds_at
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import Path

_LARGEST = 1e100  # numbers whose squares are finite
# Tolerance for bounds that hold with equality, relative to the speed scale of the problem.
_SLACK = 1e-9
# Braking to rest over less than this fraction of the length at full speed loses its digits.
_SHORTEST = 1e-6
# Speeds that count as zero, and durations of pauses that are left out, in scaled units.
_NEGLIGIBLE = 1e-12


@dataclass(frozen=True, eq=False, repr=False)
class TimeLaw(ShortRepr):
    """s(t) on t in [0, duration], a piecewise cubic through knots.

    Attributes:
        knots: times (k,) [s].
        positions: s at the knots (k,), in the metric's unit of length.
        speeds: s' at the knots (k,).

    Raises:
        ValueError: arrays of different or wrong shapes, not finite, or knots not increasing from 0.
    """

    knots: Array
    positions: Array
    speeds: Array

    def __post_init__(self) -> None:
        size = max(np.size(self.knots), 2)
        for name in ("knots", "positions", "speeds"):
            array = as_vector(name, getattr(self, name), size)
            array.flags.writeable = False
            settle(self, **{name: array})
        if self.knots[0] != 0.0 or np.any(np.diff(self.knots) <= 0.0):
            raise ValueError("knots must increase from 0")

    _shown = ("length", "duration")

    @property
    def duration(self) -> float:
        """[s]"""
        return float(self.knots[-1])

    @property
    def length(self) -> float:
        """Distance covered, in the metric's unit of length."""
        return float(self.positions[-1])

    def __call__(self, t: ArrayLike, order: int = 0) -> Array:
        """Return s(t) or its derivative of the given order, in the shape of t.

        Raises:
            ValueError: t lies outside [0, duration], or the order is negative.
        """
        times = np.asarray(t, dtype=float)
        slack = 1e-9 * self.duration
        if not np.all((times >= -slack) & (times <= self.duration + slack)):
            raise ValueError(f"t must lie in [0, {self.duration:.6g}] s, got {t!r}")
        if order < 0:
            raise ValueError(f"order must not be negative, got {order}")
        return np.asarray(self._spline(np.clip(times, 0.0, self.duration), order))

    @cached_property
    def _spline(self) -> scipy.interpolate.PPoly:
        """The `scipy.interpolate.CubicHermiteSpline`, built in a fraction of its time."""
        h = np.diff(self.knots)
        start = self.speeds[:-1]
        stop = self.speeds[1:]
        chord = np.diff(self.positions) / h
        second = (3.0 * chord - 2.0 * start - stop) / h
        third = (start + stop - 2.0 * chord) / h**2
        coefficients = np.array([third, second, start, self.positions[:-1]])
        return scipy.interpolate.PPoly.construct_fast(coefficients, self.knots)

    @property
    def cost(self) -> float:
        """The integral of s''(t)^2 over time."""
        h = np.diff(self.knots)
        (third, second, _, _) = self._spline.c
        start = 2.0 * second
        stop = 2.0 * second + 6.0 * third * h
        return float(np.sum(h * (start**2 + start * stop + stop**2) / 3.0))


def time_law(
    length: float,
    duration: float,
    start_speed: float,
    end_speed: float,
    *,
    monotone: bool = False,
) -> TimeLaw:
    """Return the minimum-acceleration s(t) over a length in a duration, with given end speeds.

    Args:
        length: l >= 0, in the metric's unit.
        duration: T > 0 [s].
        start_speed, end_speed: s'(0), s'(T), in the metric's unit per second.
        monotone: keep s'(t) >= 0 at all times.

    Raises:
        ValueError: a number is not finite or out of range, or no s(t) satisfies the conditions; the
            message says which.

    Example:
        >>> law = go.trajectory.time_law(length=0.5, duration=2.0, start_speed=0.0, end_speed=0.0)
        >>> float(law(1.0)), float(law(1.0, order=1))
        (0.25, 0.375)
    """
    duration = as_positive("duration", duration, "s")
    given = {"length": length, "start_speed": start_speed, "end_speed": end_speed}
    numbers = {name: as_number(name, number) for name, number in given.items()}
    if too_large := [name for name, number in numbers.items() if abs(number) >= _LARGEST]:
        raise ValueError(f"{too_large[0]} must be below {_LARGEST:g}")
    length, start_speed, end_speed = numbers.values()
    if length < 0.0:
        raise ValueError(f"length must not be negative, got {length}")
    speed = max(length / duration, abs(start_speed), abs(end_speed))
    if speed == 0.0:
        return TimeLaw(np.array([0.0, duration]), np.zeros(2), np.zeros(2))
    for name in ("start_speed", "end_speed"):
        if monotone and numbers[name] < -_SLACK * speed:
            raise ValueError(f"{name} of a monotone time law must not be negative")

    # Units in which the duration is one and the speeds are of order one.
    scaled = [length / (speed * duration), start_speed / speed, end_speed / speed]
    if not monotone or _least_speed(*scaled) >= -_SLACK:
        ends = ((0.0, duration), (0.0, length), (start_speed, end_speed))
        return TimeLaw(*(np.array(values) for values in ends))
    knots, positions, speeds = _with_pause(*scaled)
    positions[-1] = scaled[0]
    speeds[[0, -1]] = scaled[1:]
    return TimeLaw(duration * knots, speed * duration * positions, speed * speeds)


def _least_speed(length: float, start: float, end: float) -> float:
    """Get the smallest speed of the solution without inequalities, over a unit of time."""
    half = 3.0 * length - 2.0 * start - end
    third = 3.0 * (start + end - 2.0 * length)
    speeds = [start, end]  # of start + 2 half t + third t^2
    if third != 0.0 and 0.0 < -half / third < 1.0:
        speeds.append(start - half**2 / third)
    return min(speeds)


def _with_pause(length: float, start: float, end: float) -> tuple[Array, Array, Array]:
    """Return knots, positions and speeds over a unit of time: brake to rest, pause, accelerate.

    Raises:
        ValueError: the length is too short.
    """
    start = max(start, 0.0)
    end = max(end, 0.0)
    if length < _SHORTEST * (start + end):
        raise ValueError("there is no monotone time law: the length is too short to stop in")
    total = start**1.5 + end**1.5
    brake, launch = 3.0 * length / total * np.sqrt([start, end])
    pause = length * start**1.5 / total  # the position at rest
    points = [(0.0, 0.0, start)]
    if start > _NEGLIGIBLE:
        points.append((brake, pause, 0.0))
    if end > _NEGLIGIBLE and 1.0 - launch > points[-1][0] + _NEGLIGIBLE:
        points.append((1.0 - launch, pause, 0.0))
    knots, positions, speeds = np.transpose([*points, (1.0, length, end)])
    return knots, positions, speeds


_SAME = 1e-6  # of lengths, relative


def motion_along(path: Path, timing: float | TimeLaw, rate: float = 100.0) -> Motion:
    """Return the motion along a path under a time law, or from rest to rest in a duration [s].

    Raises:
        ValueError: a duration or rate that is not positive, a path of zero length, or a time law
            for another length.
    """
    rate = as_positive("rate", rate, "Hz")
    length = path.length
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
    return Motion(time, q, path.metric.coordinate_names, velocity)


def states_at(path: Path, law: TimeLaw, t: Array, order: int = 2) -> tuple[Array, ...]:
    """Return positions, velocities and accelerations, (k, n) each, at times t (k,) [s] of a time
    law.

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
        speed = speeds_at(path.metric, *curve)
        change = np.zeros(0)
    else:
        speed, change = at_rows(_speed_along(path.metric), *curve).T
    per_speed = np.divide(1.0, speed, out=np.zeros_like(speed), where=speed > 0.0)
    rate = law(t, 1) * per_speed
    states = [curve[0], curve[1] * rate[:, None]]
    if order == 2:
        second = (law(t, 2) - rate**2 * change) * per_speed
        states.append(curve[2] * rate[:, None] ** 2 + curve[1] * second[:, None])
    return tuple(states)


@lru_cache(maxsize=32)
def _speed_along(metric: Metric) -> ca.Function:
    """Return (q, q', q'') by s -> |q'|_G and its derivative by s."""
    q, v, a = (ca.SX.sym(name, metric.dim) for name in "qva")
    square = metric.inner(q, v, v)
    speed = ca.sqrt(square)
    half = ca.jtimes(square, ca.vertcat(q, v), ca.vertcat(v, a)) / 2
    return ca.Function("speed_along", [q, v, a], [speed, ca.if_else(speed > 0, half / speed, 0)])
