"""Shooting at a pose of the hand: the initial velocity of the geodesic that brings it there.

`shoot` solves a nonlinear program in the velocity with exact derivatives.
`descend_transported_gradient` follows the gradient of Klein, Jaquier, Meixner, Asfour (2022),
section V: the pose error is multiplied by the pseudo-inverse of the hand's Jacobian, and the result
is parallel-transported back along the geodesic, instead of using the derivative of the exponential
map.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.compiled.source import RK_A, RK_B, STAGES
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.ipopt import Ipopt, Outcome
from geodesic_ocp.logarithm.geodesic import geodesic_from_velocity
from geodesic_ocp.manifold.connection import parallel_transport
from geodesic_ocp.manifold.exp import exp
from geodesic_ocp.manifold.metrics import KineticEnergy, metric_of
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.pose_search import rotation_log
from geodesic_ocp.trajectory.path import Path

# Fixed steps of the integrator within the NLP: at first, after a failure, at most; and how closely
# their end point must agree with `exp` at the solution, and at the initial guess.
_STEPS = 2
_MORE_STEPS = 4
_MAX_STEPS = 64
_AGREEMENT = 1e-7
_ROUGH_AGREEMENT = 1e-4
# Iterations of one solve; where they do not suffice, energy weights for a continuation.
_MAX_ITERATIONS = 60
_CONTINUATION = (1.0, 1e-2, 1e-4, 1e-6)
_MAX_DESCENTS = 2000
_CONVERGED = 1e-9  # the pose error, or its relative decrease in one step
_MAX_HALVINGS = 30
_CUTOFF = 1e-3  # of the pseudo-inverse, relative to the Jacobian's largest singular value


@dataclass(frozen=True, eq=False)
class PoseTarget:
    """A pose that the hand should reach from a configuration; zero weights leave it free.

    Attributes:
        model: model whose hand it is.
        q0: initial configuration (n,).
        position, rotation: position and rotation of the hand (3,), (3, 3).
        weights: weights of both (2,).
    """

    model: Model
    q0: Array
    position: Array
    rotation: Array
    weights: Array

    @property
    def metric(self) -> KineticEnergy:
        """Kinetic-energy metric of the model, the same object for the same model."""
        return metric_of(self.model)

    def end(self, velocity: Array, steps: int) -> Array:
        """Return Exp(velocity), (n,), by equal steps; not finite where they are too few."""
        return np.asarray(_exp_function(self.model, steps)(self.q0, velocity).full()[:, 0])

    def pose_error(self, q: Array) -> Array:
        """Return weighted position and rotation vector (6,) from the hand at q to the target."""
        pose = self.model.hand_pose(q)
        error = pose_error_function()(*pose, self.position, self.rotation, self.weights)
        return np.asarray(error.full()[:, 0])


class ShootingResult(NamedTuple):
    """Initial velocity (n,), iterations, whether it is a solution, and the status as a sentence."""

    velocity: Array
    iterations: int
    success: bool
    status: str


def shoot(target: PoseTarget, velocity: Array, energy_weight: float) -> ShootingResult:
    """Solve the NLP; where that fails, by continuation from a large weight of the energy."""
    direct = _solve_with_accurate_steps(target, velocity, energy_weight, _STEPS)
    if direct.success:
        return direct
    iterations = direct.iterations
    best = direct
    reached = np.inf
    for weight in (*(each for each in _CONTINUATION if each > energy_weight), energy_weight):
        start = best.velocity if best.success else velocity
        result = _solve_with_accurate_steps(target, start, weight, _MORE_STEPS)
        iterations += result.iterations
        if result.success:
            best = result
            reached = weight
        elif best.success:
            status = f"{best.status}, but only with energy weight {reached:g}"
            return ShootingResult(best.velocity, iterations, False, status)
        else:
            break
    return best._replace(iterations=iterations)


@lru_cache(maxsize=1)
def pose_error_function() -> ca.Function:
    """Return pose, target pose and weights (2,) -> weighted difference (6,), in the base frame."""
    rotation = ca.SX.sym("R", 3, 3)
    target_rotation = ca.SX.sym("R1", 3, 3)
    position = ca.SX.sym("p", 3)
    target_position = ca.SX.sym("p1", 3)
    weights = ca.SX.sym("w", 2)
    translation = weights[0] * (target_position - position)
    rotation_vector = weights[1] * rotation_log(target_rotation @ rotation.T)
    inputs = [rotation, position, target_position, target_rotation, weights]
    return ca.Function("pose_error", inputs, [ca.vertcat(translation, rotation_vector)])


def _solve_with_accurate_steps(
    target: PoseTarget, velocity: Array, energy_weight: float, steps: int
) -> ShootingResult:
    """Solve the NLP with one weight, with enough integrator steps to agree with `exp`."""
    with suppress(IntegrationFailed):  # more steps where the geodesic of the guess needs them
        exact = exp(target.metric, target.q0, velocity)
        while steps < _MAX_STEPS:
            end = np.nan_to_num(target.end(velocity, steps), nan=np.inf)
            if np.abs(end - exact).max() <= _ROUGH_AGREEMENT:
                break
            steps *= 2
    iterations = 0
    while True:
        outcome = _solve(target, velocity, energy_weight, steps)
        iterations += outcome.iterations
        found = outcome.x[: target.q0.size]
        status = outcome.status
        if not outcome.success:
            found = found if np.all(np.isfinite(found)) else velocity
            return ShootingResult(found, iterations, False, status)
        try:
            difference = target.end(found, steps) - exp(target.metric, target.q0, found)
        except IntegrationFailed as error:
            return ShootingResult(found, iterations, False, str(error))
        if np.abs(difference).max() <= _AGREEMENT:
            return ShootingResult(found, iterations, True, status)
        if steps >= _MAX_STEPS:
            status = f"{steps} steps of the integrator are too few for this geodesic"
            return ShootingResult(found, iterations, False, status)
        steps = 2 * steps
        velocity = found


def _solve(target: PoseTarget, velocity: Array, energy_weight: float, steps: int) -> Outcome:
    """Solve for x = (v, r), where r is the pose error over the root of the energy's weight."""
    tensor = target.metric.matrix(target.q0)
    root = np.sqrt(energy_weight)
    end = target.end(velocity, steps)
    # Where the guess is too fast for the number of steps, Ipopt will report it.
    error = target.pose_error(end if np.all(np.isfinite(end)) else target.q0) / root
    columns = target.rotation.ravel(order="F"), (tensor / np.trace(tensor)).ravel(order="F")
    p = np.concatenate([target.q0, target.position, columns[0], target.weights, [root], columns[1]])
    solver = _nlp(target.model, steps)
    return solver(x0=np.concatenate([velocity, error]), p=p, lbg=0.0, ubg=0.0)


