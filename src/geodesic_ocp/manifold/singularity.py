"""Where a metric tensor is nearly singular, and along which coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geodesic_ocp.arrays import Array

# Eigenvalues of the metric in units of its diagonal this small are zero but for rounding, as are
# entries of the diagonal this far below the largest: the square of sin(pi), say.
_SINGULAR, _VANISHING = 1e-14, 1e-28
# Somewhat larger ones make geodesics hard to find.
_NEARLY_SINGULAR = 1e-4
# Coordinates with this share of the largest in a direction are named as moving in it.
_SHARE = 0.1


def is_singular(tensor: Array) -> bool:
    """Whether a symmetric, finite tensor (n, n) is not positive definite, but for rounding.

    No unit of a coordinate, and no boundary at which lengths grow, makes it so.
    """
    diagonal = np.diag(tensor)
    if np.any(diagonal <= _VANISHING * diagonal.max()):
        return True
    sizes = np.sqrt(diagonal)
    return bool(np.linalg.eigvalsh(tensor / np.outer(sizes, sizes))[0] <= _SINGULAR)


def near_singularity(tensor: Array, q: Array, names: Sequence[str] | None) -> str:
    """Along which coordinates a tensor (n, n) at q (n,) is nearly singular; empty if it is not.

    Judged by the eigenvalues of g_ij / sqrt(g_ii g_jj), which no unit of a coordinate changes.
    """
    diagonal = np.diag(tensor)
    if not (np.all(np.isfinite(tensor)) and np.all(diagonal > 0.0)):
        return f"there is no metric at {q}"
    sizes = np.sqrt(diagonal)
    eigenvalues, vectors = np.linalg.eigh(tensor / np.outer(sizes, sizes))
    if eigenvalues[0] > _NEARLY_SINGULAR:
        return ""
    shares = np.abs(vectors[:, 0])
    moved = np.flatnonzero(shares > _SHARE * shares.max()).tolist()
    words = [f"q[{index}]" if names is None else names[index] for index in moved]
    return f"the metric is nearly singular at {q}, where {' and '.join(words)} undo each other"
