"""The geodesic from a posture on which the hand comes nearest to a pose: shooting.

Least squares over the initial velocity (Klein, Jaquier, Meixner, Asfour 2022, section V) of the
logarithm of poses on R^3 x S^3, in two ways: as a nonlinear program with exact derivatives, and by
the gradient of that paper, which carries the hand's miss back along the geodesic in parallel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple, get_args

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import DOP853

from geodesic_ocp.arrays import Array, as_positive, as_rotation, as_vector
from geodesic_ocp.errors import GeodesicOcpError, IntegrationFailed, NotConverged
from geodesic_ocp.manifold.exponential import exp
from geodesic_ocp.manifold.kinetic_energy import KineticEnergy
from geodesic_ocp.manifold.transport import parallel_transport
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.ipopt import Ipopt, Outcome
from geodesic_ocp.ocp.logarithm import Geodesic, log, shoot
from geodesic_ocp.ocp.path import Path
from geodesic_ocp.ocp.pose_error import pose_miss, rotation_log

Method = Literal["newton", "transport"]
ENERGY_WEIGHT = 1e-8
# Steps of the integrator within the program, and how well they must agree with `exp`.
_STEPS, _CAREFUL, _MOST_STEPS, _AGREES = 2, 4, 64, 1e-7
# Iterations of one solve; and the weights of the energy that lead on where it takes more.
_PATIENCE, _SHRINKING = 60, (1.0, 1e-2, 1e-4, 1e-6)
_ITERATIONS = 2000  # of the gradient method
_DONE = 1e-9  # of the gradient method: the miss, or what a step gains of it
_HALVINGS = 30
_CUT = 1e-3  # of the Jacobian's largest singular value: what the pseudo-inverse leaves alone


@dataclass(frozen=True, eq=False)
class ToPose:
    """A geodesic to a pose of the hand.

    Attributes:
        path: the geodesic; None where it is a single posture.
        velocity: q'(0), (n,).
        posture: at its end, (n,).
        position_error, rotation_error: of the hand there [m], [rad]; of what was asked for.
        energy: 1/2 |q'(0)|_G^2.
        iterations: that were needed.
        success: whether the solver stopped at a solution: the nearest pose of such geodesics, which
            need not be the one that was asked for.
        status: how it stopped, a sentence.
    """

    path: Geodesic | None
    velocity: Array
    posture: Array
    position_error: float
    rotation_error: float
    energy: float
    iterations: int
    success: bool
    status: str


def geodesic_to_pose(
    model: Model,
    start: ArrayLike,
    position: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    *,
    velocity: ArrayLike | None = None,
    towards: ArrayLike | None = None,
    weights: tuple[float, float] = (1.0, 1.0),
    energy_weight: float = ENERGY_WEIGHT,
    method: Method = "newton",
    throw: bool = True,
) -> ToPose:
    """The geodesic from a posture whose end brings the hand nearest to a pose.

    min over v = q'(0) of 1/2 |(a dp, b dr)|^2 + w/2 |v|_G^2 / tr G, where dp and dr are the way and
    the rotation vector from the hand at Exp_start(v) to the pose; the rotation vector is twice as
    long as the logarithm on S^3. The energy, with its small weight w, decides among the many
    geodesics of a redundant arm; it keeps the hand from the pose by about w. Nothing else restricts
    the path: for joint limits see `Reach`.

    Args:
        model: whose hand it is; the metric is its kinetic energy.
        start: posture (n,) [rad or m].
        position: of the hand, (3,) [m] in the base's frame; None leaves it free.
        rotation: of the hand, (3, 3); None leaves it free.
        velocity: (n,) to start the search from; zero by default.
        towards: posture (n,) to start the search from: its logarithm is the velocity.
        weights: a [1/m] and b [1/rad].
        energy_weight: w of the energy in units of the metric's trace at the start. Not used by
            "transport", which stops at whatever geodesic it comes to first.
        method: "newton", an NLP in v and the miss, with exact first and second derivatives through
            the integration; or "transport", the gradient of the paper: the miss through the
            Jacobian's pseudo-inverse, carried back to the start in parallel, with a step that is
            halved until the miss falls.
        throw: raise NotConverged where the solver stops elsewhere than at a solution.

    Raises:
        ValueError: wrong shapes or values, or neither position nor rotation.
        NotConverged: see `throw`.
        IntegrationFailed: a geodesic cannot be integrated.
    """
    q0 = as_vector("start", start, model.dof)
    if position is None and rotation is None:
        raise ValueError("geodesic_to_pose needs a position, a rotation or both")
    if method not in get_args(Method):
        raise ValueError(f"method must be one of {', '.join(get_args(Method))}, got {method!r}")
    place = np.zeros(3) if position is None else as_vector("position", position, 3)
    turn = np.eye(3) if rotation is None else as_rotation("rotation", rotation)
    given = np.array([position is not None, rotation is not None])
    factors = given * [as_positive(f"weights[{k}]", weights[k]) for k in (0, 1)]
    v0 = _first_velocity(model, q0, velocity, towards)
    target = _Target(model, q0, place, turn, factors)
    if method == "newton":
        small = as_positive("energy_weight", energy_weight)
        v0, iterations, success, status = _newton(target, v0, small)
    else:
        v0, iterations, success, status = _descended(target, v0)
    result = target.reached(v0, given, iterations, success, status)
    if throw and not success:
        raise NotConverged(
            f"no geodesic to the pose was found: {status}, after {iterations} iterations; the hand "
            f"misses it by {result.position_error:.3g} m and {result.rotation_error:.3g} rad",
            result,
        )
    return result


def _first_velocity(
    model: Model, q0: Array, velocity: ArrayLike | None, towards: ArrayLike | None
) -> Array:
    if velocity is not None and towards is not None:
        raise ValueError("give velocity or towards, not both")
    if towards is not None:
        return log(KineticEnergy(model), q0, as_vector("towards", towards, model.dof))
    if velocity is not None:
        return as_vector("velocity", velocity, model.dof)
    return np.zeros(model.dof)


@dataclass(frozen=True, eq=False)
class _Target:
    """A pose to come near to from a posture; weights that are zero leave it free."""

    model: Model
    q0: Array
    position: Array
    rotation: Array
    weights: Array

    @property
    def metric(self) -> KineticEnergy:
        return _metric(self.model)

    def miss(self, q: Array) -> Array:
        """Weighted position and rotation vector (6,) from the hand at q to the pose."""
        pose = self.model.hand_pose(q)
        return np.asarray(_miss(self.model)(*pose, self.position, self.rotation, self.weights))[
            :, 0
        ]

    def reached(
        self, v: Array, given: Array, iterations: int, success: bool, status: str
    ) -> ToPose:
        """The record of a velocity."""
        path, posture = None, self.q0
        if np.any(v):
            try:
                path = shoot(self.metric, self.q0, v)
                posture = path.nodes[-1]
            except GeodesicOcpError as error:
                success, status = False, f"{status}; {error}"
        rotation, position = self.model.hand_pose(posture)
        away, angle = pose_miss(rotation, position, self.rotation, self.position)
        energy = float(self.metric.inner(self.q0, v, v)) / 2.0
        away, angle = away if given[0] else 0.0, angle if given[1] else 0.0
        return ToPose(path, v, posture, away, angle, energy, iterations, success, status)


@lru_cache(maxsize=32)
def _metric(model: Model) -> KineticEnergy:
    return KineticEnergy(model)


@lru_cache(maxsize=32)
def _miss(model: Model) -> ca.Function:
    """Pose, pose wanted and weights (2,) -> weighted difference (6,), in the base's axes."""
    del model
    rotation, wanted = ca.SX.sym("R", 3, 3), ca.SX.sym("R1", 3, 3)
    position, place, weights = ca.SX.sym("p", 3), ca.SX.sym("p1", 3), ca.SX.sym("w", 2)
    difference = ca.vertcat(
        weights[0] * (place - position), weights[1] * rotation_log(wanted @ rotation.T)
    )
    return ca.Function("miss", [rotation, position, place, wanted, weights], [difference])


