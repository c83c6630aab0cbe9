"""Where a path passes its via points, if the problem leaves it open.

The energy of pieces of lengths L_k in shares t_k of [0, 1] is at least sum_k L_k^2 / (2 t_k), which
is least where every L_k / t_k is the same. Solving and giving each piece its share take turns,
which Anderson's acceleration (J. ACM 12, 1965) makes few. What the shares are still off enters the
energy by its square.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.ocp.solve.solution import Solution, added
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

_TURNS = 30
_NO_WAY = 1e-4  # of the length: pieces that are shorter are none
_SETTLED = 1e-5  # in s; the energy is off by the square


def passed(solution: Solution, solve_on: Callable[[Grid, Path], Solution]) -> Solution:
    """The solution with its via points where they cost least.

    Args:
        solution: with via points anywhere.
        solve_on: the solution on another grid, from a path to start from.
    """
    tried: list[Array] = []
    residuals: list[Array] = []
    for _ in range(_TURNS):
        grid = solution.path.grid
        if not grid.via_segments:
            return solution
        if close := _close(solution.path):
            return _failed(solution, f"there is no way left between {close}: are they one point?")
        if not solution.stats.success:
            return solution
        tried.append(grid.via_s)
        residuals.append(_shares(solution.path) - grid.via_s)
        if np.abs(residuals[-1]).max() <= _SETTLED:
            return solution
        moved = grid.with_via_points_at(_next(tried, residuals).tolist())
        start = Path(solution.path.metric, moved, solution.path.nodes)
        solution = added(solve_on(moved, start), solution.stats)
    return _failed(solution, f"where to pass the via points did not settle in {_TURNS} turns")


def _failed(solution: Solution, status: str) -> Solution:
    return replace(solution, stats=replace(solution.stats, success=False, status=status))


def _close(path: Path) -> str:
    """Names of two neighbours among ends and via points that are nearly one; empty if none are."""
    lengths = _lengths(path)
    shortest = int(np.argmin(lengths))
    if not lengths[shortest] <= _NO_WAY * lengths.sum():
        return ""
    names = ["the start", *(f"via[{k}]" for k in range(len(lengths) - 1)), "the end"]
    return f"{names[shortest]} and {names[shortest + 1]}"


def _next(tried: list[Array], residuals: list[Array]) -> Array:
    """Shares at which the residual, as it has changed with them so far, would be zero."""
    plain = tried[-1] + residuals[-1]
    if len(tried) == 1:
        return plain
    steps, changes = (np.diff(each, axis=0).T for each in (tried, residuals))
    factors = np.linalg.lstsq(changes, residuals[-1], rcond=1e-10)[0]
    better = plain - (steps + changes) @ factors
    gaps = np.diff([0.0, *better, 1.0])
    return better if np.all(gaps > 0.2 * np.diff([0.0, *tried[-1], 1.0])) else plain


def _shares(path: Path) -> Array:
    """Where each via point would be for the pieces' mean square speeds to be the same."""
    lengths = _lengths(path)
    return np.asarray(np.cumsum(lengths)[:-1] / lengths.sum())


def _lengths(path: Path) -> Array:
    """Of the pieces between the via points, at their mean square speeds."""
    grid = path.grid
    squares = (path.speeds_at_nodes**2).reshape(grid.segments, -1)
    energies = (grid.weights * squares).sum(axis=1)
    pieces = np.split(energies, grid.via_segments)
    widths = np.diff([0.0, *grid.via_s, 1.0])
    return np.sqrt([width * piece.sum() for width, piece in zip(widths, pieces, strict=True)])
