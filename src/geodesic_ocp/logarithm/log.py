"""The logarithmic map and the Riemannian distance."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.logarithm.multi_start import find_geodesics
from geodesic_ocp.manifold.metric import Metric, has_compiled_code
from geodesic_ocp.over_rows import over_rows


@over_rows(has_compiled_code)
def log(
    metric: Metric,
    q0: ArrayLike,
    q1: ArrayLike,
    *,
    num_starts: int = 1,
    seed: int = 0,
    solver: str | None = None,
) -> Array:
    """Log_q0(q1): the velocity v0 (n,) with Exp_q0(v0) = q1.

    Where several geodesics connect the two points, the shortest of those found from `num_starts`
    initial guesses, of which the first is the straight line; see `geodesics`. The end point
    Exp_q0(v0) equals q1 to 1e-9 in every coordinate, with more than one start up to whole periods
    of the metric's coordinates. For k points (k, n) at either end or both: k velocities (k, n).

    `solver` is "newton", which takes milliseconds, or "ipopt", the reference; None takes the
    environment variable GEODESIC_OCP_SOLVER, or "newton". Both minimize the same discrete energy.

    >>> import geodesic_ocp as go
    >>> metric = go.KineticEnergy(go.human_arm())
    >>> q0 = [0.0, 0.1, -0.5, 0.8, 0.0, 0.0, 0.0]
    >>> q1 = [0.6, 0.2, -0.9, 1.4, 0.1, 0.2, 0.1]
    >>> v0 = go.log(metric, q0, q1)
    >>> v0.round(3)
    array([ 0.035, -0.141, -0.488,  2.169,  0.438, -2.102,  0.88 ])
    >>> go.exp(metric, q0, v0).round(6)
    array([ 0.6,  0.2, -0.9,  1.4,  0.1,  0.2,  0.1])

    Raises:
        ValueError: wrong shapes, numbers that are not finite, or, with one start, a straight line
            along which the metric is not defined.
        NotConverged: no geodesic was found, or it does not end at q1 when integrated forward.
    """
    return find_geodesics(metric, q0, q1, num_starts, seed, solver)[0].velocity


@over_rows(has_compiled_code)
def distance(
    metric: Metric,
    q0: ArrayLike,
    q1: ArrayLike,
    *,
    num_starts: int = 1,
    seed: int = 0,
    solver: str | None = None,
) -> Any:
    """Length |Log_q0(q1)| of the geodesic of `log`, a float; for k pairs an array (k,).

    >>> import geodesic_ocp as go
    >>> go.distance(go.Euclidean(2), [0.0, 0.0], [3.0, 4.0])
    5.0
    """
    velocity = log(metric, q0, q1, num_starts=num_starts, seed=seed, solver=solver)
    return float(metric.norm(q0, velocity))
