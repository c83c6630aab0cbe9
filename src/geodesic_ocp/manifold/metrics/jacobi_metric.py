"""The Jacobi metric, whose geodesics are motions under gravity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metrics.kinetic_energy import ModelMetric


@dataclass(frozen=True)
class JacobiMetric(ModelMetric):
    """(E - V(q)) G(q): geodesics are the paths of torque-free motion at total energy E.

    Maupertuis' principle in Jacobi's form (Arnold, "Mathematical Methods of Classical Mechanics",
    section 45): the motion without torques, with kinetic energy E - V at q, follows a geodesic of
    this metric, at speed |dq/dt|_G = sqrt(2 (E - V)) instead of constant speed. The metric is
    defined only where V < E, and paths cannot leave that region.

    Attributes:
        model: provides mass matrix and potential energy, with the gravity of `model.pin`.
        energy: total energy E [J]; see `model.potential_energy` for its zero.

    Raises:
        ValueError: the energy is not a finite number.
    """

    energy: float

    def __post_init__(self) -> None:
        if not np.isfinite(self.energy):
            raise ValueError(f"energy must be finite [J], got {self.energy}")

    def matrix(self, q: Any) -> Any:
        """Metric tensor (E - V(q)) G(q), (n, n); NaN where V(q) >= E."""
        kinetic = self.energy - self.model.potential_energy(q)
        # NaN stops a solver there, where negative squared lengths would attract it.
        return ca.if_else(kinetic > 0, kinetic, np.nan) * self.model.mass_matrix(q)

    def check_domain(self, name: str, q: Array) -> None:
        """ValueError if the potential energy at q (n,) is too high."""
        potential = self.model.potential_energy(q)
        if potential >= self.energy:
            raise ValueError(
                f"{name}: the potential energy {potential:.6g} J at {q} is not below the total"
                f" energy of {self.energy:.6g} J: the model cannot be there"
            )
