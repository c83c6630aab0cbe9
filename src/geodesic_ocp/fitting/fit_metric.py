"""fit_metric: the metric whose geodesics or cubics are nearest to recorded motions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import get_args

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_choice
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.fitting.metric_fit import Estimate, MetricFit
from geodesic_ocp.fitting.metric_program import LeastErrors, MetricProgram
from geodesic_ocp.fitting.parameter import JOINT_INERTIA, Parameter, as_parameters, with_parameters
from geodesic_ocp.fitting.recording_part import observe_all
from geodesic_ocp.fitting.segment_terms import Measure
from geodesic_ocp.ipopt import Outcome
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import AdjustableKineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress, no_progress, shows_progress
from geodesic_ocp.synergies.segment_costs import Curve
from geodesic_ocp.synergies.segment_developed import segment_developed
from geodesic_ocp.synergies.uncertainty import Cutting
from geodesic_ocp.trajectory.motion import bandwidth
from geodesic_ocp.trajectory.recording import Recording

_AT_BOUND = 1e-4  # distance from a bound, relative to the initial or the largest value
_UNITS = {"armature": "kg m^2", "payload": "kg", "joint_inertia": "m r^2"}
# Directions in which the logarithms of the parameters are more uncertain than this are reported.
_UNCERTAIN = 0.5
_SINGULAR = 1e-7  # smallest eigenvalue relative to the largest
_INVOLVED = 0.25  # smallest component of a direction that is named


@shows_progress
def fit_metric(
    recordings: Recording | Sequence[Recording],
    parameters: Parameter | Sequence[Parameter] = JOINT_INERTIA,
    *,
    metric: Callable[[Model], Metric] = AdjustableKineticEnergy,
    measure: Measure = "joint",
    segments: Sequence[Sequence[tuple[int, int]]] | Cutting = segment_developed,
    free_ends: bool = False,
    curve: Curve = "geodesic",
    degree: int = 8,
    progress: Progress | None = None,
) -> MetricFit:
    """Estimate parameters of a metric from recordings, by inverse optimal control.

    One nonlinear program in the parameters and the predictions of all segments: it minimizes the
    squared error between predictions and samples, the mean over the recordings of the mean over the
    samples, subject to each prediction being a geodesic or Riemannian cubic of the metric with
    these parameters. Ipopt solves it with exact first and second derivatives. The progress along a
    geodesic is a cubic in time whose end rates are estimated too, so that the parameters are
    determined by the shape of the paths and not by differentiated data. Cubics have the observed
    velocities at the cuts. The cuts between segments stay fixed.

    >>> arm = go.human_arm()
    >>> metric = go.manifold.AdjustableKineticEnergy(arm, joint_inertia=0.05)
    >>> q0, q1 = [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1], [1.2, -0.2, -0.9, 1.6, -0.3, 0.1, 0.4]
    >>> path, u = go.geodesic(metric, q0, q1), np.linspace(0.0, 1.0, 51)  # 1 s at 50 Hz
    >>> s, rate = 3 * u**2 - 2 * u**3, 6 * u - 6 * u**2
    >>> motion = go.Motion(u, path(s), arm.joint_names, rate[:, None] * path(s, 1))
    >>> fit = go.fitting.fit_metric(go.trajectory.Recording(arm, motion), segments=[[(0, 50)]])
    >>> round(fit.values["joint_inertia"], 4)
    0.05

    Args:
        recordings: recordings of one or more persons.
        parameters: fields of the metric and their initial values; by default one joint inertia for
            all joints, relative to the arm's m r^2 (see `AdjustableKineticEnergy`).
        metric: gives the metric of a model, such as a class: a dataclass whose fields are the
            parameters, with a matrix(q) that takes CasADi expressions for them.
        measure: "joint", configurations [rad], or "position", the hand's positions [m].
        segments: a function that finds the segments of a motion by the metric with the initial
            values, as of `analyse`; or those of each recording, (start, stop) sample indices.
            Segments that hardly move are left out.
        free_ends: whether the ends of the predictions are estimated; by default they are as
            observed, as in `reconstruct`. Estimated ends are for noisy, unfiltered data.
        curve: what predicts a segment: "geodesic", or "cubic", the motion of least covariant
            acceleration between the observed configurations and velocities (`go.cubic`).
        degree: degree of the polynomials that represent the predictions, 5 to 14.
        progress: called with the current step, the amount done, and the total.

    Returns:
        Estimates with standard errors. `bootstrap_fit`, `leave_one_out` and `error_profile` take
        it further, `save_metric` writes it to a file.

    Raises:
        ValueError: wrong parameters, curve or segments, or models of different numbers of joints.
        NotConverged: Ipopt did not find a solution.
    """
    chosen = as_parameters(parameters)
    report = progress or no_progress
    if not callable(metric):
        raise ValueError(f"metric must give the metric of a model, such as a class, got {metric!r}")
    as_choice("curve", curve, get_args(Curve))
    if free_ends and measure != "joint":
        raise ValueError("free_ends needs measure='joint': the hand leaves the redundant arm free")
    theta = ca.SX.sym("theta", len(chosen))
    start, lower, upper = np.array([(p.start, p.lower, p.upper) for p in chosen], dtype=float).T
    parts = observe_all(
        recordings,
        lambda model: with_parameters(metric(model), chosen, start.tolist()),
        lambda model: with_parameters(metric(model), chosen, ca.vertsplit(theta)),
        theta,
        {"energy" if curve == "geodesic" else "acceleration": 1.0},
        measure,
        degree,
        segments,
        report,
    )
    return solve_program(
        MetricProgram(parts, start, lower, upper, free_ends),
        chosen,
        metric,
        report=lambda k: report("fitting the metric: iterations", k, 0),
    )


def solve_program(
    program: MetricProgram,
    parameters: tuple[Parameter, ...],
    metric: Callable[[Model], Metric],
    near: Outcome | None = None,
    report: Callable[[int], object] | None = None,
) -> MetricFit:
    """Return the fit of a program with equal weights of its recordings, from a start if given.

    Raises:
        NotConverged: Ipopt did not find a solution.
    """
    outcome = program.solve(near=near, report=report)
    if not outcome.success:
        raise NotConverged(f"the metric was not fitted: {outcome.status}", outcome)
    derivatives = program.least_errors(outcome)
    relative, lower, upper = (each[: program.size] for each in (outcome.x, *program.bounds))
    bounded = (relative - lower < _AT_BOUND) | (upper - relative < _AT_BOUND * upper)
    free = np.flatnonzero(~bounded)
    of_free = derivatives.of_parameters(free)
    matrix = _covariance(program, of_free)
    deviations = np.full(program.size, np.nan)
    deviations[free] = np.sqrt(np.diag(matrix)) * program.start[free]
    numbers = (relative * program.start).tolist(), deviations.tolist(), bounded.tolist()
    estimates = tuple(
        Estimate(each.name, value, error, _UNITS.get(each.field, ""), at_bound)
        for each, value, error, at_bound in zip(parameters, *numbers, strict=True)
    )
    unknown = _undetermined(of_free, matrix, relative[free], [parameters[k].name for k in free])
    return MetricFit(estimates, parameters, unknown, program, outcome, derivatives, metric)


def _covariance(program: MetricProgram, errors: LeastErrors) -> Array:
    """Return covariance of parameters that are at no bound, in units of their initial values.

    H^-1 (sum_r s_r^2 / k_r H_r) H^-1 with the Hessians H_r of the recordings' least errors, their
    sum H, the variance s_r^2 of an error and the number k_r of independent samples: the errors of
    filtered data are correlated over 1 / (2 bandwidth) (Davidson and MacKinnon, "Estimation and
    Inference in Econometrics", 1993, chapter 5, for the form). Infinite where H is singular.
    """
    total = np.asarray(errors.hessians.sum(axis=0))
    if not total.size:
        return total
    samples = []
    for part in program.parts:
        motion = part.recording.motion
        duration = sum(float(motion.time[b] - motion.time[a]) for a, b in part.segments)
        samples.append(max(min(2.0 * bandwidth(motion) * duration, part.owners.size), 1.0))
    terms = program.parts[0].terms
    components = 3 if terms.measure == "position" else terms.dim
    weights = 2.0 * errors.values / components / np.array(samples)
    middle = np.einsum("r,rij->ij", weights, errors.hessians)
    if np.linalg.eigvalsh(middle)[0] < 0.0:  # single recordings need not have a minimum here
        sizes, axes = np.linalg.eigh(float(np.mean(weights)) * total)
        middle = (axes * np.maximum(sizes, 0.0)) @ axes.T
    # Negative curvature means that the error has no minimum along a direction.
    values, vectors = np.linalg.eigh(total)
    regular = values > _SINGULAR * max(values[-1], 1e-300)
    inverse = (vectors[:, regular] / values[regular]) @ vectors[:, regular].T
    result = inverse @ middle @ inverse
    flat = vectors[:, ~regular]
    return np.asarray(result + np.diag(np.where(np.sum(flat**2, axis=1) > 1e-6, np.inf, 0.0)))


def _undetermined(
    errors: LeastErrors, matrix: Array, relative: Array, names: Sequence[str]
) -> tuple[str, ...]:
    """Return sentences on combinations of parameters that the data do not determine.

    The eigenvectors of the Hessian by the parameters' logarithms along which one standard deviation
    is more than half, so that a factor of 1.6 and more is within it.

    Args:
        errors, matrix: errors and matrix of the parameters at no bound, and their covariance.
        relative: their values in units of their initial values.
        names: names of these parameters.
    """
    hessian = errors.hessians.sum(axis=0) * np.outer(relative, relative)
    finite = np.where(np.isfinite(matrix), matrix, 0.0) / np.outer(relative, relative)
    sentences = []
    for value, direction in zip(*np.linalg.eigh(hessian), strict=True):
        flat = value <= _SINGULAR * np.abs(hessian).max()
        if not flat and direction @ finite @ direction <= _UNCERTAIN**2:
            continue
        direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
        powers = {
            name: f"{name} by a factor of {2.0**power:.3g}"
            for name, power in zip(names, direction, strict=True)
            if abs(power) >= _INVOLVED
        }
        *others, last = powers
        sentences.append(
            f"the data determine {', '.join(others)} and {last} in combination only: "
            f"changing {' and '.join(powers.values())} leaves the error almost the same"
            if others
            else f"the data do not determine {last}"
        )
    return tuple(sentences)
