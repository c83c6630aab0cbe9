"""Spans of time in which a marker was not where the fitted motion has it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array

LOST = 0.25  # weight below which a marker counts as lost: it is farther away than `outlier`
_NEAR = 0.5  # distance from another marker's place, relative to that from its own


@dataclass(frozen=True)
class LostMarker:
    """A marker that lost its weight.

    Attributes:
        marker: its name.
        start, end: first and last such sample [s].
        distance: median from its place [m].
        near: marker near whose place it is instead, with which it may be swapped; or None.
    """

    marker: str
    start: float
    end: float
    distance: float
    near: str | None = None

    def __str__(self) -> str:
        instead = f", where {self.near} should be" if self.near else ""
        return (
            f"{self.marker} is {1e3 * self.distance:.0f} mm away from {self.start:.2f} to "
            f"{self.end:.2f} s{instead}"
        )


def lost_markers(
    time: Array, names: tuple[str, ...], observed: Array, predicted: Array, weights: Array
) -> tuple[LostMarker, ...]:
    """All spans of all markers; observed and predicted (k, m, 3) [m], weights (k, m)."""
    found = []
    for column, name in enumerate(names):
        seen = np.flatnonzero(~np.isnan(weights[:, column]))
        lost = weights[seen, column] < LOST
        edges = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(int)))
        for first, last in edges.reshape(-1, 2):
            rows = seen[first:last]
            away = np.linalg.norm(observed[rows, column, None] - predicted[rows], axis=2)
            distances = np.median(away, axis=0)
            nearest = int(np.argmin(distances))
            is_near = distances[nearest] < _NEAR * distances[column]
            found.append(
                LostMarker(
                    name,
                    float(time[rows[0]]),
                    float(time[rows[-1]]),
                    float(distances[column]),
                    names[nearest] if is_near else None,
                )
            )
    return tuple(found)
