"""Problems as classes, their conditions, and the keys by which they share an NLP."""

from __future__ import annotations

import copy
import inspect
import warnings
from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeAlias

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, is_symbolic, real_array, settle
from geodesic_ocp.blocks import Instance
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.ocp.conditions import Condition, Conditions
from geodesic_ocp.ocp.nlp import NLP, ProblemDefinition, build_nlp
from geodesic_ocp.ocp.scales import measured
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def drawn_obstacles(problem: Any) -> tuple[Obstacle, ...]:
    """Return the obstacles of a problem, which are drawn.

    A class may have an attribute `obstacles` that holds something else: then a warning says that
    nothing is drawn, and there are none.
    """
    given = problem.obstacles
    listed = isinstance(given, list | tuple)
    if listed and all(isinstance(each, Obstacle) for each in given):
        return tuple(given)
    warnings.warn(
        f"{type(problem).__name__}.obstacles are not drawn: they must be a list of go.Ball, "
        f"go.Capsule, go.Box and go.HalfSpace, got {given!r}; an attribute that means something "
        "else needs another name",
        stacklevel=2,
    )
    return ()


@dataclass(frozen=True, eq=False)
class _Identity:
    """Key of a value without a hash: equal only for the identical object."""

    value: object

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Identity) and other.value is self.value

    def __hash__(self) -> int:
        return id(self.value)


def key_of(value: object) -> Hashable:
    """Return the value itself, the contents of arrays and lists, or the identity of unhashable
    objects.
    """
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return ("array", value.shape, value.dtype.str, value.tobytes())
    if isinstance(value, (list, tuple)):
        return (type(value).__name__, *map(key_of, value))
    try:
        hash(value)
    except TypeError:
        return _Identity(value)
    return value


def parse_conditions(problem: Any) -> Conditions:
    """Return the conditions of a `Problem`; each of its methods is called once.

    The parameter has no type, as `Problem` is built on this function.

    Raises:
        ValueError: an entry is malformed, two have the same name, or a parameter is not numeric.
    """
    n = problem.metric.dim
    q0, q1, v0, v1, q, v = (ca.SX.sym(name, n) for name in ("q0", "q1", "v0", "v1", "q", "v"))
    symbolic, parameters = _with_symbols(problem)
    has_velocities = len(inspect.signature(problem.boundary).parameters) == 4
    at_ends = (q0, q1, v0, v1) if has_velocities else (q0, q1)
    equality = parameters.equality
    inequality = parameters.inequality

    entries = listed("boundary", symbolic.boundary(*at_ends))
    numbers = numbered(q0, q1)
    boundary = [equality(*entry, numbers) for entry in entries]
    entries = listed("constraints", symbolic.constraints(q, v))
    numbers = numbered(q, v)
    along = [inequality(*entry, numbers) for entry in entries]
    via = []
    for label, at_one in listed("via", symbolic.via(q)):
        if not isinstance(at_one, Sequence) or not len(at_one):
            raise ValueError(f"{label} must be a list of equalities, got {at_one!r}")
        via.append(tuple(equality(*entry, {}) for entry in listed(label, at_one)))
    jumps = [(v1 - v0, 0.0, f"velocity at via[{number}]") for number in range(len(via))]
    jumps = jumps if problem.continuous_velocity_at_via else []
    continuity = [equality("", jump, {}) for jump in jumps]
    for conditions, symbols in ((boundary, at_ends), (along, (q, v)), (sum(via, ()), (q,))):
        for condition in conditions:
            if condition.instance is None and condition.coordinates is None:
                check_symbols(condition.name, condition.expression, symbols, parameters.symbols)
    names = [c.name for c in (*boundary, *along, *continuity, *(c for each in via for c in each))]
    if len(set(names)) < len(names):
        raise ValueError(f"conditions must have different names, got {', '.join(names)}")

    cost = _expression("cost", symbolic.cost(q, v))
    if cost.shape != (1, 1):
        raise ValueError(f"cost(q, v) must be a scalar, got shape {cost.shape}")
    check_symbols("cost", cost, (q, v), parameters.symbols)
    bounds = [c for c in along if c.coordinates is not None and max(c.coordinates, default=0) < n]
    functions = [c for c in along if c not in bounds]
    along_qv = [c for c in functions if c.instance is None and ca.depends_on(c.expression, v)]
    return Conditions(
        q0,
        q1,
        v0,
        v1,
        q,
        v,
        parameters.symbols,
        parameters.values,
        cost,
        fixed=tuple(c for c in boundary if c.coordinates is not None),
        ends=tuple(c for c in boundary if c.coordinates is None),
        bounds=tuple(bounds),
        along_q=tuple(c for c in functions if c not in along_qv),
        along_qv=tuple(along_qv),
        via=tuple(via),
        via_continuity=tuple(continuity),
    )


