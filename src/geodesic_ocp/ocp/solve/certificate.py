"""Certificates: how accurate a path is as a geodesic, and whether it is locally minimizing.

A geodesic is a stationary point of the energy. It is locally minimizing if the second variation is
positive definite; the number of negative directions, the Morse index, equals the number of points
conjugate to the start inside the path (Milnor, *Morse Theory* (1963), section 15). It is computed
here from the Hessian of the discrete energy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_vector
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.manifold.exp import exp
from geodesic_ocp.ocp.solve.final_iterate import FinalIterate
from geodesic_ocp.ocp.solve.second_variation import (
    energy_derivatives,
    first_conjugate_point,
    stationarity_and_index,
)
from geodesic_ocp.trajectory.path import Path

_DRIFT = 0.05  # an unconstrained stationary path conserves its kinetic energy to this fraction
# Forces in the scaled NLP above this belong to active conditions.
_ACTIVE = 1e-6
_SMALLEST = np.finfo(float).tiny
_DEPENDENT = 1e-10


@dataclass(frozen=True, repr=False)
class Certificate:
    """What is known about a path.

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
        has_running_cost: whether the problem's own cost is minimized together with the energy;
            `stationary` and `morse_index` then refer to their sum.
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
        """Whether the path is locally minimizing among the paths that meet its conditions.

        To second order, and for the sum of energy and cost if there is a running cost.
        """
        return self.stationary and self.morse_index == 0

    def __str__(self) -> str:
        if not self.stationary:
            verdict = "not stationary"
        elif self.locally_shortest:
            verdict = "locally minimizing"
            verdict += " energy and cost" if self.has_running_cost else ""
            verdict += " under its constraints" if self.has_active_constraints else ""
        else:
            what = "energy and cost" if self.has_running_cost else "length"
            verdict = (
                f"stationary, not locally minimizing: Morse index {self.morse_index} of {what}"
            )
            if self.first_conjugate_point:
                verdict += f", first conjugate point at s = {self.first_conjugate_point:.4g}"
        if self.has_active_constraints:
            return f"{verdict}; not a geodesic, constraints are active"
        if self.has_running_cost:
            return f"{verdict}; not a geodesic, there is a running cost"
        return f"{verdict}; endpoint error {self.endpoint_error:.1e}, energy drift {self.drift:.1e}"

    def __repr__(self) -> str:
        return f"Certificate({self})"


def certify(path: Path, velocity: ArrayLike | None = None) -> Certificate:
    """The certificate of a path between fixed ends as a geodesic of its metric.

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
    stationary, index = stationarity_and_index(*energy_derivatives(path))
    stationary = stationary and drift <= _DRIFT
    return Certificate(
        endpoint_error=_endpoint_error(path, start),
        drift=drift,
        stationary=stationary,
        morse_index=index if stationary else None,
        first_conjugate_point=first_conjugate_point(path) if stationary and index else None,
    )


def certify_iterate(iterate: FinalIterate) -> Certificate:
    """The certificate of a solution among the paths that meet the problem's conditions."""
    path, n = iterate.path, iterate.path.metric.dim
    has_cost = not iterate.energy_only
    momentum = -iterate.gradient()[:n] * iterate.units.scale / iterate.units.length
    drift = _energy_drift(path)
    start = np.full(n, np.nan)
    if np.isfinite(drift):
        start = np.linalg.solve(path.metric.matrix(path.nodes[0]), momentum)
    error = _endpoint_error(path, start)
    if not iterate.success or not np.isfinite(drift):
        return Certificate(error, drift, False, None, has_running_cost=has_cost)

    active_x = iterate.fixed_x | (np.abs(iterate.lam_x) > _ACTIVE)
    jacobian = iterate.constraint_jacobian()
    # Multiplier times gradient is the force of a condition, whatever the condition's unit.
    forces = np.abs(iterate.lam_g) * np.linalg.norm(jacobian, axis=1)
    active_g = iterate.fixed_g | (forces > _ACTIVE)
    free = np.flatnonzero(~active_x)
    inner_are_free = free.size == iterate.x.size - 2 * n and not np.any(active_x[n:-n])
    if inner_are_free and not np.any(active_g) and iterate.energy_only:
        # Also finds stationary points of a coarse discretization that are no geodesics.
        return replace(certify(path), endpoint_error=error)
    reduced = iterate.hessian()[np.ix_(free, free)]
    if np.any(active_g):
        normals = jacobian[np.ix_(np.flatnonzero(active_g), free)]
        normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), _SMALLEST)
        tangent = scipy.linalg.null_space(normals, rcond=_DEPENDENT)
        reduced = tangent.T @ reduced @ tangent
    # Ipopt has ensured the first-order conditions, with all multipliers.
    _, index = stationarity_and_index(np.zeros(len(reduced)), reduced)
    along = active_g[iterate.transcription.size_ends :]
    return Certificate(
        endpoint_error=error,
        drift=drift,
        stationary=True,
        morse_index=index,
        has_active_constraints=bool(np.any(along) or np.any(active_x[n:-n])),
        has_running_cost=has_cost,
    )


def _endpoint_error(path: Path, velocity: Array) -> float:
    """Distance of the geodesic with this initial velocity from the path's end."""
    extent = float(np.ptp(path.nodes, axis=0).max())
    try:
        arrival = exp(path.metric, path.nodes[0], velocity, tolerance=1e-9 * max(1.0, extent))
    except (IntegrationFailed, ValueError):  # it does not get there, or no metric at the start
        return np.inf
    return float(np.abs(arrival - path.nodes[-1]).max())


def _energy_drift(path: Path) -> float:
    """Largest relative deviation of |q'|^2 from its mean, at the points of the quadrature."""
    squares = path.speeds_at_quadrature_points**2
    if not np.all(np.isfinite(squares)):
        return np.inf
    mean = float(np.sum(path.grid.quadrature.weights * squares))
    return float(np.abs(squares / mean - 1.0).max()) if mean > 0.0 else 0.0
