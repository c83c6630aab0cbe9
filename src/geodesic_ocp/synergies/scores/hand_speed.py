"""Speed of the hand along a motion."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.motion import Motion


def hand_twists(model: Model, motion: Motion) -> Array:
    """Linear [m/s] and angular [rad/s] velocities (k, 6) of the hand, J(q) q', in base axes.

    q' is the motion's velocity, or the derivative of the spline through its samples if it has none.
    """
    velocity = motion(motion.time, 1) if motion.velocity is None else motion.velocity
    twists: Array = evaluate(_twist(model).map(len(motion)), motion.q.T, velocity.T).T
    return twists


def hand_speeds(model: Model, motion: Motion) -> Array:
    """Speeds (k,) of the hand's position [m/s]."""
    return np.asarray(np.linalg.norm(hand_twists(model, motion)[:, :3], axis=1))


@lru_cache(maxsize=32)
def _twist(model: Model) -> ca.Function:
    q, v = ca.SX.sym("q", model.dof), ca.SX.sym("v", model.dof)
    return ca.Function("twist", [q, v], [ca.densify(model.hand_jacobian(q) @ v)])
