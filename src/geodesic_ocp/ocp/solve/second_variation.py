"""Stationarity and Morse index of a discrete functional, from its gradient and Hessian."""

from __future__ import annotations

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.ocp.nlp.transcription import Units
from geodesic_ocp.ocp.problem.point_to_point import geodesic_structure
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

# Eigenvalues of the second variation that are smaller than the largest by this factor are rounding.
_ROUNDING = 1e-11
_MOST_VARIABLES = 1500  # longer paths are resampled on a coarser grid
_COARSER = Grid(8, 20)
_BISECTIONS = 30
# At a stationary point a Newton step would change the energy by at most this fraction.
_DECREASE = 1e-5
_TINY = 1e-300


def stationarity_and_index(gradient: Array, hessian: Array) -> tuple[bool, int]:
    """Whether a point is stationary, and the number of negative eigenvalues of the Hessian.

    A point is stationary if a Newton step would change the function by less than a small fraction:
    the gradient is measured in the scale of the Hessian.
    """
    if not (np.all(np.isfinite(gradient)) and np.all(np.isfinite(hessian))):
        return False, 0
    if gradient.size == 0:
        return True, 0
    if (factor := _cholesky(hessian)) is not None:
        along = scipy.linalg.solve_triangular(factor, gradient, lower=True)
        return bool(along @ along <= _DECREASE), 0
    eigenvalues, vectors = np.linalg.eigh(hessian)
    rounding = _ROUNDING * np.abs(eigenvalues).max()
    along = vectors.T @ gradient
    decrease = float(np.sum(along**2 / np.maximum(np.abs(eigenvalues), max(rounding, _TINY))))
    return decrease <= _DECREASE, int(np.sum(eigenvalues < -rounding))


def energy_derivatives(path: Path, end: float = 1.0) -> tuple[Array, Array]:
    """Gradient and Hessian of the energy, relative to it, of the path from s = 0 to s = end.

    The derivatives are those by the inner nodes.
    """
    n, grid = path.metric.dim, path.grid
    if grid.size * n > _MOST_VARIABLES and grid.segments > _COARSER.segments:
        grid = _COARSER
    nodes = path.nodes if grid is path.grid and end == 1.0 else path(end * grid.nodes)
    # Not a problem with these ends, at which there may be no metric: the NLP is the same for all.
    transcription = geodesic_structure(path.metric).transcription(grid)
    extent = float(np.ptp(nodes, axis=0).max()) or 1.0
    energy = transcription.energy(grid, nodes)
    units = Units(nodes[0], extent, energy if 0.0 < energy < np.inf else 1.0)
    x = units.scaled(nodes).ravel()
    p = units.parameters(grid)
    _, gradient = transcription.objective(x, p)
    hessian = transcription.full_hessian(x, p, np.zeros(0))
    return gradient.full()[n:-n, 0], hessian[n:-n, n:-n]


def first_conjugate_point(path: Path) -> float:
    """S of the first point conjugate to the start, of a path whose Morse index is positive."""
    below, above = 0.0, 1.0
    width = path.metric.dim * (max(path.grid.degree, _COARSER.degree) + 1)
    for _ in range(_BISECTIONS):
        middle = (below + above) / 2.0
        _, hessian = energy_derivatives(path, middle)
        # The Hessian is banded, as nodes interact within segments only; 30 dense factorizations
        # would dominate the computing time.
        has_index = not _is_positive_definite(hessian, width)
        below, above = (below, middle) if has_index else (middle, above)
    return above


def _is_positive_definite(matrix: Array, width: int) -> bool:
    """Whether a symmetric matrix with this bandwidth is positive definite."""
    size = len(matrix)
    band = np.zeros((min(width, size), size))
    for row in range(len(band)):
        band[row, : size - row] = np.diagonal(matrix, -row)
    try:
        scipy.linalg.cholesky_banded(band, lower=True, check_finite=False)
    except np.linalg.LinAlgError:
        return False
    return True


def _cholesky(matrix: Array) -> Array | None:
    """Cholesky factor, or None if the matrix is not positive definite."""
    try:
        return np.asarray(np.linalg.cholesky(matrix))
    except np.linalg.LinAlgError:
        return None
