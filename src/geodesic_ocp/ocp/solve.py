"""Problem -> NLP -> Ipopt -> Solution: the only place that calls nlpsol and reads its success."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.ocp.certificate import Attempt
from geodesic_ocp.ocp.grid import Grid
from geodesic_ocp.ocp.nodal import NodeBounds
from geodesic_ocp.ocp.path import Path
from geodesic_ocp.ocp.prepared import Structure, transcribed
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.ocp.refinement import refined
from geodesic_ocp.ocp.solution import Solution, Stats
from geodesic_ocp.ocp.terms import Conditions, conditions
from geodesic_ocp.ocp.transcription import Transcription, Units
from geodesic_ocp.ocp.violations import misses, violations

# The objective is scaled to be of the order of one, so these are relative to the path's energy.
# Ipopt widens bounds by 1e-8 for its own ease; the answer keeps the ones that were asked for.
_IPOPT = {
    "tol": 1e-10,
    "max_iter": 300,
    "print_level": 0,
    "sb": "yes",
    "honor_original_bounds": "yes",
}
_SENTENCES = {
    "Solve_Succeeded": "Ipopt found a local solution",
    "Solved_To_Acceptable_Level": "Ipopt could not reach its tolerance, only its acceptable level",
    "Infeasible_Problem_Detected": "no path near the guess meets all conditions",
    "Maximum_Iterations_Exceeded": "Ipopt used up its iterations (raise ipopt={'max_iter': ...})",
    "Maximum_CpuTime_Exceeded": "Ipopt used up its time",
    "Restoration_Failed": "Ipopt could not return to paths that meet the conditions",
    "Invalid_Number_Detected": "the metric or a condition is not finite on the way",
    "Search_Direction_Becomes_Too_Small": "Ipopt's steps became too small",
    "Diverging_Iterates": "the iterates run away to infinity",
    "Error_In_Step_Computation": "the linear system of a step could not be solved",
    "Not_Enough_Degrees_Of_Freedom": "there are more equalities than variables",
}


# Violations that a message names: larger than this, and so many of them.
_NEGLIGIBLE, _LISTED = 1e-6, 3

Options: TypeAlias = tuple[tuple[str, Any], ...]  # Ipopt's, by name

# CasADi turns Ctrl-C during a solve into one of these.
_INTERRUPTED = ("NonIpopt_Exception_Thrown", "User_Requested_Stop")


@dataclass(frozen=True)
class Outcome:
    """What Ipopt returned: success, a sentence, iterations, wall time and the last iterate."""

    success: bool
    status: str
    iterations: int
    seconds: float
    x: Array
    g: Array
    lam_x: Array
    lam_g: Array


@dataclass(frozen=True, eq=False)
class Ipopt:
    """An NLP and Ipopt, ready to be called with values.

    Args:
        nlp: CasADi's dictionary of expressions or a function; x, p -> f, g.
        derivatives: functions for nlpsol's options grad_f, hess_lag; CasADi's own where missing.
        options: Ipopt's own, by name, over the package's.

    Raises:
        ValueError: there is no such option, or its value is of another type.
    """

    nlp: Any
    derivatives: Mapping[str, ca.Function] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    _solver: ca.Function = field(init=False, repr=False)

    def __post_init__(self) -> None:
        options: dict[str, Any] = {
            "print_time": False,
            "error_on_fail": False,
            "show_eval_warnings": False,
            "ipopt": {**_IPOPT, **self.options},
            **self.derivatives,
        }
        try:
            solver = ca.nlpsol("nlp", "ipopt", self.nlp, options)
        except RuntimeError as error:
            if not self.options:
                raise
            reason = str(error).strip().splitlines()[-1]
            raise ValueError(f"Ipopt does not take ipopt={self.options}: {reason}") from error
        object.__setattr__(self, "_solver", solver)

    def __call__(self, **values: Any) -> Outcome:
        """Solve with nlpsol's x0, p, lbx, ubx, lbg, ubg."""
        start = time.perf_counter()
        try:
            result = self._solver(**values)
        except SystemError as error:  # a Ctrl-C that CasADi noticed, as of Python 3.13
            if isinstance(error.__cause__, KeyboardInterrupt):
                raise KeyboardInterrupt from error
            raise
        seconds = time.perf_counter() - start
        stats = self._solver.stats()
        word = stats["return_status"]
        if word in _INTERRUPTED:
            raise KeyboardInterrupt
        status = _SENTENCES.get(word, f"Ipopt stopped: {word.replace('_', ' ').lower()}")
        arrays = [result[name].full()[:, 0] for name in ("x", "g", "lam_x", "lam_g")]
        success = bool(stats["success"]) and word == "Solve_Succeeded"
        success = success and all(np.all(np.isfinite(array)) for array in arrays)
        return Outcome(success, status, int(stats["iter_count"]), seconds, *arrays)


