"""Segmentation of a whole motion by its development, which is straight along geodesics.

A geodesic between two points of a motion is, in the motion's development and to first order in the
curvature, the chord between two points of a curve in a flat space. How far the motion is from its
geodesic then follows from sums along the curve, without any geodesic, and so the costs of all
segments between thousands of instants are known in a tenth of a second.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from geodesic_ocp.arrays import Array, as_not_negative, as_positive
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.synergies.segment import development, nearest_samples
from geodesic_ocp.trajectory.motion import Motion

_STEP = 0.01  # [s] between instants at which a motion may be cut
_MONOTONE = 3.0  # times the mean speed, up to which a cubic time law cannot move backwards


def segment_developed(
    metric: Metric,
    motion: Motion,
    *,
    deviation: float = 0.04,
    rest: float = 0.02,
    rest_duration: float = 0.1,
    min_duration: float = 0.1,
    max_duration: float = 2.0,
) -> list[tuple[int, int]]:
    """Cut a whole motion where geodesics explain it best, each cut being worth its price.

    The development x(t) of the motion has its speeds and turns as it does; where the motion follows
    a geodesic, x is straight (`development`). A segment from time a to b is predicted by the chord
    from x(a) to x(b), with the cubic time law that has the observed speeds at both ends, as
    `reconstruct` does. The cuts minimize, over all of the motion,

        1/I sum over segments of int |x - chord|^2 dt + deviation^2 (number of segments),

    where I = int |q'|_G^2 dt / int |q'|^2 dt is the inertia of the motion. They are the global
    optimum over instants 10 ms apart (dynamic programming; Bellman, Communications of the ACM 4,
    1961). Every cut depends on all of the motion around it, and not on the instant at which an
    angle passes a threshold, so that noise moves it little.

    A rest of `rest_duration` or longer is a segment of its own, as in `segment`.

    >>> time = np.arange(200) / 100.0
    >>> corner = go.Motion(time, np.column_stack([time, np.maximum(time - 1.0, 0.0)]), ("x", "y"))
    >>> found = go.synergies.segment_developed(go.Euclidean(2), corner.filtered(cutoff=6.0))
    >>> [round(float(time[stop]), 1) for _, stop in found]  # [s]
    [1.0, 2.0]

    Args:
        metric: metric whose geodesics are meant, of the motion's dimension.
        motion: motion with velocities, see `Motion.filtered`.
        deviation: what a further cut must save: a root mean square deviation of this size over one
            second [rad s^0.5].
        rest, rest_duration: as of `segment`.
        min_duration: min duration of a segment [s]; a rest, and a movement between two rests, may
            be shorter.
        max_duration: max duration of a segment that is not a rest [s], twice the shortest or more.

    Returns:
        (start, stop) sample indices of every segment, as from `segment`.

    Raises:
        ValueError: the motion has no velocities, never moves, is not of the metric's dimension or
            seems to be in degrees; the metric is not defined at a sample; or a number is out of
            range.
        IntegrationFailed: the metric is singular somewhere along the motion.
    """
    deviation = as_positive("deviation", deviation, "rad s^0.5")
    shortest = max(1, round(as_not_negative("min_duration", min_duration, "s") / _STEP))
    longest = round(as_positive("max_duration", max_duration, "s") / _STEP)
    if longest < 2 * shortest:
        raise ValueError(
            f"max_duration must be twice min_duration or more, got {max_duration:g} and "
            f"{min_duration:g} s"
        )
    seen = development(metric, motion, rest, rest_duration)
    velocity = motion(seen.times, 1)
    inertia = float(np.sum(seen.speeds**2) / np.sum(velocity**2))
    inner = np.flatnonzero(np.diff(seen.resting[:-1])) + 1
    cuts = [float(seen.times[0])]
    for start, stop in pairwise([0, *inner.tolist(), seen.times.size - 1]):
        first, last = seen.times[[start, stop]]
        if not seen.resting[start]:
            steps = max(1, round((last - first) / _STEP))
            times = np.linspace(first, last, steps + 1)
            columns = [np.interp(times, seen.times, column) for column in seen.points.T]
            speeds = np.interp(times, seen.times, seen.speeds)
            costs = chord_costs(np.column_stack(columns), speeds, (last - first) / steps, longest)
            costs[:, : min(shortest, steps) - 1] = np.inf
            cuts += times[least_cost_cuts(costs, inertia * deviation**2)[1:-1]].tolist()
        cuts.append(float(last))
    return list(pairwise(nearest_samples(motion, cuts)))


def chord_costs(points: Array, speeds: Array, step: float, longest: int) -> Array:
    """Return int |x - chord|^2 dt of all segments of a curve, in O(m n longest) operations.

    The chord from x_i to x_i+d has the time law p(z) = a_1 z + a_2 z^2 + a_3 z^3, z in [0, 1], with
    the speeds of the curve at its ends, at most three times the mean speed. The sums
    A_k = sum_l (x_i+l - x_i) l^k grow by one sample with d, and the cost follows from them.

    Args:
        points: x (m, n), at times `step` [s] apart.
        speeds: (m,).
        step: [s].
        longest: largest number of steps w of a segment.

    Returns:
        (m, w): [j, d - 1] of the segment of d steps that stops at point j; inf where there is none.
    """
    count = len(points)
    longest = min(longest, count - 1)
    costs = np.full((count, longest), np.inf)
    moments = np.zeros((3, *points.shape))
    # sums of |x_i+l - x_i|^2 and of l^k
    squares = np.zeros(count)
    powers = np.zeros(7)
    for d in range(1, longest + 1):
        chord = points[d:] - points[:-d]
        lengths = np.linalg.norm(chord, axis=1)
        starts, stops = (
            np.minimum(end * (d * step), _MONOTONE * lengths) for end in (speeds[:-d], speeds[d:])
        )
        law = np.array([starts, 3.0 * lengths - 2.0 * starts - stops, starts + stops - 2 * lengths])
        scale = float(d) ** -np.arange(1, 4)
        along = np.einsum("kin,in->ki", moments[:, : count - d], chord)
        along *= scale[:, None] / np.where(lengths > 0.0, lengths, 1.0)
        gram = powers[np.add.outer(np.arange(1, 4), np.arange(1, 4))] * np.outer(scale, scale)
        total = squares[: count - d] - 2.0 * np.sum(law * along, axis=0)
        total += np.einsum("ki,kl,li->i", law, gram, law)
        costs[d:, d - 1] = step * np.maximum(total, 0.0)
        # This chord's end is an inner point of the next longer segments.
        moments[:, : count - d] += (float(d) ** np.arange(1, 4))[:, None, None] * chord
        squares[: count - d] += lengths**2
        powers += float(d) ** np.arange(7)
    return costs


def least_cost_cuts(costs: Array, penalty: float) -> list[int]:
    """Return indices of points that minimize the segments' costs + penalty * their number.

    D(j) = min over d of D(j - d) + costs[j, d - 1] + penalty, in O(m w) operations.

    Args:
        costs: (m, w), see `chord_costs`.
        penalty: in their unit.
    """
    count, widest = costs.shape
    totals = np.zeros(count)
    steps = np.zeros(count, dtype=np.int64)
    for stop in range(1, count):
        before = totals[max(0, stop - widest) : stop][::-1]
        sums = before + costs[stop, : before.size]
        steps[stop] = np.argmin(sums) + 1
        totals[stop] = sums[steps[stop] - 1] + penalty
    cuts = [count - 1]
    while cuts[-1] > 0:
        cuts.append(cuts[-1] - int(steps[cuts[-1]]))
    return cuts[::-1]
