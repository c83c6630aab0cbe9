"""Knots in time: how many pieces every interval between edges of the arms is divided into."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.arm_paths import ArmPaths

_SPACING = 0.04  # of knots [s]
_LEAST, _MOST = 4, 360  # pieces of an interval, and about as many of all intervals together
SAME = 1e-6  # edges of two arms that are no further apart [s] are one


@dataclass(frozen=True, eq=False)
class Knots:
    """Knots that divide the intervals between edges into pieces of equal durations.

    Attributes:
        edges: of all arms (m + 1,) in the recording's time [s].
        pieces: of every interval (m,).
    """

    edges: Array
    pieces: np.ndarray

    @classmethod
    def spaced(cls, edges: Array, durations: Array) -> Knots:
        """About 40 ms apart when the intervals (m,) between edges (m + 1,) take these durations."""
        spacing = max(_SPACING, float(durations.sum()) / _MOST)
        return cls(edges, np.maximum(np.ceil(durations / spacing), _LEAST).astype(int))

    @property
    def person(self) -> Array:
        """Durations (m,) of the intervals in the recording [s]."""
        return np.asarray(np.diff(self.edges))

    @property
    def count(self) -> int:
        """Number of pieces."""
        return int(self.pieces.sum())

    @cached_property
    def interval(self) -> np.ndarray:
        """Number of the interval of every piece, (count,)."""
        return np.repeat(np.arange(self.pieces.size), self.pieces)

    @cached_property
    def fraction(self) -> Array:
        """Duration of every piece as a fraction of its interval's, (count,)."""
        return np.asarray(1.0 / self.pieces[self.interval])

    @cached_property
    def at_edges(self) -> np.ndarray:
        """Numbers of the knots at the edges (m + 1,)."""
        return np.concatenate([[0], np.cumsum(self.pieces)])

    def of(self, edges: Array) -> np.ndarray:
        """Numbers of the knots at some of the edges, by their times."""
        nearest = np.abs(self.edges[:, None] - edges).argmin(axis=0)
        return np.asarray(self.at_edges[nearest])

    def times(self, durations: Array) -> Array:
        """Times of the knots (count + 1,) for durations (m,) of the intervals [s]."""
        steps = durations[self.interval] * self.fraction
        return np.concatenate([[0.0], np.cumsum(steps)])


def union_of_edges(arms: Sequence[ArmPaths]) -> Array:
    """Times (m + 1,) in the recording at which any arm's path begins or ends [s]."""
    edges = np.unique(np.concatenate([arm.edges for arm in arms]))
    return np.asarray(edges[np.concatenate([[True], np.diff(edges) > SAME])])
