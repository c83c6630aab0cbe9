"""solve: Problem -> NLP -> Ipopt -> Solution."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any, TypeAlias, overload

import numpy as np

from geodesic_ocp.arrays import Array, as_integer, as_positive
from geodesic_ocp.blocks import in_rounds
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.ipopt import NO_VALUE, NOT_FINITE, STOPPED, Ipopt, Outcome, Relay
from geodesic_ocp.ocp.callback import Callback, relay_paths
from geodesic_ocp.ocp.certificate import FinalIterate, descent_direction
from geodesic_ocp.ocp.conditions import Conditions
from geodesic_ocp.ocp.descent import descend, is_at_edge, size_of, still_moving
from geodesic_ocp.ocp.guesses import FEW, Guesses
from geodesic_ocp.ocp.motion_problem import MotionProblem, MotionSolution, solve_motion
from geodesic_ocp.ocp.nlp import NLP, ProblemDefinition, build_nlp
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.ocp.refinement import (
    halved,
    meeting_conditions,
    refine,
    resolving,
    with_optimal_via_points,
)
from geodesic_ocp.ocp.solution import Solution, Stats, describe_failure, with_effort_of
from geodesic_ocp.ocp.transcription import Transcription
from geodesic_ocp.ocp.violations import (
    MAY_CHANGE,
    Kept,
    find_violations,
    joined,
    left_out,
    may_become_active,
    path_samples,
)
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

# With a free end, polynomials of a higher degree need an initial guess, solved on this grid.
_STIFF, _COARSE = 8, Grid(4, 4)
# From as many equal segments on, a solution on half of them comes first.
_MANY = 16
_MOST_SEGMENTS = 32  # on which a guess is solved anew, as it led through obstacles on fewer
# Tolerances of Ipopt: of a guess for the next grid; of a path to a tolerance; of others.
_LOOSE, _MODERATE, _TIGHT = 1e-6, 1e-8, 1e-10
_SADDLE = "Ipopt found a stationary path, a saddle point: it is not locally minimizing"
# Largest displacement of a node, relative to the path's extent, by which a saddle point is left.
_STEP = 0.1
# A step may increase the energy only if it reduces the violation of the conditions by this
# fraction, without a second-order correction: otherwise one step can replace a good guess by a path
# of fifty times its energy, and the result depends on rounding.
FILTER = {"gamma_theta": 0.9, "max_soc": 0}
# Programs are scaled, and small: preparing and checking the linear systems would take as long as
# solving them.
_SYSTEMS = {"mumps_permuting_scaling": 0, "mumps_scaling": 0, "min_refinement_steps": 0}
# If the guess is nearly a solution, Ipopt must not push it far from its bounds.
NEAR = {"bound_push": 1e-6, "bound_frac": 1e-6, "mu_init": 1e-4}
# From a path beside obstacles it stays on their side; on `NEAR` it stops at the first optimum.
_BESIDE = {**NEAR, "mu_init": 1e-3}
_FEASIBLE = 1e-2  # violation at the nodes, each in its unit, of a path to stay near to
# Among many bodies, nodes of a solution move by at most this [rad or m] from one program to the
# next, `_GROWTH` times as far where they did: from a small barrier, Ipopt's first steps may lead
# far away, and through thin bodies.
_WITHIN, _FARTHEST, _GROWTH = 0.02, 0.1, 3.0
_NEARBY = 0.03  # rows for such steps: bounds within this share of the range of a condition's values
_SMALL_BARRIER = 1e-6  # from a solution on a coarser grid among many bodies
_STRAYS = 2  # solves from a path whose solutions jump through bodies, before other grids are tried
_FEW_ITERATIONS = 100  # of Ipopt, for one step of a descent
_SAME = 1e-5  # relative difference of the objectives of one solution on one grid
# If there are multipliers as well, it need not estimate them.
_WARM_START = {
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-8,
    "warm_start_bound_frac": 1e-8,
    "warm_start_slack_bound_push": 1e-8,
    "warm_start_slack_bound_frac": 1e-8,
    "warm_start_mult_bound_push": 1e-8,
    "mu_init": 1e-9,
    "max_iter": 40,
}

# Where new rows or nodes are violated by more than this, each in its unit, other conditions become
# active, which is slow from the smallest barrier.
# Above `_NEARLY`, the multipliers of the coarser grid no longer help.
_CHANGED, _MODERATE_BARRIER, _NEARLY = 1e-3, 1e-5, 5e-3

# Rounds at most in which conditions are added, and how many solves of these may fail.
_MOST_ROUNDS, _FAILURES = 20, 2
_Start: TypeAlias = tuple[ProblemDefinition, Path | Solution | None]
Settings: TypeAlias = tuple[tuple[str, Any], ...]  # Ipopt's options, by name


@overload
def solve(problem: MotionProblem, *, throw: bool = True) -> MotionSolution: ...
@overload
def solve(
    problem: Problem,
    *,
    grid: Grid | None = None,
    guess: Path | Solution | None = None,
    tolerance: float | None = None,
    throw: bool = True,
    callback: Callback | None = None,
    ipopt: Mapping[str, Any] | None = None,
    num_starts: int = 1,
) -> Solution: ...
def solve(
    problem: Problem | MotionProblem,
    *,
    grid: Grid | None = None,
    guess: Path | Solution | None = None,
    tolerance: float | None = None,
    throw: bool = True,
    callback: Callback | None = None,
    ipopt: Mapping[str, Any] | None = None,
    num_starts: int = 1,
) -> Solution | MotionSolution:
    """Return the path of least energy under the problem's conditions, a local solution.

    A saddle point, as from a symmetric guess, is left in a direction in which the energy decreases;
    where that leads nowhere, the saddle point is the solution, and its status says so.

    min int (|q'(s)|_G^2 / 2 + cost) ds over the positions at the grid's nodes.

    Where the problem's own guess, by default the straight line, violates path constraints in q, a
    detour around them comes first, or, if none is clear, a path of a sampling planner; guesses that
    lead to no solution are followed by others, up to 2000 iterations of Ipopt. The same call always
    gives the same solution; `stats.guess` names the guess that led to it.

    Args:
        problem: an instance of a subclass of Problem, or of MotionProblem: see
            `geodesic_ocp.ocp.motion_problem.solve_motion`.
        grid: grid of the nodes; the solution has this grid. None: the problem's own, refined where
            conditions are violated between the nodes by more than 1e-4, each in its unit.
        guess: path or solution to start from, on any grid, alone; by default the problem's guess,
            or the straight line. A solution is a warm start. From a path that meets the conditions,
            such as `Path.through(metric, waypoints)`, the search stays near it.
        tolerance: refine the grid until the conditions hold to this everywhere, each in its unit,
            and the objective changes by less, relative, from one grid to the next;
            stats.mesh_history lists the solves.
        throw: raise NotConverged if there is no solution; else return the last iterate, with
            stats.success False.
        callback: called with an `Iterate` in every iteration of Ipopt, and stops it by returning
            True. Numbers start anew on every grid.
        ipopt: options of Ipopt, by name.
        num_starts: solve from so many guesses, if there are as many different ones, and return the
            best solution; not with a given guess or via points.

    Raises:
        ValueError: the problem is malformed; its fixed ends violate its own conditions; or a
            tolerance is requested for a path with continuous velocity at via points or prescribed
            velocities at the ends, of which there is none of least energy.
        NotConverged: Ipopt found no solution, the callback stopped it, or the path violates a
            condition between the nodes by more than the tolerance, without one by more than 1e-4:
            on a given grid, or if refinement fails. The last iterate is its `solution`.

    Example:
        >>> import geodesic_ocp as go
        >>> problem = go.Reach(go.human_arm(), [0.3, 0, -0.4, 0.9, 0, 0, 0], [0.10, 0.45, -0.05])
        >>> solution = go.solve(problem)
        >>> solution.stats.status
        'Ipopt found a local solution'
        >>> problem.model.hand_pose(solution.path(1.0))[1].round(6).tolist()
        [0.1, 0.45, -0.05]
    """
    options: dict[str, object] = {"grid": grid, "guess": guess, "tolerance": tolerance}
    options |= {"callback": callback, "ipopt": ipopt}
    options["num_starts"] = None if as_integer("num_starts", num_starts, 1) == 1 else num_starts
    given = [name for name, value in options.items() if value is not None]
    if isinstance(problem, MotionProblem):
        if given:
            raise ValueError(f"motions are solved without {', '.join(given)}")
        return solve_motion(problem, throw=throw)
    if not isinstance(problem, Problem):
        raise ValueError(f"problem must be an instance of a Problem class, got {problem!r}")
    if getattr(problem, "metric", None) is None:
        raise ValueError(f"{type(problem).__name__} defines no metric")
    if type(problem).solved is not Problem.solved:
        if given:
            kind = type(problem).__name__
            raise ValueError(f"{kind} is solved by a program of its own, without {given[0]}")
        own = problem.solved()
        if throw and not own.success:
            raise NotConverged(f"{type(problem).__name__} was not solved: {own.status}", own)
        found: Solution = own
        return found
    if not isinstance(grid, Grid | None):
        raise ValueError(f"grid must be a Grid, got {grid!r}")
    if not isinstance(guess, Path | Solution | None):
        raise ValueError(f"guess must be a Path or a Solution, got {guess!r}")
    definition = problem.definition()
    definition = replace(definition, guess=_remembered(definition.guess))
    conditions = definition.conditions
    if guess is not None and num_starts > 1:
        raise ValueError("num_starts: other guesses are found only where no guess is given")
    if conditions.via and num_starts > 1:
        raise ValueError("num_starts: problems with via points are solved from one guess")
    if tolerance is not None:
        tolerance = as_positive("tolerance", tolerance)
        _check_refinable(conditions)
    settings, tight = dict(ipopt or {}), _ipopt_tolerance(tolerance)
    is_bounded = len(conditions.along_q) > FEW and num_starts == 1
    solver = _Solver(problem, definition, conditions, settings, callback, tight, is_bounded)
    first = definition.grid if grid is None else grid

    search = _Search(solver, grid, tolerance)
    if guess is not None or conditions.via:
        solution = search.finish(search.begin(guess), guess, ())
    else:
        solution = _best_of(search, Guesses(definition, first), num_starts)
    if throw and not solution.stats.success:
        raise NotConverged(describe_failure(solution), solution)
    return solution


def _remembered(guess: Callable[[Array], Array | None]) -> Callable[[Array], Array | None]:
    """Return a guess that is computed once on every grid, as inverse kinematics may be slow."""
    memory: dict[bytes, Array | None] = {}

    def remembered(s: Array) -> Array | None:
        if (key := s.tobytes()) not in memory:
            memory[key] = guess(s)
        return memory[key]

    return remembered


_ATTEMPTS = 6  # guesses, if none leads to a solution
# Iterations of Ipopt after which no other guess is tried, and among many bodies, where each takes
# long, no other program; those with more variables count for more.
_MOST_ITERATIONS, _VARIABLES = 2000, 500
# Violation between nodes, each in its unit, of first solutions that go around obstacles: others may
# jump through them.
_AROUND = 3e-2


def _best_of(search: _Search, guesses: Guesses, num_starts: int) -> Solution:
    """Return the best of the solutions from so many guesses; if there is none, the last iterate
    from the problem's guess.

    Of one guess, which is clear of obstacles; otherwise of two on the first grid, those on which
    the path goes around obstacles first, the planner's last.
    """
    found: list[Solution] = []
    failed: list[Solution] = []
    waiting: list[tuple[Solution, Path | None]] = []

    def finish(one: tuple[Solution, Path | None]) -> bool:
        """Return whether the search is over."""
        first, path = one
        waiting.remove(one)
        solution = _named(search.finish(first, path, found), first.stats.guess)
        (found if solution.stats.success else failed).append(solution)
        return solution.stats.status == STOPPED or len(found) >= num_starts or is_spent()

    def is_spent() -> bool:
        return num_starts == 1 and sum(search.solver.spent) > _MOST_ITERATIONS

    def around() -> list[tuple[Solution, Path | None]]:
        return sorted(
            (one for one in waiting if _goes_around(one[0])), key=lambda one: one[0].stats.objective
        )

    def over() -> bool:
        several = num_starts > 1
        simple, further = guesses.simple(several), guesses.further(several)
        last = guesses.last()
        for enough, stage in ((2, simple), (1, further), (1, simple), (1, further), (1, last)):
            for name, path in stage:
                first = _named(search.begin(path), name)
                waiting.append((first, path))
                is_clear = not name and len(waiting) + len(failed) == 1
                wanted = num_starts if several else 1 if is_clear else enough
                tried = len(waiting) + len(failed) + len(found)
                if first.stats.status == STOPPED:
                    failed.append(first)
                    return True
                if len(around()) >= wanted or tried >= max(num_starts, _ATTEMPTS) or is_spent():
                    break
            if not several and any(map(finish, around())):
                return True
            if is_spent():
                break
        return any(map(finish, around())) or any(map(finish, list(waiting)))

    over()
    if failed and failed[-1].stats.status == STOPPED:
        return failed[-1]
    if found:
        return min(found, key=lambda each: each.stats.objective)
    last = min(failed, key=lambda each: each.stats.guess != "")
    if len(guesses.tried) < 2:
        return last
    status = f"{last.stats.status} (tried: {', '.join(guesses.tried)})"
    return replace(last, stats=replace(last.stats, status=status))


def _named(solution: Solution, name: str) -> Solution:
    return replace(solution, stats=replace(solution.stats, guess=name))


def _goes_around(first: Solution) -> bool:
    return first.stats.success and first.stats.max_path_violation <= _AROUND


def _check_refinable(conditions: Conditions) -> None:
    """Raise ValueError if there is no path of least energy that ever finer grids approach."""
    if conditions.via_continuity:
        raise ValueError(
            "tolerance: the path of least energy has a corner at its via points, which a path with "
            "continuous velocity approaches as the grid is refined; set "
            "continuous_velocity_at_via = False, or leave tolerance out"
        )
    if names := conditions.on_end_velocities:
        raise ValueError(
            f"tolerance: there is no path of least energy with a prescribed velocity at an end "
            f"({names}): the finer the grid, the shorter the piece on which it is reached; leave "
            "tolerance out"
        )


def _ipopt_tolerance(tolerance: float | None) -> float:
    """Return Ipopt's tolerance, in the scale of the energy, for a tolerance of the path."""
    return _TIGHT if tolerance is None else float(np.clip(tolerance / 100.0, _TIGHT, _MODERATE))


@dataclass(frozen=True, eq=False)
class _Search:
    """From guesses to solutions, on the problem's own grid, on a given one, or to a tolerance.

    On half the segments Ipopt takes as many iterations, at half the cost, and few from there.
    """

    solver: _Solver
    grid: Grid | None
    tolerance: float | None

    def __post_init__(self) -> None:
        object.__setattr__(self, "_grids", lru_cache(_ATTEMPTS)(self._grids))

    def begin(self, guess: Path | Solution | None) -> Solution:
        """Return the solution on the first grid; from a path on a finer one where it would jump
        through obstacles, from which refinement leads nowhere.
        """
        first, own = self._grids(guess)
        solver = self.solver if first is own else replace(self.solver, tolerance=_LOOSE)
        solution = solver.solve_from(first, guess)
        is_path = isinstance(guess, Path) and self.grid is None and not self.solver.conditions.via
        strays = solution.stats.max_path_violation > _FEASIBLE
        fails = is_path and (strays or not solution.stats.success)
        if fails and (path := self.solver.among_bodies(own, guess)) is not None:
            return with_effort_of(solution.stats, self.solver.descend(path))
        while is_path and solution.stats.max_path_violation > _FEASIBLE:
            first = own if first is not own else halved(own, np.ones(own.segments, dtype=bool))
            if not solution.stats.success or first.segments > _MOST_SEGMENTS:
                break
            own, before = first, solution
            kept = before.iterate.nlp.conditions.kept
            solution = with_effort_of(before.stats, self.solver(first, guess, kept))
        return solution

    def _grids(self, guess: Path | Solution | None) -> tuple[Grid, Grid]:
        """Return the first grid, and the one that the solution has at least."""
        if self.grid is not None:
            return self.grid, self.grid
        own, conditions = self.solver.definition.grid, self.solver.conditions
        half = own
        if own.segments >= _MANY and not own.ends and not isinstance(guess, Solution):
            half = Grid(own.segments // 2, own.degree)
        if isinstance(guess, Path) and not conditions.via:
            samples = path_samples(conditions)
            finer = resolving(own, guess, samples)
            half = half if half is not own and resolving(half, guess, samples) is half else finer
            own = finer
        return half, own

    def finish(
        self, first: Solution, guess: Path | Solution | None, others: Sequence[Solution]
    ) -> Solution:
        """Return the solution that follows from that on the first grid; one of the others if it
        leads to that.
        """
        if first.stats.status == STOPPED:
            return first
        if same := _same(first, others):
            return same
        if self.grid is not None and self.tolerance is None:
            return meeting_conditions(first, "leave grid out, or set tolerance")
        own = self._grids(guess)[1]
        is_coarse, anew = first.path.grid.segments < own.segments, True
        if is_coarse and first.stats.success:
            found = first
            if self.tolerance is None:
                found = with_effort_of(first.stats, self.solver.solve_from(own, first))
            found = self._refined(found, guess)
            if found.stats.success or found.stats.status == STOPPED:
                return found
            anew = self.tolerance is not None  # if not, that has failed already, on these grids
        if is_coarse:
            first = self.solver.solve_from(own, guess)
        return _same(first, others) or self._refined(first, guess, anew)

    def _refined(
        self, first: Solution, guess: Path | Solution | None, anew: bool = True
    ) -> Solution:
        samples = path_samples(self.solver.conditions)
        return refine(self.solver, samples, first, self.tolerance, guess, anew)


def _same(one: Solution, others: Sequence[Solution]) -> Solution | None:
    """Return the solution among others that is this one, perhaps refined, if any is."""

    def first(each: Solution) -> float:
        history = each.stats.mesh_history
        return history[0].objective if history else each.stats.objective

    objective = first(one)
    close = (o for o in others if abs(objective - first(o)) <= _SAME * abs(first(o)))
    return next(close, None) if one.stats.success else None


@dataclass(frozen=True, eq=False)
class _Solver:
    """A problem with everything that stays the same from one grid to the next."""

    problem: Problem
    definition: ProblemDefinition
    conditions: Conditions
    ipopt: Mapping[str, Any]
    callback: Callback | None
    tolerance: float
    is_bounded: bool = False  # whether all solves together end after `_MOST_ITERATIONS`
    spent: list[int] = field(default_factory=list)  # iterations of all solves
    within: float = np.inf  # how far [rad or m] nodes may move from a guess

    def __call__(
        self, grid: Grid, guess: Path | Solution | None, known: Kept = MappingProxyType({})
    ) -> Solution:
        """Return the solution or last iterate on a grid, from a path or another solution.

        Of many conditions, those far from their bounds are left out until a path violates them,
        unless they are known to count.
        """
        whole = self.definition.conditions
        if len(whole.along_q) <= FEW or whole.via:
            return self._solve_on(grid, guess)
        is_near = isinstance(guess, Solution)
        given = guess.path if isinstance(guess, Solution) else guess
        path = self.definition.initial_path(grid, given)
        within, share = np.inf, MAY_CHANGE
        if is_near:
            within, share = _WITHIN * size_of(path), _NEARBY
        farthest = _FARTHEST / _WITHIN * within
        first = self.definition.restricted(joined(known, may_become_active(whole, path, share)))
        tolerance = _LOOSE if self.tolerance == _TIGHT else self.tolerance

        def solve(start: _Start) -> Solution:
            definition, guess = start
            solver = replace(self, definition=definition, within=within, tolerance=tolerance)
            return solver._solve_on(grid, guess)

        def examine(number: int, found: Solution) -> tuple[Solution, _Start | None]:
            nonlocal path, within
            kept, is_held = found.iterate.nlp.conditions.kept, is_at_edge(path, found.path, within)
            missing = left_out(whole, kept, found.path)
            fails = not found.stats.success and number >= _FAILURES
            if found.stats.status == STOPPED or fails or not (missing or is_held):
                return found, None
            strays = guess is not None and found.stats.max_path_violation > _FEASIBLE
            if strays and (not missing if is_near else number >= _STRAYS):
                return found, None
            if is_held and number + 1 == _MOST_ROUNDS:
                return still_moving(found), None
            near = {} if strays else may_become_active(whole, found.path, share)
            more = self.definition.restricted(joined(kept, missing, near))
            if strays or not found.stats.success:
                within /= _GROWTH
                return found, (more, path if is_near else guess)
            path = found.path
            within *= _GROWTH if is_held and within < farthest else 1.0
            return found, (more, found)

        return in_rounds((first, guess), solve, examine, _MOST_ROUNDS)

    def among_bodies(self, grid: Grid, guess: Path | Solution | None) -> Path | None:
        """Return a guess on a grid if there are many conditions and it meets them, else None."""
        whole = self.definition.conditions
        if not isinstance(guess, Path) or len(whole.along_q) <= FEW or whole.via:
            return None
        path = self.definition.initial_path(grid, guess)
        worst = path_samples(whole).excess(path, roughly=True)[1].max()
        return path if worst <= _FEASIBLE else None

    def descend(self, path: Path) -> Solution:
        """Return the solution from a path that meets the conditions, by steps that go on to."""

        def step(
            definition: ProblemDefinition, path: Path, within: float, before: Solution | None
        ) -> Solution:
            solver = replace(self, definition=definition, tolerance=_LOOSE, within=within)
            nlp = build_nlp(definition, path.grid, path)
            if before is None:
                return solver._solve_nlp(nlp, {**_BESIDE, "max_iter": _FEW_ITERATIONS})
            warm = {**NEAR, **_WARM_START, "mu_init": _MODERATE_BARRIER}
            warm["max_iter"] = _FEW_ITERATIONS
            return solver._solve_nlp(nlp, warm, _multipliers(nlp, before))

        return descend(self.definition, step, path)

    def _solve_on(self, grid: Grid, guess: Path | Solution | None) -> Solution:
        """Return the solution or last iterate under the conditions of this solver."""
        if isinstance(guess, Solution):
            nlp = build_nlp(self.definition, grid, guess.path)
            if nlp.violation <= _NEARLY and (multipliers := _multipliers(nlp, guess)):
                warm = {**NEAR, **_WARM_START}
                if self.within < np.inf:
                    warm["mu_init"] = _SMALL_BARRIER
                is_first = self.within in (np.inf, _WITHIN * size_of(guess.path))
                if nlp.violation > _CHANGED or not is_first:
                    warm["mu_init"] = _MODERATE_BARRIER
                found = self._solve_nlp(nlp, warm, multipliers)
                if not found.stats.success and found.stats.status != STOPPED:
                    found = with_effort_of(found.stats, self._solve_nlp(nlp, NEAR))
            else:
                found = self._solve_nlp(nlp, NEAR)
            return self._optimize_via(found)
        has_free_end = bool(self.definition.conditions.ends)
        if guess is None and has_free_end and grid.degree > _STIFF:
            return self._solve_from_coarse(grid)
        nlp = build_nlp(self.definition, grid, guess)
        near = _BESIDE if guess is not None and nlp.violation <= _FEASIBLE else {}
        return self._optimize_via(self._solve_nlp(nlp, near))

    def solve_from(self, grid: Grid, start: Path | Solution | None) -> Solution:
        """Get the solution on a grid, from another solution's path alone if nothing else helps."""
        solution = self(grid, start)
        stats = solution.stats
        if stats.success or stats.status == STOPPED or not isinstance(start, Solution):
            return solution
        return self(grid, start.path)

    def _solve_from_coarse(self, grid: Grid) -> Solution:
        """Solve on a coarse grid first, as with a free end high degrees tend to oscillate."""
        coarse = self(_COARSE, None)
        if coarse.stats.status == STOPPED:
            return coarse
        if coarse.stats.success:
            return with_effort_of(coarse.stats, self(grid, coarse))
        return with_effort_of(coarse.stats, self._solve_once(grid, None, {}))

    def _optimize_via(self, solution: Solution) -> Solution:
        if self.definition.via_parameters is not None:
            return solution
        return with_optimal_via_points(
            solution, lambda grid, start: self._solve_once(grid, start, NEAR)
        )

    def _solve_once(self, grid: Grid, guess: Path | None, usual: Mapping[str, Any]) -> Solution:
        return self._solve_nlp(build_nlp(self.definition, grid, guess), usual)

    def _solve_nlp(
        self,
        nlp: NLP,
        usual: Mapping[str, Any],
        multipliers: Mapping[str, Array] = MappingProxyType({}),
    ) -> Solution:
        """Return the solution of the NLP from given multipliers, or the last iterate."""
        values = {**nlp.values, **multipliers}
        farthest = self.within / nlp.units.length
        values["lbx"] = np.maximum(values["lbx"], values["x0"] - farthest)
        values["ubx"] = np.minimum(values["ubx"], values["x0"] + farthest)
        given = {**FILTER, **_SYSTEMS, "tol": self.tolerance, **usual, **self.ipopt}
        if is_spent := self.is_bounded and sum(self.spent) > _MOST_ITERATIONS:
            given["max_iter"] = 0
        settings = tuple(sorted(given.items()))
        try:
            hash(settings)
        except TypeError:
            raise ValueError(f"ipopt: options are numbers and strings, got {given}") from None
        if self.callback is not None:
            relay = relay_paths(nlp, self.callback)
            outcome = _ipopt(nlp.transcription, settings, relay)(**values)
        elif self.definition.key is not None:
            shape = nlp.transcription.grid
            outcome = shared_ipopt(self.definition, shape, settings)(**values)
        else:
            outcome = _ipopt(nlp.transcription, settings)(**values)
        self.spent.append(int(outcome.iterations * max(1.0, outcome.x.size / _VARIABLES)))
        if is_spent and not outcome.success:
            status = f"no solution was found in {_MOST_ITERATIONS} iterations of Ipopt"
            outcome = replace(outcome, status=status)
        if outcome.status == NOT_FINITE and (names := nlp.not_finite()):
            status = f"already on the initial guess, {NO_VALUE}: {', '.join(names)}"
            outcome = replace(outcome, status=status)
        solution = _solution(self.problem, self.conditions, nlp, outcome)
        return self._beyond_saddle(nlp, solution) if outcome.may_be_saddle else solution

    def _beyond_saddle(self, nlp: NLP, solution: Solution) -> Solution:
        """Return a solution of less energy if this one is a saddle point, as from a symmetric
        guess.
        """
        direction = descent_direction(solution.iterate) if solution.stats.success else None
        if direction is None:
            return solution
        before = solution.stats
        for step in (_STEP, -_STEP):
            beside = nlp.path(solution.iterate.x + step * direction)
            found = self._solve_once(solution.path.grid, beside, {})
            is_less = found.stats.success and found.stats.objective < before.objective
            # Coarse grids also admit paths that jump where the metric is singular.
            if is_less and found.certificate.stationary:
                return with_effort_of(before, found)
        return replace(solution, stats=replace(before, status=_SADDLE))


def _multipliers(nlp: NLP, before: Solution) -> dict[str, Array]:
    """Return another solution's multipliers in the NLP's units; none if conditions differ."""
    old, units = before.iterate, nlp.units
    carried = nlp.bounds.carried(old.lam_x, old.lam_g, old.nlp.bounds)
    if carried is None:
        return {}
    energies = old.nlp.units.scale / units.scale
    lengths = units.length / old.nlp.units.length
    return {"lam_x0": carried[0] * energies * lengths, "lam_g0": carried[1] * energies}


def _ipopt(transcription: Transcription, settings: Settings, relay: Relay | None = None) -> Ipopt:
    return transcription.program.solver(dict(settings), relay)


@lru_cache(maxsize=32)
def shared_ipopt(definition: ProblemDefinition, shape: Grid, settings: Settings) -> Ipopt:
    """Return Ipopt for all problems with one key, on all grids of a shape (with equal segments)."""
    return _ipopt(definition.transcription(shape), settings)


def _solution(problem: Problem, conditions: Conditions, nlp: NLP, outcome: Outcome) -> Solution:
    """Return the solution under all conditions of a problem, from an NLP with some of them."""
    bounds, units = nlp.bounds, nlp.units
    iterate = FinalIterate(nlp, outcome.x, outcome.lam_x, outcome.lam_g)
    path = iterate.path
    violation, worst = bounds.worst(path.nodes, outcome.g)
    violations = find_violations(conditions, path)
    stats = Stats(
        success=outcome.success,
        status=outcome.status,
        iterations=outcome.iterations,
        seconds=outcome.seconds,
        variables=outcome.x.size,
        constraints=outcome.g.size,
        objective=units.scale * outcome.objective,
        energy=path.discrete_energy,
        max_node_violation=violation,
        worst_constraint=worst,
        max_path_violation=violations[0].amount if violations else 0.0,
    )
    lam_x = units.scale / units.length * outcome.lam_x.reshape(path.nodes.shape)
    others = {each.name: np.zeros((path.grid.size, each.size)) for each in conditions.along_q}
    multipliers = {**others, **bounds.multipliers(lam_x, units.scale * outcome.lam_g)}
    return Solution(problem, path, stats, multipliers, violations, iterate)
