"""The temporal path s(t): distance covered along a geodesic as a function of time.

min int_0^T s''(t)^2 dt with s(0) = 0, s(T) = l and given end speeds (Klein et al. 2022; the
minimum-acceleration counterpart of the minimum-jerk model of Flash and Hogan, J. Neuroscience 5,
1985). The four end conditions determine the solution without inequalities, a cubic, which is
returned at once if it satisfies the bounds. Otherwise an NLP finds s as a cubic on each of equal
intervals, with s and s' continuous; s' is then a parabola on each interval, and bounds on its three
Bezier coefficients hold between the knots as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import perm

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.ipopt import Ipopt, Outcome

_INTERVALS = 64
_MAX_INTERVALS = 4096
# Of Ipopt; hard braking has multipliers so large that the finest is lost to rounding. The problem
# is convex: every tolerance leads to the same solution.
_TOLERANCES = (1e-9, 1e-7, 1e-6)
# Tolerance for bounds that hold with equality, relative to the speed scale of the problem.
_SLACK = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class TimeLaw:
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
        arrays = {
            name: np.array(getattr(self, name), dtype=float)
            for name in ("knots", "positions", "speeds")
        }
        knots = arrays["knots"]
        for name, array in arrays.items():
            if array.shape != knots.shape or array.ndim != 1 or array.size < 2:
                raise ValueError(f"{name} must have one shape (k,), k > 1, got {array.shape}")
            if not np.all(np.isfinite(array)):
                raise ValueError(f"{name} must be finite")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if knots[0] != 0.0 or np.any(np.diff(knots) <= 0.0):
            raise ValueError("knots must increase from 0")

    def __repr__(self) -> str:
        ends = f"speeds {self.speeds[0]:.4g} to {self.speeds[-1]:.4g}"
        return f"TimeLaw(length {self.length:.6g} in {self.duration:.4g} s, {ends})"

    @property
    def duration(self) -> float:
        """[s]"""
        return float(self.knots[-1])

    @property
    def length(self) -> float:
        """Distance covered, in the metric's unit of length."""
        return float(self.positions[-1])

    def __call__(self, t: ArrayLike, order: int = 0) -> Array:
        """s(t) or its derivative of the given order, in the shape of t.

        Raises:
            ValueError: t lies outside [0, duration], or the order is negative.
        """
        times = np.asarray(t, dtype=float)
        slack = 1e-9 * self.duration
        if not np.all((times >= -slack) & (times <= self.duration + slack)):
            raise ValueError(f"t must lie in [0, {self.duration:.6g}] s, got {t!r}")
        if order < 0:
            raise ValueError(f"order must not be negative, got {order}")
        if order > 3:
            return np.zeros(times.shape)
        inside = np.clip(times, 0.0, self.duration)
        interval = np.searchsorted(self.knots[1:-1], inside, side="right")
        since = inside - self.knots[interval]
        result: Array = np.zeros(times.shape)
        for power in range(3, order - 1, -1):  # Horner's scheme
            result = result * since + perm(power, order) * self._coefficients[power, interval]
        return result

    @cached_property
    def _coefficients(self) -> Array:
        """Of the powers 0 to 3 of the time since an interval's first knot, (4, k - 1)."""
        h, start, stop = np.diff(self.knots), self.speeds[:-1], self.speeds[1:]
        chord = np.diff(self.positions) / h
        second, third = (3.0 * chord - 2.0 * start - stop) / h, (start + stop - 2.0 * chord) / h**2
        return np.array([self.positions[:-1], start, second, third])

    @property
    def cost(self) -> float:
        """The integral of s''(t)^2 over time."""
        h, (_, _, second, third) = np.diff(self.knots), self._coefficients
        start, stop = 2.0 * second, 2.0 * second + 6.0 * third * h
        return float(np.sum(h * (start**2 + start * stop + stop**2) / 3.0))


def time_law(
    length: float,
    duration: float,
    start_speed: float,
    end_speed: float,
    *,
    monotone: bool = False,
    max_speed: float | None = None,
) -> TimeLaw:
    """The minimum-acceleration s(t) over a length in a duration, with given end speeds.

    Args:
        length: l >= 0, in the metric's unit.
        duration: T > 0 [s].
        start_speed, end_speed: s'(0), s'(T), in the metric's unit per second.
        monotone: keep s'(t) >= 0 at all times.
        max_speed: keep s'(t) <= max_speed at all times.

    Raises:
        ValueError: a number is not finite or out of range, or no s(t) satisfies the conditions; the
            message says which.
        NotConverged: the solver failed.

    Example:
        >>> import geodesic_ocp as go
        >>> law = go.time_law(length=0.5, duration=2.0, start_speed=0.0, end_speed=0.0)
        >>> float(law(1.0)), float(law(1.0, order=1))
        (0.25, 0.375)
    """
    duration = as_positive("duration", duration, "s")
    given = {"length": length, "start_speed": start_speed, "end_speed": end_speed}
    numbers = {name: _finite(name, number) for name, number in given.items()}
    length, start_speed, end_speed = numbers.values()
    if length < 0.0:
        raise ValueError(f"length must not be negative, got {length}")
    lowest = 0.0 if monotone else -np.inf
    highest = np.inf if max_speed is None else as_positive("max_speed", max_speed)
    speed = max(length / duration, abs(start_speed), abs(end_speed))
    if speed == 0.0:
        return TimeLaw(np.array([0.0, duration]), np.zeros(2), np.zeros(2))
    slack = _SLACK * speed
    for name in ("start_speed", "end_speed"):
        if not lowest - slack <= numbers[name] <= highest + slack:
            raise ValueError(f"{name} {numbers[name]:.6g} lies outside [{lowest}, {highest:.6g}]")
    if length > highest * duration * (1.0 + _SLACK):
        raise ValueError(
            f"max_speed {highest:.6g} is too low to cover {length:.6g} in {duration:.6g} s"
        )

    # Units in which the duration is one and the speeds are of order one.
    scaled = [length / (speed * duration), start_speed / speed, end_speed / speed]
    low, high = lowest / speed, highest / speed
    if _cubic_within(scaled, low, high):
        ends = ((0.0, duration), (0.0, length), (start_speed, end_speed))
        return TimeLaw(*(np.array(values) for values in ends))
    law = _bounded(_num_intervals(scaled, low, high), scaled, low, high)
    return TimeLaw(duration * law.knots, speed * duration * law.positions, speed * law.speeds)


