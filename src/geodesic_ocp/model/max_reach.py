"""How far a hand reaches."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.optimize import minimize

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.joints import motion_subspace

_STARTS = 16


def reach(
    model: pin.Model, frame: int, lower: Array, upper: Array, joint: int | None = None
) -> float:
    """Largest distance [m] found of a frame from a joint, wherever that is.

    Minimises -|p(q) - p_joint(q)|^2 within the limits from random configurations.

    Args:
        model: with one coordinate for each joint.
        frame: number of the frame.
        lower, upper: limits (n,) [rad or m]; angles without any are taken within a turn, and a
            slide without any reaches to infinity.
        joint: number of the joint; None: the first that moves the frame, at its zero.
    """
    data = model.createData()
    chain = list(model.supports[model.frames[frame].parentJoint])[1:]
    if not chain:
        return 0.0

    axes = pin.LOCAL_WORLD_ALIGNED

    def negative_square(q: Array) -> tuple[float, Array]:
        jacobian = pin.computeFrameJacobian(model, data, q, frame, axes)[:3]
        place = pin.updateFramePlacement(model, data, frame).translation
        if joint is None:
            arm = place - model.jointPlacements[chain[0]].translation
        else:
            pin.computeJointJacobians(model, data, q)
            arm = place - data.oMi[joint].translation
            jacobian = jacobian - pin.getJointJacobian(model, data, joint, axes)[:3]
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
