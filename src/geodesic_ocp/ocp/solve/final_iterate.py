"""The last iterate of a solve, in the units of its NLP."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.ocp.nlp.transcription import Transcription, Units
from geodesic_ocp.trajectory.path import Path


@dataclass(frozen=True, eq=False, repr=False)
class FinalIterate:
    """Primal and dual variables of an NLP where the solver stopped.

    Attributes:
        path: of the iterate, in the problem's units.
        transcription, units, p_values: the NLP, and the values of the problem's parameters.
        x, lam_x, lam_g: variables and multipliers in the NLP's units.
        fixed_x, fixed_g: where the lower bound equals the upper bound.
        success: whether the solver accepted it as a solution.
        energy_only: whether the problem has no running cost besides the energy.
    """

    path: Path
    transcription: Transcription
    units: Units
    p_values: Array
    x: Array
    lam_x: Array
    lam_g: Array
    fixed_x: NDArray[np.bool_]
    fixed_g: NDArray[np.bool_]
    success: bool
    energy_only: bool

    @property
    def p(self) -> Array:
        """Parameters of the NLP."""
        return self.units.parameters(self.path.grid, self.p_values)

    def gradient(self) -> Array:
        """Gradient of the objective."""
        _, gradient = self.transcription.objective(self.x, self.p)
        return np.asarray(gradient.full()[:, 0])

    def hessian(self) -> Array:
        """Hessian of the Lagrangian."""
        return self.transcription.full_hessian(self.x, self.p, self.lam_g)

    def constraint_jacobian(self) -> Array:
        """Jacobian of the constraint functions."""
        return np.asarray(self.transcription.constraints(self.x, self.p)[1].full())
