"""A recording's contribution to the program of a fit: its segments, and terms of one segment.

What predicts a segment is stationary for a running cost, a weighted sum of

    energy           T = v' G(q) v / 2
    acceleration     |D_t v|^2_G / 2 = tau' G^-1 tau / 2, with tau = d/dt (dT/dv) - dT/dq
    torque change    |tau'|^2 / 2
    jerk             |q'''|^2 / 2

with the fraction s of the duration as time. q(s) is a polynomial, as are two auxiliary functions,
w = D_t v and p = tau' with p = 0 at the ends, with which nothing has to be solved for and no
derivative is higher than in the cost: the integral of

    c_1 T + c_2 (w' tau - w' G w / 2) - c_3 (p'' tau + |p|^2 / 2) + c_4 |q'''|^2 / 2

is stationary with respect to all their coefficients that are not given (weak form, Gauss
quadrature). Geodesics have the energy alone and given configurations at the ends; the progress
along them over time is a cubic of the fraction u of the duration, 0 to 1, whose rates at the ends
are estimated: between 0 and 3 each, it never moves backwards. Other costs have given velocities as
well, and the fraction itself as progress; accelerations at the ends are optimal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Literal, get_args

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre

from geodesic_ocp.arrays import Array, ShortRepr, as_integer
from geodesic_ocp.blocks import Block, Terms
from geodesic_ocp.cells import Cells, Indices
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.logarithm.cubics import cubic
from geodesic_ocp.logarithm.geodesic import geodesic
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.motion_kernels import SegmentBasis
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.synergies.segment import segment
from geodesic_ocp.synergies.segment_costs import Pair
from geodesic_ocp.synergies.synergy import as_segments

Measure = Literal["joint", "position"]
Cost = Literal["energy", "acceleration", "torque change", "jerk"]

# Shorter or smaller motions do not determine the shape of a path.
_MIN_SAMPLES, _MIN_RANGE = 4, 0.05  # [rad or m]
MAX_END_RATE = 3.0  # of the progress along the path, per duration: up to here it is monotone
DEVIATION = 0.01  # standard deviation of the error that serves as its unit [rad or m]
TIME = 0.1  # [s] in which the costs of a mixture are about equal
_LEAST_DEGREE, _MOST_DEGREE = 5, 14  # beyond, powers of the time are ill-conditioned
_TO_ENDS = Polynomial([0, 1, -1])  # vanishes at both ends


@dataclass(frozen=True, eq=False, repr=False)
class SegmentTerms(ShortRepr):
    """Squared errors of one segment, and the conditions that its prediction is stationary.

    Attributes:
        metric: metric with the symbols `theta` as parameters.
        theta: (p, 1).
        model: model whose hand is compared where the measure is "position".
        measure: what is compared with the observation.
        degree: degree of the polynomials.
        weights: of the costs, numbers or expressions in theta.
    """

    metric: Metric
    theta: ca.SX
    model: Model
    measure: Measure
    degree: int
    weights: Mapping[Cost, ca.SX | float]
    _shown = ("measure", "degree")

    @property
    def dim(self) -> int:
        """Number n of joints."""
        return self.metric.dim

    @property
    def is_geodesic(self) -> bool:
        """Whether the cost is the energy alone."""
        return set(self.weights) == {"energy"}

    @property
    def num_rates(self) -> int:
        """Number of rates of progress that are estimated."""
        return 2 if self.is_geodesic else 0

    @cached_property
    def basis(self) -> SegmentBasis:
        """Polynomials of q, and the quadrature."""
        return SegmentBasis(self.degree - 3, self.degree + 2)

    @cached_property
    def given(self) -> list[int]:
        """Indices of the polynomials of q whose coefficients are observed."""
        return [0, 2] if self.is_geodesic else [0, 1, 2, 3]

    @cached_property
    def functions(self) -> dict[str, tuple[list[Polynomial], int]]:
        """Polynomials of q, w and p, and the highest derivative of each in the cost."""
        legendre = [Legendre.basis(k, [0, 1]).convert(kind=Polynomial) for k in range(self.degree)]
        order = 3 if "jerk" in self.weights else 1 if self.is_geodesic else 2
        found = {"q": (self.basis.polynomials, order)}
        if "acceleration" in self.weights:
            found["w"] = (legendre[:-1], 0)
        if "torque change" in self.weights:
            found["p"] = ([_TO_ENDS * each for each in legendre[:-3]], 1)
        return found

    @cached_property
    def num_nodes(self) -> int:
        """Number of coefficients of all functions, for each joint."""
        return sum(len(polynomials) for polynomials, _ in self.functions.values())

    @property
    def num_x(self) -> int:
        """Number of variables: coefficients (num_nodes, n), and rates of progress."""
        return self.dim * self.num_nodes + self.num_rates

    @property
    def num_equations(self) -> int:
        """Number of equations, one for each coefficient that is not given."""
        return self.dim * (self.num_nodes - len(self.given))

    @cached_property
    def table(self) -> Array:
        """Derivatives of the functions at the points by coefficients, (points, r, nodes)."""
        s, rows, first = self.basis.rule[0], [], 0
        for polynomials, order in self.functions.values():
            values = np.zeros((order + 1, s.size, self.num_nodes))
            for k, each in enumerate(polynomials, first):
                values[:, :, k] = [each.deriv(d)(s) if d else each(s) for d in range(order + 1)]
            rows.append(values)
            first += len(polynomials)
        return np.concatenate(rows).swapaxes(0, 1)

    @cached_property
    def sums(self) -> scipy.sparse.sparray:
        """Matrix from the derivatives of the cost at all points to those of its integral."""
        tests = np.delete(np.arange(self.num_nodes), self.given)
        weighted = self.basis.rule[1][:, None, None] * self.table[:, :, tests]
        matrix = weighted.reshape(-1, tests.size).T
        return scipy.sparse.csr_array(scipy.sparse.kron(matrix, scipy.sparse.eye_array(self.dim)))

    @cached_property
    def derivatives(self) -> Terms:
        """Derivatives of the cost by the functions and their derivatives, over scales.

        Parameters are the scales (n,) and units of the costs. Equations of w and p have no weights.
        """
        counts = {name: order + 1 for name, (_, order) in self.functions.items()}
        symbols = {
            name: [ca.SX.sym(name, self.dim) for _ in range(count)]
            for name, count in counts.items()
        }
        state, scales = symbols["q"], ca.SX.sym("scales", self.dim)
        units = [ca.SX.sym("unit") for _ in self.weights]
        pairs = zip(self.weights.items(), units, strict=True)
        factors = {name: weight * unit for (name, weight), unit in pairs}
        q, v, *higher = state
        energy = self.metric._energy(q, v)
        momentum = ca.gradient(energy, v)
        total, own = ca.SX(0), []
        if "energy" in factors:
            total += factors["energy"] * energy
        if higher:
            torque = ca.jtimes(momentum, v, higher[0]) + ca.jtimes(momentum, q, v)
            torque -= ca.gradient(energy, q)
        if "acceleration" in factors:
            (w,) = symbols["w"]
            total += factors["acceleration"] * (ca.dot(w, torque) - ca.substitute(energy, v, w))
            own.append(torque - ca.substitute(momentum, v, w))
        if "torque change" in factors:
            p, slope = symbols["p"]
            total -= factors["torque change"] * ca.dot(slope, torque)
            own += [p, torque]
        if "jerk" in factors:
            total += factors["jerk"] * ca.sumsqr(state[3]) / 2
        found = [*(ca.gradient(total, each) for each in state), *own]
        z = ca.vertcat(*chain(*symbols.values()), self.theta)
        over = ca.vertcat(*(ca.densify(each) / scales for each in found))
        return Terms(z, ca.vertcat(scales, *units), constraints=ca.cse(over))

    @cached_property
    def sample(self) -> Terms:
        """Half the squared error at a sample, in the coefficients of q and the rates of progress.

        Parameters are the fraction u and the observation: a configuration, or the hand's position.
        """
        size = self.dim * len(self.basis.polynomials)
        x, u = ca.SX.sym("x", size + self.num_rates), ca.SX.sym("u")
        progress = u
        if self.is_geodesic:
            start, end = x[size], x[size + 1]
            progress = start * u + (3 - 2 * start - end) * u**2 + (start + end - 2) * u**3
        values = [ca.polyval(each.coef[::-1], progress) for each in self.basis.polynomials]
        q = ca.reshape(x[:size], self.dim, len(values)) @ ca.vertcat(*values)
        predicted = q if self.measure == "joint" else self.model.hand_pose(q)[1]
        observed = ca.SX.sym("y", predicted.shape[0])
        return Terms(x, ca.vertcat(u, observed), ca.sumsqr(predicted - observed) / 2)

    def coefficients(self, metric: Metric, q: Array, ends: Array) -> Array:
        """Return coefficients (num_nodes, n) of a motion and of its w and p.

        Args:
            metric: with numbers as parameters.
            q: (points, n) at the points of the quadrature.
            ends: coefficients that are given.
        """
        result = np.zeros((self.num_nodes, self.dim))
        result[self.given] = ends
        count = len(self.basis.polynomials)
        rest = np.delete(np.arange(count), self.given)
        result[rest] = np.linalg.lstsq(
            self.table[:, 0, rest], q - self.table[:, 0, :count] @ result[:count]
        )[0]
        if self.is_geodesic:
            return result
        q, v, a = self.table[:, :3].swapaxes(0, 1) @ result
        w = np.array([c - metric.acceleration(x, u) for x, u, c in zip(q, v, a, strict=True)])
        torque = np.array([metric.matrix(x) @ u for x, u in zip(q, w, strict=True)])
        s, first = self.basis.rule[0], count
        if "w" in self.functions:
            last = first + len(self.functions["w"][0])
            row = self.functions["q"][1] + 1  # after q and its derivatives
            result[first:last] = np.linalg.lstsq(self.table[:, row, first:last], w)[0]
            first = last
        if "p" in self.functions:
            slopes = [
                Legendre.fit(s, each, self.degree - 2, [0, 1]).deriv()(s) for each in torque.T
            ]
            result[first:] = np.linalg.lstsq(self.table[:, -2, first:], np.transpose(slopes))[0]
        return result


@dataclass(frozen=True, eq=False, repr=False)
class RecordingPart(ShortRepr):
    """The segments of one recording that are fitted.

    Attributes:
        terms: terms of one segment.
        recording: their motion.
        every: (start, stop) sample indices of all segments of the recording.
        segments: segments of those that move.
        coefficients: (count, num_nodes, n), initial coefficients of q, w and p.
        end_rates: (count, 2), initial rates of progress at the ends, per duration; or (count, 0).
        samples: configurations (k, n) of all samples.
        fractions: (k,) of the duration of its segment at which a sample was taken.
        owners: (k,) index of its segment.
        scales: (count, n), of the equation of motion of each joint.
        units: (count, costs), of the costs.
    """

    terms: SegmentTerms
    recording: Recording
    every: list[tuple[int, int]]
    segments: list[tuple[int, int]]
    coefficients: Array
    end_rates: Array
    samples: Array
    fractions: Array
    owners: Indices
    scales: Array
    units: Array
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
        terms, data = self.terms, self.samples
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
        terms, points = self.terms, len(self.terms.table)
        nodes = np.arange(terms.dim * terms.num_nodes).reshape(terms.num_nodes, terms.dim)
        indices = first + terms.num_x * np.arange(self.count)[:, None, None] + nodes
        values = np.repeat(np.hstack([self.scales, self.units]), points, axis=0)
        sums = scipy.sparse.kron(scipy.sparse.eye_array(self.count), terms.sums)
        zero = np.zeros(sums.shape[0])
        size = terms.derivatives.size
        one = np.tile(np.append(np.ones(size - units.size), units), (len(values), 1))
        return Block(
            *(terms.derivatives, Cells(indices, terms.table, tuple(range(units.size)))),
            *(values, zero, zero),
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
    segments: Sequence[Sequence[Pair]] | None,
    rule: Mapping[str, float],
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
        segments: of each recording; None: those of `segment` by the rule.
        rule: arguments of `segment`.
        report: called with the current step, the amount done, and the total.

    Raises:
        ValueError: wrong recordings, measure, degree or segments.
    """
    listed = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    if not listed or not all(isinstance(each, Recording) for each in listed):
        raise ValueError("recordings must be one or more of go.recordings.Recording")
    if len({each.model.dof for each in listed}) > 1:
        raise ValueError("the models of all recordings must have the same number of joints")
    if segments is not None and len(segments) != len(listed):
        raise ValueError(f"segments must be given for each of {len(listed)} recordings")
    if measure not in get_args(Measure):
        raise ValueError(f"measure must be one of {', '.join(get_args(Measure))}, got {measure!r}")
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
        cuts = segment(initial, recording.motion, **rule) if segments is None else segments[number]
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
    coefficients, rates, scales, units = [], [], [], []
    for start, stop in kept:
        duration = motion.time[stop] - motion.time[start]
        q0, q1 = motion.q[start], motion.q[stop]
        v0, v1 = duration * velocity[[start, stop]]
        ends = np.stack([q0, v0, q1, v1])
        tensor = metric.matrix((q0 + q1) / 2.0)
        inertia = np.trace(tensor) / terms.dim
        path, ratios = _guess(metric, terms, ends), np.zeros(0)
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
            return geodesic(metric, ends[0], ends[2])(s)
        q0, v0, q1, v1 = ends
        return cubic(metric, q0, v0, q1, v1, 1.0)(s)
    except (NotConverged, ValueError):
        if terms.is_geodesic:
            return np.asarray(ends[0] + s[:, None] * (ends[2] - ends[0]))
        return terms.basis.values(s)[:4].T @ ends
