"""Certificates: how exact a path is as a geodesic, and whether it is locally shortest.

A geodesic is stationary: its energy does not change to first order when the path does. It is
shortest among the paths near it if the second variation is positive; the number of its negative
directions, Morse's index, is the number of points conjugate to the start inside the path (Milnor,
*Morse Theory* (1963), section 15). Here it is that of the discrete energy's Hessian.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cholesky_banded, null_space, solve_triangular

from geodesic_ocp.arrays import Array, as_vector, evaluate
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.manifold.exp import exp
from geodesic_ocp.ocp.nlp.structure import transcribed
from geodesic_ocp.ocp.nlp.transcription import Transcription, Units
from geodesic_ocp.ocp.problem.point_to_point import structure_of_geodesics
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

# Eigenvalues of the second variation this much below the largest are rounding.
_ROUNDING = 1e-11
_LARGEST = 1500  # variables of the second variation; longer paths are drawn on a coarser grid
_COARSER = Grid(8, 20)
_BISECTIONS = 30
# Of a stationary path, Newton's method would change the energy by this share at most, and a path
# that no condition bends keeps its kinetic energy to this share.
_DECREASE, _DRIFT = 1e-5, 0.05
_TINY = 1e-300
# Multipliers of the scaled NLP above this belong to conditions that hold the path back.
_HOLDING = 1e-6
_DEPENDENT = 1e-10


@dataclass(frozen=True)
class Certificate:
    """What is known of a path.

    Attributes:
        endpoint_error: distance from the path's end, in the worst coordinate [rad or m], at which the
            geodesic with its initial velocity arrives when integrated forward; inf if it does not.
            Where constraints bend a path, it is no geodesic, and this is large.
        drift: largest deviation of the kinetic energy along the path from its mean, as a share;
            inf where there is no metric.
        stationary: whether the energy stays the same, to first order, when the path changes and
            meets its conditions. If not, the path is none that was looked for.
        morse_index: number of independent directions in which the energy of a stationary path falls, to
            second order; None of others.
        first_conjugate_point: s, to 1e-6, of the first point of a geodesic between fixed ends that is conjugate
            to its start: up to there it is locally shortest. None: there is none inside.
        has_active_constraints: whether conditions along the path hold it back, so that it is no geodesic.
        has_running_cost: whether a cost of the problem's own is minimised with the energy, to which
            `stationary` and `index` then refer.
    """

    endpoint_error: float
    drift: float
    stationary: bool
    morse_index: int | None
    first_conjugate_point: float | None = None
    has_active_constraints: bool = False
    has_running_cost: bool = False

    @property
    def locally_shortest(self) -> bool:
        """Whether no path near this one that meets its conditions is shorter, to second order.

        With a cost of the problem's own: whether none has less of energy and cost.
        """
        return self.stationary and self.morse_index == 0

    def __str__(self) -> str:
        if not self.stationary:
            kind = "not stationary"
        elif self.locally_shortest:
            kind = f"{'cheapest' if self.has_running_cost else 'shortest'} among the paths near it"
            kind += " that meet its conditions" if self.has_active_constraints else ""
        else:
            where = (
                f", first conjugate point at s = {self.first_conjugate_point:.4g}"
                if self.first_conjugate_point
                else ""
            )
            ways = (
                "1 direction makes"
                if self.morse_index == 1
                else f"{self.morse_index} directions make"
            )
            much = ("cheapest", "cheaper") if self.has_running_cost else ("shortest", "shorter")
            kind = f"stationary, not {much[0]}: {ways} it {much[1]}{where}"
        if self.has_active_constraints or self.has_running_cost:
            return f"{kind}; no geodesic"
        return f"{kind}; residual {self.endpoint_error:.1e}, drift {self.drift:.1e}"


def certify(path: Path, velocity: ArrayLike | None = None) -> Certificate:
    """The certificate of a path between fixed ends, as a geodesic of its metric.

    Args:
        path: any; `stationary` tells whether it is a geodesic, as well as its nodes draw one.
        velocity: its initial velocity (n,), where it is known better than from the path.

    Raises:
        ValueError: not a path, or a velocity of another shape.
    """
    if not isinstance(path, Path):
        raise ValueError(f"path must be a Path, got {path!r}")
    n = path.metric.dim
    start = path(0.0, 1) if velocity is None else as_vector("velocity", velocity, n)
    drift = _drift(path)
    gradient, hessian = _derivatives(path, 1.0)
    stationary, index = _judged(gradient[n:-n], hessian[n:-n, n:-n])
    stationary, conjugate = stationary and drift <= _DRIFT, None
    if stationary and index:
        conjugate = _first_conjugate(path)
    return Certificate(
        _residual(path, start), drift, stationary, index if stationary else None, conjugate
    )


def _first_conjugate(path: Path) -> float:
    n, below, above = path.metric.dim, 0.0, 1.0
    width = n * (max(path.grid.degree, _COARSER.degree) + 1)
    for _ in range(_BISECTIONS):
        middle = (below + above) / 2.0
        _, hessian = _derivatives(path, middle)
        # A segment's nodes know of no others; 30 dense factors would take most of the time.
        falls = not _is_positive(hessian[n:-n, n:-n], width)
        below, above = (below, middle) if falls else (middle, above)
    return above


def _residual(path: Path, velocity: Array) -> float:
    """By how much the geodesic with this initial velocity misses the path's end."""
    extent = float(np.ptp(path.nodes, axis=0).max())
    try:
        arrival = exp(path.metric, path.nodes[0], velocity, tolerance=1e-9 * max(1.0, extent))
    except (IntegrationFailed, ValueError):  # no way there, or no metric at the start
        return np.inf
    return float(np.abs(arrival - path.nodes[-1]).max())


