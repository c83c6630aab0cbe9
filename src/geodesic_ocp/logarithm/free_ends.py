"""Splines whose inner times, or whose end with a pose of the hand, are optimal.

Of the least action as a function of these, the derivatives are exact (Hamilton, Jacobi): by the end
the momentum p, by a knot's time the jump of the Hamiltonian there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.optimize

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.logarithm.hand_target import HandTarget
from geodesic_ocp.logarithm.riemannian_spline import BOUNDARY, Mask, RiemannianSpline
from geodesic_ocp.logarithm.spline_search import least_action
from geodesic_ocp.manifold.metric import Metric

_SHORTEST = 0.1  # interval between free times, of the mean one
_ROUNDING = 1e-6
_ITERATIONS = 200
_DECREASE = 1e-15
_TOO_FAR = 1e6  # action where no spline was found, relative to that of the guess


@dataclass(frozen=True, eq=False)
class FreeSpline:
    """A spline of which inner times, or the end, are optimal, in about the mean interval as unit.

    Attributes:
        metric: metric of the manifold.
        times: of the knots (k,), the first guess where they are free.
        knots: positions and velocities (k, 2 n), the first guess of a free end.
        is_free: True for the components that are optimal (k, 2 n), the end's position excepted.
        tension: zero for Riemannian cubics.
        bounds: of the inner times, (2, k - 2); None: they are given.
        hand: pose of the hand at the end; None: the end is given.
    """

    metric: Metric
    times: Array
    knots: Array
    is_free: Mask
    tension: float
    bounds: Array | None
    hand: HandTarget | None

    @property
    def free_times(self) -> int:
        """Number of times that are optimal."""
        return 0 if self.bounds is None else len(self.times) - 2

    @property
    def _shortest(self) -> float:
        """Least interval between free times, in the unit of time."""
        return min(_SHORTEST, float(np.diff(self.times).min()) / 2.0)

    def at(self, z: Array) -> RiemannianSpline:
        """Return the spline with these inner times and this end."""
        times = self.times.copy()
        knots = self.knots.copy()
        if self.bounds is not None:
            times[1:-1] = z[: self.free_times]
        if self.hand is not None:
            knots[-1, : self.metric.dim] = z[self.free_times :]
        return least_action(self.metric, times, knots, self.is_free, self.tension)

    def solved(self) -> RiemannianSpline:
        """Return the spline of least action, by sequential quadratic programs (SciPy's SLSQP).

        Raises:
            NotConverged: none was found.
        """
        n = self.metric.dim
        free = self.free_times
        last = slice(n if self.hand is not None else 0)
        z = np.concatenate([self.times[1 : 1 + free], self.knots[-1, last]])
        lower, upper = np.full((2, z.size), [[-np.inf], [np.inf]])
        if self.bounds is not None:
            lower[:free], upper[:free] = self.bounds
        unit = self.at(z).action or 1.0

        def action(z: Array) -> tuple[float, Array]:
            try:
                found = self.at(z)
            except NotConverged:  # a step too far: a shorter one follows
                return _TOO_FAR, np.zeros_like(z)
            momentum = found.arrivals[-1, 2 * n :][last]
            slopes = np.concatenate([found.hamiltonian_jumps[:free], momentum])
            return found.action / unit, slopes / unit

        outcome = scipy.optimize.minimize(
            action,
            z,
            jac=True,
            method="SLSQP",
            bounds=scipy.optimize.Bounds(lower, upper),
            constraints=list(self._constraints(z.size)),
            options={"ftol": _DECREASE, "maxiter": _ITERATIONS},
        )
        found = self.at(outcome.x)
        is_free = found.is_free.copy()
        is_free[-1, :n] |= self.hand is not None
        found = replace(found, is_free=is_free, hand=self.hand, time_bounds=self.bounds)
        residual = found.boundary_residual if self.hand is not None else 0.0
        if residual > BOUNDARY or sum(map(len, found.optimal_times)) < free:
            if np.diff(found.times).min() <= self._shortest * (1.0 + _ROUNDING):
                raise NotConverged(
                    "no optimal times were found: knots come as close as a tenth of the mean "
                    "interval; leave one of them out, or bound the times further apart"
                )
            raise NotConverged(
                "no optimal times or end were found: "
                f"{outcome.message}, after {outcome.nit} iterations; the residual of the natural "
                f"boundary conditions is {residual:.1e}, the shortest interval "
                f"{np.diff(found.times).min():.1e} of the mean one"
            )
        return found

    def _constraints(self, size: int) -> Iterator[dict[str, Any]]:
        """Yield the constraints: the times increase, and the hand has its pose."""
        free = self.free_times
        if free:
            differences = np.diff(np.eye(free + 2), axis=0)
            first, last = self.times[[0, -1]]
            offset = last * differences[:, -1] + first * differences[:, 0] - self._shortest
            inner = np.hstack([differences[:, 1:-1], np.zeros((free + 1, size - free))])
            yield {"type": "ineq", "fun": lambda z: inner @ z + offset, "jac": lambda _: inner}
        if (hand := self.hand) is not None:
            yield {
                "type": "eq",
                "fun": lambda z: hand.error(z[free:]),
                "jac": lambda z: np.hstack([np.zeros((hand.size, free)), hand.jacobian(z[free:])]),
            }
