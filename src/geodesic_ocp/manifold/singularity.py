"""Detection of singular metric tensors, and of the coordinates that cause the singularity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geodesic_ocp.arrays import Array

# Eigenvalues of the normalized tensor below the first are zero up to rounding, as are entries of
# the diagonal below the second relative to the largest, such as the square of sin(pi).
_SINGULAR, _VANISHING = 1e-14, 1e-28
# Eigenvalues below this make geodesics hard to compute.
_NEARLY_SINGULAR = 1e-4
# Coordinates are named if their component of the singular direction exceeds this fraction.
_FRACTION = 0.1


def is_singular(tensor: Array) -> bool:
    """Whether a symmetric, finite tensor (n, n) is not positive definite, up to rounding.

    The result does not depend on units of coordinates, nor on lengths that grow near a boundary.
    """
    diagonal = np.diag(tensor)
    if np.any(diagonal <= _VANISHING * diagonal.max()):
        return True
    sizes = np.sqrt(diagonal)
    return bool(np.linalg.eigvalsh(tensor / np.outer(sizes, sizes))[0] <= _SINGULAR)


def describe_singularity(tensor: Array, q: Array, names: Sequence[str] | None) -> str:
    """Say which coordinates make a tensor (n, n) at q (n,) nearly singular; empty if it is not.

    Based on the eigenvalues of g_ij / sqrt(g_ii g_jj), which do not depend on units.
    """
    diagonal = np.diag(tensor)
    if not (np.all(np.isfinite(tensor)) and np.all(diagonal > 0.0)):
        return f"the metric is not positive definite at {q}"
    sizes = np.sqrt(diagonal)
    eigenvalues, vectors = np.linalg.eigh(tensor / np.outer(sizes, sizes))
    if eigenvalues[0] > _NEARLY_SINGULAR:
        return ""
    components = np.abs(vectors[:, 0])
    moved = np.flatnonzero(components > _FRACTION * components.max()).tolist()
    dependent = [f"q[{index}]" if names is None else names[index] for index in moved]
    return (
        f"the metric is nearly singular at {q}, where {' and '.join(dependent)} are linearly "
        "dependent (kinematic singularity)"
    )
