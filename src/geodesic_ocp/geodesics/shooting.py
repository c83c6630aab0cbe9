"""Shooting for a pose: a nonlinear program in the initial velocity, with exact derivatives."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np
from scipy.integrate import DOP853

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.geodesics.pose_target import Found, Target, metric_of, miss_function
from geodesic_ocp.ipopt import Ipopt, Outcome
from geodesic_ocp.manifold.exp import exp
from geodesic_ocp.model.model import Model

# Steps of the integrator within the program, and how well they must agree with `exp`.
_STEPS, _CAREFUL, _MOST_STEPS, _AGREES = 2, 4, 64, 1e-7
_FOLLOWS = 1e-4  # likewise, of the velocity to start from
# Iterations of one solve; and the weights of the energy that lead on where it takes more.
_PATIENCE, _SHRINKING = 60, (1.0, 1e-2, 1e-4, 1e-6)


def shot(target: Target, v: Array, small: float) -> Found:
    """The NLP; where it is not solved at once, with a large weight of the energy that shrinks."""
    direct = _with_steps(target, v, small, _STEPS)
    if direct.success:
        return direct
    iterations, best, reached = direct.iterations, direct, np.inf
    weights = [weight for weight in _SHRINKING if weight > small]
    for weight in (*weights, small):
        outcome = _with_steps(target, best.velocity if best.success else v, weight, _CAREFUL)
        iterations += outcome.iterations
        if not outcome.success:
            if best.success:
                status = f"{best.status}, but with weight {reached:g} of the energy only"
                return Found(best.velocity, iterations, False, status)
            break
        best, reached = outcome, weight
    return best._replace(iterations=iterations)


def _with_steps(target: Target, v: Array, small: float, steps: int) -> Found:
    """The NLP with one weight, and as many steps of its integrator as agree with `exp`."""
    iterations, steps = 0, _enough(target, v, steps)
    while True:
        outcome = _shot(target, v, small, steps)
        iterations += outcome.iterations
        found = outcome.x[: target.q0.size]
        if not outcome.success:
            found = found if np.all(np.isfinite(found)) else v
            return Found(found, iterations, False, outcome.status)
        end = _flow(target.model, steps)(target.q0, found).full()[:, 0]
        try:
            agrees = np.abs(end - exp(target.metric, target.q0, found)).max() <= _AGREES
        except IntegrationFailed as error:
            return Found(found, iterations, False, str(error))
        if agrees:
            return Found(found, iterations, True, outcome.status)
        if steps >= _MOST_STEPS:
            status = f"{steps} steps of the integrator are too few for this geodesic"
            return Found(found, iterations, False, status)
        steps, v = 2 * steps, found


def _enough(target: Target, v: Array, steps: int) -> int:
    """So many steps, or more where they do not follow the geodesic of the first velocity."""
    try:
        there = exp(target.metric, target.q0, v)
    except IntegrationFailed:
        return steps
    while steps < _MOST_STEPS:
        end = _flow(target.model, steps)(target.q0, v).full()[:, 0]
        if np.abs(np.nan_to_num(end, nan=np.inf) - there).max() <= _FOLLOWS:
            break
        steps *= 2
    return steps


def _shot(target: Target, v: Array, small: float, steps: int) -> Outcome:
    """In x = (v, r), where r is the miss in units of the square root of the energy's weight."""
    metric, q0 = target.metric, target.q0
    matrix = metric.matrix(q0)
    scale = float(np.trace(matrix))
    root = np.sqrt(small)
    end = _flow(target.model, steps)(q0, v).full()[:, 0]
    # Too fast for so few steps: the program will say so.
    first = target.miss(end if np.all(np.isfinite(end)) else q0) / root
    p = np.concatenate([q0, target.position, target.rotation.ravel(order="F")])
    p = np.concatenate([p, target.weights, [root], (matrix / scale).ravel(order="F")])
    solver = _program(target.model, steps)
    return solver(x0=np.concatenate([v, first]), p=p, lbg=0.0, ubg=0.0)


@lru_cache(maxsize=32)
def _program(model: Model, steps: int) -> Ipopt:
    n = model.dof
    x, p = ca.MX.sym("x", n + 6), ca.MX.sym("p", n + 15 + n * n)
    v, r = x[:n], x[n:]
    q0, place, turn, weights, root, matrix = ca.vertsplit(
        p, np.cumsum([0, n, 3, 9, 2, 1, n * n]).tolist()
    )
    end = _flow(model, steps)(q0, v)
    rotation, position = _pose(model)(end)
    missed = miss_function()(rotation, position, place, ca.reshape(turn, 3, 3), weights)
    f = (ca.bilin(ca.reshape(matrix, n, n), v, v) + ca.sumsqr(r)) / 2
    # The misses are divided by the root of a small number: finer is beyond rounding.
    options = {"max_iter": _PATIENCE, "nlp_scaling_method": "none", "tol": 1e-8}
    return Ipopt({"x": x, "p": p, "f": f, "g": missed / root - r}, options=options)


@lru_cache(maxsize=32)
def _pose(model: Model) -> ca.Function:
    q = ca.SX.sym("q", model.dof)
    return ca.Function("pose", [q], list(model.hand_pose(q)))


@lru_cache(maxsize=32)
def _flow(model: Model, steps: int) -> ca.Function:
    """(q, v) -> Exp_q(v) by steps of the method of order 8 of Dormand and Prince, all alike."""
    n, rate = model.dof, metric_of(model).geodesic_equation
    y = ca.MX.sym("y", 2 * n)
    slopes: list[ca.MX] = [rate(y)]
    for stage in range(1, DOP853.n_stages):
        weights = ca.DM(DOP853.A[stage, :stage]) / steps
        slopes.append(rate(y + ca.horzcat(*slopes) @ weights))
    step = ca.Function("step", [y], [y + ca.horzcat(*slopes) @ ca.DM(DOP853.B) / steps])
    q, v = ca.MX.sym("q", n), ca.MX.sym("v", n)
    return ca.Function("flow", [q, v], [step.fold(steps)(ca.vertcat(q, v))[:n]])