def check_symbols(
    name: str, expression: ca.SX, symbols: Sequence[ca.SX], parameters: ca.SX | None = None
) -> None:
    """Raise ValueError if an expression contains others than the given symbols."""
    used = ca.symvar(expression)
    if not used:
        return
    given = [*symbols, ca.SX(0, 1) if parameters is None else parameters]
    allowed = {each for one in given for each in _hashes(one)}
    foreign = [str(each) for each in used if each.element_hash() not in allowed]
    if foreign:
        known = dict.fromkeys(str(each[0]).rpartition("_")[0] or str(each) for each in symbols)
        raise ValueError(
            f"{name} contains {', '.join(foreign)}, which is not one of its arguments "
            f"({', '.join(known)})"
        )


@dataclass(frozen=True, eq=False)
class _Parameters:
    """Symbols (k, 1) of a problem's parameters and their values (k,)."""

    symbols: ca.SX
    values: Array

    def equality(self, label: str, entry: Sequence[Any], known: _Numbers) -> Condition:
        """Return the condition of an entry (expression, value[, name])."""
        expression, value, name = _parts(entry, label, "expression, value")
        return self._condition(name, value, expression, value, known)

    def inequality(self, label: str, entry: Sequence[Any], known: _Numbers) -> Condition:
        """Return the condition of an entry (lower, expression, upper[, name])."""
        lower, expression, upper, name = _parts(entry, label, "lower, expression, upper")
        return self._condition(name, lower, expression, upper, known)

    def _condition(
        self, name: str, lower: Any, expression: Any, upper: Any, known: _Numbers
    ) -> Condition:
        column = ca.densify(ca.vec(_expression(name, expression)))
        size = column.shape[0]
        limits = []
        for limit in (lower, upper):
            # CasADi fills matrices by columns, as ca.vec does above.
            values = self._numbers(name, limit).ravel(order="F")
            if values.size not in (1, size) or np.any(np.isnan(values)):
                raise ValueError(
                    f"{name}: a bound must be one number or {size}, not NaN, got {limit!r}"
                )
            limits.append(np.broadcast_to(values, (size,)).copy())
        if np.any(limits[0] > limits[1]):
            raise ValueError(f"{name}: a lower bound lies above its upper bound")
        if isinstance(expression, Instance):
            variables = _bare_symbols(expression.variables, known)
            if variables == tuple(range(expression.variables.numel())):
                return Condition(name, column, limits[0], limits[1], None, expression)
        return Condition(name, column, limits[0], limits[1], _bare_symbols(column, known))

    def _numbers(self, name: str, limit: Any) -> Array:
        """Return a bound as numbers, with the parameters at their values."""
        if not _has_symbols(limit):
            try:
                return real_array(limit)
            except (TypeError, ValueError):
                raise ValueError(f"{name}: a bound must be numbers, got {limit!r}") from None
        try:
            is_list = isinstance(limit, (list, tuple, np.ndarray))
            expression = ca.densify(ca.SX(ca.vertcat(*limit) if is_list else limit))
            function = ca.Function("bound", [self.symbols], [expression])
        except (NotImplementedError, TypeError, RuntimeError):
            raise ValueError(
                f"{name}: a bound must be numbers or an expression in the parameters alone, got "
                f"{limit!r}"
            ) from None
        return np.asarray(function(self.values).full())


def _has_symbols(limit: Any) -> bool:
    if isinstance(limit, (list, tuple)):
        return any(map(_has_symbols, limit))
    if isinstance(limit, np.ndarray):
        return bool(limit.dtype == object)
    return is_symbolic(limit)


def _with_symbols(problem: Any) -> tuple[Any, _Parameters]:
    """Return the problem with symbols in place of its parameters, and these symbols."""
    if not problem.parameters:
        return problem, NUMBERS
    symbolic = copy.copy(problem)
    symbols = []
    numbers = []
    for name in problem.parameters:
        try:
            value = real_array(getattr(problem, name))
        except (AttributeError, TypeError, ValueError):
            value = np.array(np.nan)
        if value.ndim > 2 or not np.all(np.isfinite(value)):
            raise ValueError(f"parameter {name!r} must be a field with finite numbers")
        shape = value.shape if value.ndim == 2 else (value.size, 1)
        symbol = ca.SX.sym(name, *shape)
        settle(symbolic, **{name: symbol})
        symbols.append(ca.vec(symbol))
        numbers.append(value.ravel(order="F"))
    return symbolic, _Parameters(ca.vertcat(*symbols), np.concatenate(numbers))


def listed(what: str, entries: Any) -> list[tuple[str, Any]]:
    """Return entries with labels such as "boundary[0]"."""
    if not isinstance(entries, (list, tuple)):
        raise ValueError(f"{what} must give a list of conditions, got {entries!r}")
    return [(f"{what}[{index}]", entry) for index, entry in enumerate(entries)]


