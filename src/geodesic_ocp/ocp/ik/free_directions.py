"""Directions in which a position is left free."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, real_array


def as_directions(name: str, given: ArrayLike | None) -> Array:
    """Unit directions (k, 3) from None, one direction (3,) or several (k, 3).

    Raises:
        ValueError: wrong shapes, a zero vector, or directions that span all of space.
    """
    if given is None:
        return np.zeros((0, 3))
    try:
        directions = np.atleast_2d(real_array(given))
    except (TypeError, ValueError):
        directions = np.zeros(0)
    if directions.shape == (1, 0) or directions.shape == (0, 3):
        return np.zeros((0, 3))
    lengths = np.linalg.norm(directions, axis=-1)
    scaled = directions / np.where(lengths > 0.0, lengths, 1.0)[..., None]
    if (
        directions.ndim != 2
        or directions.shape[1] != 3
        or not np.all(np.isfinite(directions))
        or not np.all(lengths > 0.0)
        or np.linalg.matrix_rank(np.nan_to_num(scaled)) > 2
    ):
        raise ValueError(
            f"{name} must be a direction (3,), or (k, 3) of at most two independent ones, not "
            f"zero, got {given!r}"
        )
    return np.asarray(scaled)


def complement(directions: Array) -> tuple[Array, int]:
    """Orthonormal axes (3, 3), in columns, of which the first m span the directions, and m."""
    if not len(directions):
        return np.eye(3), 0
    across = scipy.linalg.null_space(directions)
    along = scipy.linalg.null_space(across.T)
    return np.hstack([along, across]), along.shape[1]
