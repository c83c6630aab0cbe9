"""Shooting for a pose: a nonlinear program in the initial velocity, with exact derivatives."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.compiled.source import RK_A, RK_B, STAGES
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.ipopt import Ipopt, Outcome
from geodesic_ocp.logarithm.to_pose.pose_target import (
    PoseTarget,
    ShootingResult,
    metric_of,
    pose_error_function,
)
from geodesic_ocp.manifold.exp import exp
from geodesic_ocp.model.model import Model

# Fixed steps of the integrator within the NLP: at first, after a failure, at most; and how closely
# their end point must agree with `exp` at the solution, and at the initial guess.
_STEPS, _MORE_STEPS, _MAX_STEPS = 2, 4, 64
_AGREEMENT, _ROUGH_AGREEMENT = 1e-7, 1e-4
# Iterations of one solve; where they do not suffice, energy weights for a continuation.
_MAX_ITERATIONS, _CONTINUATION = 60, (1.0, 1e-2, 1e-4, 1e-6)


def shoot(target: PoseTarget, velocity: Array, energy_weight: float) -> ShootingResult:
    """Solve the NLP; where that fails, by continuation from a large weight of the energy."""
    direct = _solve_with_accurate_steps(target, velocity, energy_weight, _STEPS)
    if direct.success:
        return direct
    iterations, best, reached = direct.iterations, direct, np.inf
    weights = [weight for weight in _CONTINUATION if weight > energy_weight]
    for weight in (*weights, energy_weight):
        start = best.velocity if best.success else velocity
        result = _solve_with_accurate_steps(target, start, weight, _MORE_STEPS)
        iterations += result.iterations
        if not result.success:
            if best.success:
                status = f"{best.status}, but only with energy weight {reached:g}"
                return ShootingResult(best.velocity, iterations, False, status)
            break
        best, reached = result, weight
    return best._replace(iterations=iterations)


def _solve_with_accurate_steps(
    target: PoseTarget, velocity: Array, energy_weight: float, steps: int
) -> ShootingResult:
    """Solve the NLP with one weight, with enough integrator steps to agree with `exp`."""
    iterations, steps = 0, _steps_for_guess(target, velocity, steps)
    while True:
        outcome = _solve(target, velocity, energy_weight, steps)
        iterations += outcome.iterations
        found = outcome.x[: target.q0.size]
        if not outcome.success:
            found = found if np.all(np.isfinite(found)) else velocity
            return ShootingResult(found, iterations, False, outcome.status)
        end = _exp_function(target.model, steps)(target.q0, found).full()[:, 0]
        try:
            agrees = np.abs(end - exp(target.metric, target.q0, found)).max() <= _AGREEMENT
        except IntegrationFailed as error:
            return ShootingResult(found, iterations, False, str(error))
        if agrees:
            return ShootingResult(found, iterations, True, outcome.status)
        if steps >= _MAX_STEPS:
            status = f"{steps} steps of the integrator are too few for this geodesic"
            return ShootingResult(found, iterations, False, status)
        steps, velocity = 2 * steps, found


def _steps_for_guess(target: PoseTarget, velocity: Array, steps: int) -> int:
    """At least this number of steps, more where the geodesic of the initial guess needs them."""
    try:
        exact = exp(target.metric, target.q0, velocity)
    except IntegrationFailed:
        return steps
    while steps < _MAX_STEPS:
        end = _exp_function(target.model, steps)(target.q0, velocity).full()[:, 0]
        if np.abs(np.nan_to_num(end, nan=np.inf) - exact).max() <= _ROUGH_AGREEMENT:
            break
        steps *= 2
    return steps


def _solve(target: PoseTarget, velocity: Array, energy_weight: float, steps: int) -> Outcome:
    """In x = (v, r), where r is the pose error divided by the root of the energy's weight."""
    tensor = target.metric.matrix(target.q0)
    root = np.sqrt(energy_weight)
    end = _exp_function(target.model, steps)(target.q0, velocity).full()[:, 0]
    # Where the guess is too fast for the number of steps, Ipopt will report it.
    error = target.pose_error(end if np.all(np.isfinite(end)) else target.q0) / root
    p = np.concatenate([target.q0, target.position, target.rotation.ravel(order="F")])
    p = np.concatenate(
        [p, target.weights, [root], (tensor / float(np.trace(tensor))).ravel(order="F")]
    )
    solver = _nlp(target.model, steps)
    return solver(x0=np.concatenate([velocity, error]), p=p, lbg=0.0, ubg=0.0)


@lru_cache(maxsize=32)
def _nlp(model: Model, steps: int) -> Ipopt:
    n = model.dof
    x, p = ca.MX.sym("x", n + 6), ca.MX.sym("p", n + 15 + n * n)
    v, r = x[:n], x[n:]
    q0, target_position, target_rotation, weights, root, tensor = ca.vertsplit(
        p, np.cumsum([0, n, 3, 9, 2, 1, n * n]).tolist()
    )
    rotation, position = _hand_pose_function(model)(_exp_function(model, steps)(q0, v))
    target = (target_position, ca.reshape(target_rotation, 3, 3))
    error = pose_error_function()(rotation, position, *target, weights)
    f = (ca.bilin(ca.reshape(tensor, n, n), v, v) + ca.sumsqr(r)) / 2
    # Pose errors are divided by a small number: a tighter tolerance is below rounding.
    options = {"max_iter": _MAX_ITERATIONS, "nlp_scaling_method": "none", "tol": 1e-8}
    return Ipopt({"x": x, "p": p, "f": f, "g": error / root - r}, options=options)


@lru_cache(maxsize=32)
def _hand_pose_function(model: Model) -> ca.Function:
    q = ca.SX.sym("q", model.dof)
    return ca.Function("hand_pose", [q], list(model.hand_pose(q)))


@lru_cache(maxsize=32)
def _exp_function(model: Model, steps: int) -> ca.Function:
    """(q, v) -> Exp_q(v) by equal steps of the method of order 8 of Dormand and Prince."""
    n, rate = model.dof, metric_of(model).geodesic_equation
    y = ca.MX.sym("y", 2 * n)
    slopes: list[ca.MX] = [rate(y)]
    for stage in range(1, STAGES):
        weights = ca.DM(RK_A[stage, :stage]) / steps
        slopes.append(rate(y + ca.horzcat(*slopes) @ weights))
    step = ca.Function("step", [y], [y + ca.horzcat(*slopes) @ ca.DM(RK_B) / steps])
    q, v = ca.MX.sym("q", n), ca.MX.sym("v", n)
    return ca.Function("exp", [q, v], [step.fold(steps)(ca.vertcat(q, v))[:n]])
