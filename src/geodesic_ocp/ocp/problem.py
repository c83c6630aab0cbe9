"""Problems: which path is sought, written as a class; and the ones that come with the package."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_vector
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.grid import Grid

# (expression, value) or (expression, value, name)
Equality: TypeAlias = tuple[Any, Any] | tuple[Any, Any, str]
# (lower, expression, upper) or (lower, expression, upper, name)
Inequality: TypeAlias = tuple[Any, Any, Any] | tuple[Any, Any, Any, str]


class Problem(ABC):
    """A path of least energy 1/2 int |q'(s)|_G^2 ds, s in [0, 1], under boundary conditions.

    A subclass, usually a frozen dataclass whose fields all have defaults, gives `metric` and
    `boundary`, and where it needs them `constraints`, `cost`, `guess` and the closed form.
    Expressions are built from CasADi SX symbols; a bare coordinate, such as `q0` or `q[2]`, becomes
    a bound.

    Attributes:
        metric: of the manifold.
        parameters: names of the fields, numbers or arrays of them, that may change from one solve
            to the next without a new NLP: expressions are built with symbols in their place.
    """

    metric: Metric
    parameters: ClassVar[Sequence[str]] = ()

    @abstractmethod
    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        """Equalities (expression, value[, name]) in the path's ends q0 and q1, (n, 1) each.

        A method that takes four arguments, boundary(self, q0, q1, v0, v1), is given v = q'(s) at
        both ends, too.
        """

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Inequality]:
        """Bounds (lower, expression, upper[, name]) along the path in q and v = q'(s)."""
        return ()

    def cost(self, q: ca.SX, v: ca.SX) -> Any:
        """Integrand of what is minimised in addition to the energy; zero by default."""
        return 0.0

    def guess(self, s: Array) -> Array | None:
        """Positions (len(s), n) to start from; None is the straight line between the fixed ends.

        Coordinates that are fixed at one end only stay constant, free ones start at zero.
        """
        return None

    @property
    def grid(self) -> Grid:
        """Grid to solve on unless another is asked for.

        Smooth paths are best served by one polynomial of high degree, paths with constraints by
        segments of low degree.
        """
        symbols = (ca.SX.sym(name, self.metric.dim) for name in "qv")
        return Grid(16, 4) if len(self.constraints(*symbols)) else Grid(1, 20)

    @property
    def structure(self) -> Hashable | None:
        """Problems of one class and equal structure differ in values and bounds alone.

        They share one NLP, built once. None: the NLP is built anew for every solve. Problems with
        `parameters` that are dataclasses have the metric and all other fields for structure.
        """
        fields = getattr(self, "__dataclass_fields__", None)
        if not self.parameters or fields is None:
            return None
        others = [getattr(self, name) for name in fields if name not in self.parameters]
        # A metric may depend on a parameter, which then changes the NLP after all.
        return tuple(key_of(value) for value in (self.metric, *others))

    def exact(self, s: Array) -> Array | None:
        """The solution in closed form at s, (len(s), n), where it is known."""
        return None

    @property
    def exact_length(self) -> float | None:
        """The solution's length in closed form, where it is known."""
        return None


def as_speed(speed: Any, dim: int) -> tuple[float, ...] | None:
    """The largest speeds (n,) of one number or n of them; ValueError if they are not positive."""
    if speed is None:
        return None
    speeds = as_vector("speed", np.broadcast_to(speed, dim) if np.ndim(speed) == 0 else speed, dim)
    if not np.all(speeds > 0.0):
        raise ValueError(f"speed must be positive, got {speed!r}")
    return tuple(speeds.tolist())


def along(model: Model | None, speed: Any, q: ca.SX, v: ca.SX) -> list[Inequality]:
    """Joint limits of a model and bounds of |q'(s)|, each where there are any."""
    conditions: list[Inequality] = []
    if model is not None:
        conditions.append((model.lower, q, model.upper, "joint limits"))
    if speed is not None:
        conditions.append((-np.array(speed), v, np.array(speed), "speed"))
    return conditions


def _hashable(value: object) -> bool:
    try:
        hash(value)
    except TypeError:
        return False
    return True


@dataclass(frozen=True, eq=False)
class _Identity:
    """A key for a value that has no hash: equal if it is the very same object."""

    value: object

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Identity) and other.value is self.value

    def __hash__(self) -> int:
        return id(self.value)


def key_of(value: object) -> Hashable:
    """The value, or its identity where it has no hash."""
    return value if _hashable(value) else _Identity(value)


@dataclass(frozen=True)
class PointToPoint(Problem):
    """The geodesic between two configurations.

    Attributes:
        metric: of the manifold.
        q0, q1: start and goal (n,) [rad or m].
        limits: whether the joints stay within the limits of the metric's model.
        speed: largest |dq_j / ds|, for all coordinates or (n,); None: any.

    Raises:
        ValueError: wrong shapes or numbers that are not finite, or the metric is singular there;
            limits of a metric without a model.
    """

    metric: Metric
    q0: tuple[float, ...]
    q1: tuple[float, ...]
    limits: bool = False
    speed: float | tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        metric = as_metric(self.metric)
        for name in ("q0", "q1"):
            vector = metric.point(name, getattr(self, name))
            object.__setattr__(self, name, tuple(vector.tolist()))
        if self.limits and getattr(metric, "model", None) is None:
            raise ValueError(f"limits: {type(metric).__name__} has no model with limits")
        object.__setattr__(self, "speed", as_speed(self.speed, metric.dim))

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        """Both ends."""
        return [(q0, self.q0, "start"), (q1, self.q1, "goal")]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Inequality]:
        """Joint limits and speed, where they are asked for."""
        model = getattr(self.metric, "model", None) if self.limits else None
        return along(model, self.speed, q, v)

    @property
    def structure(self) -> Hashable:
        """The metric, or its identity where it has no hash, and what constraints there are."""
        key = key_of(self.metric)
        plain = not self.limits and self.speed is None
        return key if plain else (key, self.limits, self.speed is None)
