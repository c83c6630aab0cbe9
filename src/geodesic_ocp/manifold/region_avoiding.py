"""Geodesics that stay inside a region by themselves: a metric stretched towards its boundary."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_vector, evaluate
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.manifold.region import Region, middle, of_functions, of_joint_limits
from geodesic_ocp.model.model import Model

# Places at which a region is looked at, to know whether it comes round with a coordinate.
_LOOKED_AT, _EQUAL = 5, 1e-9


@dataclass(frozen=True)
class RegionAvoiding(Metric):
    """G + sum_i w_i (margin_i / h_i)^2 grad h_i grad h_i', where all h_i(q) > 0.

    The metric of the graph of margin_i sqrt(w_i) log h_i over the given manifold, as if motion
    towards a boundary carried an inertia that grows near it. Every curve is at least as long as
    margin_i sqrt(w_i) |log(h_i(q1) / h_i(q0))|: the boundary is infinitely far away, and no
    geodesic leaves, without constraints. With margin -> 0 they tend to the given metric's, where
    these stay inside, and else to paths along the boundary. The term is that of Klein, Jaquier,
    Meixner, Asfour, "On the Design of Region-Avoiding Metrics for Collision-Safe Motion Generation
    on Riemannian Manifolds" (2023).

    w_i = 1 / (grad h_i' G^-1 grad h_i) at `configuration`, the inertia that is felt against h_i there:
    a joint's, or the hand's apparent mass, if h_i is its distance to a table.

    A factor 1 + sum_i (margin_i / h_i)^2 on G would do too, as in the hyperbolic half-plane, but
    gives the space a curvature of -1 / (w_i margin_i^2) near the boundary. Geodesics that run apart
    like exp(length / (margin_i sqrt(w_i))) cannot be found: a light wrist's are lost to rounding.

    Attributes:
        metric: any other metric.
        functions: q (n, 1) -> h(q), a column (m, 1) or a list of scalars in CasADi operations;
            None takes the finite limits of the metric's model, q_j - lower_j and upper_j - q_j.
        margin: value of h_i [its unit] at which motion towards the boundary weighs double; one for
            all, one for each function, or, of joint limits, one for each joint [rad or m].
        configuration: q (n,) where w_i is measured, in the region or not; None is the middle of the
            joints' limits, or the origin of a metric without a model.

    Functions are equal as Python has it: the same object. Where the straight line between two
    points leaves the region, `geodesic` has no start: solve a problem with a guess.

    Raises:
        ValueError: functions do not give scalar expressions in q, or are None and there is no model
            with finite limits; a margin is not positive; or an h_i has no slope at the configuration.
    """

    metric: Metric
    functions: Callable[[ca.SX], Any] | None = None
    margin: float | Sequence[float] = 0.1
    configuration: Sequence[float] | None = None

    def __post_init__(self) -> None:
        as_metric(self.metric)
        if np.ndim(self.margin) == 0:
            margin: Any = float(as_vector("margin", [self.margin], 1)[0])
        else:
            count = self.dim if self.functions is None else len(self._region.labels)
            margin = tuple(as_vector("margin", self.margin, count).tolist())
        if not np.all(np.asarray(margin) > 0.0):
            raise ValueError(f"margin must be positive, got {margin}")
        object.__setattr__(self, "margin", margin)
        if self.configuration is not None:
            configuration = tuple(as_vector("configuration", self.configuration, self.dim).tolist())
            object.__setattr__(self, "configuration", configuration)
        # What is wrong with the functions shows here, where they were given.
        _ = self._barrier

    @property
    def dim(self) -> int:  # type: ignore[override]
        """Dimension of the given metric."""
        return self.metric.dim

    @property
    def joint_names(self) -> tuple[str, ...] | None:  # type: ignore[override]
        """Names of the given metric's coordinates."""
        return self.metric.joint_names

    @cached_property
    def periods(self) -> tuple[float, ...] | None:  # type: ignore[override]
        """Periods of the given metric, of the coordinates in which the region has them, too."""
        if self.metric.periods is None:
            return None
        rng, periods = np.random.default_rng(0), list(self.metric.periods)
        for coordinate in np.flatnonzero(np.isfinite(periods)):
            for q in rng.normal(size=(_LOOKED_AT, self.dim)):
                there = q.copy()
                there[coordinate] += periods[coordinate]
                here, again = (evaluate(self._region.values, point) for point in (q, there))
                if not np.allclose(here, again, rtol=_EQUAL, atol=_EQUAL, equal_nan=True):
                    periods[coordinate] = np.inf
                    break
        return tuple(periods)

    @property
    def model(self) -> Model:
        """Model of the given metric; AttributeError where it has none."""
        return self.metric.model  # type: ignore[attr-defined, no-any-return]

    @cached_property
    def _region(self) -> Region:
        if self.functions is not None:
            return of_functions(self.functions, self.dim)
        model = getattr(self.metric, "model", None)
        if model is None:
            raise ValueError(f"{type(self.metric).__name__} has no model: give functions")
        return of_joint_limits(model)

    @cached_property
    def _lengths(self) -> Array:
        """margin_i sqrt(w_i), (m,): what a factor e of h_i adds to a path's length at least."""
        region = self._region
        if self.configuration is not None:
            q = np.array(self.configuration)
        else:
            model = getattr(self.metric, "model", None)
            q = np.zeros(self.dim) if model is None else middle(model)
        q = self.metric.point("configuration", q)
        slopes, tensor = region.slopes(q).full(), self.metric.matrix(q)
        mobilities = np.sum(slopes.T * np.linalg.solve(tensor, slopes.T), axis=0)
        for label, mobility in zip(region.labels, mobilities, strict=True):
            if not 0.0 < mobility < np.inf:
                raise ValueError(f"configuration: {label} has no slope at {q}: give another")
        margin = np.atleast_1d(self.margin)
        if margin.size > 1 and region.joints:
            margin = margin[list(region.joints)]
        return np.asarray(margin / np.sqrt(mobilities))

    @cached_property
    def _barrier(self) -> ca.Function:
        """What is added to the given metric's tensor, q -> (n, n); not a number outside."""
        q = ca.SX.sym("q", self.dim)
        h = self._region.values(q)
        # A solver that tries a point outside must notice: there h^2 is positive again.
        inside = ca.if_else(h > 0, h, np.nan)
        slopes = ca.diag(ca.DM(self._lengths) / inside) @ self._region.slopes(q)
        return ca.Function("barrier", [q], [ca.densify(slopes.T @ slopes)])

    def matrix(self, q: Any) -> Any:
        """Metric tensor G + sum_i w_i (margin_i / h_i)^2 grad h_i grad h_i', (n, n)."""
        return self.metric.matrix(q) + self._barrier(q)

    def point(self, name: str, q: Any) -> Array:
        """The argument of that name as a point (n,) inside the region.

        Raises:
            ValueError: an h_i is not positive there, or the given metric is no metric.
        """
        point = self.metric.point(name, q)
        values = evaluate(self._region.values, point)[:, 0]
        found = zip(self._region.labels, values, strict=True)
        outside = [f"{label} is {value:.6g}" for label, value in found if not value > 0.0]
        if outside:
            raise ValueError(f"{name}: {point} is not inside the region: {', '.join(outside)}")
        return super().point(name, point)