def _finite(name: str, value: float) -> float:
    """The value as a number whose square is finite."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be a number, got {value!r}") from None
    if not abs(number) < 1e100:
        raise ValueError(f"{name} must be finite and below 1e100, got {value}")
    return number


def _cubic_within(scaled: list[float], low: float, high: float) -> bool:
    """Whether the speed of the solution without inequalities is within the bounds at all times."""
    length, start, end = scaled
    half, third = 3.0 * length - 2.0 * start - end, 3.0 * (start + end - 2.0 * length)
    speeds = [start, end]  # of start + 2 half t + third t^2
    if third != 0.0 and 0.0 < -half / third < 1.0:
        speeds.append(start - half**2 / third)
    return all(low - _SLACK <= speed <= high + _SLACK for speed in speeds)


def _num_intervals(scaled: list[float], low: float, high: float) -> int:
    """Number of intervals that allows for immediate braking on the first or last of them.

    On an interval of width h the speed cannot leave its end value u for the bound sooner than along
    the parabola u (1 - t/h)^2, which covers u h / 3.
    """
    length, start, end = scaled
    needed = 1.0
    if low == 0.0:
        needed = max(needed, (start + end) / (3.0 * length) if length > 0.0 else np.inf)
    if np.isfinite(high):
        margin = high - length
        braking = (high - start) + (high - end)
        needed = max(needed, braking / (3.0 * margin) if margin > 0.0 else np.inf)
    if needed > _MAX_INTERVALS / 4:
        if start <= _SLACK and end <= _SLACK and length == 0.0:
            return _INTERVALS
        raise ValueError(
            f"no time law on {_MAX_INTERVALS} intervals keeps its speed within bounds: the length "
            f"{'is too short to stop in' if low == 0.0 else 'needs the full speed throughout'}"
        )
    return max(_INTERVALS, int(np.ceil(4.0 * needed)))


def _bounded(intervals: int, scaled: list[float], low: float, high: float) -> TimeLaw:
    """The solution of the NLP, in scaled units."""
    length, start, end = scaled
    knots = np.linspace(0.0, 1.0, intervals + 1)
    lower = np.concatenate([np.full(intervals + 1, -np.inf), np.full(intervals + 1, low)])
    upper = np.concatenate([np.full(intervals + 1, np.inf), np.full(intervals + 1, high)])
    for index, value in ((0, 0.0), (intervals, length), (intervals + 1, start), (-1, end)):
        lower[index] = upper[index] = value
    guess = np.concatenate([knots * length, start + knots * (end - start)])
    for tolerance in _TOLERANCES:
        outcome: Outcome = _program(intervals, tolerance)(
            x0=guess,
            lbx=lower,
            ubx=upper,
            lbg=np.full(intervals, low),
            ubg=np.full(intervals, high),
        )
        if outcome.success:
            break
    else:
        raise NotConverged(f"the time law was not found: {outcome.status}")
    positions, speeds = np.split(outcome.x, 2)
    return TimeLaw(knots, positions, speeds)


@lru_cache(maxsize=32)
def _program(intervals: int, tolerance: float) -> Ipopt:
    """Min sum over the intervals of int s''^2; g: the middle Bezier coefficient of s' on each."""
    positions, speeds = ca.SX.sym("s", intervals + 1), ca.SX.sym("u", intervals + 1)
    h = 1.0 / intervals
    chord = (positions[1:] - positions[:-1]) / h
    start, stop = speeds[:-1], speeds[1:]
    # s'' is linear on a piece: its values at the piece's ends.
    at_start = (6 * chord - 4 * start - 2 * stop) / h
    at_stop = (2 * start + 4 * stop - 6 * chord) / h
    cost = h / 3 * ca.sum1(at_start**2 + at_start * at_stop + at_stop**2)
    middle = 3 * chord - start - stop
    x = ca.vertcat(positions, speeds)
    # Without relaxed bounds the speed is never negative, not even by Ipopt's usual 1e-8.
    options = {"tol": tolerance, "bound_relax_factor": 0.0}
    return Ipopt({"x": x, "f": cost, "g": middle}, options=options)
