"""The fewest knots with which a spline explains a recorded motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr, as_positive
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.logarithm.cubics import spline
from geodesic_ocp.logarithm.riemannian_spline import RiemannianSpline
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.progress import Progress, shows_progress
from geodesic_ocp.synergies.optimal_segmentations import cut_candidates, fewest_within
from geodesic_ocp.synergies.segment import observed_velocity
from geodesic_ocp.trajectory.motion import Motion

_WINDOW = 3  # knots on either side, beyond which a knot's influence is below 0.27^3 (cubic splines)


@dataclass(frozen=True, eq=False, repr=False)
class SplineKnots(ShortRepr):
    """Knots of splines through a motion, for every number of segments, from `spline_knots`.

    Attributes:
        motion: motion that is explained.
        counts: numbers of segments between knots, increasing (k,).
        errors: mean absolute error of the joints (k,) [rad].
    """

    motion: Motion
    counts: np.ndarray
    errors: Array
    _knots: Mapping[int, tuple[int, ...]]

    _shown = ("counts", "errors")

    def segments(self, count: int) -> list[tuple[int, int]]:
        """Return (start, stop) sample indices between the knots of so many segments.

        Raises:
            ValueError: this number of segments is not known.
        """
        if count not in self._knots:
            raise ValueError(
                f"count must be one of {self.counts[0]} to {self.counts[-1]}, got {count!r}"
            )
        return list(pairwise(self._knots[count]))

    def count_for(self, error: float) -> int:
        """Return the smallest number of segments whose mean error is at most this [rad].

        Raises:
            ValueError: no number of segments reaches it.
        """
        return fewest_within(self.counts, self.errors, error)


@shows_progress
def spline_knots(
    metric: Metric,
    motion: Motion,
    *,
    spacing: float = 0.1,
    progress: Progress | None = None,
) -> SplineKnots:
    """Return few knots of Riemannian splines that explain a motion, for every number of them.

    A spline depends on all of its knots, so that dynamic programming does not apply. Starting with
    knots about `spacing` apart, the knot is removed without which the spline through its
    neighbours, three on either side, has the least error; and so on. The errors are those of the
    whole spline, so that the least possible error for a number of knots is at most this.

    >>> reach = go.trajectory.bundled_recording().motion.part(270, 429)
    >>> knots = go.synergies.spline_knots(go.Euclidean(7), reach, spacing=0.2)
    >>> knots.errors.round(3).tolist()
    [0.056, 0.017, 0.009, 0.006, 0.005, 0.004, 0.004]

    Args:
        metric: metric of the splines; of the Euclidean one they are the usual cubic splines.
        motion: motion with velocities, of which the splines receive the first and the last.
        spacing: of the knots at the beginning [s].
        progress: called with what is done, the number of knots removed, and the total.

    Raises:
        ValueError: the motion has no velocities or does not fit the metric.
        NotConverged: no spline through the first knots was found.
    """
    metric = as_metric(metric)
    velocity = observed_velocity(motion)
    knots = cut_candidates(motion, as_positive("spacing", spacing, "s"))
    total = len(knots) - 2
    found: dict[int, tuple[int, ...]] = {}
    errors: dict[int, float] = {}
    gains: dict[int, float] = {}  # of removing a knot, by its sample
    for done in range(total + 1):
        if progress is not None:
            progress("removing knots", done, total)
        try:
            whole = _through(metric, motion, knots, velocity[[0, -1]])
        except NotConverged:
            if done == 0:
                raise
            break
        error = _errors(whole, motion, knots)
        count = len(knots) - 1
        found[count] = tuple(knots)
        errors[count] = float(error.sum()) / len(motion)
        if count == 1:
            break
        at_knots = whole(motion.time[knots], 1)
        for k in range(1, count):
            if knots[k] not in gains:
                first = max(k - _WINDOW, 0)
                last = min(k + _WINDOW, count)
                without = [*knots[first:k], *knots[k + 1 : last + 1]]
                samples = slice(without[0], without[-1])
                try:
                    part = _through(metric, motion, without, at_knots[[first, last]])
                    added = _errors(part, motion, without)[:-1].sum() - error[samples].sum()
                except NotConverged:
                    added = np.inf
                gains[knots[k]] = float(added)
        least = min(range(1, count), key=lambda k: gains[knots[k]])
        for k in range(max(least - _WINDOW, 1), min(least + _WINDOW + 1, count)):
            del gains[knots[k]]
        del knots[least]
    counts = np.array(sorted(found))
    return SplineKnots(
        motion, counts, np.array([errors[k] for k in counts]), MappingProxyType(found)
    )


def _through(
    metric: Metric, motion: Motion, knots: list[int], velocities: Array
) -> RiemannianSpline:
    v0, v1 = velocities
    return spline(metric, motion.time[knots], motion.q[knots], v0=v0, v1=v1)


def _errors(curve: RiemannianSpline, motion: Motion, knots: list[int]) -> Array:
    """Return mean absolute errors of the joints at the samples from the first to the last knot."""
    samples = slice(knots[0], knots[-1] + 1)
    return np.asarray(np.mean(np.abs(curve(motion.time[samples]) - motion.q[samples]), axis=1))
