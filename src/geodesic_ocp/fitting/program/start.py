"""Values from which a fit is solved again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from geodesic_ocp.arrays import Array


class Start(Protocol):
    """Values of the variables and of the multipliers, such as an `Outcome`."""

    @property
    def x(self) -> Array:
        """Variables."""

    @property
    def lam_x(self) -> Array:
        """Multipliers of their bounds."""

    @property
    def lam_g(self) -> Array:
        """Multipliers of the equations."""


@dataclass(frozen=True, eq=False)
class StartValues:
    """A `Start` of given values."""

    x: Array
    lam_x: Array
    lam_g: Array
