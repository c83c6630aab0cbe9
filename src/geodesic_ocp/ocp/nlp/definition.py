"""What an NLP is built from, and transcriptions shared by problems that differ in numbers alone."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field, replace
from functools import lru_cache

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.nlp.conditions import Conditions
from geodesic_ocp.ocp.nlp.transcription import PathTerms, Transcription
from geodesic_ocp.trajectory.grid import Grid


@dataclass(frozen=True)
class Structure:
    """The expressions of a problem, without the numbers that may change from solve to solve.

    Attributes:
        key: equal for problems that share one NLP; None if the NLP is not shared.
        metric: of the manifold.
        conditions: of the problem.
    """

    key: Hashable
    metric: Metric = field(compare=False)
    conditions: Conditions = field(compare=False)

    def transcription(self, grid: Grid) -> Transcription:
        """The NLP on all grids of this shape, built once for all problems with this key."""
        even = replace(grid, ends=None)
        if self.key is None:
            return Transcription(_unshared_terms(self.metric, self.conditions), even)
        return _shared(self, even)


@dataclass(frozen=True, eq=False, repr=False)
class ProblemDefinition:
    """Everything about a problem that its NLP is built from.

    Attributes:
        metric: of the manifold.
        conditions: boundary conditions, constraints and running cost.
        guess: initial guess, s (k,) -> positions (k, n), or None for the straight line.
        via_parameters: s of each via point; None if they are free.
        key: equal for problems that share one NLP; None if the NLP is not shared.
        grid: to solve on unless another is requested.
    """

    metric: Metric
    conditions: Conditions
    guess: Callable[[Array], Array | None]
    via_parameters: tuple[float, ...] | None
    key: Hashable
    grid: Grid

    def __repr__(self) -> str:
        return f"ProblemDefinition({self.metric!r}, {self.conditions!r}, {self.grid!r})"

    @property
    def structure(self) -> Structure:
        """The expressions alone."""
        return Structure(self.key, self.metric, self.conditions)


# Differentiating takes longest, and the derivatives are the same on every grid.
_unshared_terms = lru_cache(maxsize=4)(PathTerms.of)


@lru_cache(maxsize=32)
def _shared_terms(structure: Structure) -> PathTerms:
    return PathTerms.of(structure.metric, structure.conditions)


@lru_cache(maxsize=32)
def _shared(structure: Structure, grid: Grid) -> Transcription:
    return Transcription(_shared_terms(structure), grid)
