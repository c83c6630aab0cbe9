"""Certificates: how exact a path is as a geodesic, and whether it is locally shortest.

A geodesic is stationary: its energy does not change to first order when the path does. It is
shortest among the paths near it if the second variation is positive; the number of its negative
directions, Morse's index, is the number of points conjugate to the start inside the path (Milnor,
*Morse Theory* (1963), section 15). Here it is that of the discrete energy's Hessian.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.manifold.exponential import exp
from geodesic_ocp.ocp.grid import Grid
from geodesic_ocp.ocp.path import Path
from geodesic_ocp.ocp.prepared import transcription_of
from geodesic_ocp.ocp.problem import PointToPoint
from geodesic_ocp.ocp.transcription import Transcription, Units

# Eigenvalues of the second variation this much below the largest are rounding.
_ROUNDING = 1e-11
_LARGEST = 1500  # variables of the second variation; longer paths are drawn on a coarser grid
_COARSER = Grid(8, 20)
_BISECTIONS = 30
# Multipliers of the scaled NLP above this belong to conditions that hold the path back.
_HOLDING = 1e-6
_DEPENDENT = 1e-10


@dataclass(frozen=True)
class Certificate:
    """What is known of a path.

    Attributes:
        residual: distance from the path's end, in the worst coordinate [rad or m], at which the
            geodesic with its initial velocity arrives when integrated forward; inf if it does not.
            Where constraints bend a path, it is no geodesic, and this is large.
        drift: largest deviation of the kinetic energy along the path from its mean, as a share.
        index: number of independent directions in which the path gets shorter, to second order,
            while it meets its conditions. 0: it is shortest among the paths near it.
        conjugate: s of the first point of a geodesic between fixed ends that is conjugate to its
            start: up to there it is locally shortest. None: there is none inside.
    """

    residual: float
    drift: float
    index: int
    conjugate: float | None = None

    @property
    def locally_shortest(self) -> bool:
        """Whether no path near this one is shorter, to second order; else it is only stationary."""
        return self.index == 0

    def __str__(self) -> str:
        if self.locally_shortest:
            kind = "shortest among the paths near it"
        else:
            where = f", first conjugate point at s = {self.conjugate:.4g}" if self.conjugate else ""
            kind = f"stationary, not shortest: {self.index} directions make it shorter{where}"
        return f"{kind}; residual {self.residual:.1e}, drift {self.drift:.1e}"


def certify(path: Path, velocity: Array | None = None) -> Certificate:
    """The certificate of a path between fixed ends, as a geodesic of its metric.

    Args:
        path: any; it should be stationary for `index` to mean anything, which `residual` tells.
        velocity: its initial velocity (n,), where it is known better than from the path.
    """
    start = path(0.0, 1) if velocity is None else velocity
    index, conjugate = _index(path, 1.0), None
    if index:
        below, above = 0.0, 1.0
        for _ in range(_BISECTIONS):
            middle = (below + above) / 2.0
            below, above = (below, middle) if _index(path, middle) else (middle, above)
        conjugate = above
    return Certificate(_residual(path, start), _drift(path), index, conjugate)


def _residual(path: Path, velocity: Array) -> float:
    """By how much the geodesic with this initial velocity misses the path's end."""
    try:
        arrival = exp(path.metric, path.nodes[0], velocity)
    except (IntegrationFailed, ValueError):
        return np.inf
    return float(np.abs(arrival - path.nodes[-1]).max())


def _drift(path: Path) -> float:
    """Largest deviation of |q'|^2 at the nodes from its mean, as a share of it."""
    grid, n = path.grid, path.metric.dim
    positions = grid.in_segments(path.nodes)
    slopes = grid.differentiation @ (positions - positions[:, :1])
    speeds = path.metric.speed.map(grid.collocations)
    squares = evaluate(speeds, positions.reshape(-1, n).T, slopes.reshape(-1, n).T).ravel() ** 2
    mean = float(np.tile(grid.weights, grid.segments) @ squares)
    return float(np.abs(squares / mean - 1.0).max()) if mean > 0.0 else 0.0


def _index(path: Path, end: float) -> int:
    """Index of the part of the path up to s = end, between fixed ends."""
    n, grid = path.metric.dim, path.grid
    if grid.size * n > _LARGEST and grid.segments > _COARSER.segments:
        grid = _COARSER
    nodes = path.nodes if grid is path.grid and end == 1.0 else path(end * grid.nodes)
    problem = PointToPoint(path.metric, nodes[0], nodes[-1])
    extent = float(np.ptp(nodes, axis=0).max()) or 1.0
    size = float(np.trace(path.metric.matrix(nodes[0]))) / n
    units = Units(nodes[0], extent, size * extent**2)
    x, no_conditions = units.scaled(nodes).ravel(), np.zeros(0)
    hessian = _hessian(transcription_of(problem, grid), x, units, no_conditions)
    return _negative_directions(hessian[n:-n, n:-n])


@dataclass(frozen=True, eq=False)
class Attempt:
    """A solve's last iterate as the NLP has it.

    Attributes:
        path: in the problem's units.
        transcription, units: the NLP.
        x, lam_x, lam_g: iterate and multipliers in the NLP's units.
        held_x, held_g: where both bounds are one.
    """

    path: Path
    transcription: Transcription
    units: Units
    x: Array
    lam_x: Array
    lam_g: Array
    held_x: NDArray[np.bool_]
    held_g: NDArray[np.bool_]

    def certificate(self) -> Certificate:
        """The path's certificate among the paths that meet the problem's conditions."""
        n = self.path.metric.dim
        held_x = self.held_x | (np.abs(self.lam_x) > _HOLDING)
        held_g = self.held_g | (np.abs(self.lam_g) > _HOLDING)
        free = np.flatnonzero(~held_x)
        hessian = _hessian(self.transcription, self.x, self.units, self.lam_g)
        reduced = hessian[np.ix_(free, free)]
        if np.any(held_g):
            slopes = self._jacobian()[np.ix_(np.flatnonzero(held_g), free)]
            allowed = null_space(slopes, rcond=_DEPENDENT)
            reduced = allowed.T @ reduced @ allowed
        index, conjugate = _negative_directions(reduced), None
        fixed = np.all(held_x[:n]) and np.all(held_x[-n:]) and free.size == self.x.size - 2 * n
        if index and fixed and not np.any(held_g):
            conjugate = certify(self.path).conjugate
        _, gradient = self.transcription.objective(self.x, self.units.parameters)
        momentum = -gradient.full()[:n, 0] * self.units.scale / self.units.length
        start = np.linalg.solve(self.path.metric.matrix(self.path.nodes[0]), momentum)
        return Certificate(_residual(self.path, start), _drift(self.path), index, conjugate)

    def _jacobian(self) -> Array:
        x, p = ca.MX.sym("x", self.x.size), ca.MX.sym("p", self.units.parameters.size)
        slopes = ca.jacobian(self.transcription.constraints(x, p), x)
        return np.asarray(
            evaluate(ca.Function("dg", [x, p], [slopes]), self.x, self.units.parameters)
        )


def _hessian(transcription: Transcription, x: Array, units: Units, lam_g: Array) -> Array:
    upper = evaluate(transcription.hessian, x, units.parameters, 1.0, lam_g)
    return np.asarray(np.triu(upper) + np.triu(upper, 1).T)


def _negative_directions(matrix: Array) -> int:
    """Number of negative eigenvalues of a symmetric matrix."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        eigenvalues = np.linalg.eigvalsh(matrix)
        return int(np.sum(eigenvalues < -_ROUNDING * np.abs(eigenvalues).max()))
    return 0
