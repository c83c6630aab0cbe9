"""A path's second variation, and certificates that it is locally minimizing.

A geodesic is a stationary point of the energy. It is locally minimizing if the second variation is
positive definite; the number of negative directions, the Morse index, equals the number of points
conjugate to the start inside the path (Milnor, *Morse Theory* (1963), section 15). It is computed
here from the Hessian of the discrete energy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from geodesic_ocp.arrays import Array, as_vector, evaluate
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.manifold.exp import exp
from geodesic_ocp.ocp.displacements import decreases_nearby, fine_objective
from geodesic_ocp.ocp.nlp import NLP
from geodesic_ocp.ocp.problems import geodesic_definition
from geodesic_ocp.ocp.transcription import Units
from geodesic_ocp.ocp.violations import NEGLIGIBLE, path_samples
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path


@dataclass(frozen=True, eq=False, repr=False)
class FinalIterate:
    """Primal and dual variables of an NLP where the solver stopped.

    Attributes:
        nlp: the NLP.
        x: variables in its units.
        lam_bounds: multipliers of the bounds of variables that are not fixed.
        lam_g: multipliers of the constraint functions.
    """

    nlp: NLP
    x: Array
    lam_bounds: Array
    lam_g: Array

    @cached_property
    def path(self) -> Path:
        """Path of the iterate, in the problem's units."""
        return self.nlp.path(self.x)

    @cached_property
    def lam_x(self) -> Array:
        """Multipliers of all bounds; at fixed variables they balance the other forces."""
        fixed = (self.nlp.bounds.lower == self.nlp.bounds.upper).ravel()
        forces = self.gradient() + self.constraints[1].T @ self.lam_g
        return np.where(fixed, -forces, self.lam_bounds)

    def gradient(self) -> Array:
        """Return gradient of the objective."""
        _, gradient = self.nlp.transcription.objective(self.x, self.nlp.p)
        return np.asarray(gradient.full()[:, 0])

    @property
    def balance(self) -> Array:
        """Gradient of the Lagrangian, the sum of all forces."""
        return self.gradient() + self.lam_x + self.constraints[1].T @ self.lam_g

    def hessian(self) -> Array:
        """Return Hessian of the Lagrangian."""
        return self.nlp.transcription.full_hessian(self.x, self.nlp.p, self.lam_g)

    @cached_property
    def constraints(self) -> tuple[Array, Array]:
        """Constraint functions and their Jacobian."""
        g, jacobian = evaluate(self.nlp.transcription.constraints, self.x, self.nlp.p)
        return g[:, 0], jacobian


# Eigenvalues of the second variation that are smaller than the largest by this factor are rounding.
_ROUNDING = 1e-11
_MOST_VARIABLES = 1500  # longer paths are resampled on a coarser grid
_COARSER = Grid(8, 20)
_BISECTIONS = 30
# At a stationary point a Newton step would change the energy by at most this fraction.
_DECREASE = 1e-5
_TINY = 1e-300


def stationarity_and_index(
    gradient: Array, hessian: Array | scipy.sparse.csc_array
) -> tuple[bool, int]:
    """Return whether a point is stationary, and the number of negative eigenvalues of the Hessian.

    A point is stationary if a Newton step would change the function by less than a small fraction:
    the gradient is measured in the scale of the Hessian, which may be sparse with a band.
    """
    if isinstance(hessian, scipy.sparse.csc_array):
        entries = hessian.tocoo()
        offset = entries.row - entries.col
        lower = offset >= 0
        band = np.zeros((int(offset.max(initial=0)) + 1, gradient.size))
        band[offset[lower], entries.col[lower]] = entries.data[lower]
        try:
            step = scipy.linalg.solveh_banded(band, gradient, lower=True)
            return bool(gradient @ step <= _DECREASE), 0
        except (np.linalg.LinAlgError, ValueError):  # not positive definite, or not finite
            hessian = hessian.toarray()
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
    """Return gradient and Hessian of the energy, relative to it, of the path from s = 0 to s = end.

    The derivatives are those by the inner nodes.
    """
    n = path.metric.dim
    grid = _usable(path)
    nodes = path.nodes if grid is path.grid and end == 1.0 else path(end * grid.nodes)
    # Not a problem with these ends, at which there may be no metric: the NLP is the same for all.
    transcription = geodesic_definition(path.metric).transcription(grid)
    extent = float(np.ptp(nodes, axis=0).max()) or 1.0
    energy = transcription.energy(grid, nodes)
    units = Units(nodes[0], extent, energy if 0.0 < energy < np.inf else 1.0)
    x = units.scaled(nodes).ravel()
    p = transcription.parameters(units, grid)
    _, gradient = transcription.objective(x, p)
    hessian = transcription.full_hessian(x, p, np.zeros(0))
    return gradient.full()[n:-n, 0], hessian[n:-n, n:-n]


