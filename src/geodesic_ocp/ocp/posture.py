"""A posture in which the hand has a pose: inverse kinematics by optimisation."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_rotation, as_vector
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.solve import Ipopt

# A rotation by pi is taken for none by the error below, but is left by any small step.
_TINY = 1e-14
_STARTS, _ENOUGH = 60, 4
_REACHED = 1e-6  # [m], or sine of half an angle


def rotation_error(rotation: ca.SX, wanted: ca.SX) -> ca.SX:
    """sin(angle / 2) axis (3, 1) of the turn from one rotation (3, 3) to another.

    It grows up to a turn by pi, where the skew part of the rotation alone would vanish again.
    """
    turn = wanted.T @ rotation
    skew = ca.inv_skew(turn - turn.T) / 2
    return skew / ca.sqrt(ca.fmax(1 + ca.trace(turn), 0) + _TINY)


def find_posture(
    model: Model,
    near: ArrayLike,
    position: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    *,
    limits: bool = True,
) -> Array:
    """The posture (n,) nearest to another, joint by joint, with this hand's pose.

    min |q - near|^2 over q with the hand at the position, turned as the rotation, or both; from
    several starts, and within half a turn of joints whose limits are a turn apart or more.

    Args:
        model: whose hand is placed.
        near: posture (n,) to stay near to.
        position: of the hand (3,) [m] in the base's frame; None leaves it free.
        rotation: of the hand (3, 3); None leaves it free.
        limits: whether the joints stay within their limits.

    Raises:
        ValueError: wrong shapes or values, or neither position nor rotation.
        NotConverged: no such posture was found from any of several starts; says how near one came.
    """
    start = as_vector("near", near, model.dof)
    place = np.zeros(3) if position is None else as_vector("position", position, 3)
    turn = np.eye(3) if rotation is None else as_rotation("rotation", rotation)
    if position is None and rotation is None:
        raise ValueError("find_posture needs a position, a rotation or both")
    lower = model.lower if limits else np.full(model.dof, -np.inf)
    upper = model.upper if limits else np.full(model.dof, np.inf)
    inside = np.clip(start, lower, upper)
    # Where there is more room, half a turn leads anywhere; unbounded steps would wind the arm up.
    wide = ~(upper - lower <= 2.0 * np.pi)
    lower = np.where(wide, np.maximum(lower, inside - np.pi), lower)
    upper = np.where(wide, np.minimum(upper, inside + np.pi), upper)
    solver = _program(model, position is not None, rotation is not None)
    rng = np.random.default_rng(0)
    p = np.concatenate([start, place, turn.ravel(order="F")])
    found, nearest = [], np.inf
    for x0 in (inside, *rng.uniform(lower, upper, (_STARTS - 1, model.dof))):
        outcome = solver(x0=x0, p=p, lbx=lower, ubx=upper, lbg=0.0, ubg=0.0)
        miss = float(np.abs(outcome.g).max())
        nearest = min(nearest, miss)
        if outcome.success and miss <= _REACHED:
            found.append(outcome.x)
            if len(found) == _ENOUGH:
                break
    if not found:
        what = [
            name
            for name, given in (("position", position), ("rotation", rotation))
            if given is not None
        ]
        raise NotConverged(
            f"no posture of {model.name!r}{' within its limits' if limits else ''} has the hand's "
            f"{' and '.join(what)}: the nearest one misses {'them' if len(what) > 1 else 'it'} by "
            f"{nearest:.3g} (m, or sine of half an angle)"
        )
    return min(found, key=lambda q: float(np.linalg.norm(q - start)))


@lru_cache(maxsize=32)
def _program(model: Model, placed: bool, turned: bool) -> Ipopt:
    n = model.dof
    q, p = ca.SX.sym("q", n), ca.SX.sym("p", n + 12)
    rotation, position = model.hand_pose(q)
    away = q - p[:n]
    conditions = []
    if placed:
        conditions.append(position - p[n : n + 3])
    if turned:
        conditions.append(rotation_error(rotation, ca.reshape(p[n + 3 :], 3, 3)))
    return Ipopt({"x": q, "p": p, "f": ca.sumsqr(away) / 2, "g": ca.vertcat(*conditions)})
