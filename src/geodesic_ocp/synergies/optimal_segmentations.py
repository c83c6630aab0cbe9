"""The segmentations of a recorded motion with the smallest errors, for every number of segments."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import (
    Array,
    ShortRepr,
    as_integer,
    as_not_negative,
    as_number,
    as_positive,
)
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress, no_progress, shows_progress
from geodesic_ocp.synergies.segment import nearest_samples
from geodesic_ocp.synergies.segment_costs import (
    BestPartitions,
    Curve,
    Measure,
    SegmentCosts,
    best_partitions,
    refine_cuts,
)
from geodesic_ocp.trajectory.motion import Motion

_SLACK = 1e-9  # of the longest duration, relative


@shows_progress
def segment_optimal(
    metric: Metric,
    motion: Motion,
    *,
    count: int | None = None,
    penalty: float | None = None,
    error: float | None = None,
    measure: Measure = "joint",
    model: Model | None = None,
    curve: Curve = "geodesic",
    spacing: float = 0.05,
    max_duration: float = 2.0,
    progress: Progress | None = None,
) -> list[tuple[int, int]]:
    """Cut a motion where `reconstruct` then has the least mean error.

    Exactly one of `count`, `penalty` and `error` says how many segments. The optimum over a grid of
    candidate cuts, every `spacing` seconds, is found by dynamic programming
    (`optimal_segmentations`); then each cut moves by single samples as long as that lowers the
    error. Where `segment` cuts as the motion unfolds, from its past alone, this function sees all
    of it.

    >>> part = go.trajectory.bundled_recording().motion.part(0, 89)
    >>> segments = go.synergies.segment_optimal(go.Euclidean(7), part, count=3)
    >>> len(segments), segments[0][0], segments[-1][1]
    (3, 0, 89)

    Args:
        metric: metric of the motion's dimension.
        motion: motion with velocities, see `Motion.filtered`.
        count: number of segments.
        penalty: cost of a segment: the number of segments k minimizes (mean error of k segments) +
            penalty * k, in the unit of the measure, before the refinement.
        error: the smallest number of segments is taken whose mean error is at most this before the
            refinement, in the unit of the measure.
        measure, model, curve, spacing, max_duration, progress: see `optimal_segmentations`.

    Returns:
        (start, stop) sample indices of every segment, as from `segment`.

    Raises:
        ValueError: not exactly one of count, penalty and error; a count or an error that is not
            possible, with the possible range; or see `optimal_segmentations`.
        NotConverged: see `optimal_segmentations`.
    """
    if sum(each is not None for each in (count, penalty, error)) != 1:
        raise ValueError("exactly one of count, penalty and error must be given")
    found = optimal_segmentations(
        metric,
        motion,
        measure=measure,
        model=model,
        curve=curve,
        spacing=spacing,
        max_duration=max_duration,
        progress=progress,
    )
    if count is None:
        count = found.count_for(penalty=penalty, error=error)
    return found.segments(count)


@shows_progress
def optimal_segmentations(
    metric: Metric,
    motion: Motion,
    *,
    measure: Measure = "joint",
    model: Model | None = None,
    curve: Curve = "geodesic",
    spacing: float = 0.05,
    max_duration: float = 2.0,
    progress: Progress | None = None,
) -> OptimalSegmentations:
    """Return the cuts that minimize the reconstruction error, for every number of segments.

    For k segments, the cuts c_0 = 0 < c_1 < ... < c_k at the last sample minimize

        E_k = 1/N sum_j e(c_j, c_j+1),

    where e is the sum over a segment's samples of the error that `reconstruct` and `evaluate` give
    for it, over the N samples of the motion. Candidates for cuts are the samples nearest to times
    about `spacing` apart. Dynamic programming finds the global optimum among them for all k at once
    (Bellman, Communications of the ACM 4, 1961; Jackson et al., IEEE Signal Processing Letters 12,
    2005). A rest is not treated apart: a segment in which nothing moves has no error.

    >>> time = np.linspace(0.0, 1.2, 61)
    >>> slope = np.where(time < 0.5, -1.0, 1.0)  # the first of two coordinates turns at 0.5 s
    >>> q, v = np.stack([np.abs(time - 0.5), time], 1), np.stack([slope, np.ones(61)], 1)
    >>> motion = go.Motion(time, q, ("x", "y"), v)
    >>> found = go.synergies.optimal_segmentations(go.Euclidean(2), motion, spacing=0.1)
    >>> found.segments(2)
    [(0, 25), (25, 60)]

    Args:
        metric: metric of the motion's dimension.
        motion: motion with velocities, see `Motion.filtered`.
        measure: measure of the error: "joint" [rad], "position" or "orientation" of the hand [m,
            rad].
        model: model whose hand is measured; None is the metric's, where it has one.
        curve: "geodesic", or "cubic": Riemannian cubics (`go.cubic`), which also receive the
            velocities at the cuts; errors of both at equal numbers of segments are not comparable.
        spacing: spacing of the candidates [s].
        max_duration: max duration of a segment [s].
        progress: called with what is done, the number of segments planned, and the total.

    Raises:
        ValueError: the motion has no velocities or does not fit the metric, the measure is unknown
            or needs a model, the metric is not defined at a sample, or a number is out of range.
        NotConverged: so many segments fail that nothing covers the motion.

    Warns:
        RuntimeWarning: log maps failed; such a segment is not available.
    """
    spacing = as_positive("spacing", spacing, "s")
    max_duration = as_positive("max_duration", max_duration, "s")
    costs = SegmentCosts(metric, motion, measure, model, curve)
    candidates = np.array(cut_candidates(motion, spacing))
    gap = float(np.diff(motion.time[candidates]).max())
    if max_duration * (1.0 + _SLACK) < gap:
        raise ValueError(
            f"max_duration must be at least {gap:.4g} s, the largest gap between candidates, got "
            f"{max_duration:g} s"
        )
    time = motion.time[candidates]
    short_enough = time - time[:, None] <= max_duration * (1.0 + _SLACK)
    first, last = np.nonzero(np.triu(short_enough, 1))
    pairs = list(zip(candidates[first].tolist(), candidates[last].tolist(), strict=True))
    report = progress or no_progress
    values = costs(pairs, lambda done: report("planning segments", done, len(pairs)))
    table = np.full((len(candidates), (last - first).max()), np.inf)
    table[last, last - first - 1] = values
    partitions = best_partitions(table)
    counts = np.flatnonzero(np.isfinite(partitions.totals))
    if not counts.size:
        metric.check_domain_along("the motion", motion.time, motion.q)
        raise NotConverged(
            f"no segments cover the motion: {costs.failures} of {len(pairs)} log maps failed"
        )
    _warn(costs.failures, f"of {len(pairs)}", 3)
    errors = partitions.totals[counts] / len(motion)
    return OptimalSegmentations(
        metric, motion, measure, counts, errors, max_duration, candidates, partitions, costs
    )


@dataclass(frozen=True, eq=False, repr=False)
class OptimalSegmentations(ShortRepr):
    """The best cuts of a motion for every number of segments, from `optimal_segmentations`.

    Attributes:
        metric: metric whose geodesics reconstruct the segments.
        motion: motion that is cut.
        measure: "joint" [rad], "position" [m] or "orientation" [rad]: the error that is minimized.
        counts: numbers of segments (k,) that are possible.
        errors: least mean error (k,) of each, with cuts on the grid of candidates, in the unit of
            the measure.
        max_duration: max duration of a segment [s].
    """

    metric: Metric
    motion: Motion
    measure: Measure
    counts: np.ndarray
    errors: Array
    max_duration: float
    _candidates: NDArray[np.int64]
    _partitions: BestPartitions
    _costs: SegmentCosts

    _shown = ("measure", "counts", "errors", "max_duration")

    def segments(self, count: int, *, refined: bool = True) -> list[tuple[int, int]]:
        """Return (start, stop) sample indices of the best `count` segments, as `segment` does.

        Refined by default: each cut moves by single samples as long as that lowers the error.
        `refined=False` gives the optimum on the grid of candidates.

        Raises:
            ValueError: this number of segments is not possible; the message gives the range.
        """
        return list(pairwise(self._cuts(count, refined)[0]))

    def error(self, count: int, *, refined: bool = True) -> float:
        """Return mean error of `segments(count)`, in the unit of the measure. Raises likewise."""
        return self._cuts(count, refined)[1] / len(self.motion)

    def predicted(self, count: int, *, refined: bool = True) -> Motion:
        """Return the coordinates that `reconstruct` predicts from `segments(count)`, without
        velocities.

        Raises likewise.
        """
        q = self._costs.predicted(self.segments(count, refined=refined))
        seen = self.motion
        return Motion(seen.time, q, seen.joint_names, subject=seen.subject)

    def count_for(self, *, penalty: float | None = None, error: float | None = None) -> int:
        """Return the number of segments that a penalty or a largest error selects on the grid.

        Args:
            penalty: the number minimizes the mean error + penalty * number; in the unit of the
                measure, for each segment.
            error: the smallest number whose mean error on the grid is at most this, in the unit of
                the measure.

        Raises:
            ValueError: not exactly one of them, a negative penalty, or an error that no number
                reaches.
        """
        if (penalty is None) == (error is None):
            raise ValueError("exactly one of penalty and error must be given")
        if penalty is not None:
            weighted = as_not_negative("penalty", penalty) * self.counts
            return int(self.counts[np.argmin(self.errors + weighted)])
        return fewest_within(self.counts, self.errors, error)

    def _cuts(self, count: int, refined: bool) -> tuple[list[int], float]:
        """Sample indices of the cuts, with both ends, and their total cost."""
        count = as_integer("count", count, 1)
        if count not in self.counts:
            low = int(self.counts[0])
            high = int(self.counts[-1])
            allowed = f"{low} to {high}" if low < high else f"{low}, the only number possible"
            raise ValueError(
                f"count must be {allowed} with these candidates and segments of at most "
                f"{self.max_duration:g} s, got {count}"
            )
        if not refined:
            cuts = self._candidates[self._partitions.cuts(count)].tolist()
            return cuts, float(self._partitions.totals[count])
        cuts, total, failures = _refined(self, count)
        _warn(failures, "of the refinement", 4)
        return cuts, total

    def _refinement(self, count: int) -> tuple[list[int], float, int]:
        """Return the refined cuts, their total cost, and the number of geodesics not found."""
        start, _ = self._cuts(count, False)
        step = int(np.diff(self._candidates).max()) // 2
        before = self._costs.failures
        cuts, total = refine_cuts(start, self._costs_within, step)
        return cuts, total, self._costs.failures - before

    def _costs_within(self, pairs: list[tuple[int, int]]) -> list[float]:
        """Return costs of segments; those that last longer than allowed have none."""
        time = self.motion.time
        longest = self.max_duration * (1.0 + _SLACK)
        allowed = [pair for pair in pairs if time[pair[1]] - time[pair[0]] <= longest]
        costs = dict(zip(allowed, self._costs(allowed), strict=True))
        return [costs.get(pair, np.inf) for pair in pairs]


_refined = lru_cache(maxsize=32)(OptimalSegmentations._refinement)


def fewest_within(counts: np.ndarray, errors: Array, error: float | None) -> int:
    """Return the smallest of the numbers of segments (k,) whose mean error (k,) is at most this.

    Raises:
        ValueError: none is.
    """
    enough = errors <= as_number("error", error)
    if not enough.any():
        best = int(np.argmin(errors))
        raise ValueError(
            f"error must be at least {errors[best]:.4g}, which {counts[best]} segments reach, got "
            f"{error}"
        )
    return int(counts[np.argmax(enough)])


def cut_candidates(motion: Motion, spacing: float) -> list[int]:
    """Return indices of the samples nearest to evenly spaced times, both ends included."""
    count = max(1, round(motion.duration / spacing))
    return nearest_samples(motion, np.linspace(motion.time[0], motion.time[-1], count + 1))


def _warn(failures: int, which: str, stacklevel: int) -> None:
    if failures:
        warnings.warn(
            f"{failures} log maps {which} failed; these segments are not available",
            RuntimeWarning,
            stacklevel=stacklevel,
        )
