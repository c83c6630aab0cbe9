"""The distances that are too small at some configurations, which a program has to constrain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geodesic_ocp.arrays import Array, as_number
from geodesic_ocp.execution.clearance_constraint import Clearance


@dataclass(frozen=True, eq=False, repr=False)
class ActiveRows:
    """Distances that are too small at some of k configurations.

    Attributes:
        samples: indices of the configurations (j,).
        rows: index of the distance (j,) that is too small there, of `Clearance.row`.
        lower: bound (j,) [m] that `Clearance.row` has to keep near that configuration for the
            exact distance to be the one allowed.
    """

    samples: NDArray[np.int64]
    rows: NDArray[np.int64]
    lower: Array

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        return f"ActiveRows({len(set(self.rows.tolist()))} distances, {len(self)} violations)"


def active_rows(
    clearance: Clearance, q: ArrayLike, margin: float = 0.0, *, exact: bool = True
) -> ActiveRows:
    """The distances that are too small at configurations q (k, N).

    A path is planned without constraints first, checked at many points, and planned again with
    those distances alone that are too small, at the points where they are.

    With `exact`, a distance counts only if that of the exact geometry is too small, too, so that
    wide capsules bend no path that is clear; its bound is lower by how much the capsules are closer
    than the links. Where links overlap the bound is that of the capsules.

    Args:
        clearance: the distances.
        q: configurations.
        margin: added to the smallest distances allowed [m].
        exact: whether the exact geometry decides, if it is known.

    Raises:
        ValueError: q has the wrong shape.
    """
    margin = as_number("margin", margin)
    points = np.asarray(q, dtype=float)
    if points.ndim != 2 or points.shape[1] != clearance.dof or not np.isfinite(points).all():
        raise ValueError(f"q must be finite, of shape (k, {clearance.dof}), got {points.shape}")
    distances = clearance.function(points.T).full() if len(points) else np.empty((0, 0))
    least = clearance.lower + margin
    rows, samples = np.nonzero(distances < least[: len(distances), None])
    lower = least[rows]
    if exact and clearance.exact is not None:
        places = zip(samples.tolist(), rows.tolist(), strict=True)
        apart = np.array([clearance.exact(points[k], row) for k, row in places])
        gaps = np.where(apart > 0.0, apart - distances[rows, samples], 0.0)
        close = apart < lower
        samples, rows, lower = samples[close], rows[close], (lower - gaps)[close]
    return ActiveRows(samples, rows, lower)
