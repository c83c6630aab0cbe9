"""Optimal path parameters of via points.

The energy of segments of lengths L_k on intervals of widths t_k is at least sum_k L_k^2 / (2 t_k),
which is least where every L_k / t_k is equal. Solving and redistributing s alternate, accelerated
by Anderson's method (J. ACM 12, 1965). The remaining error in s enters the energy squared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.ocp.solution import Solution, with_effort_of
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

_MAX_UPDATES = 30
_COINCIDENT = 1e-4  # of the length: via points closer than this coincide
_CONVERGED = 1e-5  # in s; the error of the energy is its square


def with_optimal_via_points(
    solution: Solution, solve_on: Callable[[Grid, Path], Solution]
) -> Solution:
    """The solution with its via points at the optimal s.

    Args:
        solution: with via points at any s.
        solve_on: solves on another grid, from an initial guess.
    """
    tried: list[Array] = []
    residuals: list[Array] = []
    for _ in range(_MAX_UPDATES):
        grid = solution.path.grid
        if not grid.via_segments:
            return solution
        if close := _coincident(solution.path):
            return _failed(solution, f"{close} have come together: do they coincide?")
        if not solution.stats.success:
            return solution
        tried.append(grid.via_s)
        residuals.append(_balanced_via_s(solution.path) - grid.via_s)
        if np.abs(residuals[-1]).max() <= _CONVERGED:
            return solution
        moved = grid.with_via_points_at(_next(tried, residuals).tolist())
        start = Path(solution.path.metric, moved, solution.path.nodes)
        solution = with_effort_of(solution.stats, solve_on(moved, start))
    return _failed(
        solution, f"the parameters s of the via points did not converge in {_MAX_UPDATES} updates"
    )


def _failed(solution: Solution, status: str) -> Solution:
    return replace(solution, stats=replace(solution.stats, success=False, status=status))


def _coincident(path: Path) -> str:
    """Names of two neighbouring ends or via points that nearly coincide; empty if none do."""
    lengths = _lengths(path)
    shortest = int(np.argmin(lengths))
    if not lengths[shortest] <= _COINCIDENT * lengths.sum():
        return ""
    names = ["the start", *(f"via[{k}]" for k in range(len(lengths) - 1)), "the end"]
    return f"{names[shortest]} and {names[shortest + 1]}"


def _next(tried: list[Array], residuals: list[Array]) -> Array:
    """Via parameters at which the residual, extrapolated linearly, would be zero."""
    plain = tried[-1] + residuals[-1]
    if len(tried) == 1:
        return plain
    steps, changes = (np.diff(each, axis=0).T for each in (tried, residuals))
    factors = np.linalg.lstsq(changes, residuals[-1], rcond=1e-10)[0]
    better = plain - (steps + changes) @ factors
    gaps = np.diff([0.0, *better, 1.0])
    return better if np.all(gaps > 0.2 * np.diff([0.0, *tried[-1], 1.0])) else plain


def _balanced_via_s(path: Path) -> Array:
    """Via parameters at which the mean square speed of all pieces would be equal."""
    lengths = _lengths(path)
    return np.asarray(np.cumsum(lengths)[:-1] / lengths.sum())


def _lengths(path: Path) -> Array:
    """Lengths of the pieces between via points, from their mean square speeds."""
    grid = path.grid
    energies = (grid.quadrature.weights * path.speeds_at_quadrature_points**2).sum(axis=1)
    pieces = np.split(energies, grid.via_segments)
    widths = np.diff([0.0, *grid.via_s, 1.0])
    return np.sqrt([width * piece.sum() for width, piece in zip(widths, pieces, strict=True)])
