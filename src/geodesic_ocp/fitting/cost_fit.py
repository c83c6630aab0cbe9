"""fit_cost: the weights of a running cost whose optimal motions are nearest to recorded ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, get_args

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.fitting.metric_fit import ConfidenceInterval
from geodesic_ocp.fitting.metric_program import LeastErrors, MetricProgram
from geodesic_ocp.fitting.recording_part import DEVIATION, observe_all
from geodesic_ocp.fitting.resampling import resampled, units_of
from geodesic_ocp.fitting.segment_terms import Cost, Measure
from geodesic_ocp.ipopt import Outcome
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import as_analysis_metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress, no_progress, shows_progress
from geodesic_ocp.synergies.segment_developed import segment_developed
from geodesic_ocp.synergies.uncertainty import Cutting
from geodesic_ocp.tables import markdown, new_table
from geodesic_ocp.trajectory.recording import Recording

if TYPE_CHECKING:
    from pandas import DataFrame

_AT_BOUND = 1e-4  # a weight that is zero
_UNCERTAIN = 0.25  # standard errors of a weight from which on the data do not determine it
_INVOLVED = 0.25  # smallest component of a direction that is named
_SINGULAR = 1e-7  # smallest eigenvalue relative to the largest


@dataclass(frozen=True, eq=False, repr=False)
class CostFit(ShortRepr):
    """Weights of a running cost, estimated from recordings.

    Attributes:
        costs: names of the costs.
        weights: their weights (k,), which add up to one.
        standard_errors: (k,), of segments as independent units; NaN of a weight that is zero and of
            a single segment, inf where the data do not determine it.
        directions: orthonormal directions of weights that are not zero (d, k), the best determined
            first, whose entries add up to zero.
        direction_errors: standard errors along them (d,), inf where the error is flat.
        program: the nonlinear program.
        outcome: its solution.
    """

    costs: tuple[Cost, ...]
    weights: Array
    standard_errors: Array
    directions: Array
    direction_errors: Array
    program: MetricProgram
    outcome: Outcome
    _shown = ("costs", "weights", "standard_errors")

    @property
    def errors(self) -> Array:
        """Root mean square error of each recording, of a joint [rad] or of the hand [m]."""
        terms = self.program.parts[0].terms
        entries = terms.dim if terms.measure == "joint" else 1
        return np.asarray(DEVIATION * np.sqrt(self.program.mean_squares(self.outcome.x) / entries))

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Sentences on combinations of weights that the data do not determine.

        Those along which the standard error is more than a quarter of all weights together.
        """
        sentences = []
        for direction, error in zip(self.directions, self.direction_errors, strict=True):
            if error > _UNCERTAIN:
                sides = [
                    " and ".join(
                        name
                        for name, part in zip(self.costs, sign * direction, strict=True)
                        if part >= _INVOLVED
                    )
                    for sign in (1.0, -1.0)
                ]
                sentences.append(
                    f"the data do not tell {sides[0]} from {sides[1]}: more weight of the one for "
                    f"the other leaves the error almost the same (standard error {error:.2g})"
                )
        return tuple(sentences)

    def _repr_markdown_(self) -> str:
        return markdown(self.table()) + "".join(f"\n- {each}" for each in self.undetermined)

    def table(self, intervals: Sequence[ConfidenceInterval] = ()) -> DataFrame:
        """Return weights, standard errors, and bootstrap intervals if given (`bootstrap_cost`)."""
        header: tuple[str, ...] = ("cost", "weight", "standard error")
        columns = [self.costs, self.weights.tolist(), self.standard_errors.tolist()]
        if intervals:
            header += (f"{100 * intervals[0].confidence:g} % from", "to")
            columns += [[each.low for each in intervals], [each.high for each in intervals]]
        return new_table(header, zip(*columns, strict=True))

    def directions_table(self) -> DataFrame:
        """Return combinations of weights with their standard errors, the best determined first."""
        header = ("direction", *self.costs, "standard error")
        rows = zip(self.directions.tolist(), self.direction_errors.tolist(), strict=True)
        return new_table(header, [(k, *own, error) for k, (own, error) in enumerate(rows, 1)])


