"""The largest distance that a hand (end-effector) can reach."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.joints import motion_subspace

_NUM_STARTS = 16


def max_reach(
    model: pin.Model, frame: int, lower: Array, upper: Array, joint: int | None = None
) -> float:
    """Largest distance [m] found between a frame and a joint.

    Minimises -|p(q) - p_joint(q)|^2 within the joint limits from random configurations.

    Args:
        model: with one coordinate per joint.
        frame: index of the frame.
        lower, upper: joint limits (n,) [rad or m]; an unlimited angle is restricted to one
            revolution, and an unlimited prismatic joint has infinite reach.
        joint: index of the joint; None: the first that moves the frame, at its zero position.
    """
    data = model.createData()
    chain = list(model.supports[model.frames[frame].parentJoint])[1:]
    if not chain:
        return 0.0

    axes = pin.LOCAL_WORLD_ALIGNED

    def negative_square(q: Array) -> tuple[float, Array]:
        jacobian = pin.computeFrameJacobian(model, data, q, frame, axes)[:3]
        position = pin.updateFramePlacement(model, data, frame).translation
        if joint is None:
            arm = position - model.jointPlacements[chain[0]].translation
        else:
            pin.computeJointJacobians(model, data, q)
            arm = position - data.oMi[joint].translation
            jacobian = jacobian - pin.getJointJacobian(model, data, joint, axes)[:3]
        return -float(arm @ arm), -2.0 * jacobian.T @ arm

    for index in chain:
        i = model.joints[index].idx_v
        prismatic = np.linalg.norm(motion_subspace(model, index)[3:]) == 0.0
        if prismatic and not np.isfinite(upper[i] - lower[i]):
            return np.inf
    low = np.where(np.isfinite(lower), lower, -np.pi)
    high = np.where(np.isfinite(upper), upper, np.pi)
    rng, bounds = np.random.default_rng(0), list(zip(low, high, strict=True))
    found = [
        scipy.optimize.minimize(
            negative_square, start, jac=True, bounds=bounds, method="L-BFGS-B"
        ).fun
        for start in rng.uniform(low, high, (_NUM_STARTS, model.nv))
    ]
    return float(np.sqrt(-min(found)))