def _usable(path: Path) -> Grid:
    """Return the grid of a path, or a coarser one if that has very many nodes."""
    is_long = path.grid.size * path.metric.dim > _MOST_VARIABLES
    return _COARSER if is_long and path.grid.segments > _COARSER.segments else path.grid


def _geodesic_decreases_nearby(path: Path, gradient: Array, hessian: Array) -> bool:
    """Return whether the energy decreases at small displacements of the inner nodes."""
    grid = _usable(path)
    n = path.metric.dim
    nodes = path(grid.nodes)
    extent = float(np.ptp(nodes, axis=0).max())
    energy = fine_objective(Path(path.metric, grid, nodes))
    if not len(hessian) or extent == 0.0 or not 0.0 < energy < np.inf:
        return False

    def objective(displacement: Array) -> float:
        moved = nodes.copy()
        moved[1:-1] += extent * displacement.reshape(-1, n)
        return fine_objective(Path(path.metric, grid, moved)) / energy

    every = np.eye(len(hessian))
    return decreases_nearby(objective, gradient, hessian, every, grid.nodes[1:-1])


def _iterate_decreases_nearby(iterate: FinalIterate, hessian: Array, basis: Array) -> bool:
    """Return whether the Lagrangian decreases at small displacements that conditions allow."""
    nlp = iterate.nlp
    conditions = nlp.conditions
    samples = path_samples(conditions)
    allowed = max(NEGLIGIBLE, float(samples.excess(iterate.path, roughly=True)[1].max()))
    active_g = _active(iterate)[1]

    def objective(displacement: Array) -> float:
        x = iterate.x + displacement
        path = nlp.path(x)
        g = evaluate(nlp.transcription.constraints, x, nlp.p)[0][:, 0]
        inactive = np.maximum(nlp.bounds.lower_g - g, g - nlp.bounds.upper_g)[~active_g]
        if np.any(inactive > allowed):
            return np.nan
        return fine_objective(path, conditions) / nlp.units.scale + float(iterate.lam_g @ g)

    if not len(hessian):
        return False
    gradient = basis.T @ iterate.balance
    return decreases_nearby(objective, gradient, hessian, basis, nlp.grid.nodes)


def first_conjugate_point(path: Path) -> float:
    """Get s of the first point conjugate to the start, of a path whose Morse index is positive."""
    below = 0.0
    above = 1.0
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
    """Return whether a symmetric matrix with this bandwidth is positive definite."""
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
    """Return cholesky factor, or None if the matrix is not positive definite."""
    try:
        return np.asarray(np.linalg.cholesky(matrix))
    except np.linalg.LinAlgError:
        return None


_DRIFT = 0.05  # an unconstrained stationary path conserves its kinetic energy to this fraction
# Forces in the scaled NLP above this belong to active conditions.
_ACTIVE = 1e-6
# Distance from a bound, and unbalanced force, in the scaled NLP.
_AT_BOUND = 1e-4
_BALANCE = 1e-3
_SMALLEST = np.finfo(float).tiny
_DEPENDENT = 1e-10


