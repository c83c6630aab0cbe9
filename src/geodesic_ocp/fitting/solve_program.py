"""The solution of a fit's nonlinear program, with standard errors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from geodesic_ocp.errors import NotConverged
from geodesic_ocp.fitting.metric_fit import Estimate, MetricFit
from geodesic_ocp.fitting.parameter import Parameter
from geodesic_ocp.fitting.program.curvature import least_errors
from geodesic_ocp.fitting.program.metric_program import MetricProgram
from geodesic_ocp.fitting.program.start import Start
from geodesic_ocp.fitting.uncertainty import covariance, undetermined_directions
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model

_AT_BOUND = 1e-4  # distance from a bound, relative to the initial or the largest value
_UNITS = {"armature": "kg m^2", "payload": "kg", "joint_inertia": "m r^2"}


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
    matrix = covariance(program, derivatives.of_parameters(free))
    deviations = np.full(p, np.nan)
    deviations[free] = np.sqrt(np.diag(matrix)) * program.start[free]
    names = [each.name for each in parameters]
    units = [_UNITS.get(each.field, "") for each in parameters]
    values = relative * program.start
    estimates = tuple(
        Estimate(names[k], float(values[k]), float(deviations[k]), units[k], bool(bounded[k]))
        for k in range(p)
    )
    return MetricFit(
        estimates=estimates,
        parameters=parameters,
        undetermined=undetermined_directions(
            derivatives.of_parameters(free), matrix, relative[free], [names[k] for k in free]
        ),
        program=program,
        outcome=outcome,
        derivatives=derivatives,
        family=metric,
    )
