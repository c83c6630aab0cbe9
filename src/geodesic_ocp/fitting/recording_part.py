"""The observed segments of a recording, and its contribution to the program of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.blocks import Block, Cells
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.fitting.segment_functions import SegmentFunctions
from geodesic_ocp.logarithm.geodesic import geodesic
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.synergies.synergy import as_segments
from geodesic_ocp.trajectory.grid import Grid

# Shorter or smaller motions do not determine the shape of a path.
_MIN_SAMPLES, _MIN_RANGE = 4, 0.05  # [rad or m]
MAX_END_RATE = 3.0  # of the progress along the path, per duration: up to here it is monotone


@dataclass(frozen=True, eq=False, repr=False)
class ObservedSegments(ShortRepr):
    """The segments of one recording that are fitted.

    Attributes:
        recording: their motion.
        segments: (start, stop) sample indices of those that move.
        every: of all segments of the recording.
        nodes: (count, n, degree + 1), initial paths at the nodes of a grid.
        end_rates: (count, 2), initial rates of progress at the ends, per duration.
        samples: configurations (k, n) of all samples.
        fractions: (k,) of the duration of its segment at which a sample was taken.
        owners: (k,) index of its segment.
        scales: (count, n), of the equation of motion of each joint.
    """

    recording: Recording
    segments: tuple[tuple[int, int], ...]
    every: tuple[tuple[int, int], ...]
    nodes: Array
    end_rates: Array
    samples: Array
    fractions: Array
    owners: np.ndarray
    scales: Array
    _shown = ("segments", "every")


def observe(
    recording: Recording,
    metric: Metric,
    segments: Sequence[tuple[int, int]],
    grid: Grid,
) -> ObservedSegments:
    """The segments of a recording, with the metric's geodesics as initial paths.

    Args:
        recording: with velocities.
        metric: with the parameters' initial values.
        segments: (start, stop) sample indices, which cover the motion.
        grid: of the paths' nodes.

    Raises:
        ValueError: the segments do not cover the motion, or none moves enough to be fitted.
    """
    motion = recording.motion
    every = as_segments(motion, segments)
    kept = tuple(
        (int(start), int(stop))
        for start, stop in every
        if stop - start + 1 >= _MIN_SAMPLES
        and np.ptp(motion.q[start : stop + 1], axis=0).max() >= _MIN_RANGE
    )
    if not kept:
        raise ValueError(
            f"{recording.name or 'recording'}: none of its {len(every)} segments has "
            f"{_MIN_SAMPLES} samples and moves by {_MIN_RANGE:g} rad"
        )
    velocity = np.asarray(motion.velocity)
    nodes, rates, scales, samples, fractions, owners = [], [], [], [], [], []
    for number, (start, stop) in enumerate(kept):
        q0, q1 = motion.q[start], motion.q[stop]
        try:
            path = geodesic(metric, q0, q1)(grid.nodes)
        except (NotConverged, ValueError):
            path = q0 + grid.nodes[:, None] * (q1 - q0)
        nodes.append(path.T)
        time = motion.time[start : stop + 1]
        duration = time[-1] - time[0]
        tensor = metric.matrix((q0 + q1) / 2.0)
        chord = q1 - q0
        length = np.sqrt(chord @ tensor @ chord)
        speeds = (np.sqrt(v @ tensor @ v) for v in (velocity[start], velocity[stop]))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = [np.nan_to_num(speed * duration / length, posinf=1.0) for speed in speeds]
        rates.append(np.clip(ratios, 0.05, MAX_END_RATE - 0.05))
        scales.append(np.diag(tensor) * max(np.abs(np.diff(path, axis=0)).sum(axis=0).max(), 1e-3))
        samples.append(motion.q[start : stop + 1])
        fractions.append((time - time[0]) / duration)
        owners.append(np.full(time.size, number))
    return ObservedSegments(
        recording,
        kept,
        tuple((int(start), int(stop)) for start, stop in every),
        np.array(nodes),
        np.array(rates),
        np.vstack(samples),
        np.concatenate(fractions),
        np.concatenate(owners),
        np.array(scales),
    )


@dataclass(frozen=True, eq=False, repr=False)
class RecordingPart(ShortRepr):
    """One recording's contribution: its data and the functions of its model.

    Attributes:
        functions: of one segment.
        observed: the data.
        deviation: standard deviation of the error that serves as unit [rad or m].
    """

    functions: SegmentFunctions
    observed: ObservedSegments
    deviation: float
    _shown = ("observed", "deviation")

    @cached_property
    def count(self) -> int:
        """Number of segments."""
        return len(self.observed.segments)

    def errors(self, first: int, weight: ca.MX | float) -> Block:
        """Half the mean squared error of the samples, relative, with a weight.

        Args:
            first: index of the first of the variables.
            weight: a number, or an expression in the program's parameters.
        """
        observed, size = self.observed, self.functions.sample.size
        data = observed.samples
        if self.functions.measure == "position":
            data = self.functions.model.hand_pose(data)[1]
        places = first + np.arange(size * self.count).reshape(self.count, size)
        share = ca.DM.ones(len(data), 1) / (len(data) * self.deviation**2)
        values = np.column_stack([observed.fractions, data])
        return Block(
            self.functions.sample, places, values, weights=share * weight, groups=observed.owners
        )

    def equations(self, first: int, units: Array) -> Block:
        """The geodesic equations, which also depend on the parameters, in their units (p,)."""
        f, count = self.functions, self.count
        inner, size = f.grid.size - 2, f.sample.size
        nodes = np.arange(f.num_nodes).reshape(f.grid.size, f.dim)
        indices = first + size * np.arange(count)[:, None, None] + nodes
        every = inner * count
        scales = np.repeat(self.observed.scales, inner, axis=0)
        one = np.concatenate([np.ones(3 * f.dim), units])
        zero = np.zeros((every, f.dim))
        return Block(
            f.equation,
            Cells(indices, f.rows_at_nodes, tuple(range(units.size))),
            scales,
            *(zero, zero),
            units=(np.zeros((every, one.size)), np.tile(one, (every, 1))),
        )