def _drift(path: Path) -> float:
    """Largest deviation of |q'|^2 at the nodes from its mean, as a share of it."""
    squares = path.speeds_at_nodes**2
    if not np.all(np.isfinite(squares)):
        return np.inf
    mean = float(path.grid.weights.ravel() @ squares)
    return float(np.abs(squares / mean - 1.0).max()) if mean > 0.0 else 0.0


def _derivatives(path: Path, end: float) -> tuple[Array, Array]:
    """Gradient and Hessian, in units of the energy, of the energy of the path up to s = end."""
    n, grid = path.metric.dim, path.grid
    if grid.size * n > _LARGEST and grid.segments > _COARSER.segments:
        grid = _COARSER
    nodes = path.nodes if grid is path.grid and end == 1.0 else path(end * grid.nodes)
    # Not a problem with these ends, at which there may be no metric: the NLP is the same for all.
    transcription = transcribed(structure_of_geodesics(path.metric), grid)
    extent = float(np.ptp(nodes, axis=0).max()) or 1.0
    energy = transcription.energy(nodes)
    units = Units(nodes[0], extent, energy if 0.0 < energy < np.inf else 1.0)
    x = units.scaled(nodes).ravel()
    _, gradient = transcription.objective(x, units.parameters)
    return gradient.full()[:, 0], _hessian(transcription, x, units.parameters, np.zeros(0))


def _judged(gradient: Array, hessian: Array) -> tuple[bool, int]:
    """Whether a point is stationary, and the number of negative eigenvalues there.

    It is if Newton's method would change the function by less than a small share: the gradient is
    measured by the Hessian's own scale.
    """
    if not (np.all(np.isfinite(gradient)) and np.all(np.isfinite(hessian))):
        return False, 0
    if gradient.size == 0:
        return True, 0
    if (factor := _factor(hessian)) is not None:
        along = solve_triangular(factor, gradient, lower=True)
        return bool(along @ along <= _DECREASE), 0
    eigenvalues, vectors = np.linalg.eigh(hessian)
    rounding = _ROUNDING * np.abs(eigenvalues).max()
    along = vectors.T @ gradient
    decrease = float(np.sum(along**2 / np.maximum(np.abs(eigenvalues), max(rounding, _TINY))))
    return decrease <= _DECREASE, int(np.sum(eigenvalues < -rounding))