def solve(
    problem: Problem,
    *,
    grid: Grid | None = None,
    guess: Path | Solution | None = None,
    tolerance: float | None = None,
    throw: bool = True,
    ipopt: Mapping[str, Any] | None = None,
) -> Solution:
    """The path of least energy under the problem's conditions, found from one start.

    min int (|q'(s)|_G^2 / 2 + cost) ds over the positions at the grid's nodes.

    Args:
        problem: an instance of a subclass of Problem.
        grid: nodes of the path; the problem's own choice by default.
        guess: a path or solution to start from, on any grid; by default the problem's guess, or the
            straight line.
        tolerance: divide the grid's segments where needed until conditions hold to this everywhere,
            each in its unit, and the objective, relative, from one grid to the next; what was done
            is in stats.rounds. None: solve on the grid as it is.
        throw: raise NotConverged where there is no solution; otherwise the record of the attempt
            is returned, with stats.success False.
        ipopt: options for Ipopt, by its names.

    Raises:
        ValueError: the problem is malformed, or its fixed ends violate its own bounds.
        NotConverged: Ipopt stopped elsewhere than at a solution; carries the record.
    """
    if not isinstance(problem, Problem):
        raise ValueError(f"problem must be an instance of a Problem class, got {problem!r}")
    grid = problem.grid if grid is None else grid
    start = guess.path if isinstance(guess, Solution) else guess
    terms = conditions(problem)

    def solve_on(grid: Grid, start: Path | None) -> Solution:
        return _solved(problem, terms, grid, start, ipopt or {})

    if tolerance is None:
        solution = solve_on(grid, start)
    else:
        solution = refined(solve_on, misses(terms), grid, tolerance, start)
    if throw and not solution.stats.success:
        raise NotConverged(_explanation(solution), solution)
    return solution


def _solved(
    problem: Problem, terms: Conditions, grid: Grid, guess: Path | None, ipopt: Mapping[str, Any]
) -> Solution:
    """The solution on one grid, or the record of the attempt."""
    bounds = NodeBounds.of(terms, grid, problem.metric.joint_names)
    structure = Structure.of(problem, terms)
    transcription = transcribed(structure, grid)
    options = tuple(sorted(ipopt.items()))
    shared = structure.key is not None
    solver = _shared(structure, grid, options) if shared else _ipopt(transcription, options)
    nodes = _initial(problem, grid, bounds, guess)
    units = _units(problem, transcription, nodes, terms.values)
    outcome = solver(
        x0=units.scaled(nodes).ravel(),
        p=units.with_values(terms.values),
        lbx=units.scaled(bounds.lower).ravel(),
        ubx=units.scaled(bounds.upper).ravel(),
        lbg=bounds.lower_g,
        ubg=bounds.upper_g,
    )
    return _solution(problem, terms, transcription, bounds, outcome, units)


def _ipopt(transcription: Transcription, options: Options) -> Ipopt:
    x = ca.MX.sym("x", transcription.dim * transcription.grid.size)
    p = ca.MX.sym("p", transcription.size_p)
    f, _ = transcription.objective(x, p)
    nlp = {"x": x, "p": p, "f": f, "g": transcription.constraints(x, p)}
    derivatives = {"grad_f": transcription.objective, "hess_lag": transcription.hessian}
    return Ipopt(nlp, derivatives, dict(options))


@lru_cache(maxsize=32)
def _shared(structure: Structure, grid: Grid, options: Options) -> Ipopt:
    return _ipopt(transcribed(structure, grid), options)


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


def _solution(
    problem: Problem,
    terms: Conditions,
    transcription: Transcription,
    bounds: NodeBounds,
    outcome: Outcome,
    units: Units,
) -> Solution:
    grid = transcription.grid
    x = units.positions(np.nan_to_num(outcome.x).reshape(grid.size, problem.metric.dim))
    # Fixed coordinates come back exactly, not by way of their scaled values.
    x = np.where(bounds.lower == bounds.upper, bounds.lower, x)
    violation, worst = bounds.worst(x, outcome.g)
    path = Path(problem.metric, grid, x)
    missed = violations(terms, path, problem.metric.joint_names)
    stats = Stats(
        success=outcome.success,
        status=outcome.status,
        iterations=outcome.iterations,
        seconds=outcome.seconds,
        variables=outcome.x.size,
        constraints=outcome.g.size,
        objective=transcription.energy(x, terms.values),
        energy=float(grid.weights.ravel() @ path.speeds_at_nodes**2) / 2.0,
        violation=violation,
        worst=worst,
        between=missed[0].amount if missed else 0.0,
    )
    lam_x = units.scale / units.length * outcome.lam_x.reshape(x.shape)
    multipliers = bounds.multipliers(lam_x, units.scale * outcome.lam_g)
    attempt = Attempt(
        path,
        transcription,
        units,
        terms.values,
        outcome.x,
        outcome.lam_x,
        outcome.lam_g,
        held_x=(bounds.lower == bounds.upper).ravel(),
        held_g=bounds.lower_g == bounds.upper_g,
        success=stats.success,
        of_energy=bool(terms.cost.is_zero()),
    )
    return Solution(problem, path, stats, multipliers, missed, attempt)


def _explanation(solution: Solution) -> str:
    stats = solution.stats
    large = [each for each in solution.violations if each.amount > _NEGLIGIBLE][:_LISTED]
    missed = f": {'; '.join(map(str, large))}" if large else ""
    return (
        f"{type(solution.problem).__name__} was not solved: {stats.status}, after "
        f"{stats.iterations} iterations{missed}. Try another guess (guess(s) or solve(..., "
        "guess=path)) or a finer grid."
    )