@shows_progress
def fit_cost(
    recordings: Recording | Sequence[Recording],
    costs: Sequence[Cost] = get_args(Cost),
    *,
    metric: Callable[[Model], Metric] | None = None,
    measure: Measure = "joint",
    segments: Sequence[Sequence[tuple[int, int]]] | Cutting = segment_developed,
    free_ends: bool = False,
    degree: int = 10,
    progress: Progress | None = None,
) -> CostFit:
    """Estimate the weights of a running cost from recordings, by inverse optimal control.

    The prediction of a segment of duration T is the motion of least

        int w_1 |q'|^2_G / (2 t^2) + w_2 |D_t q'|^2_G / 2 + w_3 t^2 |tau'|^2 / (2 m)
            + w_4 t^2 m |q\'\'\'|^2 / 2  dt

    between the observed configurations and velocities, with accelerations at the ends free,
    tau = G D_t q' (no gravity), t = 0.1 s and the mean m of the diagonal of G, so that the costs of
    an ordinary reach are of similar size. The weights are not negative and add up to one. They
    minimize the squared error between predictions and samples, in the program of `fit_metric`,
    whose constraints are the conditions of optimality of all segments.

    Standard errors are those of the jackknife over segments, by one Newton step each (Efron and
    Tibshirani, "An Introduction to the Bootstrap", 1993, chapter 11). Where errors are far larger
    than noise, or weights are zero, the intervals of `bootstrap_cost` say more.

    >>> recording = go.trajectory.bundled_recording()
    >>> fit = go.fitting.fit_cost(recording, ["energy", "jerk"], degree=6)
    >>> fit.weights.round(2).tolist()
    [0.95, 0.05]

    Args:
        recordings: recordings of one or more persons.
        costs: two or more of "energy", "acceleration", "torque change" and "jerk".
        metric: gives the metric of a model, such as a class; None: the kinetic energy with joint
            inertia of `analyse`.
        measure: "joint", configurations [rad], or "position", the hand's positions [m].
        segments: as of `fit_metric`.
        free_ends: whether configurations and velocities at the ends are estimated, for unfiltered
            data; by default they are as observed.
        degree: degree of the polynomials that represent the motions.
        progress: called with the current step, the amount done, and the total.

    Raises:
        ValueError: wrong costs, recordings or segments.
        NotConverged: Ipopt did not find a solution.
    """
    chosen = tuple(costs)
    known = get_args(Cost)
    if len(set(chosen)) < max(2, len(chosen)) or not set(chosen) <= set(known):
        raise ValueError(f"costs must be two or more of {', '.join(known)}, got {costs!r}")
    if metric is not None and not callable(metric):
        raise ValueError(f"metric must give the metric of a model, such as a class, got {metric!r}")
    if free_ends and measure != "joint":
        raise ValueError("free_ends needs measure='joint': the hand leaves the redundant arm free")
    family = metric or (lambda model: as_analysis_metric(None, model))
    report = progress or no_progress
    k = len(chosen)
    theta = ca.SX.sym("theta", k)
    parts = observe_all(
        recordings,
        family,
        family,
        theta,
        dict(zip(chosen, ca.vertsplit(theta), strict=True)),
        measure,
        degree,
        segments,
        report,
    )
    equal = np.full(k, 1.0 / k)
    program = MetricProgram(parts, equal, np.zeros(k), np.ones(k), free_ends, True)
    outcome = program.solve(report=lambda n: report("fitting the cost: iterations", n, 0))
    if not outcome.success:
        raise NotConverged(f"the cost was not fitted: {outcome.status}", outcome)
    relative = program.least_errors(outcome, by_segment=True)
    found = LeastErrors(
        relative.values, relative.gradients * k, relative.hessians * k**2
    )  # by the weights themselves
    weights = outcome.x[:k] / k
    return CostFit(chosen, weights, *_certainty(weights, found), program, outcome)


