"""NLP: a problem on a grid as a nonlinear program, with numbers to solve it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.ocp.nlp.bounds import NodeBounds
from geodesic_ocp.ocp.nlp.conditions import Conditions, conditions
from geodesic_ocp.ocp.nlp.structure import Structure, transcribed
from geodesic_ocp.ocp.nlp.transcription import Transcription, Units
from geodesic_ocp.ocp.nlp.violations import NEGLIGIBLE, violations_at
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

if TYPE_CHECKING:
    from geodesic_ocp.ocp.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class NLP:
    """A program whose variables x are the positions at the grid's nodes, one after the other.

    They have units of their own; `path` makes a path of them.

    Attributes:
        problem: of which it is the program.
        terms: its conditions.
        structure: what the expressions depend on.
        transcription: functions of x and p: energy and cost with their derivatives, constraints.
        bounds: of the positions and the constraint functions.
        units: of x and of the energy.
        nodes: positions (size, n) to start from.
    """

    problem: Problem
    terms: Conditions
    structure: Structure
    transcription: Transcription
    bounds: NodeBounds
    units: Units
    nodes: Array

    @property
    def grid(self) -> Grid:
        """Of the nodes."""
        return self.transcription.grid

    @property
    def values(self) -> dict[str, Array]:
        """Numbers for a solver of CasADi's: x0, p, lbx, ubx, lbg, ubg."""
        units, bounds = self.units, self.bounds
        return {
            "x0": units.scaled(self.nodes).ravel(),
            "p": units.with_values(self.terms.values),
            "lbx": units.scaled(bounds.lower).ravel(),
            "ubx": units.scaled(bounds.upper).ravel(),
            "lbg": bounds.lower_g,
            "ubg": bounds.upper_g,
        }

    @property
    def expressions(self) -> dict[str, ca.MX]:
        """CasADi's x, p, f and g, as `nlpsol` takes them; without the exact derivatives of
        `transcription`, which save it from finding its own.
        """
        x = ca.MX.sym("x", self.transcription.dim * self.grid.size)
        p = ca.MX.sym("p", self.transcription.size_p)
        f, _ = self.transcription.objective(x, p)
        return {"x": x, "p": p, "f": f, "g": self.transcription.constraints(x, p)}

    def not_finite(self) -> list[str]:
        """Names of what is not finite, or not differentiable, on the path that was started from."""
        terms, grid = self.terms, self.grid
        path = Path(self.problem.metric, grid, self.nodes)
        q, v = path.nodes.T, path(grid.nodes, 1).T
        energy = self.problem.metric.inner(terms.q, terms.v, terms.v)
        found = {"the metric": energy, "the cost": terms.cost}
        found |= {repr(term.name): term.expression for term in (*terms.still, *terms.moving)}
        names = []
        for name, expression in found.items():
            symbols = ca.vertcat(terms.q, terms.v)
            outputs = [expression, ca.jacobian(expression, symbols)]
            function = ca.Function("term", [terms.q, terms.v, terms.p], outputs).map(grid.size)
            own = np.tile(terms.values[:, None], grid.size)
            whole = [np.isfinite(values).all(axis=0) for values in evaluate(function, q, v, own)]
            bad = ~np.all([each.reshape(grid.size, -1).all(axis=1) for each in whole], axis=0)
            if np.any(bad):
                names.append(f"{name} at s = {grid.nodes[int(np.argmax(bad))]:.2f}")
        return names

    def path(self, x: Array) -> Path:
        """The path of a value of the variables (size * n,)."""
        nodes = np.nan_to_num(np.asarray(x, dtype=float)).reshape(self.grid.size, -1)
        positions = self.units.positions(nodes)
        # Fixed coordinates come back exactly, not by way of their scaled values.
        held = self.bounds.lower == self.bounds.upper
        return Path(self.problem.metric, self.grid, np.where(held, self.bounds.lower, positions))


