"""Between samples: the quintic polynomials by which robot controllers interpolate.

The joint_trajectory_controller of ros2_control moves between two samples along the polynomial of
least order that has their positions, velocities and accelerations: of order five if all three are
stated, of order three without accelerations, and a straight line with positions alone.
"""

from __future__ import annotations

from math import perm
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PPoly

from geodesic_ocp.arrays import Array

_ORDERS = range(6)
# Powers of s in [0, 1] of the quintic with q, h q', h^2 q'' at 0 and 1: coefficients (6, 6).
_COEFFICIENTS = np.linalg.inv(
    [[perm(k, d) * s ** max(k - d, 0) for k in _ORDERS] for s in (0.0, 1.0) for d in range(3)]
)
# A step of the jerk from 0 to 1 inside an interval, a share u before its end, leaves q, q', q'' of
# u^3 / 6, u^2 / 2, u at the end. There the jerk of the quintic is 10 u^3 - 18 u^2 + 9 u, at its
# largest 6 u (1 - u), where its derivative vanishes, at u = (6 - sqrt(6)) / 10; it is nowhere
# larger inside. This is by how much that exceeds the step.
JERK_OVERSHOOT = float((2.0 + 3.0 * np.sqrt(6.0)) / 25.0)
_FRACTIONS = np.linspace(0.0, 1.0, 21)  # between two of them a jerk is missed by 0.002 of a step


def _ends(step: Array, start: Array, end: Array) -> Array:
    """Return q, h q', h^2 q'' at both ends of intervals, from their first positions (6, k, n).

    Positions count from the start of each interval, so that no digits of short ones are lost.

    Args:
        step: durations h of the intervals (k, 1).
        start: positions, velocities and accelerations where they begin (3, k, n).
        end: likewise where they end.
    """
    powers = step ** np.arange(3.0)[:, None, None]
    first = start * powers
    last = end * powers
    last[0] -= start[0]
    first[0] = 0.0
    return np.concatenate([first, last])


def quintic(time: Array, q: Array, v: Array, a: Array) -> PPoly:
    """Return the quintic interpolant of states (k, n) at times (k,), twice continuously
    differentiable, with an error of order six.
    """
    h = np.diff(time)[:, None]
    states = np.array([q, v, a])
    powers = np.einsum("ab,bkn->akn", _COEFFICIENTS, _ends(h, states[:, :-1], states[:, 1:]))
    powers = powers / h ** np.arange(6)[:, None, None]
    powers[0] = q[:-1]
    return PPoly.construct_fast(powers[::-1], time)


class Within(NamedTuple):
    """A derivative of quintic interpolants within k intervals.

    Attributes:
        shares: shares of an interval (m,), from 0 to 1.
        values: values (k, m, n).
        rounding: by how much the last digits of the states may change them (k, m, n).
    """

    shares: Array
    values: Array
    rounding: Array


def within_intervals(
    step: Array, start: Array, end: Array, order: int, digits: Array | None = None
) -> Within:
    """Return derivatives of the quintics between the states at both ends of intervals.

    Args:
        step: durations of the intervals (k, 1) [s].
        start: positions, velocities and accelerations where they begin (3, k, n).
        end: likewise where they end.
        order: 0 for positions to 3 for the jerk.
        digits: what the last digits of the states stand for (3, n); None: exact.
    """
    powers = [perm(k, order) * _FRACTIONS ** max(k - order, 0) for k in _ORDERS]
    weights = np.transpose(powers) @ _COEFFICIENTS  # (m, 6)
    scale = step[:, None] ** order
    values = np.einsum("mb,bkn->kmn", weights, _ends(step, start, end)) / scale
    if order == 0:
        values += start[0][:, None]
    rounding = np.zeros(values.shape)
    if digits is not None:
        halves = 0.5 * digits[:, None] * step ** np.arange(3.0)[:, None, None]  # (3, k, n)
        # The difference of two positions may be off by half a digit of each.
        each = np.concatenate([0.0 * halves[:1], halves[1:], 2.0 * halves[:1], halves[1:]])
        rounding = np.einsum("mb,bkn->kmn", np.abs(weights), each) / scale
    return Within(_FRACTIONS, values, rounding)
