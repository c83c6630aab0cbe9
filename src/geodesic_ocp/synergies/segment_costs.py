"""Costs of segments of a motion, and the segmentation of least cost.

A segment is predicted as by `reconstruct`, at the observed times and at a third of the cost: a
geodesic has constant speed, so that the configuration at the distance s(t) is the one at the
fraction s(t) / length of its parameter, and neither arc lengths nor velocities are needed. The best
cuts among candidates are found by dynamic programming (Bellman, "On the approximation of curves by
line segments using dynamic programming", Communications of the ACM 4, 1961; Jackson et al., "An
algorithm for optimal partitioning of data on an interval", IEEE Signal Processing Letters 12,
2005).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from typing import Literal, get_args

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from geodesic_ocp.arrays import Array, ShortRepr, as_choice
from geodesic_ocp.errors import IntegrationFailed, NotConverged
from geodesic_ocp.logarithm.by_newton import CHECK_TOLERANCE, ConnectingGeodesic
from geodesic_ocp.logarithm.cubics import cubic
from geodesic_ocp.logarithm.geodesic import sampled
from geodesic_ocp.logarithm.log import log
from geodesic_ocp.manifold.exp import integrate_geodesic
from geodesic_ocp.manifold.metric import Metric, as_metric, has_compiled_code, in_threads
from geodesic_ocp.manifold.motion_kernels import second_order
from geodesic_ocp.model.model import Model
from geodesic_ocp.synergies.scores import pose_differences
from geodesic_ocp.synergies.segment import observed_velocity, speeds
from geodesic_ocp.synergies.synergy import law_of_segment
from geodesic_ocp.trajectory.motion import Motion

Pair = tuple[int, int]
# A smaller relative decrease is rounding.
_DECREASE = 1e-12
Measure = Literal["joint", "position", "orientation"]
Curve = Literal["geodesic", "cubic"]  # that predicts a segment
_ROWS = 2048  # of configurations whose poses are computed at once
_BLOCK = 8  # segments that a thread plans in one go


class SegmentCosts:
    """Predictions and costs of segments (start, stop) of one motion; each is planned once.

    The cost of a segment is the sum of the absolute errors of its samples, averaged over the hands,
    divided by the number of samples of the motion. The costs of all segments add up to the mean
    error that `synergies.motion_errors` gives for `synergies.reconstruct`.

    Args:
        metric: metric of the geodesics or cubics.
        motion: motion with velocities.
        measure: "joint" [rad], "position" [m] or "orientation" [rad].
        model: model whose hand is measured; None is the metric's, where it has one.
        curve: "geodesic", or "cubic": Riemannian cubics, which receive the velocities at the cuts.

    Raises:
        ValueError: an unknown measure or curve, a measure of the hand without a model, joints that
            the motion lacks, or a motion that does not fit the metric.
    """

    def __init__(
        self,
        metric: Metric,
        motion: Motion,
        measure: Measure,
        model: Model | None,
        curve: Curve = "geodesic",
    ) -> None:
        as_choice("measure", measure, get_args(Measure))
        as_choice("curve", curve, get_args(Curve))
        model = getattr(metric, "model", None) if model is None else model
        if measure != "joint" and model is None:
            raise ValueError(f"measure {measure!r} needs a model, which this metric does not have")
        self.metric = as_metric(metric)
        self.motion = motion
        self.measure = measure
        self.curve = curve
        self._speed = speeds(metric, motion)
        if curve == "cubic" and not metric.has_constant_tensor:
            second_order(metric).available()  # CasADi's expressions are not for several threads
        self._predicted: dict[Pair, Array | None] = {}
        self._costs: dict[Pair, float] = {}
        if measure != "joint":
            assert model is not None
            motion.select(model.joint_names)  # raises where one is missing
            self._model = model
            self._columns = [motion.joint_names.index(name) for name in model.joint_names]
            self._poses = self._hand_poses(motion.q)

    def __call__(
        self, segments: Sequence[Pair], progress: Callable[[int], object] | None = None
    ) -> list[float]:
        """Return costs of segments, inf where no geodesic is found."""
        if new := sorted({pair for pair in segments if pair not in self._costs}):
            self._plan(new, progress or (lambda done: None))
            self._measure(new)
        return [self._costs[pair] for pair in segments]

    @property
    def failures(self) -> int:
        """Number of segments so far for which no geodesic or cubic was found."""
        return sum(rows is None for rows in self._predicted.values())

    def predicted(self, segments: Sequence[Pair]) -> Array:
        """Get configurations (k, n) at all samples, predicted by segments that cover the motion."""
        q = np.array(self.motion.q)
        for start, stop in segments:
            rows = self._predicted[start, stop]
            if rows is None:
                raise NotConverged(f"no {self.curve} was found from sample {start} to {stop}")
            q[start : stop + 1] = rows
        return q

    def _plan(self, pairs: list[Pair], progress: Callable[[int], object]) -> None:
        def rows_of(block: int) -> list[Array | None]:
            return [self._rows(pair) for pair in pairs[block * _BLOCK : (block + 1) * _BLOCK]]

        blocks = -(-len(pairs) // _BLOCK)
        threads = blocks > 1 and has_compiled_code(self.metric)
        results = in_threads(rows_of, blocks) if threads else map(rows_of, range(blocks))
        for pair, rows in zip(pairs, chain.from_iterable(results), strict=True):
            self._predicted[pair] = rows
            progress(len(self._predicted) - len(self._costs))

    def _rows(self, pair: Pair) -> Array | None:
        """Predict a segment; None where no geodesic is found or the metric is singular."""
        try:
            if self.curve == "cubic":
                return predict_cubic(self.metric, self.motion, *pair)
            return predict_segment(self.metric, self.motion, self._speed, *pair)
        except (NotConverged, IntegrationFailed, ValueError):
            return None

    def _measure(self, pairs: list[Pair]) -> None:
        self._costs.update(dict.fromkeys(pairs, np.inf))
        found = {pair: rows for pair in pairs if (rows := self._predicted[pair]) is not None}
        if found:
            samples = np.concatenate([np.arange(start, stop + 1) for start, stop in found])
            errors = self._errors(samples, np.concatenate([*found.values()]))
            edges = np.cumsum([0, *map(len, found.values())])
            totals = np.add.reduceat(errors, edges[:-1]).tolist()
            self._costs.update(zip(found, totals, strict=True))

    def _errors(self, samples: np.ndarray, q: Array) -> Array:
        """Return errors (k,) of configurations (k, n) that are predicted for these samples."""
        if self.measure == "joint":
            return np.asarray(np.mean(np.abs(q - self.motion.q[samples]), axis=1))
        differences = [
            pose_differences(found, (rotations[samples], positions[samples]))
            for found, (rotations, positions) in zip(self._hand_poses(q), self._poses, strict=True)
        ]
        return np.asarray(np.mean(differences, axis=0)[0 if self.measure == "position" else 1])

    def _hand_poses(self, q: Array) -> list[tuple[Array, Array]]:
        """Return poses of each hand in many configurations of the motion's joints."""
        blocks = np.split(q[:, self._columns], range(_ROWS, len(q), _ROWS))
        hands = []
        for hand in self._model.hands:
            poses = [self._model.frame_pose(hand, block) for block in blocks]
            rotations, positions = (np.concatenate(parts) for parts in zip(*poses, strict=True))
            hands.append((rotations, positions))
        return hands


