"""A recording's contribution to the program of a fit: its segments, and terms of one segment.

A path is a polynomial through its values at Gauss-Lobatto nodes. It is a geodesic where the
Euler-Lagrange equation of its energy holds at the inner nodes (orthogonal collocation),

    d/ds (dT/dv) - dT/dq = 0,  T = v' G(q) v / 2.

The progress along it over time is a cubic of the fraction u of the duration, 0 to 1, whose rates at
the ends are estimated: between 0 and 3 each, it never moves backwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import casadi as ca
import numpy as np
from numpy.polynomial import legendre

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.blocks import Block, Terms
from geodesic_ocp.cells import Cells, Indices
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.logarithm.geodesic import geodesic
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.synergies.synergy import as_segments
from geodesic_ocp.trajectory.grid import Grid

Measure = Literal["joint", "position"]

# Shorter or smaller motions do not determine the shape of a path.
_MIN_SAMPLES, _MIN_RANGE = 4, 0.05  # [rad or m]
MAX_END_RATE = 3.0  # of the progress along the path, per duration: up to here it is monotone
DEVIATION = 0.01  # standard deviation of the error that serves as its unit [rad or m]


@dataclass(frozen=True, eq=False, repr=False)
class SegmentTerms(ShortRepr):
    """Squared errors and geodesic equations of one segment.

    Attributes:
        metric: metric with the symbols `theta` as parameters.
        theta: (p, 1).
        model: model whose hand is compared where the measure is "position".
        measure: what is compared with the observation.
        grid: grid of the nodes.
    """

    metric: Metric
    theta: ca.SX
    model: Model
    measure: Measure
    grid: Grid
    _shown = ("measure", "grid")

    @property
    def dim(self) -> int:
        """Number n of joints."""
        return self.metric.dim

    @property
    def num_nodes(self) -> int:
        """Number of values of a path, n (degree + 1)."""
        return self.dim * self.grid.size

    @property
    def num_equations(self) -> int:
        """Number of equations of a path, n (degree - 1)."""
        return self.dim * (self.grid.size - 2)

    @cached_property
    def equation(self) -> Terms:
        """The Euler-Lagrange equation's left side over scales (n,), in (q, v, a) and theta."""
        q, v, a, scales = (ca.SX.sym(name, self.dim) for name in ("q", "v", "a", "scales"))
        energy = self.metric._energy(q, v)
        momentum = ca.gradient(energy, v)
        force = ca.jtimes(momentum, v, a) + ca.jtimes(momentum, q, v) - ca.gradient(energy, q)
        state = ca.vertcat(q, v, a, self.theta)
        return Terms(state, scales, constraints=ca.cse(ca.densify(force)) / scales)

    @cached_property
    def sample(self) -> Terms:
        """Half the squared error at a sample, in the path's values and the rates at its ends.

        Parameters are the fraction u and the observation: a configuration, or the hand's position.
        """
        x, u = ca.SX.sym("x", self.num_nodes + 2), ca.SX.sym("u")
        nodes, start, end = ca.vertsplit(x, [0, self.num_nodes, self.num_nodes + 1, x.numel()])
        progress = start * u + (3 - 2 * start - end) * u**2 + (start + end - 2) * u**3
        q = ca.reshape(nodes, self.dim, self.grid.size) @ self._interpolation(progress)
        predicted = q if self.measure == "joint" else self.model.hand_pose(q)[1]
        observed = ca.SX.sym("y", predicted.shape[0])
        return Terms(x, ca.vertcat(u, observed), ca.sumsqr(predicted - observed) / 2)

    def _interpolation(self, s: ca.SX) -> ca.SX:
        """Return values (nodes, 1) at s of the Lagrange polynomials of the nodes."""
        degree, z = self.grid.degree, 2 * s - 1
        inverse = np.linalg.inv(legendre.legvander(2.0 * self.grid.nodes - 1.0, degree))
        values = [ca.SX(1), z]
        for k in range(1, degree):  # the recurrence of Legendre's polynomials
            values.append(((2 * k + 1) * z * values[k] - k * values[k - 1]) / (k + 1))
        return ca.SX(inverse.T) @ ca.vertcat(*values)


