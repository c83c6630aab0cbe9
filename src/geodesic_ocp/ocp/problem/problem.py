"""Problem: which path is sought, written as a class."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeAlias

import casadi as ca

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.obstacles import draw_obstacle
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.ocp.nlp.conditions import Conditions
from geodesic_ocp.ocp.nlp.definition import ProblemDefinition
from geodesic_ocp.ocp.nlp.nlp import NLP, build_nlp
from geodesic_ocp.ocp.problem.drawn_obstacles import drawn_obstacles
from geodesic_ocp.ocp.problem.keys import key_of
from geodesic_ocp.ocp.problem.parse_conditions import parse_conditions
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# (expression, value) or (expression, value, name)
Equality: TypeAlias = tuple[Any, Any] | tuple[Any, Any, str]
# (lower, expression, upper) or (lower, expression, upper, name)
Inequality: TypeAlias = tuple[Any, Any, Any] | tuple[Any, Any, Any, str]


class HasPath(Protocol):
    """Anything with a path, such as a solution."""

    @property
    def path(self) -> Path:
        """The path."""


class Problem(ABC):
    """A path of least energy 1/2 int |q'(s)|_G^2 ds, s in [0, 1], under boundary conditions.

    A subclass, usually a frozen dataclass whose fields all have defaults, defines `metric` and
    `boundary`, and if needed `constraints`, `via`, `cost`, `guess` and the closed form. Expressions
    are built from CasADi SX symbols; a bare coordinate, such as `q0` or `q[2]`, becomes a bound on
    a variable.

    Attributes:
        metric: of the manifold.
        parameters: names of fields (numbers or arrays) that may change from one solve to the next
            without a new NLP: expressions are built with symbols in their place. All other fields
            must be equal, models and metrics identical objects.
        via_parameters: s of each via point; None leaves them free: the optimal ones, at which the
            mean square of the speed is the same before and after.
        continuous_velocity_at_via: whether the velocity is continuous at via points. The path of
            least energy generally has a corner at a via point; a path with continuous velocity
            rounds it within the two adjacent segments of the grid, more tightly the finer the grid.
        obstacles: stationary obstacles, drawn in figures and by `show`, in the base frame of the
            metric's model; without a model, in the space of the coordinates. They are no condition
            by themselves: see `clearance_constraints`.
    """

    metric: Metric
    parameters: ClassVar[Sequence[str]] = ()
    via_parameters: ClassVar[Sequence[float] | None] = None
    continuous_velocity_at_via: ClassVar[bool] = True
    obstacles: Sequence[Obstacle] = ()

    @abstractmethod
    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        """Equalities (expression, value[, name]) in the path's ends q0 and q1, (n, 1) each.

        A method with four arguments, boundary(self, q0, q1, v0, v1), also receives v = q'(s) at
        both ends. Without conditions on them the velocities at the ends are optimal. A prescribed
        velocity is reached within the first or last segment of the grid, at a cost that vanishes
        as the grid is refined: the grid is part of such a problem.
        """

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Inequality]:
        """Bounds (lower, expression, upper[, name]) along the path in q and v = q'(s)."""
        return ()

    def via(self, q: ca.SX) -> Sequence[Sequence[Equality]]:
        """For each via point, in order, a list of equalities (expression, value[, name]) in q."""
        return ()

    def cost(self, q: ca.SX, v: ca.SX) -> Any:
        """Running cost, minimized in addition to the energy: an integrand in q and v = q'(s)."""
        return 0.0

    def guess(self, s: Array) -> Array | None:
        """Initial guess, positions (len(s), n); None is the straight line between the fixed ends.

        Coordinates that are fixed at one end only stay constant, free ones are zero.
        """
        return None

    def draw(self, axes: Axes, path: Path, columns: tuple[int, int]) -> None:
        """Draw additional items into a figure of the path: the outlines of obstacles by default.

        Args:
            axes: of the path in the plane of two coordinates, or of the hand's path.
            path: the path in the figure, not necessarily a solution.
            columns: indices of the two coordinates, or of the hand's x, y and z, on the axes.
        """
        if getattr(path.metric, "model", None) is not None and path.metric.dim <= 2:
            return  # the axes are those of two joints, not of space
        obstacles = drawn_obstacles(self)
        several = len(obstacles) > 1
        for number, obstacle in enumerate(obstacles):
            label = "obstacles" if several else obstacle.name or "obstacle"
            draw_obstacle(axes, obstacle, columns, label if number == 0 else None)

    @property
    def grid(self) -> Grid:
        """Grid to start from unless another is requested; a subclass may choose its own.

        By default one polynomial of degree 20 for problems with conditions at the ends alone, whose
        paths are smooth, and 16 segments of degree 4 for all others.
        """
        return _default_grid(parse_conditions(self))

    def definition(self) -> ProblemDefinition:
        """Everything that the NLP is built from.

        Raises:
            ValueError: the problem is malformed.
        """
        conditions = parse_conditions(self)
        has_own_grid = getattr(type(self), "grid", None) is not Problem.grid
        structure, via_parameters = self.structure, self.via_parameters
        return ProblemDefinition(
            metric=self.metric,
            conditions=conditions,
            guess=self.guess,
            via_parameters=None if via_parameters is None else tuple(via_parameters),
            key=None if structure is None else (type(self), structure),
            grid=self.grid if has_own_grid else _default_grid(conditions),
        )

    def nlp(self, grid: Grid | None = None, guess: Path | HasPath | None = None) -> NLP:
        """The nonlinear program of this problem on a grid, its own by default.

        Args:
            grid: of the nodes; via points whose s is free lie where the guess has them, or evenly.
            guess: path or solution to start from.
        """
        definition = self.definition()
        start = guess if guess is None or isinstance(guess, Path) else guess.path
        return build_nlp(definition, definition.grid if grid is None else grid, start)

    @property
    def structure(self) -> Hashable | None:
        """A key: problems of one class with equal keys differ in values and bounds alone.

        They share one NLP, built once. None: the NLP is built anew for every solve. For a dataclass
        with `parameters` the key consists of the metric and all other fields.
        """
        fields = getattr(self, "__dataclass_fields__", None)
        if not self.parameters or fields is None:
            return None
        others = [getattr(self, name) for name in fields if name not in self.parameters]
        # The metric may depend on a parameter, which then changes the NLP after all.
        return tuple(key_of(value) for value in (self.metric, *others))

    def exact(self, s: Array) -> Array | None:
        """The solution in closed form at s, (len(s), n), or None if it is not known."""
        return None

    @property
    def exact_length(self) -> float | None:
        """The length of the solution in closed form, or None if it is not known."""
        return None


def _default_grid(conditions: Conditions) -> Grid:
    return Grid(1, 20) if conditions.only_ends else Grid(16, 4)