def predict_segment(metric: Metric, motion: Motion, speed: Array, start: int, stop: int) -> Array:
    """Return configurations (stop - start + 1, n) at the samples from start to stop.

    Args:
        metric: metric whose geodesic connects the observed configurations at the two ends.
        motion: observed.
        speed: its speeds |q'|_G at the samples (k,).
        start, stop: indices of the first and the last sample.

    Raises:
        NotConverged, IntegrationFailed: no geodesic was found, or it cannot be sampled.
    """
    q0 = motion.q[start]
    q1 = motion.q[stop]
    velocity = log(metric, q0, q1, wrap=False)  # the way that was recorded
    length = float(metric.norm(q0, velocity))
    samples = motion.time[start : stop + 1]
    if not length > 0.0:
        return np.tile(q0, (samples.size, 1))
    law = law_of_segment(motion, speed, length, start, stop)
    covered = np.clip(law(samples - samples[0]) / length, 0.0, 1.0)
    if metric.has_constant_tensor:
        return np.asarray(q0 + np.outer(covered, velocity))
    found = ConnectingGeodesic(q0, q1, velocity)
    grid, nodes = sampled(
        found, lambda times: integrate_geodesic(metric, q0, velocity, times, CHECK_TOLERANCE)
    )
    return grid.interpolate(grid.in_segments(nodes), covered)