def program(
    problem: Problem, grid: Grid, guess: Path | None = None, terms: Conditions | None = None
) -> NLP:
    """The problem's NLP on a grid.

    Args:
        problem: whose path is sought.
        grid: of its nodes.
        guess: to start from; by default the problem's guess, or the straight line.
        terms: the problem's conditions, where they are known already.

    Raises:
        ValueError: the problem is malformed, or its fixed ends violate its own conditions.
    """
    terms = conditions(problem) if terms is None else terms
    grid = with_stations(problem, grid, guess, len(terms.via))
    bounds = NodeBounds.of(terms, grid, problem.metric.joint_names)
    structure = Structure.of(problem, terms)
    transcription = transcribed(structure, grid)
    _check_ends(terms, bounds)
    nodes = _initial(problem, grid, bounds, guess)
    units = _units(problem, transcription, nodes, terms.values)
    return NLP(problem, terms, structure, transcription, bounds, units, nodes)


def _check_ends(terms: Conditions, bounds: NodeBounds) -> None:
    """ValueError where an end that is fixed altogether violates a condition along the path."""
    for s, end in enumerate(bounds.ends):
        if not np.any(np.isnan(end)):
            missed = [
                each for each in violations_at(terms, end, float(s)) if each.amount > NEGLIGIBLE
            ]
            if missed:
                word = ("start", "end")[s]
                raise ValueError(f"the {word} that is given: {'; '.join(map(str, missed))}")


def with_stations(problem: Problem, grid: Grid, guess: Path | None, count: int) -> Grid:
    """The grid with as many via points: where the problem has them, as the guess, or evenly."""
    if not count:
        if grid.via_segments:
            raise ValueError(f"the grid has {len(grid.via_segments)} via points, the problem none")
        return grid
    if problem.via_parameters is not None:
        shares = list(problem.via_parameters)
        if len(shares) != count:
            raise ValueError(f"passing must have s for {count} via points, got {shares}")
        return grid if list(grid.via_s) == shares else grid.with_via_points(shares)
    if len(grid.via_segments) == count:
        return grid
    if guess is not None and len(guess.grid.via_segments) == count:
        return grid.with_via_points(guess.grid.via_s.tolist())
    return grid.with_via_points([(number + 1) / (count + 1) for number in range(count)])


def _initial(problem: Problem, grid: Grid, bounds: NodeBounds, guess: Path | None) -> Array:
    """Positions (size, n) to start from, with the fixed coordinates at their values."""
    given = guess(grid.nodes) if guess is not None else problem.guess(grid.nodes)
    if given is None:
        start, end = bounds.ends
        start, end = np.where(np.isnan(start), end, start), np.where(np.isnan(end), start, end)
        # Exactly constant where both ends are: rounding would pass for a movement.
        given = np.nan_to_num(start + grid.nodes[:, None] * (end - start))
    nodes = np.array(given, dtype=float)
    if nodes.shape != (grid.size, problem.metric.dim) or not np.all(np.isfinite(nodes)):
        raise ValueError(
            f"guess(s) must give finite positions of shape {(grid.size, problem.metric.dim)} for "
            f"s of shape ({grid.size},), got shape {nodes.shape}"
        )
    return np.asarray(np.clip(nodes, bounds.lower, bounds.upper))


def _units(problem: Problem, transcription: Transcription, nodes: Array, values: Array) -> Units:
    """The guess's extent and energy, or one and the metric's size where the guess does not move."""
    extent = float(np.ptp(nodes, axis=0).max())
    size = float(np.trace(problem.metric.matrix(nodes[0]))) / problem.metric.dim
    energy = abs(transcription.energy(nodes, values))
    if not np.isfinite(energy) or not np.isfinite(size) or size <= 0.0:
        raise ValueError("the metric is not finite and positive along the guess")
    if extent <= 0.0 or energy <= 0.0:
        return Units(nodes[0], 1.0, size)
    return Units(nodes[0], extent, energy)
