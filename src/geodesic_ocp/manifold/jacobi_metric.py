"""Motion under gravity as geodesics: the Jacobi metric."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.kinetic_energy import ModelMetric


@dataclass(frozen=True)
class JacobiMetric(ModelMetric):
    """(E - V(q)) G(q): geodesics are the paths that the model takes by itself at total energy E.

    The principle of Maupertuis in Jacobi's form (Arnold, *Mathematical Methods of Classical
    Mechanics*, section 45): with kinetic energy E - V left over at q, the motion without torques
    follows a geodesic of this metric, at |dq/dt|_G = sqrt(2 (E - V)) instead of constant speed.
    There is a metric only where V < E; paths cannot go beyond.

    Attributes:
        model: gives mass matrix and potential energy, in the gravity of `model.pin`.
        energy: E [J], on the scale of `model.potential_energy`.

    Raises:
        ValueError: the energy is not a finite number.
    """

    energy: float

    def __post_init__(self) -> None:
        if not np.isfinite(self.energy):
            raise ValueError(f"energy must be finite [J], got {self.energy}")

    def matrix(self, q: Any) -> Any:
        """Metric tensor (E - V(q)) G(q), (n, n); not a number where V(q) >= E."""
        left = self.energy - self.model.potential_energy(q)
        # A solver that tries a point beyond must notice: negative squares of lengths would lure it.
        return ca.if_else(left > 0, left, np.nan) * self.model.mass_matrix(q)

    def point(self, name: str, q: Any) -> Array:
        """The argument of that name as a point (n,) below the energy.

        Raises:
            ValueError: it is not n finite numbers, the potential is too high there, or G is not
                positive definite.
        """
        (point,) = self._checked(**{name: q})
        potential = self.model.potential_energy(point)
        if potential >= self.energy:
            raise ValueError(
                f"{name}: the potential energy {potential:.6g} J at {point} is not below the total"
                f" energy of {self.energy:.6g} J: the model cannot be there"
            )
        return super().point(name, point)
