"""geodesic_to_pose: the geodesic of the least length to a pose of the hand.

Least squares over the initial velocity (Klein, Jaquier, Meixner, Asfour 2022, section V) of the
logarithm of poses on R^3 x S^3, in two ways: as a nonlinear program with exact derivatives, and by
the gradient of that paper, which parallel-transports the pose error back along the geodesic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_choice, as_positive, as_rotation, as_vector
from geodesic_ocp.errors import GeodesicOcpError, NotConverged
from geodesic_ocp.logarithm.geodesic import Geodesic, geodesic_from_velocity
from geodesic_ocp.logarithm.pose_shooting import (
    PoseTarget,
    ShootingResult,
    descend_transported_gradient,
    shoot,
)
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.ocp.pose_search import pose_difference

Method = Literal["newton", "transport"]
ENERGY_WEIGHT = 1e-8


@dataclass(frozen=True, eq=False, repr=False)
class ToPose(ShortRepr):
    """A geodesic to a pose of the hand.

    Attributes:
        path: the geodesic; None where it is a single configuration.
        velocity: q'(0), (n,).
        configuration: at its end, (n,).
        position_error, rotation_error: position error and rotation error of the hand there [m],
            [rad]; zero for what was left free.
        energy: 1/2 |q'(0)|_G^2.
        iterations: iterations of the solver.
        success: whether the solver converged: to a locally minimal pose error, which need not be
            zero.
        status: how it stopped, a sentence.
    """

    path: Geodesic | None
    velocity: Array
    configuration: Array
    position_error: float
    rotation_error: float
    energy: float
    iterations: int
    success: bool
    status: str

    _shown = ("velocity", "position_error", "rotation_error", "energy", "success", "status")


def geodesic_to_pose(
    model: Model,
    start: ArrayLike,
    position: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    *,
    velocity: ArrayLike | None = None,
    weights: tuple[float, float] = (1.0, 1.0),
    energy_weight: float = ENERGY_WEIGHT,
    method: Method = "newton",
    throw: bool = True,
) -> ToPose:
    """Return the geodesic from a configuration whose end brings the hand (end-effector) nearest to
    a pose.

    min over v = q'(0) of 1/2 |(a dp, b dr)|^2 + w/2 |v|_G^2 / tr G, where dp and dr are the
    translation and the rotation vector from the hand at Exp_start(v) to the pose; the rotation
    vector is twice as long as the logarithm on S^3. The energy, with its small weight w, selects
    one of the many geodesics of a redundant arm, at the price of a pose error of about w. Nothing
    else restricts the path: for joint limits see `Reach`.

    >>> arm, start = go.human_arm(), [0.4, 0.1, -0.6, 1.2, 0.2, 0.0, 0.1]
    >>> result = go.logarithm.geodesic_to_pose(arm, start, position=[0.2, 0.35, -0.1])
    >>> result.success
    True
    >>> arm.hand_pose(result.path(1.0))[1].round(4)
    array([ 0.2 ,  0.35, -0.1 ])

    Args:
        model: model whose hand it is; the metric is its kinetic energy.
        start: configuration (n,) [rad or m].
        position: position of the hand, (3,) [m] in the base's frame; None leaves it free.
        rotation: rotation of the hand, (3, 3); None leaves it free.
        velocity: (n,) initial guess; zero by default.
        weights: a [1/m] and b [1/rad].
        energy_weight: w of the energy, relative to the metric's trace at the start. Not used by
            "transport", which stops at the first geodesic to the pose.
        method: "newton", an NLP in v and the pose error, with exact first and second derivatives
            through the integration; or "transport", the gradient of the paper: the pose error times
            the Jacobian's pseudo-inverse, parallel-transported back to the start, with a step that
            is halved until the pose error decreases.
        throw: raise NotConverged if the solver does not converge.

    Raises:
        ValueError: wrong shapes or values, or neither position nor rotation.
        NotConverged: see `throw`.
        IntegrationFailed: a geodesic cannot be integrated.
    """
    q0 = as_vector("start", start, as_model(model).dof)
    if position is None and rotation is None:
        raise ValueError("geodesic_to_pose needs a position, a rotation or both")
    as_choice("method", method, get_args(Method))
    target_position = np.zeros(3) if position is None else as_vector("position", position, 3)
    target_rotation = np.eye(3) if rotation is None else as_rotation("rotation", rotation)
    given = np.array([position is not None, rotation is not None])
    factors = given * [as_positive(f"weights[{k}]", weights[k]) for k in (0, 1)]
    v0 = np.zeros(model.dof) if velocity is None else as_vector("velocity", velocity, model.dof)
    target = PoseTarget(model, q0, target_position, target_rotation, factors)
    if method == "newton":
        found = shoot(target, v0, as_positive("energy_weight", energy_weight))
    else:
        found = descend_transported_gradient(target, v0)
    result = _as_result(target, found, given)
    if throw and not result.success:
        raise NotConverged(
            f"no geodesic to the pose was found: {result.status}, after {result.iterations} "
            f"iterations; the pose error of the hand is {result.position_error:.3g} m and "
            f"{result.rotation_error:.3g} rad",
            result,
        )
    return result


def _as_result(target: PoseTarget, found: ShootingResult, given: Array) -> ToPose:
    """Return the result with its path, and with the errors of what was given."""
    velocity, iterations, success, status = found
    path = None
    configuration = target.q0
    if np.any(velocity):
        try:
            path = geodesic_from_velocity(target.metric, target.q0, velocity)
            configuration = path.nodes[-1]
        except GeodesicOcpError as error:
            success = False
            status = f"{status}; {error}"
    rotation, position = target.model.hand_pose(configuration)
    distance, angle = pose_difference(rotation, position, target.rotation, target.position)
    return ToPose(
        path,
        velocity,
        configuration,
        distance if given[0] else 0.0,
        angle if given[1] else 0.0,
        float(target.metric.inner(target.q0, velocity, velocity)) / 2.0,
        iterations,
        success,
        status,
    )


def nearest_of(found: Sequence[ToPose]) -> ToPose:
    """Get the one with the smallest pose error; among equal ones, that of the smallest energy."""
    smallest = min(each.position_error + each.rotation_error for each in found)
    return min(
        (each for each in found if each.position_error + each.rotation_error <= smallest + 1e-6),
        key=lambda each: each.energy,
    )
