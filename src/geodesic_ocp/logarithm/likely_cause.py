"""Why a geodesic was not found, as far as the last path tells."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.trajectory.path import Path

# Samples of the straight line, and the ratio of the largest to the smallest diagonal entry of the
# metric that is worth reporting.
_SAMPLES, _LARGE_RATIO = 21, 1e4


def check_straight_line(metric: Metric, q0: Array, q1: Array, guess: Path | None) -> None:
    """ValueError if the metric is not finite, or not positive, along the initial guess."""
    s = np.linspace(0.0, 1.0, _SAMPLES)
    samples = q0 + s[:, None] * (q1 - q0) if guess is None else guess(s)
    metric.check_domain_along("the guess", s, samples)
    for q in samples:
        tensor = metric.matrix(q)
        if not (np.all(np.isfinite(tensor)) and np.all(np.diag(tensor) > 0.0)):
            raise ValueError(f"the metric is not finite and positive along the guess: at {q}")


def likely_cause(metric: Metric, nodes: Array) -> str:
    """A singularity that the last path (k, n) passes, or what else the cause may be."""
    finite = nodes[np.all(np.isfinite(nodes), axis=1)]
    for sample in finite:
        if cause := metric.near_singularity(sample):
            return cause
    sizes = np.array([np.diag(metric.matrix(sample)) for sample in finite])
    ratios = sizes.max(axis=0) / sizes.min(axis=0)
    if ratios.max() > _LARGE_RATIO:
        worst = int(np.argmax(ratios))
        names = metric.joint_names or [f"q[{index}]" for index in range(metric.dim)]
        low, high = (finite[pick(sizes[:, worst])] for pick in (np.argmin, np.argmax))
        return (
            f"between {low} and {high} the squared length along {names[worst]} grows by "
            f"{ratios[worst]:.0e}: one of them is near a singularity or a boundary"
        )
    return "no path from any of the attempts led to one; the goal may lie at a conjugate point"
