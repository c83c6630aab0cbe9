"""Metrics on the joint space of a model: the kinetic energy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model


@dataclass(frozen=True)
class ModelMetric(Metric):
    """A metric on the joint space of a model."""

    model: Model

    @property
    def dim(self) -> int:  # type: ignore[override]
        """Degrees of freedom of the model."""
        return self.model.dof

    @property
    def joint_names(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the model's joints, in the order of q."""
        return self.model.joint_names

    @property
    def periods(self) -> tuple[float, ...]:  # type: ignore[override]
        """A turn, 2 pi, of continuous joints, otherwise inf."""
        turning = (name in self.model.continuous for name in self.joint_names)
        return tuple(2.0 * np.pi if turns else np.inf for turns in turning)


@dataclass(frozen=True)
class KineticEnergy(ModelMetric):
    """The mass-inertia matrix of a model: |v|^2 / 2 is its kinetic energy [J]."""

    def matrix(self, q: Any) -> Any:
        """Mass-inertia matrix G(q), (n, n)."""
        return self.model.mass_matrix(q)
