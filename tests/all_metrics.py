"""Examples of every metric of the package, and of user-defined metrics."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
from known_metrics import HalfPlane, PolarPlane, Sphere
from known_models import planar_arm, random_tree

import geodesic_ocp as go


def planar() -> go.KineticEnergy:
    return go.KineticEnergy(planar_arm((1.0, 0.8), (1.3, 0.7), (0.4, 0.5), (0.2, 0.1)))


METRICS: dict[str, Callable[[], go.Metric]] = {
    "sphere": Sphere,
    "half-plane": HalfPlane,
    "polar plane": PolarPlane,
    "Euclidean": lambda: go.Euclidean(3),
    "planar arm": planar,
    "human arm": lambda: go.KineticEnergy(go.human_arm("left", 1.0, 1.0)),
    "gravity": lambda: go.manifold.JacobiMetric(go.human_arm("right", 1.0, 1.0), 2.0),
    "region": lambda: go.manifold.RegionAvoiding(
        planar(),
        lambda q: [q[0] - 0.7, 1.8 - q[1], ca.norm_2(q) - 1.1],
        margin=0.3,
        configuration=(1.0, 1.0),
    ),
    "joint limits": lambda: go.manifold.RegionAvoiding(
        go.KineticEnergy(
            planar_arm((1.0, 0.8), (1.3, 0.7), (0.4, 0.5), (0.2, 0.1)).with_limits(
                [0.5, 0.4], [2.0, 2.2]
            )
        )
    ),
    "both arms": lambda: go.KineticEnergy(
        go.model.combine(
            planar_arm((1.0,), (2.0,), (0.5,), (0.1,)),
            planar_arm((1.0, 0.8), (1.3, 0.7), (0.4, 0.5), (0.2, 0.1)),
        )
    ),
    "tree": lambda: go.KineticEnergy(
        go.Model(random_tree(np.random.default_rng(3), joints=4), "tool")
    ),
}


def points(metric: go.Metric, rng: np.random.Generator, count: int) -> np.ndarray:
    """Random points (count, n), away from the singularities of the charts."""
    return 1.2 + rng.uniform(-0.3, 0.3, (count, metric.dim))
