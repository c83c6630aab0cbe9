"""Transcriptions of problems, each built once for all problems that differ in numbers alone."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.nlp.conditions import Conditions, conditions
from geodesic_ocp.ocp.nlp.transcription import Blocks, Transcription, transcribe
from geodesic_ocp.trajectory.grid import Grid

if TYPE_CHECKING:
    from geodesic_ocp.ocp.problem.problem import Problem


@dataclass(frozen=True)
class Structure:
    """What an NLP depends on, and the conditions and metric to build it from.

    Attributes:
        key: equal for problems with one NLP; None for a problem that has its own.
    """

    key: Hashable
    metric: Metric = field(compare=False)
    terms: Conditions = field(compare=False)

    @classmethod
    def of(cls, problem: Problem, terms: Conditions) -> Structure:
        """The structure of a problem with these conditions."""
        own = problem.structure
        return cls(None if own is None else (type(problem), own), problem.metric, terms)


def transcribed(structure: Structure, grid: Grid) -> Transcription:
    """The NLP of the structure on the grid."""
    return (_built if structure.key is None else _shared)(structure, grid)


def transcription_of(problem: Problem, grid: Grid) -> Transcription:
    """The NLP of the problem on the grid."""
    return transcribed(Structure.of(problem, conditions(problem)), grid)


# Derivatives take longest, and are the same on every grid.
_own_blocks = lru_cache(maxsize=4)(Blocks.of)


def _built(structure: Structure, grid: Grid) -> Transcription:
    return transcribe(_own_blocks(structure.metric, structure.terms), grid)


@lru_cache(maxsize=32)
def _shared_blocks(structure: Structure) -> Blocks:
    return Blocks.of(structure.metric, structure.terms)


@lru_cache(maxsize=32)
def _shared(structure: Structure, grid: Grid) -> Transcription:
    return transcribe(_shared_blocks(structure), grid)
