"""The observed segments of a recording, and its contribution to the program of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
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


@dataclass(frozen=True, eq=False)
class ObservedSegments:
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

    def __repr__(self) -> str:
        return (
            f"ObservedSegments({self.recording.name!r}, {len(self.segments)} of "
            f"{len(self.every)} move)"
        )


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


@dataclass(frozen=True, eq=False)
class RecordingPart:
    """One recording's contribution: its data and the functions of its model.

    Attributes:
        functions: of one segment.
        observed: the data.
        deviation: standard deviation of the error that serves as unit [rad or m].
    """

    functions: SegmentFunctions
    observed: ObservedSegments
    deviation: float

    def __repr__(self) -> str:
        return f"RecordingPart({self.observed.recording.name!r}, {self.count} segments)"

    @cached_property
    def count(self) -> int:
        """Number of segments."""
        return len(self.observed.segments)

    @cached_property
    def _data(self) -> Array:
        """Observations (m, k) of the samples."""
        if self.functions.measure == "joint":
            return self.observed.samples.T
        return np.asarray(self.functions.model.hand_pose(self.observed.samples)[1].T)

    @cached_property
    def _owner_matrix(self) -> ca.DM:
        """(k, count), sums over the samples of each segment, as means of the recording."""
        k = self.observed.owners.size
        matrix = np.zeros((k, self.count))
        matrix[np.arange(k), self.observed.owners] = 1.0 / (k * self.deviation**2)
        return ca.sparsify(ca.DM(matrix))

    def _samples(self, x: ca.MX) -> list[ca.MX | ca.DM]:
        repeated = x[:, self.observed.owners.tolist()]
        return [repeated, ca.DM(self.observed.fractions[None]), ca.DM(self._data)]

    def errors(self, x: ca.MX) -> ca.MX:
        """Half the mean squared error of each segment's samples, relative, (1, count)."""
        function = self.functions.sample_error.map(self.observed.owners.size)
        return function(*self._samples(x)) @ self._owner_matrix

    def error_gradients(self, x: ca.MX) -> ca.MX:
        """Their gradients by x (num_x, count)."""
        function = self.functions.sample_gradient.map(self.observed.owners.size)
        return function(*self._samples(x)) @ self._owner_matrix

    def error_hessians(self, x: ca.MX) -> ca.MX:
        """Upper triangles of their Hessians by x, (num_x (num_x + 1) / 2, count)."""
        function = self.functions.sample_hessian.map(self.observed.owners.size)
        return function(*self._samples(x)) @ self._owner_matrix

    def _at_nodes(self, x: ca.MX, theta: ca.MX) -> list[ca.MX | ca.DM]:
        f = self.functions
        nodes = ca.reshape(x[: f.num_nodes, :], f.dim, f.grid.size * self.count)
        inner = f.grid.size - 2
        scales = np.repeat(self.observed.scales.T, inner, axis=1)
        return [f.states(nodes), ca.repmat(theta, 1, inner * self.count), ca.DM(scales)]

    def equations(self, x: ca.MX, theta: ca.MX) -> ca.MX:
        """Left sides of the geodesic equations (equations, count)."""
        f = self.functions
        every = f.node_equation.map(self.count * (f.grid.size - 2))(*self._at_nodes(x, theta))
        return ca.reshape(every, f.num_equations, self.count)

    def equation_jacobians(self, x: ca.MX, theta: ca.MX) -> ca.MX:
        """Their derivatives by theta and nodes, columns first, (.., count)."""
        f = self.functions
        every = f.node_jacobian.map(self.count * (f.grid.size - 2))(*self._at_nodes(x, theta))
        return f.assemble_jacobian.map(self.count)(every)

    def equation_hessians(self, x: ca.MX, theta: ca.MX, factors: ca.MX) -> ca.MX:
        """Upper triangles of the Hessians of factors' equations by theta and nodes, (.., count)."""
        f = self.functions
        inner = f.grid.size - 2
        per_node = ca.reshape(factors, f.dim, inner * self.count)
        arguments = [*self._at_nodes(x, theta), per_node]
        every = f.node_hessian.map(self.count * inner)(*arguments)
        return f.assemble_hessian.map(self.count)(every)
