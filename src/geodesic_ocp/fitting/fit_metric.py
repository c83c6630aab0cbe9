"""The parameters of a metric whose geodesics explain recordings best."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import as_integer
from geodesic_ocp.fitting.metric_fit import MetricFit
from geodesic_ocp.fitting.parameter import JOINT_INERTIA, Parameter, as_parameters, with_parameters
from geodesic_ocp.fitting.program.metric_program import MetricProgram
from geodesic_ocp.fitting.program.observed_segments import observe
from geodesic_ocp.fitting.program.recording_part import RecordingPart
from geodesic_ocp.fitting.program.segment_functions import Measure, SegmentFunctions, as_measure
from geodesic_ocp.fitting.solve_program import solve_program
from geodesic_ocp.manifold.adjustable_kinetic_energy import AdjustableKineticEnergy
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.synergies.segmentation.segment import segment
from geodesic_ocp.trajectory.grid import Grid

_SIDES = ("lower", "upper")
_UNIT = {"joint": 0.01, "position": 0.01}  # of the errors [rad], [m]


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
    grid = Grid(1, as_integer("degree", degree, 3))
    theta = ca.SX.sym("theta", len(chosen))
    start = np.array([each.start for each in chosen], dtype=float)
    functions: dict[int, SegmentFunctions] = {}
    parts = []
    for number, recording in enumerate(listed):
        if progress is not None:
            progress("preparing recordings", number, len(listed))
        model = recording.model
        if id(model) not in functions:
            symbolic = with_parameters(metric(model), chosen, ca.vertsplit(theta))
            functions[id(model)] = SegmentFunctions(symbolic, theta, model, measure, grid)
        initial = with_parameters(metric(model), chosen, start.tolist())
        given = None if segments is None else segments[number]
        if given is None:
            given = segment(
                initial,
                recording.motion,
                threshold,
                min_duration=min_duration,
                hysteresis=hysteresis,
            )
        observed = observe(recording, initial, given, grid)
        parts.append(RecordingPart(functions[id(model)], observed, _UNIT[measure]))
    lower, upper = (np.array([getattr(each, side) for each in chosen]) for side in _SIDES)
    program = MetricProgram(tuple(parts), start, lower, upper, free_ends)
    if progress is not None:
        progress("fitting the metric", 0, 1)
    fit = solve_program(program, chosen, metric)
    if progress is not None:
        progress("fitting the metric", 1, 1)
    return fit
