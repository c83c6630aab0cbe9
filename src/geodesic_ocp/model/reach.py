"""How far a hand reaches."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.optimize import minimize

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.joints import motion_subspace

_STARTS = 16


def reach(model: pin.Model, frame: int, lower: Array, upper: Array) -> float:
    """Largest distance [m] found of a frame from the first joint that moves it, at its zero.

    Minimises -|p(q) - p_joint|^2 within the limits from random postures.

    Args:
        model: with one coordinate for each joint.
        frame: number of the frame.
        lower, upper: limits (n,) [rad or m]; angles without any are taken within a turn, and a
            slide without any reaches to infinity.
    """
    data, joint = model.createData(), model.frames[frame].parentJoint
    chain = list(model.supports[joint])[1:]
    if not chain:
        return 0.0
    origin = model.jointPlacements[chain[0]].translation

    def negative_square(q: Array) -> tuple[float, Array]:
        jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
        arm = pin.updateFramePlacement(model, data, frame).translation - origin
        return -float(arm @ arm), -2.0 * jacobian.T @ arm

    slides = [np.linalg.norm(motion_subspace(model, index)[3:]) == 0.0 for index in chain]
    places = [model.joints[index].idx_v for index in chain]
    if any(s and not np.isfinite(upper[i] - lower[i]) for s, i in zip(slides, places, strict=True)):
        return np.inf
    low = np.where(np.isfinite(lower), lower, -np.pi)
    high = np.where(np.isfinite(upper), upper, np.pi)
    rng, bounds = np.random.default_rng(0), list(zip(low, high, strict=True))
    found = [
        minimize(negative_square, start, jac=True, bounds=bounds, method="L-BFGS-B").fun
        for start in rng.uniform(low, high, (_STARTS, model.nv))
    ]
    return float(np.sqrt(-min(found)))
