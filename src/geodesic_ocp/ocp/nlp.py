"""A problem on a grid as a nonlinear program, with the numbers to solve it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, ShortRepr, evaluate
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.conditions import Conditions, NodeBounds
from geodesic_ocp.ocp.transcription import PathTerms, Transcription, Units
from geodesic_ocp.ocp.violations import NEGLIGIBLE, violations_at
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path


@dataclass(frozen=True, repr=False)
class ProblemDefinition(ShortRepr):
    """Everything about a problem that its NLP is built from.

    Definitions with one key are equal: they have the same expressions, and may differ in numbers.

    Attributes:
        metric: metric of the manifold.
        conditions: boundary conditions, constraints and running cost.
        guess: initial guess, s (k,) -> positions (k, n), or several (m, k, n), or None for the
            straight line.
        via_parameters: s of each via point; None if they are free.
        key: equal for problems that share one NLP; None if the NLP is not shared.
        grid: to solve on unless another is requested.
        size: size of the problem in its coordinates, see `scales`.
    """

    metric: Metric = field(compare=False)
    conditions: Conditions = field(compare=False)
    guess: Callable[[Array], Array | None] = field(compare=False)
    via_parameters: tuple[float, ...] | None = field(compare=False)
    key: Hashable
    grid: Grid = field(compare=False)
    size: float = field(default=1.0, compare=False)
    _shown = ("metric", "grid")

    def restricted(self, kept: Mapping[str, NDArray[np.bool_]]) -> ProblemDefinition:
        """Return the definition with only these of the conditions in q along the path, by name.

        Distances are kept in their cells of s alone; the NLP is then not shared.
        """
        conditions = self.conditions
        along_q = tuple(
            each if each.instance is None else replace(each, cells=kept[each.name])
            for each in conditions.along_q
            if each.name in kept
        )
        has_cells = any(each.instance is not None for each in along_q)
        key = None if has_cells or self.key is None else (self.key, frozenset(kept))
        return replace(self, conditions=replace(conditions, along_q=along_q), key=key)

    def initial_path(self, grid: Grid, guess: Path | None) -> Path:
        """Return the initial guess on a grid: the given one, the problem's or a straight line."""
        return Path(self.metric, grid, initial_nodes(self, self.bounds(grid), guess))

    def bounds(self, grid: Grid) -> NodeBounds:
        """Return the bounds on a grid; ValueError if a fixed end lies outside."""
        return NodeBounds.on_grid(self.conditions, grid, self.metric.joint_names)

    def transcription(self, grid: Grid) -> Transcription:
        """Return the NLP on all grids of this shape, built once for all problems with this key."""
        even = replace(grid, ends=None)
        if self.key is None:
            terms = _unshared_terms(self.metric, self.conditions)
            return Transcription(terms, even, grid.nodes)
        return _shared(self, even)


# Differentiating takes longest, and the derivatives are the same on every grid.
_unshared_terms = lru_cache(maxsize=4)(PathTerms.of)


@lru_cache(maxsize=32)
def _shared_terms(definition: ProblemDefinition) -> PathTerms:
    return PathTerms.of(definition.metric, definition.conditions)


@lru_cache(maxsize=32)
def _shared(definition: ProblemDefinition, grid: Grid) -> Transcription:
    return Transcription(_shared_terms(definition), grid, grid.nodes)