def _newton(target: _Target, v: Array, small: float) -> tuple[Array, int, bool, str]:
    """The NLP; where it is not solved at once, with a large weight of the energy that shrinks."""
    direct = _with_steps(target, v, small, _STEPS)
    if direct.success:
        return direct.x, direct.iterations, True, direct.status
    iterations, best, reached = direct.iterations, direct, np.inf
    weights = [weight for weight in _SHRINKING if weight > small]
    for weight in (*weights, small):
        outcome = _with_steps(target, best.x if best.success else v, weight, _CAREFUL)
        iterations += outcome.iterations
        if not outcome.success:
            if best.success:
                status = f"{best.status}, but with weight {reached:g} of the energy only"
                return best.x, iterations, False, status
            break
        best, reached = outcome, weight
    return best.x, iterations, best.success, best.status


class _Outcome(NamedTuple):
    x: Array
    iterations: int
    success: bool
    status: str


def _with_steps(target: _Target, v: Array, small: float, steps: int) -> _Outcome:
    """The NLP with one weight, and as many steps of its integrator as agree with `exp`."""
    iterations = 0
    while True:
        outcome = _shot(target, v, small, steps)
        iterations += outcome.iterations
        found = outcome.x[: target.q0.size]
        if not outcome.success:
            found = found if np.all(np.isfinite(found)) else v
            return _Outcome(found, iterations, False, outcome.status)
        end = _flow(target.model, steps)(target.q0, found).full()[:, 0]
        try:
            agrees = np.abs(end - exp(target.metric, target.q0, found)).max() <= _AGREES
        except IntegrationFailed as error:
            return _Outcome(found, iterations, False, str(error))
        if agrees:
            return _Outcome(found, iterations, True, outcome.status)
        if steps >= _MOST_STEPS:
            status = f"{steps} steps of the integrator are too few for this geodesic"
            return _Outcome(found, iterations, False, status)
        steps, v = 2 * steps, found


