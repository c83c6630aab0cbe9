"""The configuration whose hand comes nearest to a pose that is out of reach."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_rotation, as_vector
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.ipopt import Ipopt
from geodesic_ocp.model.geometry.signed_distances import signed_distances
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.ik.inverse_kinematics import Clear, room
from geodesic_ocp.ocp.ik.pose_error import rotation_log

# Among configurations that are equally near, the one near the start: a share too small to matter.
_STAY = 1e-6
_STARTS = 24


def nearest_configuration(
    model: Model,
    near: ArrayLike,
    position: ArrayLike | None,
    rotation: ArrayLike | None,
    weights: tuple[float, float],
    limits: bool,
    clear: Clear,
) -> Array:
    """The configuration (n,) whose hand's pose is nearest to a given one, within limits and clear.

    min (a |p - position|)^2 + (b angle)^2 with weights (a, b) [1/m], [1/rad], from several starts;
    the angle is that of the turn between the two rotations, up to pi.

    Args:
        model: whose hand is placed.
        near: configuration (n,) to stay near to, as far as that costs nothing.
        position: (3,) [m] in the base's frame; None leaves it free.
        rotation: (3, 3); None leaves it free.
        weights: of the position and of the rotation.
        limits: whether the joints stay within their limits.
        clear: bodies that are kept apart.

    Raises:
        ValueError: wrong shapes or values, or neither position nor rotation.
        NotConverged: no start led to a configuration that is clear of the bodies.
    """
    start = as_vector("near", near, model.dof)
    if position is None and rotation is None:
        raise ValueError("nearest_configuration needs a position, a rotation or both")
    place = np.zeros(3) if position is None else as_vector("position", position, 3)
    turn = np.eye(3) if rotation is None else as_rotation("rotation", rotation)
    of_each = np.where([position is None, rotation is None], 0.0, weights)
    lower, upper, inside = room(model, start, limits)
    solver = _program(model, clear.bodies)
    least = np.full(solver.size_g, clear.margin)
    p = np.concatenate([start, place, turn.ravel(order="F"), of_each])
    rng = np.random.default_rng(0)
    found = []
    for x0 in (inside, *rng.uniform(lower, upper, (_STARTS - 1, model.dof))):
        outcome = solver(x0=x0, p=p, lbx=lower, ubx=upper, lbg=least, ubg=np.inf)
        if outcome.success:
            found.append((outcome.objective, outcome.x))
    if not found:
        raise NotConverged(f"no configuration of {model.name!r} was found near the hand's pose")
    return min(found, key=lambda each: each[0])[1]


@lru_cache(maxsize=32)
def _program(model: Model, clear: tuple[Any, Any, Any]) -> Ipopt:
    n = model.dof
    q, p = ca.SX.sym("q", n), ca.SX.sym("p", n + 14)
    rotation, position = model.hand_pose(q)
    turn = ca.reshape(p[n + 3 : n + 12], 3, 3).T @ rotation
    away = p[n + 12] ** 2 * ca.sumsqr(position - p[n : n + 3])
    turned = p[n + 13] ** 2 * ca.sumsqr(rotation_log(turn))
    obstacles, links, pairs = clear
    distances = signed_distances(model, q, obstacles, links=links, pairs=pairs)
    f = away + turned + _STAY * ca.sumsqr(q - p[:n])
    return Ipopt({"x": q, "p": p, "f": f, "g": ca.vertcat(ca.SX(0, 1), *distances.values())})