@dataclass(frozen=True, eq=False, repr=False)
class NLP(ShortRepr):
    """A nonlinear program whose variables x are the scaled positions at the grid's nodes.

    Attributes:
        definition: definition of the problem.
        transcription: functions of x and p: energy and cost with their derivatives, constraints.
        grid: grid of the nodes.
        bounds: on the positions and the constraint functions, which are in units of their scales.
        units: units of x and of the energy.
        nodes: positions (size, n) of the initial guess.
    """

    definition: ProblemDefinition
    transcription: Transcription
    grid: Grid
    bounds: NodeBounds
    units: Units
    nodes: Array
    _shown = ("grid", "transcription")

    @property
    def conditions(self) -> Conditions:
        """Conditions of the problem."""
        return self.definition.conditions

    @property
    def p(self) -> Array:
        """Parameters of the NLP."""
        values = self.conditions.p_values
        return self.transcription.parameters(self.units, self.grid, values, self.bounds.scales_g)

    @property
    def values(self) -> dict[str, Array]:
        """Numerical arguments for a CasADi solver: x0, p, lbx, ubx, lbg, ubg."""
        units = self.units
        bounds = self.bounds
        return {
            "x0": units.scaled(self.nodes).ravel(),
            "p": self.p,
            "lbx": units.scaled(bounds.lower).ravel(),
            "ubx": units.scaled(bounds.upper).ravel(),
            "lbg": bounds.lower_g,
            "ubg": bounds.upper_g,
        }

    @property
    def expressions(self) -> dict[str, ca.MX]:
        """CasADi's x, p, f and g, as `nlpsol` takes them.

        The exact derivatives of `transcription` are not part of them; pass these as nlpsol's
        options to save it from deriving its own.
        """
        x = ca.MX.sym("x", self.transcription.dim * self.grid.size)
        p = ca.MX.sym("p", self.transcription.size_p)
        f, g = self.transcription.differentiable(x, p)
        return {"x": x, "p": p, "f": f, "g": g}

    @property
    def violation(self) -> float:
        """Largest violation of any condition, in its scale, at the nodes of the initial guess."""
        _, g = evaluate(self.transcription.value, self.units.scaled(self.nodes).ravel(), self.p)
        return self.bounds.worst(self.nodes, g[:, 0])[0]

    def with_linear(self, matrix: scipy.sparse.sparray, most: Array) -> NLP:
        """Return the program with linear conditions, A (x - x0) <= most (rows,), from the guess x0.

        Args:
            matrix: A, (rows, size * n).
            most: in the unit of A x.
        """
        upper = most + matrix @ self.values["x0"]
        transcription = replace(self.transcription, linear=matrix)
        return replace(self, transcription=transcription, bounds=self.bounds.with_rows(upper))

    def not_finite(self) -> list[str]:
        """Get names of the expressions that are not finite or not differentiable on the guess."""
        c = self.conditions
        grid = self.grid
        metric = self.definition.metric
        path = Path(metric, grid, self.nodes)
        points = grid.in_segments(grid.nodes) @ grid.quadrature.values.T
        s = np.sort(np.concatenate([grid.nodes, points.ravel()]))
        q = path(s).T
        v = path(s, 1).T
        expressions = {"the metric": metric.inner(c.q, c.v, c.v), "the cost": c.cost}
        expressions |= {repr(each.name): each.expression for each in (*c.along_q, *c.along_qv)}
        names = []
        for name, expression in expressions.items():
            outputs = [expression, ca.jacobian(expression, ca.vertcat(c.q, c.v))]
            function = ca.Function("expression", [c.q, c.v, c.p], outputs).map(s.size)
            repeated = np.tile(c.p_values[:, None], s.size)
            finite = [np.isfinite(values) for values in evaluate(function, q, v, repeated)]
            by_node = [each.all(axis=0).reshape(s.size, -1).all(axis=1) for each in finite]
            bad = ~np.all(by_node, axis=0)
            if np.any(bad):
                names.append(f"{name} at s = {s[int(np.argmax(bad))]:.2f}")
        return names

    def path(self, x: Array) -> Path:
        """Return the path of a value of the variables (size * n,)."""
        nodes = np.nan_to_num(np.asarray(x, dtype=float)).reshape(self.grid.size, -1)
        positions = self.units.positions(nodes)
        # Fixed coordinates keep their exact value instead of a rounded, scaled one.
        fixed = self.bounds.lower == self.bounds.upper
        nodes = np.where(fixed, self.bounds.lower, positions)
        return Path(self.definition.metric, self.grid, nodes)


