"""The metrics of the package: Euclidean, kinetic energy of a model, Jacobi's."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.model.model import Model


@dataclass(frozen=True)
class Euclidean(Metric):
    """The Euclidean metric of R^n, whose geodesics are straight lines."""

    dim: int

    def __post_init__(self) -> None:
        as_metric(self)

    def matrix(self, q: Any) -> Any:
        """The identity (n, n)."""
        return type(q).eye(self.dim)


@dataclass(frozen=True)
class ModelMetric(Metric):
    """A metric on the joint space of a model."""

    model: Model

    @property
    def dim(self) -> int:  # type: ignore[override]
        """Number of degrees of freedom of the model."""
        return self.model.dof

    @property
    def joint_names(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the model's joints, in the order of q."""
        return self.model.joint_names

    @property
    def periods(self) -> tuple[float, ...]:  # type: ignore[override]
        """2 pi for continuous joints, inf for others."""
        return tuple(
            2.0 * np.pi if name in self.model.continuous else np.inf for name in self.joint_names
        )

    def check_units(self, name: str, q: Array) -> None:
        """ValueError if a joint is more than a revolution beyond its limits, as if in degrees.

        Joints that are continuous, prismatic or without limits may be anywhere.
        """
        low, high = self._conceivable
        outside = (q < low) | (q > high)
        if outside.any():
            index = int(np.argmax(outside))
            low, high = self.model.lower[index], self.model.upper[index]
            raise ValueError(
                f"{name}: {self.joint_names[index]} is at {q[index]:.4g} rad, more than a "
                f"revolution beyond its limits {low:.3g} to {high:.3g}: are these degrees? Angles "
                "must be in rad"
            )

    @cached_property
    def _conceivable(self) -> tuple[Array, Array]:
        """Limits of the joints, wider by a revolution; none for continuous and prismatic joints."""
        model = self.model
        names = zip(model.joint_names, model.units, strict=True)
        free = [unit != "rad" or name in model.continuous for name, unit in names]
        wider = np.where(free, np.inf, 2.0 * np.pi)
        return model.lower - wider, model.upper + wider


@dataclass(frozen=True)
class KineticEnergy(ModelMetric):
    """The mass-inertia matrix of a model as metric: |v|^2 / 2 is its kinetic energy [J].

    >>> import geodesic_ocp as go
    >>> metric = go.KineticEnergy(go.human_arm())
    >>> q = [0.3, 0.1, -0.2, 0.8, 0.0, 0.0, 0.0]
    >>> metric.matrix(q).shape
    (7, 7)
    >>> round(metric.norm(q, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]) ** 2 / 2.0, 3)  # 1 rad/s, in J
    0.201
    """

    def matrix(self, q: Any) -> Any:
        """Mass-inertia matrix G(q), (n, n)."""
        return self.model.mass_matrix(q)

    def _energy(self, q: ca.SX, v: ca.SX) -> ca.SX:
        """Kinetic energy v' G(q) v / 2 [J], summed over the bodies."""
        if not self._has_mass_matrix:
            return super()._energy(q, v)
        return ca.SX(self.model.kinetic_energy(q, v))

    def _christoffel_force(self, q: ca.SX, u: ca.SX, v: ca.SX) -> ca.SX:
        """sum_jk Gamma_ijk u_j v_k, (n, 1): the symmetric bilinear form of the Coriolis forces."""
        if not self._has_mass_matrix:
            return super()._christoffel_force(q, u, v)
        quadratic = ca.SX(self.model.coriolis_force(q, u))
        return quadratic if ca.is_equal(u, v) else ca.jtimes(quadratic, u, v) / 2

    @property
    def _has_mass_matrix(self) -> bool:
        """Whether no subclass overrides `matrix`, so that the model's recursions apply."""
        return type(self).matrix is KineticEnergy.matrix


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
