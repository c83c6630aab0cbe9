"""A metric that grows towards the boundary of a region, so that geodesics stay inside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_vector, evaluate, settle
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.model.model import Model

# The margin of the relaxed metric, relative.
_RELAXED = 10.0
# Number of samples and tolerance for deciding whether a region is periodic in a coordinate.
_NUM_SAMPLES = 5
_EQUAL = 1e-9


@dataclass(frozen=True, eq=False)
class Region:
    """The set of q (n,) with all h_i(q) > 0."""

    values: ca.Function  # q -> h (m, 1)
    gradients: ca.Function  # q -> dh / dq (m, n)
    labels: tuple[str, ...]  # description of each h_i, for messages
    # index of the joint that h_i limits; empty for functions of a user
    joints: tuple[int, ...] = ()


def joint_limit_region(model: Model) -> Region:
    """Return the region within the finite joint limits of a model: q_j - lower_j and upper_j - q_j.

    The limits of continuous joints are ignored if they are at least one revolution apart.

    Raises:
        ValueError: the model has no finite limit.
    """
    q = ca.SX.sym("q", model.dof)
    rows = []
    labels = []
    joints = []
    continuous = np.array([name in model.continuous for name in model.joint_names])
    unlimited = continuous & (model.upper - model.lower >= 2.0 * np.pi)
    for side, limits, sign in (("lower", model.lower, 1.0), ("upper", model.upper, -1.0)):
        for joint in np.flatnonzero(np.isfinite(limits) & ~unlimited).tolist():
            rows.append(sign * (q[joint] - limits[joint]))
            name = model.joint_names[joint]
            labels.append(f"the distance of {name} to its {side} limit {limits[joint]:.6g}")
            joints.append(joint)
    if not rows:
        raise ValueError(f"no joint of {model.name!r} has a finite limit: give functions")
    return _region(ca.SX(ca.vertcat(*rows)), q, labels, joints)


def region_of_functions(functions: Callable[[ca.SX], Any], dim: int) -> Region:
    """Return the region where all of a user's functions, q (n, 1) -> column or list, are positive.

    Raises:
        ValueError: a function is not a CasADi scalar, or does not depend on q alone.
    """
    if not callable(functions):
        raise ValueError(f"functions must be callable with q, got {functions!r}")
    q = ca.SX.sym("q", dim)
    given = functions(q)
    if isinstance(given, ca.SX) and given.shape[1] == 1 and given.shape[0] > 0:
        given = ca.vertsplit(given)
    if not isinstance(given, (list, tuple)) or not given:
        raise ValueError(f"functions(q) must be a column or a list of scalars, is {given!r}")
    for index, row in enumerate(given):
        if not isinstance(row, ca.SX) or row.shape != (1, 1):
            raise ValueError(f"functions[{index}] must be a CasADi scalar, is {row!r}")
        if not ca.depends_on(row, q):
            raise ValueError(f"functions[{index}] does not depend on q, is {row}")
        if ca.symvar(ca.substitute(row, q, ca.DM.zeros(dim))):
            raise ValueError(f"functions[{index}] depends on other symbols than q, is {row}")
    labels = [f"functions[{index}]" for index in range(len(given))]
    return _region(ca.SX(ca.vertcat(*given)), q, labels, [])


def _region(h: ca.SX, q: ca.SX, labels: list[str], joints: list[int]) -> Region:
    gradients = ca.Function("dh", [q], [ca.densify(ca.jacobian(h, q))], ["q"], ["dh"])
    values = ca.Function("h", [q], [ca.densify(h)], ["q"], ["h"])
    return Region(values, gradients, tuple(labels), tuple(joints))


@dataclass(frozen=True, repr=False)
class RegionAvoiding(Metric):
    """G + sum_i w_i (margin_i / h_i)^2 grad h_i grad h_i', where all h_i(q) > 0.

    This is the metric of the graph of margin_i sqrt(w_i) log h_i over the given manifold: motion
    towards a boundary has an additional inertia that grows near it. Every curve has at least the
    length margin_i sqrt(w_i) |log(h_i(q1) / h_i(q0))|, so the boundary is infinitely distant and no
    geodesic reaches it, without any constraint. For margin -> 0, geodesics converge to those of the
    given metric if these stay inside, otherwise to paths along the boundary. The term is that of
    Klein, Jaquier, Meixner, Asfour, "On the Design of Region-Avoiding Metrics for Collision-Safe
    Motion Generation on Riemannian Manifolds" (2023).

    w_i = 1 / (grad h_i' G^-1 grad h_i) at `configuration` is the effective inertia along h_i there:
    that of a joint, or the apparent mass of the hand if h_i is its distance to a table.

    Scaling G by 1 + sum_i (margin_i / h_i)^2 instead, as in the hyperbolic half-plane, would give a
    curvature of -1 / (w_i margin_i^2) near the boundary. Geodesics that diverge like
    exp(length / (margin_i sqrt(w_i))) cannot be computed, for example for a light wrist.

    >>> plain = go.KineticEnergy(go.human_arm())
    >>> metric = go.manifold.RegionAvoiding(plain, margin=0.1)  # within the joint limits
    >>> q, v = [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1], [0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0]
    >>> wrist = metric.joint_names.index("RWx_joint")  # upper limit 0.349 rad
    >>> float(go.exp(plain, q, v)[wrist].round(2)), float(go.exp(metric, q, v)[wrist].round(2))
    (0.49, 0.34)

    Attributes:
        metric: any other metric.
        functions: q (n, 1) -> h(q), a column (m, 1) or a list of scalars in CasADi operations;
            None: the finite joint limits of the metric's model, q_j - lower_j and upper_j - q_j.
        margin: value of h_i [its unit] at which the inertia along h_i is doubled; one for all, one
            for each function, or, for joint limits, one for each joint [rad or m].
        configuration: q (n,) at which w_i is evaluated, inside the region or not; None: the middle
            of the joint limits, or the origin if the metric has no model.

    Functions compare equal only if they are the same object. If the straight line between two
    points leaves the region, `geodesic` has no initial guess: solve a problem with a guess instead.

    Raises:
        ValueError: functions are not scalar expressions of q, or are None and there is no model
            with finite limits; a margin is not positive; or the gradient of an h_i is zero at the
            configuration.
    """

    metric: Metric
    functions: Callable[[ca.SX], Any] | None = None
    margin: float | Sequence[float] = 0.1
    configuration: Sequence[float] | None = None

    def __post_init__(self) -> None:
        as_metric(self.metric)
        count = self.dim if self.functions is None else len(self._region.labels)
        several = np.ndim(self.margin) > 0
        given = as_vector(
            "margin", self.margin if several else [self.margin], count if several else 1
        )
        if not np.all(given > 0.0):
            raise ValueError(f"margin must be positive, got {self.margin}")
        settle(self, margin=tuple(given.tolist()) if several else float(given[0]))
        if self.configuration is not None:
            configuration = tuple(as_vector("configuration", self.configuration, self.dim).tolist())
            settle(self, configuration=configuration)
        _ = self._barrier  # evaluates the functions, so that their errors are raised here

    def __repr__(self) -> str:
        count = len(self._region.labels)
        inside = f"{count} function{'s' * (count > 1)}" if self.functions else "joint limits"
        smallest = np.min(self.margin)
        largest = np.max(self.margin)
        margin = f"{smallest:g}" + (f" to {largest:g}" if largest > smallest else "")
        return f"RegionAvoiding({self.metric!r}, {inside}, margin={margin})"

    @property
    def dim(self) -> int:  # type: ignore[override]
        """Dimension of the given metric."""
        return self.metric.dim

    @property
    def joint_names(self) -> tuple[str, ...] | None:  # type: ignore[override]
        """Names of the coordinates of the given metric."""
        return self.metric.joint_names

    @cached_property
    def periods(self) -> tuple[float, ...] | None:  # type: ignore[override]
        """Periods of the given metric, in coordinates in which the region is periodic, too."""
        if self.metric.periods is None:
            return None
        rng = np.random.default_rng(0)
        periods = list(self.metric.periods)
        for coordinate in np.flatnonzero(np.isfinite(periods)):
            q = rng.normal(size=(self.dim, _NUM_SAMPLES))
            shifted = q + periods[coordinate] * np.eye(self.dim)[:, [coordinate]]
            first, second = (self._region.values(each).full() for each in (q, shifted))
            if not np.allclose(first, second, rtol=_EQUAL, atol=_EQUAL, equal_nan=True):
                periods[coordinate] = np.inf
        return tuple(periods)

    @cached_property
    def relaxed(self) -> RegionAvoiding:
        """Return the metric with a margin ten times as large, whose geodesics turn less sharply."""
        margin: Any = _RELAXED * np.asarray(self.margin)
        return replace(self, margin=margin)

    @property
    def model(self) -> Model:
        """Model of the given metric; AttributeError if it has none."""
        return self.metric.model  # type: ignore[attr-defined, no-any-return]

    @cached_property
    def _region(self) -> Region:
        if self.functions is not None:
            return region_of_functions(self.functions, self.dim)
        model = getattr(self.metric, "model", None)
        if model is None:
            raise ValueError(f"{type(self.metric).__name__} has no model: give functions")
        return joint_limit_region(model)

    @cached_property
    def _lengths(self) -> Array:
        """margin_i sqrt(w_i), (m,): least length of a path on which h_i changes by a factor e."""
        region = self._region
        model = getattr(self.metric, "model", None)
        q = np.zeros(self.dim)
        if self.configuration is not None:
            q = np.array(self.configuration)
        elif model is not None:  # the middle; of a joint without both limits, the value next to 0
            both = np.isfinite(model.lower) & np.isfinite(model.upper)
            with np.errstate(invalid="ignore"):
                middle = (model.lower + model.upper) / 2.0
            q = np.where(both, middle, np.clip(0.0, model.lower, model.upper))
        q = self.metric.point("configuration", q)
        gradients = region.gradients(q).full()
        tensor = self.metric.matrix(q)
        mobilities = np.sum(gradients.T * np.linalg.solve(tensor, gradients.T), axis=0)
        for label, mobility in zip(region.labels, mobilities, strict=True):
            if not 0.0 < mobility < np.inf:
                raise ValueError(
                    f"configuration: {label} has no gradient at {q}; choose another one"
                )
        margin = np.atleast_1d(self.margin)
        if margin.size > 1 and region.joints:
            margin = margin[list(region.joints)]
        return np.asarray(margin / np.sqrt(mobilities))

    @cached_property
    def _barrier(self) -> ca.Function:
        """The term that is added to the given metric tensor, q -> (n, n); NaN outside."""
        q = ca.SX.sym("q", self.dim)
        h = self._region.values(q)
        # NaN stops a solver outside, where h^2 is positive again.
        inside = ca.if_else(h > 0, h, np.nan)
        scaled = ca.diag(ca.DM(self._lengths) / inside) @ self._region.gradients(q)
        return ca.Function("barrier", [q], [ca.densify(scaled.T @ scaled)])

    def matrix(self, q: Any) -> Any:
        """Return metric tensor G + sum_i w_i (margin_i / h_i)^2 grad h_i grad h_i', (n, n)."""
        return self.metric.matrix(q) + self._barrier(q)

    def check_units(self, name: str, q: Array) -> None:
        """Check the units as the given metric does."""
        self.metric.check_units(name, q)

    def check_domain(self, name: str, q: Array) -> None:
        """Raise ValueError if an h_i is not positive at q (n,)."""
        self.metric.check_domain(name, q)
        values = evaluate(self._region.values, q)[:, 0]
        found = zip(self._region.labels, values, strict=True)
        outside = [f"{label} is {value:.6g}" for label, value in found if not value > 0.0]
        if outside:
            raise ValueError(f"{name}: {q} is not inside the region: {', '.join(outside)}")
