"""What segments of a motion predict, and how far from the observed motion that is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain, pairwise
from typing import Literal, get_args

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import IntegrationFailed, NotConverged
from geodesic_ocp.manifold.metric import Metric, as_metric, has_compiled_code
from geodesic_ocp.model.model import Model
from geodesic_ocp.over_rows import in_threads
from geodesic_ocp.rotations import rotation_vector
from geodesic_ocp.synergies.observed_velocity import speeds
from geodesic_ocp.synergies.segmentation.predict_segment import predict_segment
from geodesic_ocp.synergies.segmentation.refine_cuts import Pair
from geodesic_ocp.trajectory.motion import Motion

Measure = Literal["joint", "position", "orientation"]
_ROWS = 2048  # of configurations whose poses are computed at once
_BLOCK = 8  # segments that a thread plans in one go


class SegmentCosts:
    """Predictions and costs of segments (start, stop) of one motion; each is planned once.

    The cost of a segment is the sum over its samples of the absolute error that `measure` names, as
    of `go.reconstruct` and `go.evaluate`, of several hands their mean; divided by the number of
    samples of the motion, those of its segments add up to the mean error.

    Args:
        metric: of the geodesics.
        motion: with velocities.
        measure: "joint" [rad], "position" [m] or "orientation" [rad].
        model: whose hand is measured; None is the metric's, where it has one.

    Raises:
        ValueError: an unknown measure, a measure of the hand without a model, joints that the
            motion lacks, or a motion that does not fit the metric.
    """

    def __init__(
        self, metric: Metric, motion: Motion, measure: Measure, model: Model | None
    ) -> None:
        if measure not in get_args(Measure):
            known = ", ".join(map(repr, get_args(Measure)))
            raise ValueError(f"measure must be one of {known}, got {measure!r}")
        model = getattr(metric, "model", None) if model is None else model
        if measure != "joint" and model is None:
            raise ValueError(f"measure {measure!r} needs a model, which this metric does not have")
        self.metric, self.motion, self.measure = as_metric(metric), motion, measure
        self._speed = speeds(metric, motion)
        self._predicted: dict[Pair, Array | None] = {}
        self._costs: dict[Pair, float] = {}
        if measure != "joint":
            assert model is not None
            self._model = model
            motion.select(model.joint_names)  # raises where one is missing
            self._columns = [motion.joint_names.index(name) for name in model.joint_names]
            self._poses = self._hand_poses(motion.q[:, self._columns])

    def __repr__(self) -> str:
        return f"SegmentCosts({self.planned} segments planned)"

    def __call__(
        self,
        segments: Sequence[Pair],
        progress: Callable[[int], object] | None = None,
    ) -> list[float]:
        """Costs of segments, inf where no geodesic is found."""
        new = sorted({pair for pair in segments if pair not in self._costs})
        if new:
            self._plan(new, progress)
            self._measure(new)
        return [self._costs[pair] for pair in segments]

    @property
    def failures(self) -> int:
        """Number of segments so far for which no geodesic was found."""
        return sum(rows is None for rows in self._predicted.values())

    @property
    def planned(self) -> int:
        """Number of segments so far."""
        return len(self._predicted)

    def predicted(self, segments: Sequence[Pair]) -> Array:
        """Configurations (k, n) at all samples, predicted by segments that cover the motion."""
        q = np.array(self.motion.q)
        for start, stop in segments:
            rows = self._predicted[start, stop]
            if rows is None:
                raise NotConverged(f"no geodesic was found from sample {start} to {stop}")
            q[start : stop + 1] = rows
        return q

    def _plan(self, pairs: list[Pair], progress: Callable[[int], object] | None) -> None:
        def rows_of(block: int) -> list[Array | None]:
            return [self._rows(pair) for pair in pairs[block * _BLOCK : (block + 1) * _BLOCK]]

        blocks = -(-len(pairs) // _BLOCK)
        threads = blocks > 1 and has_compiled_code(self.metric)
        results = in_threads(rows_of, blocks) if threads else map(rows_of, range(blocks))
        for done, (pair, rows) in enumerate(
            zip(pairs, chain.from_iterable(results), strict=True), start=1
        ):
            self._predicted[pair] = rows
            if progress is not None:
                progress(done)

    def _rows(self, pair: Pair) -> Array | None:
        """What a segment predicts; None where no geodesic is found or the metric is singular."""
        try:
            return predict_segment(self.metric, self.motion, self._speed, *pair)
        except (NotConverged, IntegrationFailed, ValueError):
            return None

    def _measure(self, pairs: list[Pair]) -> None:
        found = [(pair, rows) for pair in pairs if (rows := self._predicted[pair]) is not None]
        self._costs.update(dict.fromkeys(pairs, np.inf))
        if not found:
            return
        samples = np.concatenate([np.arange(start, stop + 1) for (start, stop), _ in found])
        errors = self._errors(samples, np.concatenate([rows for _, rows in found]))
        edges = np.concatenate([[0], np.cumsum([len(rows) for _, rows in found])])
        for (pair, _), (first, after) in zip(found, pairwise(edges), strict=True):
            self._costs[pair] = float(np.sum(errors[first:after]))

    def _errors(self, samples: np.ndarray, q: Array) -> Array:
        """Errors (k,) of configurations (k, n) that are predicted for these samples."""
        if self.measure == "joint":
            return np.asarray(np.mean(np.abs(q - self.motion.q[samples]), axis=1))
        errors = []
        for found, seen in zip(self._hand_poses(q[:, self._columns]), self._poses, strict=True):
            if self.measure == "position":
                errors.append(np.linalg.norm(found[1] - seen[1][samples], axis=1))
            else:
                between = found[0] @ seen[0][samples].transpose(0, 2, 1)
                errors.append(np.linalg.norm(rotation_vector(between), axis=1))
        return np.asarray(np.mean(errors, axis=0))

    def _hand_poses(self, q: Array) -> list[tuple[Array, Array]]:
        """Poses of each hand in many configurations, in blocks of one size."""
        hands = []
        for hand in self._model.hands:
            blocks = []
            for first in range(0, len(q), _ROWS):
                block = q[first : first + _ROWS]
                padded = block if len(q) <= _ROWS else np.resize(block, (_ROWS, q.shape[1]))
                blocks.append([each[: len(block)] for each in self._model.frame_pose(hand, padded)])
            rotations, positions = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
            hands.append((rotations, positions))
        return hands