def _parts(entry: Sequence[Any], label: str, form: str) -> list[Any]:
    """Return the entry's parts; its label stands in for a name that is not given."""
    count = form.count(",") + 1
    if not isinstance(entry, (tuple, list)) or len(entry) not in (count, count + 1):
        raise ValueError(f"{label} must be ({form}[, name]), got {entry!r}")
    return [*entry[:count], str(entry[count]) if len(entry) > count else label]


def _expression(name: str, expression: Any) -> ca.SX:
    try:
        return expression if type(expression) is ca.SX else ca.SX(expression)
    except (NotImplementedError, TypeError, RuntimeError):
        raise ValueError(f"{name}: {expression!r} is not an expression in SX symbols") from None


def numbered(*symbols: ca.SX) -> _Numbers:
    """Return the position of each of these symbols, by its hash."""
    every = (each for one in symbols for each in _hashes(one))
    return {each: number for number, each in enumerate(every)}


def _bare_symbols(column: ca.SX, known: _Numbers) -> tuple[int, ...] | None:
    """Return numbers (m,) of the symbols that the rows are, or None if a row is anything else."""
    if not column.is_valid_input():  # a row is no symbol
        return None
    index = [known.get(entry, -1) for entry in _hashes(column)]
    return None if -1 in index else tuple(index)


def _hashes(symbols: ca.SX) -> list[int]:
    elements: Any = symbols.elements()  # four times as quick as its nz
    return [each.element_hash() for each in elements]


_Numbers: TypeAlias = Mapping[int, int]
NUMBERS = _Parameters(ca.SX(0, 1), np.zeros(0))  # entries without parameters

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
        metric: metric of the manifold.
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
        """Return equalities (expression, value[, name]) in the path's ends q0 and q1, (n, 1) each.

        A method with four arguments, boundary(self, q0, q1, v0, v1), also receives v = q'(s) at
        both ends. Without conditions on them the velocities at the ends are optimal. A prescribed
        velocity is reached within the first or last segment of the grid, at a cost that vanishes
        as the grid is refined: the grid is part of such a problem.
        """

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Inequality]:
        """Return bounds (lower, expression, upper[, name]) along the path in q and v = q'(s)."""
        return ()

    def via(self, q: ca.SX) -> Sequence[Sequence[Equality]]:
        """Return, for each via point in order, equalities (expression, value[, name]) in q."""
        return ()

    def cost(self, q: ca.SX, v: ca.SX) -> Any:
        """Return running cost, minimized in addition to the energy: an integrand in q and v =
        q'(s).
        """
        return 0.0

    def guess(self, s: Array) -> Array | None:
        """Return initial guess, positions (len(s), n), or several, (k, len(s), n), of which the
        first comes first; None is the straight line between the fixed ends.

        Coordinates that are fixed at one end only stay constant, free ones are zero.
        """
        return None

    def draw(self, axes: Axes, path: Path, columns: tuple[int, int]) -> None:
        """Draw items of the problem into a figure of a path; obstacles are drawn without it.

        Args:
            axes: axes of the path in the plane of two coordinates, or of the hand's path.
            path: the path in the figure, not necessarily a solution.
            columns: indices of the two coordinates, or of the hand's x, y and z, on the axes.
        """
        del axes, path, columns

    @property
    def grid(self) -> Grid:
        """Grid to start from unless another is requested; a subclass may choose its own.

        By default one polynomial of degree 20 for problems with conditions at the ends alone, whose
        paths are smooth, and 16 segments of degree 4 for all others, which `solve` halves at first.
        """
        return _default_grid(parse_conditions(self))

    def definition(self) -> ProblemDefinition:
        """Return everything that the NLP is built from.

        Raises:
            ValueError: the problem is malformed.
        """
        conditions = parse_conditions(self)
        has_own_grid = getattr(type(self), "grid", None) is not Problem.grid
        structure = self.structure
        via_parameters = self.via_parameters
        return ProblemDefinition(
            metric=self.metric,
            conditions=conditions,
            guess=self.guess,
            via_parameters=None if via_parameters is None else tuple(via_parameters),
            key=None if structure is None else (type(self), structure),
            grid=self.grid if has_own_grid else _default_grid(conditions),
        )

    def nlp(self, grid: Grid | None = None, guess: Path | HasPath | None = None) -> NLP:
        """Return the nonlinear program of this problem on a grid, its own by default.

        Args:
            grid: grid of the nodes; via points whose s is free lie where the guess has them, or
                evenly.
            guess: path or solution to start from.
        """
        definition = self.definition()
        start = guess if guess is None or isinstance(guess, Path) else guess.path
        grid = definition.grid if grid is None else grid
        definition = measured(definition, start or definition.initial_path(grid, None))
        return build_nlp(definition, grid, start)

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
        """Return the solution in closed form at s, (len(s), n), or None if it is not known."""
        return None

    @property
    def exact_length(self) -> float | None:
        """The length of the solution in closed form, or None if it is not known."""
        return None


def _default_grid(conditions: Conditions) -> Grid:
    return Grid(1, 20) if conditions.only_ends else Grid(16, 4)
