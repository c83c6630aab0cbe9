"""A recording's contribution to the program of a fit: its segments, with initial predictions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import get_args

import casadi as ca
import numpy as np
import scipy.sparse

from geodesic_ocp.arrays import Array, ShortRepr, as_choice, as_integer
from geodesic_ocp.blocks import Block
from geodesic_ocp.cells import Cells, Indices
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.fitting.segment_terms import Cost, Measure, SegmentTerms
from geodesic_ocp.logarithm.cubics import cubic
from geodesic_ocp.logarithm.geodesic import geodesic
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress
from geodesic_ocp.synergies.segment_costs import Pair
from geodesic_ocp.synergies.synergy import as_segments
from geodesic_ocp.synergies.uncertainty import Cutting
from geodesic_ocp.trajectory.recording import Recording, as_recordings

# Shorter or smaller motions do not determine the shape of a path.
_MIN_SAMPLES = 4  # [rad or m]
_MIN_RANGE = 0.05  # [rad or m]
MAX_END_RATE = 3.0  # of the progress along the path, per duration: up to here it is monotone
DEVIATION = 0.01  # standard deviation of the error that serves as its unit [rad or m]
TIME = 0.1  # [s] in which the costs of a mixture are about equal
# beyond, powers of the time are ill-conditioned
_LEAST_DEGREE = 5
_MOST_DEGREE = 14


@dataclass(frozen=True, eq=False, repr=False)
class RecordingPart(ShortRepr):
    """The segments of one recording that are fitted."""

    terms: SegmentTerms
    recording: Recording  # their motion
    every: list[tuple[int, int]]  # (start, stop) sample indices of all segments of the recording
    segments: list[tuple[int, int]]  # segments of those that move
    coefficients: Array  # (count, num_nodes, n), initial coefficients of q, w and p
    # (count, 2), initial rates of progress at the ends, per duration; or (count, 0)
    end_rates: Array
    samples: Array  # configurations (k, n) of all samples
    fractions: Array  # (k,) of the duration of its segment at which a sample was taken
    owners: Indices  # (k,) index of its segment
    scales: Array  # (count, n), of the equation of motion of each joint
    units: Array  # (count, costs), of the costs
    _shown = ("segments", "every")

    @property
    def count(self) -> int:
        """Number of segments that are fitted."""
        return len(self.segments)

    def errors(self, first: int, weights: ca.MX | None = None) -> Block:
        """Return half the mean squared error of the samples, relative.

        Args:
            first: index of the first of the variables.
            weights: of the segments, expressions in the program's parameters (count, 1).
        """
        terms = self.terms
        data = self.samples
        if terms.measure == "position":
            data = terms.model.hand_pose(data)[1]
        places = first + terms.num_x * np.arange(self.count)[:, None] + np.arange(terms.sample.size)
        share: ca.MX | ca.DM = ca.DM.ones(len(data), 1) / (len(data) * DEVIATION**2)
        if weights is not None:
            share = share * weights[self.owners.tolist(), 0]
        values = np.column_stack([self.fractions, data])
        return Block(terms.sample, places, values, weights=share, groups=self.owners)

    def equations(self, first: int, units: Array) -> Block:
        """Get the conditions of stationarity, which also depend on the parameters, in their units
        (p,).
        """
        terms = self.terms
        points = len(self.terms.table)
        nodes = np.arange(terms.dim * terms.num_nodes).reshape(terms.num_nodes, terms.dim)
        indices = first + terms.num_x * np.arange(self.count)[:, None, None] + nodes
        values = np.repeat(np.hstack([self.scales, self.units]), points, axis=0)
        sums = scipy.sparse.kron(scipy.sparse.eye_array(self.count), terms.sums)
        zero = np.zeros(sums.shape[0])
        size = terms.derivatives.size
        one = np.tile(np.append(np.ones(size - units.size), units), (len(values), 1))
        return Block(
            terms.derivatives,
            Cells(indices, terms.table, tuple(range(units.size))),
            values,
            zero,
            zero,
            units=(np.zeros(one.shape), one),
            sums=scipy.sparse.csr_array(sums),
        )


def observe_all(
    recordings: Recording | Sequence[Recording],
    metric: Callable[[Model], Metric],
    symbolic: Callable[[Model], Metric],
    theta: ca.SX,
    weights: Mapping[Cost, ca.SX | float],
    measure: Measure,
    degree: int,
    segments: Sequence[Sequence[Pair]] | Cutting,
    report: Progress,
) -> tuple[RecordingPart, ...]:
    """Return the segments of all recordings; those of one model share their terms.

    Args:
        recordings: recordings of one or more persons.
        metric: metric of a model with the parameters' initial values.
        symbolic: the same with the symbols theta.
        theta: (p, 1).
        weights: of the costs, numbers or expressions in theta.
        measure: what is compared.
        degree: degree of the polynomials.
        segments: of each recording, or a function that finds them by the metric.
        report: called with the current step, the amount done, and the total.

    Raises:
        ValueError: wrong recordings, measure, degree or segments.
    """
    listed = as_recordings(recordings)
    if len({each.model.dof for each in listed}) > 1:
        raise ValueError("the models of all recordings must have the same number of joints")
    if not callable(segments) and len(segments) != len(listed):
        raise ValueError(f"segments must be given for each of {len(listed)} recordings")
    as_choice("measure", measure, get_args(Measure))
    if as_integer("degree", degree, _LEAST_DEGREE) > _MOST_DEGREE:
        raise ValueError(f"degree must be {_LEAST_DEGREE} to {_MOST_DEGREE}, got {degree}")
    terms: dict[int, SegmentTerms] = {}
    parts = []
    for number, recording in enumerate(listed):
        report("preparing recordings", number, len(listed))
        model = recording.model
        if id(model) not in terms:
            terms[id(model)] = SegmentTerms(symbolic(model), theta, model, measure, degree, weights)
        initial = metric(model)
        cuts = segments(initial, recording.motion) if callable(segments) else segments[number]
        parts.append(observe(recording, initial, cuts, terms[id(model)]))
    return tuple(parts)


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
    motion = recording.motion
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
    velocity = np.asarray(motion.velocity)
    coefficients = []
    rates = []
    scales = []
    units = []
    for start, stop in kept:
        duration = motion.time[stop] - motion.time[start]
        q0 = motion.q[start]
        q1 = motion.q[stop]
        v0, v1 = duration * velocity[[start, stop]]
        ends = np.stack([q0, v0, q1, v1])
        tensor = metric.matrix((q0 + q1) / 2.0)
        inertia = np.trace(tensor) / terms.dim
        path = _guess(metric, terms, ends)
        ratios = np.zeros(0)
        if terms.is_geodesic:
            vectors = np.stack([q1 - q0, v0, v1])
            length, *speeds = np.sqrt(np.einsum("ki,ij,kj->k", vectors, tensor, vectors))
            with np.errstate(divide="ignore", invalid="ignore"):
                ratios = np.nan_to_num(np.array(speeds) / length, posinf=1.0)
        rates.append(np.clip(ratios, 0.05, MAX_END_RATE - 0.05))
        coefficients.append(terms.coefficients(metric, path, ends[terms.given]))
        scales.append(np.diag(tensor) * max(np.abs(np.diff(path, axis=0)).sum(axis=0).max(), 1e-3))
        square = (duration / TIME) ** 2
        of_costs = dict(
            zip(
                get_args(Cost),
                (square, 1.0, 1.0 / (inertia * square), inertia / square),
                strict=True,
            )
        )
        units.append([1.0 if len(terms.weights) == 1 else of_costs[name] for name in terms.weights])
    rows = [np.arange(start, stop + 1) for start, stop in kept]
    times = [motion.time[each] for each in rows]
    return RecordingPart(
        terms,
        recording,
        every,
        kept,
        np.array(coefficients),
        np.array(rates),
        motion.q[np.concatenate(rows)],
        np.concatenate([(each - each[0]) / (each[-1] - each[0]) for each in times]),
        np.repeat(np.arange(len(kept)), [each.size for each in rows]),
        np.array(scales),
        np.array(units),
    )


def _guess(metric: Metric, terms: SegmentTerms, ends: Array) -> Array:
    """Return the geodesic or the Riemannian cubic between the ends at the points, (points, n).

    Where there is none, that of a constant metric.
    """
    s = terms.basis.rule[0]
    try:
        if terms.is_geodesic:
            return geodesic(metric, ends[0], ends[2], wrap=False)(s)
        q0, v0, q1, v1 = ends
        return cubic(metric, q0, v0, q1, v1, 1.0)(s)
    except (NotConverged, ValueError):
        if terms.is_geodesic:
            return np.asarray(ends[0] + s[:, None] * (ends[2] - ends[0]))
        return terms.basis.values(s)[:4].T @ ends