@dataclass(frozen=True, eq=False, repr=False)
class RecordingPart(ShortRepr):
    """The segments of one recording that are fitted.

    Attributes:
        terms: terms of one segment.
        recording: their motion.
        every: (start, stop) sample indices of all segments of the recording.
        segments: segments of those that move.
        nodes: (count, degree + 1, n), initial paths at the nodes of the grid.
        end_rates: (count, 2), initial rates of progress at the ends, per duration.
        samples: configurations (k, n) of all samples.
        fractions: (k,) of the duration of its segment at which a sample was taken.
        owners: (k,) index of its segment.
        scales: (count, n), of the equation of motion of each joint.
    """

    terms: SegmentTerms
    recording: Recording
    every: list[tuple[int, int]]
    segments: list[tuple[int, int]]
    nodes: Array
    end_rates: Array
    samples: Array
    fractions: Array
    owners: Indices
    scales: Array
    _shown = ("segments", "every")

    @property
    def count(self) -> int:
        """Number of segments that are fitted."""
        return len(self.segments)

    def errors(self, first: int, weight: ca.MX | float) -> Block:
        """Return half the mean squared error of the samples, relative, with a weight.

        Args:
            first: index of the first of the variables.
            weight: a number, or an expression in the program's parameters.
        """
        terms, data = self.terms, self.samples
        if terms.measure == "position":
            data = terms.model.hand_pose(data)[1]
        size = terms.sample.size
        places = first + np.arange(size * self.count).reshape(self.count, size)
        share = ca.DM.ones(len(data), 1) / (len(data) * DEVIATION**2)
        values = np.column_stack([self.fractions, data])
        return Block(terms.sample, places, values, weights=share * weight, groups=self.owners)

    def equations(self, first: int, units: Array) -> Block:
        """Get the geodesic equations, which also depend on the parameters, in their units (p,)."""
        terms, grid = self.terms, self.terms.grid
        nodes = np.arange(terms.num_nodes).reshape(grid.size, terms.dim)
        indices = first + terms.sample.size * np.arange(self.count)[:, None, None] + nodes
        slopes = grid.differentiation[0]
        rows = np.stack([np.eye(grid.size), slopes, slopes @ slopes], axis=1)[1:-1]
        scales = np.repeat(self.scales, len(rows), axis=0)
        zero = np.zeros(scales.shape)
        one = np.tile(np.concatenate([np.ones(3 * terms.dim), units]), (len(scales), 1))
        cells = Cells(indices, rows, tuple(range(units.size)))
        return Block(terms.equation, cells, scales, zero, zero, units=(np.zeros(one.shape), one))


def observe(
    recording: Recording, metric: Metric, segments: Sequence[tuple[int, int]], terms: SegmentTerms
) -> RecordingPart:
    """Return the segments of a recording, with the metric's geodesics as initial paths.

    Args:
        recording: recording with velocities.
        metric: metric with the parameters' initial values.
        segments: (start, stop) sample indices, which cover the motion.
        terms: terms of the fit.

    Raises:
        ValueError: the segments do not cover the motion, or none moves enough to be fitted.
    """
    motion, at = recording.motion, terms.grid.nodes
    every = as_segments(motion, segments)
    kept = [
        (start, stop)
        for start, stop in every
        if stop - start + 1 >= _MIN_SAMPLES
        and np.ptp(motion.q[start : stop + 1], axis=0).max() >= _MIN_RANGE
    ]
    if not kept:
        raise ValueError(
            f"{recording.name or 'recording'}: none of its {len(every)} segments has "
            f"{_MIN_SAMPLES} samples and moves by {_MIN_RANGE:g} rad"
        )
    nodes, rates, scales = [], [], []
    for start, stop in kept:
        q0, q1 = motion.q[start], motion.q[stop]
        try:
            path = geodesic(metric, q0, q1)(at)
        except (NotConverged, ValueError):
            path = q0 + at[:, None] * (q1 - q0)
        nodes.append(path)
        tensor = metric.matrix((q0 + q1) / 2.0)
        vectors = np.stack([q1 - q0, *np.asarray(motion.velocity)[[start, stop]]])
        length, *speeds = np.sqrt(np.einsum("ki,ij,kj->k", vectors, tensor, vectors))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = np.array(speeds) * (motion.time[stop] - motion.time[start]) / length
        rates.append(np.clip(np.nan_to_num(ratios, posinf=1.0), 0.05, MAX_END_RATE - 0.05))
        scales.append(np.diag(tensor) * max(np.abs(np.diff(path, axis=0)).sum(axis=0).max(), 1e-3))
    rows = [np.arange(start, stop + 1) for start, stop in kept]
    times = [motion.time[each] for each in rows]
    return RecordingPart(
        terms,
        recording,
        every,
        kept,
        np.array(nodes),
        np.array(rates),
        motion.q[np.concatenate(rows)],
        np.concatenate([(each - each[0]) / (each[-1] - each[0]) for each in times]),
        np.repeat(np.arange(len(kept)), [each.size for each in rows]),
        np.array(scales),
    )