def build_nlp(definition: ProblemDefinition, grid: Grid, guess: Path | None = None) -> NLP:
    """Return the nonlinear program of a problem on a grid.

    Args:
        definition: definition of the problem.
        grid: grid of the nodes.
        guess: initial guess; by default the problem's own, or the straight line.

    Raises:
        ValueError: the fixed ends violate the problem's own conditions, or the guess is malformed.
    """
    conditions = definition.conditions
    metric = definition.metric
    grid = _with_via_points(definition, grid, guess)
    bounds = definition.bounds(grid)
    _check_fixed_ends(conditions, metric, bounds)
    transcription = definition.transcription(grid)
    nodes = initial_nodes(definition, bounds, guess)
    units = _units(definition, transcription, grid, nodes)
    return NLP(definition, transcription, grid, bounds, units, nodes)


def _check_fixed_ends(conditions: Conditions, metric: Metric, bounds: NodeBounds) -> None:
    """Raise ValueError if an end whose coordinates are all fixed violates a path constraint."""
    for s, (word, end) in enumerate(zip(("start", "end"), bounds.ends, strict=True)):
        if not np.any(np.isnan(end)):
            found = violations_at(conditions, metric, end, float(s))
            if violated := [str(each) for each in found if each.relative > NEGLIGIBLE]:
                raise ValueError(f"the given {word} violates a constraint: {'; '.join(violated)}")


def _with_via_points(definition: ProblemDefinition, grid: Grid, guess: Path | None) -> Grid:
    """Get the grid with the problem's via points: at their s, as in the guess, or evenly spaced."""
    count = len(definition.conditions.via)
    if not count:
        if grid.via_segments:
            raise ValueError(f"the grid has {len(grid.via_segments)} via points, the problem none")
        return grid
    if definition.via_parameters is not None:
        via_s = list(definition.via_parameters)
        if len(via_s) != count:
            raise ValueError(f"via_parameters must be s for {count} via points, got {via_s}")
        return grid if list(grid.via_s) == via_s else grid.with_via_points(via_s)
    if len(grid.via_segments) == count:
        return grid
    if guess is not None and len(guess.grid.via_segments) == count:
        return grid.with_via_points(guess.grid.via_s.tolist())
    return grid.with_via_points([(number + 1) / (count + 1) for number in range(count)])


def initial_nodes(
    definition: ProblemDefinition, bounds: NodeBounds, guess: Path | None = None
) -> Array:
    """Get positions (size, n) of the initial guess, with the fixed coordinates at their values."""
    grid = bounds.grid
    given = guess(grid.nodes) if guess is not None else definition.guess(grid.nodes)
    if given is None:
        start, end = bounds.ends
        start, end = np.where(np.isnan(start), end, start), np.where(np.isnan(end), start, end)
        # Exactly constant if both ends are equal: rounding would look like motion.
        given = np.nan_to_num(start + grid.nodes[:, None] * (end - start))
    nodes = np.array(given, dtype=float)
    shape = (grid.size, definition.metric.dim)
    are_several = int(nodes.ndim == 3 and len(nodes) > 0)
    if nodes.shape[are_several:] != shape or not np.all(np.isfinite(nodes)):
        raise ValueError(
            f"guess(s) must give finite positions of shape {shape} for s of shape ({grid.size},), "
            f"got shape {nodes.shape}"
        )
    return np.asarray(np.clip(nodes[0] if are_several else nodes, bounds.lower, bounds.upper))


def _units(
    definition: ProblemDefinition, transcription: Transcription, grid: Grid, nodes: Array
) -> Units:
    """Return extent and energy of the guess, or those of a motion by the problem's size if it does
    not move.
    """
    metric = definition.metric
    extent = float(np.ptp(nodes, axis=0).max())
    inertia = float(np.trace(metric.matrix(nodes[0]))) / metric.dim
    energy = abs(transcription.energy(grid, nodes, definition.conditions.p_values))
    if not np.isfinite(energy) or not np.isfinite(inertia) or inertia <= 0.0:
        raise ValueError("the metric is not finite and positive along the guess")
    if extent <= 0.0 or energy <= 0.0:
        return Units(nodes[0], definition.size, definition.size**2 * inertia)
    return Units(nodes[0], extent, energy)
