"""solve: Problem -> NLP -> Ipopt -> Solution."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any, TypeAlias

import casadi as ca

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.ipopt import NO_VALUE, NOT_FINITE, STOPPED, Ipopt, Outcome
from geodesic_ocp.ocp.nlp.conditions import Conditions, conditions
from geodesic_ocp.ocp.nlp.nlp import NLP, program
from geodesic_ocp.ocp.nlp.structure import Structure, transcribed
from geodesic_ocp.ocp.nlp.transcription import Transcription
from geodesic_ocp.ocp.nlp.violations import NEGLIGIBLE, misses, violations
from geodesic_ocp.ocp.problem.problem import Problem
from geodesic_ocp.ocp.solve.callback import Callback, Relay
from geodesic_ocp.ocp.solve.certificate import Attempt
from geodesic_ocp.ocp.solve.refinement import refined
from geodesic_ocp.ocp.solve.solution import Solution, Stats, added
from geodesic_ocp.ocp.solve.via_points import passed
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

# Polynomials of a higher degree are not solved without a start on this grid, if an end is free.
_STIFF, _COARSE = 8, Grid(8, 2)
_LISTED = 3  # violations in a message
# Where the guess is nearly a solution, Ipopt must not push it far from its bounds.
_NEAR = {"bound_push": 1e-6, "bound_frac": 1e-6, "mu_init": 1e-4}
# Where there are multipliers besides, it need not find them anew.
_KNOWN = {
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-8,
    "warm_start_bound_frac": 1e-8,
    "warm_start_slack_bound_push": 1e-8,
    "warm_start_slack_bound_frac": 1e-8,
    "warm_start_mult_bound_push": 1e-8,
    "mu_init": 1e-6,
}

Options: TypeAlias = tuple[tuple[str, Any], ...]  # Ipopt's, by name


def solve(
    problem: Problem,
    *,
    grid: Grid | None = None,
    guess: Path | Solution | None = None,
    tolerance: float | None = None,
    throw: bool = True,
    callback: Callback | None = None,
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
            is in stats.mesh_history. None: solve on the grid as it is.
        throw: raise NotConverged where there is no solution; otherwise the record of the attempt
            is returned, with stats.success False.
        callback: called with an `Iterate` in every iteration of Ipopt; one that returns True stops
            it there. Numbers begin anew where the grid changes.
        ipopt: options for Ipopt, by its names.

    Raises:
        ValueError: the problem is malformed, its fixed ends violate its own conditions, or a
            tolerance is asked of a path that is to be smooth at via points, or to have a velocity
            at an end, which no path that costs least does.
        NotConverged: Ipopt stopped elsewhere than at a solution, or the callback stopped it; the
            record is its `solution`.
    """
    if not isinstance(problem, Problem):
        raise ValueError(f"problem must be an instance of a Problem class, got {problem!r}")
    if getattr(problem, "metric", None) is None:
        raise ValueError(f"{type(problem).__name__} gives no metric")
    grid = problem.grid if grid is None else grid
    before = guess if isinstance(guess, Solution) else None
    start = guess.path if isinstance(guess, Solution) else guess
    solver = _Solver(problem, conditions(problem), dict(ipopt or {}), callback, before)
    if tolerance is None:
        solution = solver.started(grid, start)
    elif solver.terms.smooth:
        raise ValueError(
            "tolerance: the path of least energy has a corner at its via points, which a smooth "
            "one comes the closer to the finer the grid; set continuous_velocity_at_via=False, or leave tolerance out"
        )
    elif quick := solver.terms.on_velocities:
        raise ValueError(
            f"tolerance: no path of least energy has a velocity at an end that is given ({quick}): "
            "the finer the grid, the shorter the piece on which the velocity is reached; leave "
            "tolerance out"
        )
    else:
        solution = refined(solver, misses(solver.terms), grid, tolerance, start)
    if throw and not solution.stats.success:
        raise NotConverged(_explanation(solution), solution)
    return solution