@shows_progress
def bootstrap_cost(
    fit: CostFit,
    count: int = 200,
    *,
    by: str = "segment",
    confidence: float = 0.95,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[ConfidenceInterval, ...]:
    """Return percentile intervals of the weights from resampled segments, recordings or subjects.

    Every resample is fitted exactly, from the estimate.

    >>> whole = go.trajectory.bundled_recording()
    >>> parts = [whole.motion.part(k, k + 79) for k in (270, 350, 430)]
    >>> recordings = [go.trajectory.Recording(whole.model, part) for part in parts]
    >>> segments = [[(0, 79)]] * 3
    >>> fit = go.fitting.fit_cost(recordings, ["energy", "jerk"], segments=segments, degree=6)
    >>> energy, jerk = go.fitting.bootstrap_cost(fit, 20)
    >>> jerk.name, round(jerk.low, 1), jerk.high
    ('jerk', 0.8, 1.0)

    Args:
        fit: fit whose segments are used.
        count: number of resamples.
        by: unit that is drawn with replacement, "segment", "recording" or "subject".
        confidence: confidence of the intervals.
        seed: seed of the random numbers.
        progress: called with the current step, the amount done, and the total.

    Raises:
        ValueError: fewer than two units, or a number out of range.
        NotConverged: Ipopt did not find the solution of a resample.
    """
    units = _units(fit.program, by)
    report = progress or no_progress
    drawn, tails = resampled(units, by, count, confidence, seed)
    estimates = []
    for number, weights in enumerate(drawn):
        report("resampling", number, count)
        outcome = fit.program.solve(weights, fit.outcome)
        if not outcome.success:
            raise NotConverged(f"resample {number}: {outcome.status}", outcome)
        estimates.append(outcome.x[: fit.weights.size] * fit.program.start)
    low, high = np.percentile(estimates, tails, axis=0)
    return tuple(
        ConfidenceInterval(name, a, b, confidence, by, len(units))
        for name, a, b in zip(fit.costs, low.tolist(), high.tolist(), strict=True)
    )


def _units(program: MetricProgram, by: str) -> list[list[int]]:
    """Return indices of the segments of each segment, recording or subject."""
    owners = program.owners
    if by == "segment":
        return [[k] for k in range(owners.size)]
    units = units_of([part.recording for part in program.parts], by).values()
    return [np.flatnonzero(np.isin(owners, members)).tolist() for members in units]


def _tangents(size: int) -> Array:
    """Return orthonormal vectors (size - 1, size) whose entries add up to zero."""
    return np.asarray(np.linalg.svd(np.ones((1, size)))[2][1:])


def _certainty(weights: Array, errors: LeastErrors) -> tuple[Array, Array, Array]:
    """Return standard errors (k,), directions (d, k), and standard errors along them (d,)."""
    free = np.flatnonzero((weights > _AT_BOUND) & (weights < 1.0 - _AT_BOUND))
    deviations = np.full(weights.size, np.nan)
    if free.size < 2 or len(errors.values) < 2:
        return deviations, np.zeros((0, weights.size)), np.zeros(0)
    basis = _tangents(free.size)
    own = errors.of_parameters(free)
    gradients = own.gradients @ basis.T
    hessian = basis @ own.hessians.sum(axis=0) @ basis.T
    values, axes = np.linalg.eigh(hessian)
    regular = values > _SINGULAR * max(np.abs(values).max(), 1e-300)
    rest = axes[:, regular]
    flat = axes[:, ~regular]
    without = np.diag(values[regular]) - rest.T @ (basis @ own.hessians @ basis.T) @ rest
    moved = np.linalg.solve(without, (gradients @ rest)[..., None])[..., 0] @ rest.T
    covariance = (1.0 - 1.0 / len(moved)) * moved.T @ moved
    directions = np.zeros((free.size - 1, weights.size))
    sizes, vectors = np.linalg.eigh(covariance)
    if flat.size:  # nothing is known along these
        sizes, vectors = np.linalg.eigh(rest.T @ covariance @ rest)
        vectors = np.hstack([rest @ vectors, flat])
        sizes = np.append(sizes, np.full(flat.shape[1], np.inf))
    directions[:, free] = vectors.T @ basis
    deviations[free] = np.sqrt(np.diag(basis.T @ covariance @ basis))
    unknown = np.any(np.abs(directions[np.isinf(sizes)]) > 1e-3, axis=0)
    deviations[unknown] = np.inf
    return deviations, directions, np.sqrt(np.maximum(sizes, 0.0))