def _shot(target: _Target, v: Array, small: float, steps: int) -> Outcome:
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
    missed = _miss(model)(rotation, position, place, ca.reshape(turn, 3, 3), weights)
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
    n, rate = model.dof, _metric(model).geodesic_equation
    y = ca.MX.sym("y", 2 * n)
    slopes: list[ca.MX] = [rate(y)]
    for stage in range(1, DOP853.n_stages):
        weights = ca.DM(DOP853.A[stage, :stage]) / steps
        slopes.append(rate(y + ca.horzcat(*slopes) @ weights))
    step = ca.Function("step", [y], [y + ca.horzcat(*slopes) @ ca.DM(DOP853.B) / steps])
    q, v = ca.MX.sym("q", n), ca.MX.sym("v", n)
    return ca.Function("flow", [q, v], [step.fold(steps)(ca.vertcat(q, v))[:n]])


def _descended(target: _Target, v: Array) -> tuple[Array, int, bool, str]:
    """Steps along the miss, by the pseudo-inverse and parallel transport, that make it smaller."""
    metric, q0 = target.metric, target.q0
    end = exp(metric, q0, v)
    missed = target.miss(end)
    rows = np.repeat(target.weights, 3)
    for iteration in range(_ITERATIONS):
        size = float(np.linalg.norm(missed))
        if size <= _DONE:
            return v, iteration, True, "the hand is at the pose"
        jacobian = rows[:, None] * target.model.hand_jacobian(end)
        step = np.linalg.pinv(jacobian, rcond=_CUT) @ missed
        if np.any(v):
            path = shoot(metric, q0, v)
            back = Path(metric, path.grid, path.nodes[::-1])  # its grids are symmetric
            step = parallel_transport(metric, back, step)
        share = 1.0
        for _ in range(_HALVINGS):
            try:
                new = exp(metric, q0, v + share * step)
                new_missed = target.miss(new)
            except IntegrationFailed:
                new_missed = np.full(6, np.inf)
            if np.linalg.norm(new_missed) < size:
                break
            share /= 2.0
        else:
            return v, iteration, False, "no step along the gradient brings the hand nearer"
        v, end, missed = v + share * step, new, new_missed
        if size - np.linalg.norm(missed) <= _DONE * size:
            return v, iteration + 1, True, "the hand comes no nearer"
    return v, _ITERATIONS, False, "too many iterations"


def nearest_of(found: Sequence[ToPose]) -> ToPose:
    """The one that misses the pose least; among those that miss it alike, of least energy."""
    least = min(each.position_error + each.rotation_error for each in found)
    close = [each for each in found if each.position_error + each.rotation_error <= least + 1e-6]
    return min(close, key=lambda each: each.energy)