def _is_positive(matrix: Array, width: int) -> bool:
    """Whether a matrix is positive definite, of which entries further apart than a width are 0."""
    size = len(matrix)
    band = np.zeros((min(width, size), size))
    for row in range(len(band)):
        band[row, : size - row] = np.diagonal(matrix, -row)
    try:
        cholesky_banded(band, lower=True, check_finite=False)
    except np.linalg.LinAlgError:
        return False
    return True


def _factor(matrix: Array) -> Array | None:
    """Cholesky's factor, where the matrix is positive definite."""
    try:
        return np.asarray(np.linalg.cholesky(matrix))
    except np.linalg.LinAlgError:
        return None


@dataclass(frozen=True, eq=False)
class Attempt:
    """A solve's last iterate as the NLP has it.

    Attributes:
        path: in the problem's units.
        transcription, units, values: the NLP, and the values of the problem's own parameters.
        x, lam_x, lam_g: iterate and multipliers in the NLP's units.
        held_x, held_g: where both bounds are one.
        success: whether the solver took it for a solution.
        of_energy: whether nothing but the energy was minimised.
    """

    path: Path
    transcription: Transcription
    units: Units
    values: Array
    x: Array
    lam_x: Array
    lam_g: Array
    held_x: NDArray[np.bool_]
    held_g: NDArray[np.bool_]
    success: bool
    of_energy: bool

    def certificate(self) -> Certificate:
        """The path's certificate among the paths that meet the problem's conditions."""
        n = self.path.metric.dim
        held_x = self.held_x | (np.abs(self.lam_x) > _HOLDING)
        held_g = self.held_g | (np.abs(self.lam_g) > _HOLDING)
        has_cost = not self.of_energy
        free = np.flatnonzero(~held_x)
        p = self.units.with_values(self.values)
        _, gradient = self.transcription.objective(self.x, p)
        slopes = gradient.full()[:, 0]
        momentum = -slopes[:n] * self.units.scale / self.units.length
        drift = _drift(self.path)
        start = np.full(n, np.nan)
        if np.isfinite(drift):
            start = np.linalg.solve(self.path.metric.matrix(self.path.nodes[0]), momentum)
        residual = _residual(self.path, start)
        if not self.success or not np.isfinite(drift):
            return Certificate(
                residual, drift, stationary=False, morse_index=None, has_running_cost=has_cost
            )
        reduced = _hessian(self.transcription, self.x, p, self.lam_g)[np.ix_(free, free)]
        if np.any(held_g):
            normals = self._jacobian()[np.ix_(np.flatnonzero(held_g), free)]
            allowed = null_space(normals, rcond=_DEPENDENT)
            reduced = allowed.T @ reduced @ allowed
        # Ipopt has made sure of the first order, with all multipliers.
        _, index = _judged(np.zeros(len(reduced)), reduced)
        inside = free.size == self.x.size - 2 * n and not np.any(held_x[n:-n])
        if inside and not np.any(held_g) and self.of_energy:
            whole = certify(self.path)
            # A grid that is too coarse has stationary points that are no geodesics.
            return replace(whole, endpoint_error=residual)
        along = held_g[self.transcription.size_ends :]
        active = bool(np.any(along) or np.any(held_x[n:-n]))
        return Certificate(
            residual, drift, True, index, has_active_constraints=active, has_running_cost=has_cost
        )

    def _jacobian(self) -> Array:
        x, p = ca.MX.sym("x", self.x.size), ca.MX.sym("p", self.transcription.size_p)
        slopes = ca.jacobian(self.transcription.constraints(x, p), x)
        jacobian = ca.Function("dg", [x, p], [slopes])
        return np.asarray(evaluate(jacobian, self.x, self.units.with_values(self.values)))


def _hessian(transcription: Transcription, x: Array, p: Array, lam_g: Array) -> Array:
    upper = evaluate(transcription.hessian, x, p, 1.0, lam_g)
    return np.asarray(np.triu(upper) + np.triu(upper, 1).T)