def predict_cubic(metric: Metric, motion: Motion, start: int, stop: int) -> Array:
    """Return configurations (stop - start + 1, n) of the Riemannian cubic from start to stop.

    Raises:
        NotConverged, IntegrationFailed: no cubic was found.
    """
    velocity = observed_velocity(motion)
    time = motion.time[start : stop + 1] - motion.time[start]
    ends = motion.q[start], velocity[start], motion.q[stop], velocity[stop]
    return cubic(metric, *ends, float(time[-1]))(time)


@dataclass(frozen=True, eq=False, repr=False)
class BestPartitions(ShortRepr):
    """The best partition of the steps between m candidates for every number of segments.

    Attributes:
        totals: least sum of the costs (m,), by the number of segments; inf where there is none.
        before: (m, m), for a number of segments and the candidate where the last of them stops, the
            number of steps in that segment.
    """

    totals: Array
    before: np.ndarray

    def cuts(self, count: int) -> list[int]:
        """Get indices of the count + 1 candidates of the best partition into `count` segments."""
        stops = [len(self.totals) - 1]
        for number in range(count, 0, -1):
            stops.append(stops[-1] - int(self.before[number, stops[-1]]))
        return stops[::-1]


def best_partitions(costs: Array) -> BestPartitions:
    """Minimize the sum of the segments' costs, for every number of segments at once.

    D_k(j) = min over d of D_(k-1)(j - d) + costs[j, d - 1], in O(m^2 w) operations.

    Args:
        costs: (m, w); [j, d - 1] of the segment of d steps that stops at candidate j, inf where
            there is none.
    """
    count, widest = costs.shape
    best = np.full((count, count), np.inf)
    before = np.zeros((count, count), dtype=np.int32)
    best[0, 0] = 0.0
    for number in range(1, count):
        padded = np.concatenate([np.full(widest, np.inf), best[number - 1]])
        # Row j holds the totals at the candidates j - 1, j - 2, ..., j - w.
        earlier = sliding_window_view(padded, widest)[:count, ::-1]
        totals = earlier + costs
        steps = np.argmin(totals, axis=1)
        best[number] = np.take_along_axis(totals, steps[:, None], axis=1)[:, 0]
        before[number] = steps + 1
    return BestPartitions(best[:, -1].copy(), before)


def refine_cuts(
    cuts: Sequence[int], costs_of: Callable[[list[Pair]], list[float]], step: int
) -> tuple[list[int], float]:
    """Return coordinate descent on the cuts: each moves by `step` samples while that lowers the
    total.

    The step is halved down to one sample; the result cannot be improved by moving any single cut
    by one sample. The cuts at even and at odd positions are tried in turn, each group at once:
    their segments do not overlap. The total never increases.

    Args:
        cuts: sample indices, of which the first and the last stay.
        costs_of: costs of segments (start, stop), inf where there is none.
        step: the first one, in samples.

    Returns:
        The cuts, and their total cost.
    """
    cuts = list(cuts)
    step = 1 << max(step, 1).bit_length() - 1
    while step >= 1:
        # Cuts that may improve: those that moved, and their neighbours.
        open_cuts = set(range(1, len(cuts) - 1))
        while open_cuts:
            for parity in (0, 1):
                tried = sorted(index for index in open_cuts if index % 2 == parity)
                open_cuts -= set(tried)
                for index in _improve(cuts, tried, costs_of, step):
                    open_cuts |= {index - 1, index, index + 1} & set(range(1, len(cuts) - 1))
        step //= 2
    return cuts, sum(costs_of(list(pairwise(cuts))))


def _improve(
    cuts: list[int], tried: Sequence[int], costs_of: Callable[[list[Pair]], list[float]], step: int
) -> list[int]:
    """Move each of these cuts, no two of them neighbours, to its best place; which have moved."""
    places = [
        [
            place
            for place in (cuts[index], cuts[index] - step, cuts[index] + step)
            if cuts[index - 1] < place < cuts[index + 1]
        ]
        for index in tried
    ]
    pairs = [
        pair
        for index, choices in zip(tried, places, strict=True)
        for place in choices
        for pair in ((cuts[index - 1], place), (place, cuts[index + 1]))
    ]
    costs = iter(costs_of(pairs))
    moved = []
    for index, choices in zip(tried, places, strict=True):
        totals = [next(costs) + next(costs) for _ in choices]
        best = int(np.argmin(totals))
        if totals[best] < totals[0] * (1.0 - _DECREASE):
            cuts[index] = choices[best]
            moved.append(index)
    return moved
