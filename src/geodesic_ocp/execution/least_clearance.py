"""The least distances between bodies along a sampled trajectory."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.execution.clearance_constraint import Clearance
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

_INTERVAL = 0.01  # [s] between the samples at which distances are evaluated
_ROUNDING = 1e-6  # [m]


def least_clearance(
    trajectory: JointTrajectory, clearance: Clearance
) -> tuple[float, tuple[str, ...]]:
    """The least of all distances [m], and a sentence for each that is below its lower bound.

    Raises:
        ValueError: the distances are not of the joints of the trajectory.
    """
    joints = len(trajectory.joint_names)
    if clearance.dof != joints:
        raise ValueError(f"clearance must be of the {joints} joints of all models: {clearance!r}")
    steps = max(len(trajectory.time) - 1, 1)
    stride = max(int(_INTERVAL * steps / max(trajectory.duration, _ROUNDING) + 1e-9), 1)
    chosen = np.unique(np.append(np.arange(0, steps + 1, stride), len(trajectory.time) - 1))
    chosen = chosen[chosen < len(trajectory.time)]
    q = trajectory.positions[chosen]
    distances = np.asarray(evaluate(clearance.function.map(len(q)), q.T))
    sentences, least = [], np.inf
    for index, (name, bound) in enumerate(zip(clearance.names, clearance.lower, strict=True)):
        nearest, where = _least(clearance, q, distances[index], index, bound)
        least = min(least, nearest)
        if nearest < bound - _ROUNDING:
            sentences.append(
                f"{name}: {nearest:.3g} m apart at {trajectory.time[chosen[where]]:.4g} s, at "
                f"least {bound:.3g} m must remain"
            )
    return float(least), tuple(sentences)


def _least(
    clearance: Clearance, q: Array, distances: Array, index: int, bound: float
) -> tuple[float, int]:
    """The least distance [m] over the samples, and at which; exact if it matters."""
    order = np.argsort(distances)
    if distances[order[0]] >= bound or clearance.exact is None:
        return float(distances[order[0]]), int(order[0])
    least, where = np.inf, int(order[0])
    for sample in order:  # the function is a lower bound: later samples are farther apart
        if distances[sample] >= least:
            break
        exact = clearance.exact(q[sample], index)
        if exact < least:
            least, where = exact, int(sample)
    return float(least), where