@dataclass(frozen=True, repr=False)
class Certificate:
    """Certificate of a path: geodesic residuals, second-order conditions, multipliers.

    Attributes:
        endpoint_error: distance between the end of the path and the end of the geodesic with the
            same initial velocity, integrated forward, in the worst coordinate [rad or m]; inf if
            the integration fails. It is large where constraints are active: such a path is not a
            geodesic.
        drift: largest relative deviation of the kinetic energy along the path from its mean; inf
            where there is no metric.
        stationary: whether the energy does not change to first order under variations that meet
            the path's conditions. If not, the path is not a solution.
        morse_index: number of independent directions in which the energy of a stationary path
            decreases to second order; None if the path is not stationary.
        first_conjugate_point: s, to 1e-6, of the first point conjugate to the start of a geodesic
            between fixed ends: up to there it is locally minimizing. None: there is none inside.
        has_active_constraints: whether conditions along the path are active, so that the path is
            not a geodesic.
        decreases_nearby: whether the energy decreases at a small displacement although it should
            increase by its second derivatives, as cost, conditions or metric are not smooth there.
        has_running_cost: whether the problem's own cost is minimized together with the energy;
            `stationary` and `morse_index` then refer to their sum.
        switching_points: s, to the distance of two nodes, at which conditions along the path become
            active or inactive. The path's second derivative jumps there, but not that of a
            polynomial: in the segments around them, the force of a limit that is computed from
            second derivatives may have the wrong sign. The multipliers at the nodes do not, or the
            path is not stationary; the error disappears as the grid becomes finer.
    """

    endpoint_error: float
    drift: float
    stationary: bool
    morse_index: int | None
    first_conjugate_point: float | None = None
    has_active_constraints: bool = False
    has_running_cost: bool = False
    switching_points: tuple[float, ...] = ()
    decreases_nearby: bool = False

    @property
    def locally_shortest(self) -> bool:
        """True if the path is locally minimizing among the paths that meet its conditions.

        To second order, at small displacements that were tried, and for the sum of energy and cost
        if there is a running cost.
        """
        return self.stationary and self.morse_index == 0 and not self.decreases_nearby

    def __str__(self) -> str:
        if not self.stationary:
            verdict = "not stationary"
        elif self.locally_shortest:
            verdict = "locally minimizing"
            verdict += " energy and cost" if self.has_running_cost else ""
            verdict += " under its constraints" if self.has_active_constraints else ""
        elif self.decreases_nearby:
            what = "energy and cost decrease" if self.has_running_cost else "the energy decreases"
            verdict = f"not locally minimizing: {what} nearby, against what the derivatives tell"
        else:
            what = "energy and cost" if self.has_running_cost else "length"
            verdict = (
                f"stationary, not locally minimizing: Morse index {self.morse_index} of {what}"
            )
            if self.first_conjugate_point:
                verdict += f", first conjugate point at s = {self.first_conjugate_point:.4g}"
        if self.has_active_constraints:
            count = len(self.switching_points)
            switching = f", {count} switching point{'s' * (count > 1)}" * (count > 0)
            return f"{verdict}; not a geodesic, constraints are active{switching}"
        if self.has_running_cost:
            return f"{verdict}; not a geodesic, there is a running cost"
        return f"{verdict}; endpoint error {self.endpoint_error:.1e}, energy drift {self.drift:.1e}"

    def __repr__(self) -> str:
        return f"Certificate({self})"


def certify(path: Path, velocity: ArrayLike | None = None) -> Certificate:
    """Return the certificate of a path between fixed ends as a geodesic of its metric.

    >>> import geodesic_ocp as go
    >>> path = go.geodesic(go.Euclidean(2), [0.0, 0.0], [3.0, 4.0])
    >>> go.ocp.certify(path).locally_shortest
    True

    Args:
        path: any path; `stationary` tells whether it is a geodesic, as far as its nodes resolve it.
        velocity: the initial velocity (n,), if it is known more accurately than from the path.

    Raises:
        ValueError: not a path, or a velocity of another shape.
    """
    if not isinstance(path, Path):
        raise ValueError(f"path must be a Path, got {path!r}")
    start = path(0.0, 1) if velocity is None else as_vector("velocity", velocity, path.metric.dim)
    drift = _energy_drift(path)
    gradient, hessian = energy_derivatives(path)
    stationary, index = stationarity_and_index(gradient, hessian)
    stationary = stationary and drift <= _DRIFT
    may_be_least = stationary and index == 0
    return Certificate(
        endpoint_error=_endpoint_error(path, start),
        drift=drift,
        stationary=stationary,
        morse_index=index if stationary else None,
        first_conjugate_point=first_conjugate_point(path) if stationary and index else None,
        decreases_nearby=may_be_least and _geodesic_decreases_nearby(path, gradient, hessian),
    )


def certify_iterate(iterate: FinalIterate, success: bool) -> Certificate:
    """Return the certificate of a path among those that meet the problem's conditions.

    Args:
        iterate: where the solver stopped.
        success: whether it is a solution.
    """
    nlp = iterate.nlp
    path = iterate.path
    n = iterate.path.metric.dim
    has_cost = not nlp.conditions.cost.is_zero()
    momentum = -iterate.gradient()[:n] * nlp.units.scale / nlp.units.length
    drift = _energy_drift(path)
    start = np.full(n, np.nan)
    if np.isfinite(drift):
        start = np.linalg.solve(path.metric.matrix(path.nodes[0]), momentum)
    error = _endpoint_error(path, start)
    if not success or not np.isfinite(drift) or not _is_first_order(iterate):
        return Certificate(error, drift, False, None, has_running_cost=has_cost)
    active_x, active_g = _active(iterate)
    inner_are_free = np.sum(~active_x) == iterate.x.size - 2 * n and not np.any(active_x[n:-n])
    if inner_are_free and not np.any(active_g) and not has_cost:
        # Also finds stationary points of a coarse discretization that are no geodesics.
        return replace(certify(path), endpoint_error=error)
    along = active_g[nlp.transcription.size_ends :]
    is_constrained = bool(np.any(along) or np.any(active_x[n:-n]))
    if not has_cost and not is_constrained and drift > _DRIFT:
        return Certificate(error, drift, False, None)
    reduced, basis = _reduced_hessian(iterate)
    _, index = stationarity_and_index(np.zeros(len(reduced)), reduced)
    along_x = active_x.reshape(-1, n).copy()
    along_x[[0, -1]] = along_x[[1, -2]]  # what fixes the ends does not act along the path
    return Certificate(
        endpoint_error=error,
        drift=drift,
        stationary=True,
        morse_index=index,
        has_active_constraints=is_constrained,
        has_running_cost=has_cost,
        switching_points=nlp.bounds.switching_points(path.grid, along_x.ravel(), active_g),
        decreases_nearby=index == 0 and _iterate_decreases_nearby(iterate, reduced, basis),
    )


