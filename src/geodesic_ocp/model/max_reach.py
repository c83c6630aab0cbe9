"""The largest distance that a hand (end-effector) can reach."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.joints import motion_subspace

_NUM_RANDOM, _NUM_STARTS = 128, 8
_STRETCHED = 1e-7  # relative distance from the sum of the links' lengths


def max_reach(
    model: pin.Model, frame: int, lower: Array, upper: Array, joint: int | None = None
) -> float:
    """Largest distance [m] found between a frame and a joint.

    Minimizes -|p(q) - p_joint(q)|^2 within the joint limits from the best of many random
    configurations, until a stretched chain is found, which nothing exceeds.

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

    longest = _length(model, frame, chain, joint)
    for index in chain:
        i, subspace = model.joints[index].idx_v, motion_subspace(model, index)
        if np.any(subspace[:3]):
            longest = np.inf
        if not np.any(subspace[3:]) and not np.isfinite(upper[i] - lower[i]):
            return np.inf
    low = np.where(np.isfinite(lower), lower, -np.pi)
    high = np.where(np.isfinite(upper), upper, np.pi)
    bounds = list(zip(low, high, strict=True))
    random = np.random.default_rng(0).uniform(low, high, (_NUM_RANDOM, model.nv))
    reached = 0.0
    for start in sorted(random, key=lambda q: negative_square(q)[0])[:_NUM_STARTS]:
        found = scipy.optimize.minimize(
            negative_square, start, jac=True, bounds=bounds, method="L-BFGS-B"
        )
        reached = max(reached, float(np.sqrt(-found.fun)))
        if reached >= (1.0 - _STRETCHED) * longest:
            break
    return reached


def _length(model: pin.Model, frame: int, chain: list[int], joint: int | None) -> float:
    """Length [m] of the stretched chain from the joint to the frame; inf if the joint is not in it.

    Prismatic joints are at zero.
    """
    if joint is not None and joint not in chain:
        return np.inf
    behind = chain[1 if joint is None else chain.index(joint) + 1 :]
    placements = [model.jointPlacements[index] for index in behind]
    placements.append(model.frames[frame].placement)
    return sum(float(np.linalg.norm(placement.translation)) for placement in placements)
