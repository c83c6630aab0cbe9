"""Problem: which path is sought, written as a class."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import casadi as ca
import numpy as np
from matplotlib.axes import Axes

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.nlp.nlp import NLP, program
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

if TYPE_CHECKING:
    from geodesic_ocp.ocp.solve.solution import Solution

# (expression, value) or (expression, value, name)
Equality: TypeAlias = tuple[Any, Any] | tuple[Any, Any, str]
# (lower, expression, upper) or (lower, expression, upper, name)
Inequality: TypeAlias = tuple[Any, Any, Any] | tuple[Any, Any, Any, str]


class Problem(ABC):
    """A path of least energy 1/2 int |q'(s)|_G^2 ds, s in [0, 1], under boundary conditions.

    A subclass, usually a frozen dataclass whose fields all have defaults, gives `metric` and
    `boundary`, and where it needs them `constraints`, `via`, `cost`, `guess` and the closed form.
    Expressions are built from CasADi SX symbols; a bare coordinate, such as `q0` or `q[2]`, becomes
    a bound.

    Attributes:
        metric: of the manifold.
        parameters: names of the fields, numbers or arrays of them, that may change from one solve
            to the next without a new NLP: expressions are built with symbols in their place. The
            other fields must be equal, models and metrics the very same object.
        via_parameters: s of each via point; None: where the mean square of the speed is the same before
            and after, which costs least.
        continuous_velocity_at_via: whether the velocity is continuous at via points. The path of least energy has a
            corner there, unless it is a geodesic through the point by chance; a continuous one
            rounds it within the segments of the grid beside it, the closer the finer they are.
    """

    metric: Metric
    parameters: ClassVar[Sequence[str]] = ()
    via_parameters: ClassVar[Sequence[float] | None] = None
    continuous_velocity_at_via: ClassVar[bool] = True

    @abstractmethod
    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        """Equalities (expression, value[, name]) in the path's ends q0 and q1, (n, 1) each.

        A method that takes four arguments, boundary(self, q0, q1, v0, v1), is given v = q'(s) at
        both ends, too. Without such conditions the path arrives with the velocity that costs least;
        with them it takes that of the grid's first or last segment, and the finer the grid is, the
        less it costs: a grid is part of such a problem.
        """

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Inequality]:
        """Bounds (lower, expression, upper[, name]) along the path in q and v = q'(s)."""
        return ()

    def via(self, q: ca.SX) -> Sequence[Sequence[Equality]]:
        """For each via point, in order, equalities (expression, value[, name]) in q there."""
        return ()

    def cost(self, q: ca.SX, v: ca.SX) -> Any:
        """Integrand of what is minimised in addition to the energy; zero by default."""
        return 0.0

    def guess(self, s: Array) -> Array | None:
        """Positions (len(s), n) to start from; None is the straight line between the fixed ends.

        Coordinates that are fixed at one end only stay constant, free ones start at zero.
        """
        return None

    def draw(self, axes: Axes, path: Path, columns: tuple[int, int]) -> None:  # noqa: B027
        """Draw what belongs to a picture of the path besides it, such as obstacles.

        Args:
            axes: where the path in the plane of two coordinates, or the hand's path, is drawn.
            path: that is drawn, which need not be a solution yet.
            columns: which coordinates, or which of the hand's x, y and z, are shown.
        """

    @property
    def grid(self) -> Grid:
        """Grid to solve on unless another is asked for.

        Smooth paths are best served by one polynomial of high degree, paths with constraints by
        segments of low degree.
        """
        q, v = (ca.SX.sym(name, self.metric.dim) for name in "qv")
        smooth = not len(self.constraints(q, v)) and not len(self.via(q))
        return Grid(1, 20) if smooth else Grid(16, 4)

    def nlp(self, grid: Grid | None = None, guess: Path | Solution | None = None) -> NLP:
        """The nonlinear program of this problem on a grid, its own by default.

        Args:
            grid: nodes of the path; via points that are not fixed lie where the guess has them,
                or evenly.
            guess: to start from.
        """
        start = guess if guess is None or isinstance(guess, Path) else guess.path
        return program(self, self.grid if grid is None else grid, start)

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
    """The value; of arrays and lists their contents; of others without a hash their identity."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return ("array", value.shape, value.dtype.str, value.tobytes())
    if isinstance(value, (list, tuple)):
        return (type(value).__name__, *map(key_of, value))
    return value if _hashable(value) else _Identity(value)