def descent_direction(iterate: FinalIterate) -> Array | None:
    """Return change of x, largest entry 1, along which the objective decreases to second order.

    Active conditions remain satisfied to first order. None: there is no such direction.
    """
    reduced, basis = _reduced_hessian(iterate)
    if stationarity_and_index(np.zeros(len(reduced)), reduced)[1] == 0:
        return None
    direction = basis @ np.linalg.eigh(reduced)[1][:, 0]
    return np.asarray(direction / np.abs(direction).max())


def _active(iterate: FinalIterate) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which bounds of x, and which constraints, are equalities or exert a force."""
    # Multiplier times gradient is the force of a condition, whatever the condition's unit.
    forces = np.abs(iterate.lam_g) * np.linalg.norm(iterate.constraints[1], axis=1)
    bounds = iterate.nlp.bounds
    fixed_x = (bounds.lower == bounds.upper).ravel()
    fixed_g = bounds.lower_g == bounds.upper_g
    return fixed_x | (np.abs(iterate.lam_x) > _ACTIVE), fixed_g | (forces > _ACTIVE)


def _reduced_hessian(iterate: FinalIterate) -> tuple[Array, Array]:
    """Get the Lagrangian's Hessian (k, k) on the tangent space of active conditions; its basis."""
    active_x, active_g = _active(iterate)
    basis = np.eye(iterate.x.size)[:, ~active_x]
    reduced = iterate.hessian()[np.ix_(~active_x, ~active_x)]
    if np.any(active_g):
        normals = iterate.constraints[1][np.ix_(active_g, ~active_x)]
        normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), _SMALLEST)
        tangent = scipy.linalg.null_space(normals, rcond=_DEPENDENT)
        reduced = tangent.T @ reduced @ tangent
        basis = basis @ tangent
    return reduced, basis


def _is_first_order(iterate: FinalIterate) -> bool:
    """Return whether forces balance, and multipliers have the signs of their bounds."""
    (g, jacobian) = iterate.constraints
    bounds = iterate.nlp.bounds
    length = iterate.nlp.units.length
    q = iterate.path.nodes
    sizes = np.maximum(np.linalg.norm(jacobian, axis=1), _SMALLEST)
    wrong = [np.abs(iterate.balance)]
    for force, scale, value, lower, upper in (
        (iterate.lam_x, 1.0 / length, q.ravel(), bounds.lower.ravel(), bounds.upper.ravel()),
        (iterate.lam_g * sizes, 1.0 / sizes, g, bounds.lower_g, bounds.upper_g),
    ):
        away = scale * np.array([upper - value, value - lower])
        wrong.append(np.maximum([force, -force], 0.0)[away > _AT_BOUND])
    return bool(np.concatenate(wrong).max(initial=0.0) <= _BALANCE)


def _endpoint_error(path: Path, velocity: Array) -> float:
    """Return distance of the geodesic with this initial velocity from the path's end."""
    extent = float(np.ptp(path.nodes, axis=0).max())
    try:
        arrival = exp(path.metric, path.nodes[0], velocity, tolerance=1e-9 * (extent or 1.0))
    except (IntegrationFailed, ValueError):  # it does not get there, or no metric at the start
        return np.inf
    return float(np.abs(arrival - path.nodes[-1]).max())


def _energy_drift(path: Path) -> float:
    """Get largest relative deviation of |q'|^2 from its mean, at the points of the quadrature."""
    squares = path.speeds_at_quadrature_points**2
    if not np.all(np.isfinite(squares)):
        return np.inf
    mean = float(np.sum(path.grid.quadrature.weights * squares))
    return float(np.abs(squares / mean - 1.0).max()) if mean > 0.0 else 0.0
