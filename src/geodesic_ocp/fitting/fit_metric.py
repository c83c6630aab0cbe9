"""fit_metric: the metric whose geodesics are nearest to recorded motions."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_integer
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.fitting.curvature import LeastErrors, least_errors
from geodesic_ocp.fitting.metric_fit import Estimate, MetricFit
from geodesic_ocp.fitting.metric_program import MetricProgram, Start
from geodesic_ocp.fitting.parameter import JOINT_INERTIA, Parameter, as_parameters, with_parameters
from geodesic_ocp.fitting.recording_part import RecordingPart, observe
from geodesic_ocp.fitting.segment_functions import Measure, SegmentFunctions, as_measure
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import AdjustableKineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress, no_progress
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.synergies.segment import segment
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.motion import bandwidth

_UNIT = {"joint": 0.01, "position": 0.01}  # of the errors [rad], [m]
_AT_BOUND = 1e-4  # distance from a bound, relative to the initial or the largest value
_UNITS = {"armature": "kg m^2", "payload": "kg", "joint_inertia": "m r^2"}
# Directions in which the logarithms of the parameters are more uncertain than this are reported.
_UNCERTAIN = 0.5
_SINGULAR = 1e-7  # smallest eigenvalue relative to the largest
_INVOLVED = 0.25  # smallest component of a direction that is named


def fit_metric(
    recordings: Recording | Sequence[Recording],
    parameters: Parameter | Sequence[Parameter] = JOINT_INERTIA,
    *,
    metric: Callable[[Model], Metric] = AdjustableKineticEnergy,
    measure: Measure = "joint",
    segments: Sequence[Sequence[tuple[int, int]]] | None = None,
    threshold: float = 0.6,
    min_duration: float = 0.1,
    hysteresis: float = 0.1,
    free_ends: bool = False,
    degree: int = 8,
    progress: Progress | None = None,
) -> MetricFit:
    """Estimate parameters of a metric from recordings, by inverse optimal control.

    One nonlinear program in the parameters and the paths of all segments: it minimizes the squared
    error between paths and samples, the mean over the recordings of the mean over the samples,
    subject to each path being a geodesic of the metric with these parameters. Ipopt solves it with
    exact first and second derivatives. The progress along each path is a cubic in time whose end
    rates are estimated too, so that the parameters are determined by the shape of the paths and not
    by differentiated data. The cuts between segments stay fixed.

    >>> import numpy as np
    >>> import geodesic_ocp as go
    >>> arm = go.human_arm()
    >>> metric = go.AdjustableKineticEnergy(arm, joint_inertia=0.05)
    >>> q0, q1 = [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1], [1.2, -0.2, -0.9, 1.6, -0.3, 0.1, 0.4]
    >>> path, u = go.geodesic(metric, q0, q1), np.linspace(0.0, 1.0, 51)  # 1 s at 50 Hz
    >>> s, rate = 3 * u**2 - 2 * u**3, 6 * u - 6 * u**2
    >>> motion = go.Motion(u, path(s), arm.joint_names, rate[:, None] * path(s, 1))
    >>> fit = go.fit_metric(go.Recording(arm, motion), segments=[[(0, 50)]])
    >>> round(fit.values["joint_inertia"], 4)
    0.05

    Args:
        recordings: of one or more persons.
        parameters: fields of the metric and their initial values; by default one joint inertia for
            all joints, relative to the arm's m r^2 (see `AdjustableKineticEnergy`).
        metric: gives the metric of a model, such as a class: a dataclass whose fields are the
            parameters, with a matrix(q) that takes CasADi expressions for them.
        measure: "joint", configurations [rad], or "position", the hand's positions [m].
        segments: of each recording, (start, stop) sample indices; None: those of `segment` with the
            initial values. Segments that hardly move are left out.
        threshold, min_duration, hysteresis: of `segment` [rad], [s], [rad].
        free_ends: whether the ends of the paths are estimated; by default they are as observed, as
            in `reconstruct`. Estimated ends are for noisy, unfiltered data.
        degree: of the polynomials that represent the paths.
        progress: called with the current step, the amount done, and the total.

    Returns:
        Estimates with standard errors. `bootstrap_fit`, `leave_one_out` and `error_profile` take
        it further, `save_metric` writes it to a file.

    Raises:
        ValueError: wrong parameters or segments, or models of different numbers of joints.
        NotConverged: Ipopt did not find a solution.
    """
    listed = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    if not listed or not all(isinstance(each, Recording) for each in listed):
        raise ValueError("recordings must be one or more of go.Recording")
    if len({each.model.dof for each in listed}) > 1:
        raise ValueError("the models of all recordings must have the same number of joints")
    if segments is not None and len(segments) != len(listed):
        raise ValueError(f"segments must be given for each of {len(listed)} recordings")
    if not callable(metric):
        raise ValueError(f"metric must give the metric of a model, such as a class, got {metric!r}")
    chosen, measure = as_parameters(parameters), as_measure(measure)
    if free_ends and measure != "joint":
        raise ValueError("free_ends needs measure='joint': the hand leaves the redundant arm free")
    report, grid = progress or no_progress, Grid(1, as_integer("degree", degree, 3))
    theta = ca.SX.sym("theta", len(chosen))
    start = np.array([each.start for each in chosen], dtype=float)
    functions: dict[int, SegmentFunctions] = {}
    parts = []
    for number, recording in enumerate(listed):
        report("preparing recordings", number, len(listed))
        model = recording.model
        if id(model) not in functions:
            symbolic = with_parameters(metric(model), chosen, ca.vertsplit(theta))
            functions[id(model)] = SegmentFunctions(symbolic, theta, model, measure, grid)
        initial = with_parameters(metric(model), chosen, start.tolist())
        if segments is None:
            rule = {"min_duration": min_duration, "hysteresis": hysteresis}
            cuts: Sequence[tuple[int, int]] = segment(initial, recording.motion, threshold, **rule)
        else:
            cuts = segments[number]
        observed = observe(recording, initial, cuts, grid)
        parts.append(RecordingPart(functions[id(model)], observed, _UNIT[measure]))
    lower, upper = np.array([(each.lower, each.upper) for each in chosen]).T
    program = MetricProgram(tuple(parts), start, lower, upper, free_ends)
    report("fitting the metric", 0, 1)
    fit = solve_program(program, chosen, metric)
    report("fitting the metric", 1, 1)
    return fit


def solve_program(
    program: MetricProgram,
    parameters: tuple[Parameter, ...],
    metric: Callable[[Model], Metric],
    near: Start | None = None,
) -> MetricFit:
    """The fit of a program with equal weights of its recordings, from a start if it is given.

    Raises:
        NotConverged: Ipopt did not find a solution.
    """
    outcome = program.solve(np.ones(len(program.parts)), near)
    if not outcome.success:
        raise NotConverged(f"the metric was not fitted: {outcome.status}", outcome)
    p = program.size
    relative = outcome.x[:p]
    derivatives = least_errors(program, outcome.x, outcome.lam_g)
    lower, upper = (bound[:p] for bound in program.bounds)
    bounded = (relative - lower < _AT_BOUND) | (upper - relative < _AT_BOUND * upper)
    free = np.flatnonzero(~bounded)
    matrix = _covariance(program, derivatives.of_parameters(free))
    deviations = np.full(p, np.nan)
    deviations[free] = np.sqrt(np.diag(matrix)) * program.start[free]
    found = zip(parameters, relative * program.start, deviations, bounded, strict=True)
    estimates = tuple(
        Estimate(each.name, float(value), float(error), _UNITS.get(each.field, ""), bool(at_bound))
        for each, value, error, at_bound in found
    )
    unknown = _undetermined(
        derivatives.of_parameters(free),
        matrix,
        relative[free],
        [parameters[k].name for k in free],
    )
    return MetricFit(estimates, parameters, unknown, program, outcome, derivatives, metric)


def _covariance(program: MetricProgram, errors: LeastErrors) -> Array:
    """Covariance of parameters that are at no bound, in units of their initial values.

    H^-1 (sum_r s_r^2 / k_r H_r) H^-1 with the Hessians H_r of the recordings' least errors, their
    sum H, the variance s_r^2 of an error and the number k_r of independent samples: the errors of
    filtered data are correlated over 1 / (2 bandwidth) (Davidson and MacKinnon, "Estimation and
    Inference in Econometrics", 1993, chapter 5, for the form). Infinite where H is singular.
    """
    total = np.asarray(errors.hessians.sum(axis=0))
    if not total.size:
        return total
    weights = []
    for part, value in zip(program.parts, errors.values, strict=True):
        motion = part.observed.recording.motion
        duration = sum(float(motion.time[b] - motion.time[a]) for a, b in part.observed.segments)
        frequency = bandwidth(motion)
        samples = min(2.0 * frequency * duration, part.observed.owners.size)
        components = 3 if part.functions.measure == "position" else part.functions.dim
        variance = 2.0 * value / components
        weights.append(variance / max(samples, 1.0))
    middle = np.einsum("r,rij->ij", np.array(weights), errors.hessians)
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
    """Sentences on combinations of parameters that the data do not determine.

    The eigenvectors of the Hessian by the parameters' logarithms along which one standard deviation
    is more than half, so that a factor of 1.6 and more is within it.

    Args:
        errors, matrix: of the parameters at no bound, and their covariance.
        relative: their values in units of their initial values.
        names: of these parameters.
    """
    if not relative.size:
        return ()
    hessian = errors.hessians.sum(axis=0) * np.outer(relative, relative)
    finite = np.where(np.isfinite(matrix), matrix, 0.0) / np.outer(relative, relative)
    sentences = []
    for value, direction in zip(*np.linalg.eigh(hessian), strict=True):
        flat = value <= _SINGULAR * np.abs(hessian).max()
        variance = max(float(direction @ finite @ direction), 0.0)
        if not flat and variance <= _UNCERTAIN**2:
            continue
        direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
        involved = [k for k in range(relative.size) if abs(direction[k]) >= _INVOLVED]
        listed = [names[k] for k in involved]
        if len(listed) == 1:
            sentences.append(f"the data do not determine {listed[0]}")
            continue
        powers = [f"{names[k]} by a factor of {2.0 ** direction[k]:.3g}" for k in involved]
        sentences.append(
            f"the data determine {', '.join(listed[:-1])} and {listed[-1]} in combination only: "
            f"changing {' and '.join(powers)} leaves the error almost the same"
        )
    return tuple(sentences)
