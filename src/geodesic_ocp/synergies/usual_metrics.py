"""The three metrics of every comparison, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import Euclidean, KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.synergies.joint_inertia import with_joint_inertia

JOINT_INERTIA = "kinetic energy with joint inertia"
KINETIC_ENERGY = "kinetic energy"
STRAIGHT_LINES = "straight lines"


def _with_joint_inertia(model: Model) -> Metric:
    return KineticEnergy(with_joint_inertia(model))


def _of_the_links_alone(model: Model) -> Metric:
    return KineticEnergy(model.with_armature(0.0) if np.any(model.armature) else model)


def _straight_lines(model: Model) -> Metric:
    return Euclidean(model.dof)


# Functions of a model: the kinetic energy with the model's or the default joint inertia, that of
# the links alone, and the Euclidean metric, whose geodesics are straight lines in joint space.
USUAL_METRICS: Mapping[str, Callable[[Model], Metric]] = MappingProxyType(
    {
        JOINT_INERTIA: _with_joint_inertia,
        KINETIC_ENERGY: _of_the_links_alone,
        STRAIGHT_LINES: _straight_lines,
    }
)