@dataclass(frozen=True, eq=False)
class _Solver:
    """A problem with all that stays the same from one grid to the next."""

    problem: Problem
    terms: Conditions
    options: Mapping[str, Any]
    callback: Callback | None
    before: Solution | None

    def __call__(self, grid: Grid, guess: Path | None, near: bool) -> Solution:
        """The solution on a grid, or the record of the attempt; near: the guess is nearly one."""
        if guess is None and self.terms.ends and grid.degree > _STIFF:
            return self._from_coarse(grid)
        solution = self._once(grid, guess, _NEAR if near else {})
        return (
            solution if self.problem.via_parameters is not None else passed(solution, self._again)
        )

    def started(self, grid: Grid, start: Path | None) -> Solution:
        """The solution on a grid from another solution, if there was one, or else from a path."""
        if self.before is None:
            return self(grid, start, False)
        nlp = program(self.problem, grid, start, self.terms)
        known = _multipliers(nlp, self.before)
        usual = {**_NEAR, **(_KNOWN if known else {})}
        solution = _solved(nlp, {**usual, **self.options}, self.callback, known)
        if self.problem.via_parameters is None:
            solution = passed(solution, self._again)
        if solution.stats.success or solution.stats.status == STOPPED:
            return solution
        return self(grid, start, False)

    def _from_coarse(self, grid: Grid) -> Solution:
        """For problems with a free end: polynomials of high degree have many ways to twist."""
        rough = self(_COARSE, None, False)
        if rough.stats.status == STOPPED:
            return rough
        if rough.stats.success:
            solution = self(grid, rough.path, True)
        else:
            solution = self._once(grid, None, {})
        return added(solution, rough.stats)

    def _again(self, grid: Grid, start: Path) -> Solution:
        return self._once(grid, start, _NEAR)

    def _once(self, grid: Grid, guess: Path | None, usual: Mapping[str, Any]) -> Solution:
        nlp = program(self.problem, grid, guess, self.terms)
        return _solved(nlp, {**usual, **self.options}, self.callback)


def _multipliers(nlp: NLP, before: Solution) -> dict[str, Array]:
    """Those of another solution in the NLP's units, if they are of the same conditions and grid."""
    old, units = before.attempt, nlp.units
    if before.path.grid != nlp.grid or old.lam_g.size != nlp.bounds.lower_g.size:
        return {}
    energies = old.units.scale / units.scale
    lam_x = old.lam_x * energies * (units.length / old.units.length)
    return {"lam_x0": lam_x, "lam_g0": old.lam_g * energies}


def _solved(
    nlp: NLP,
    ipopt: Mapping[str, Any],
    callback: Callback | None,
    known: Mapping[str, Array] = MappingProxyType({}),
) -> Solution:
    """The solution of the NLP, from known multipliers, or the record of the attempt."""
    values = {**nlp.values, **known}
    options = tuple(sorted(ipopt.items()))
    try:
        hash(options)
    except TypeError:
        raise ValueError(f"ipopt: options are numbers and texts, got {dict(ipopt)}") from None
    if callback is not None:
        relay = Relay(nlp, callback)
        outcome = _ipopt(nlp.transcription, options, relay)(**values)
        if relay.failure is not None:
            raise relay.failure
    elif nlp.structure.key is not None:
        outcome = _shared(nlp.structure, nlp.grid, options)(**values)
    else:
        outcome = _ipopt(nlp.transcription, options)(**values)
    if outcome.status == NOT_FINITE and (names := nlp.not_finite()):
        outcome = replace(outcome, status=f"on the guess already, {NO_VALUE}: {', '.join(names)}")
    return _solution(nlp, outcome)


def _ipopt(
    transcription: Transcription, options: Options, relay: ca.Callback | None = None
) -> Ipopt:
    x = ca.MX.sym("x", transcription.dim * transcription.grid.size)
    p = ca.MX.sym("p", transcription.size_p)
    f, _ = transcription.objective(x, p)
    nlp = {"x": x, "p": p, "f": f, "g": transcription.constraints(x, p)}
    derivatives = {"grad_f": transcription.objective, "hess_lag": transcription.hessian}
    return Ipopt(nlp, derivatives, dict(options), relay)


@lru_cache(maxsize=32)
def _shared(structure: Structure, grid: Grid, options: Options) -> Ipopt:
    return _ipopt(transcribed(structure, grid), options)


def _solution(nlp: NLP, outcome: Outcome) -> Solution:
    problem, terms, transcription = nlp.problem, nlp.terms, nlp.transcription
    bounds, units = nlp.bounds, nlp.units
    path = nlp.path(outcome.x)
    x = path.nodes
    violation, worst = bounds.worst(x, outcome.g)
    missed = violations(terms, path, problem.metric.joint_names)
    stats = Stats(
        success=outcome.success,
        status=outcome.status,
        iterations=outcome.iterations,
        seconds=outcome.seconds,
        variables=outcome.x.size,
        constraints=outcome.g.size,
        objective=transcription.energy(x, terms.values),
        energy=path.energy_at_nodes,
        max_node_violation=violation,
        worst_constraint=worst,
        max_path_violation=missed[0].amount if missed else 0.0,
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
    large = [each for each in solution.violations if each.amount > NEGLIGIBLE][:_LISTED]
    missed = f": {'; '.join(map(str, large))}" if large else ""
    advice = (
        ". Can its conditions be met together? If so, try another guess (guess(s) or solve(..., "
        "guess=path)) or a finer grid"
    )
    advice = "" if stats.status == STOPPED or len(stats.mesh_history) > 1 else advice
    return (
        f"{type(solution.problem).__name__} was not solved: {stats.status}, after "
        f"{stats.iterations} iterations{missed}{advice}."
    )