@lru_cache(maxsize=32)
def _nlp(model: Model, steps: int) -> Ipopt:
    n = model.dof
    x = ca.MX.sym("x", n + 6)
    p = ca.MX.sym("p", n + 15 + n * n)
    v = x[:n]
    r = x[n:]
    q0, target_position, target_rotation, weights, root, tensor = ca.vertsplit(
        p, np.cumsum([0, n, 3, 9, 2, 1, n * n]).tolist()
    )
    q = ca.SX.sym("q", n)
    hand_pose = ca.Function("hand_pose", [q], list(model.hand_pose(q)))
    rotation, position = hand_pose(_exp_function(model, steps)(q0, v))
    target = (target_position, ca.reshape(target_rotation, 3, 3))
    error = pose_error_function()(rotation, position, *target, weights)
    f = (ca.bilin(ca.reshape(tensor, n, n), v, v) + ca.sumsqr(r)) / 2
    # Pose errors are divided by a small number: a tighter tolerance is below rounding.
    options = {"max_iter": _MAX_ITERATIONS, "nlp_scaling_method": "none", "tol": 1e-8}
    return Ipopt({"x": x, "p": p, "f": f, "g": error / root - r}, options=options)


@lru_cache(maxsize=32)
def _exp_function(model: Model, steps: int) -> ca.Function:
    """Return (q, v) -> Exp_q(v) by equal steps of the method of order 8 of Dormand and Prince."""
    n = model.dof
    rate = metric_of(model).geodesic_equation
    y = ca.MX.sym("y", 2 * n)
    slopes: list[ca.MX] = [rate(y)]
    for stage in range(1, STAGES):
        weights = ca.DM(RK_A[stage, :stage]) / steps
        slopes.append(rate(y + ca.horzcat(*slopes) @ weights))
    step = ca.Function("step", [y], [y + ca.horzcat(*slopes) @ ca.DM(RK_B) / steps])
    q = ca.MX.sym("q", n)
    v = ca.MX.sym("v", n)
    return ca.Function("exp", [q, v], [step.fold(steps)(ca.vertcat(q, v))[:n]])


def descend_transported_gradient(target: PoseTarget, velocity: Array) -> ShootingResult:
    """Return steps along the transported gradient, halved until they decrease the pose error."""
    metric = target.metric
    q0 = target.q0
    v = velocity
    end = exp(metric, q0, v)
    error = target.pose_error(end)
    rows = np.repeat(target.weights, 3)
    for iteration in range(_MAX_DESCENTS):
        size = float(np.linalg.norm(error))
        if size <= _CONVERGED:
            return ShootingResult(v, iteration, True, "the hand is at the pose")
        jacobian = rows[:, None] * target.model.hand_jacobian(end)
        step = np.linalg.pinv(jacobian, rcond=_CUTOFF) @ error
        if np.any(v):
            path = geodesic_from_velocity(metric, q0, v)
            backwards = Path(metric, path.grid, path.nodes[::-1])  # its grids are symmetric
            step = parallel_transport(metric, backwards, step)
        damping = 1.0
        for _ in range(_MAX_HALVINGS):
            try:
                new = exp(metric, q0, v + damping * step)
                new_error = target.pose_error(new)
            except IntegrationFailed:
                new_error = np.full(6, np.inf)
            if np.linalg.norm(new_error) < size:
                break
            damping /= 2.0
        else:
            status = "no step along the gradient decreases the pose error"
            return ShootingResult(v, iteration, False, status)
        v = v + damping * step
        end = new
        error = new_error
        if size - np.linalg.norm(error) <= _CONVERGED * size:
            return ShootingResult(v, iteration + 1, True, "the pose error no longer decreases")
    return ShootingResult(v, _MAX_DESCENTS, False, "the maximum number of iterations is reached")
