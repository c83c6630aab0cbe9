"""solve: Problem -> NLP -> Ipopt -> Solution."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, overload

import numpy as np

from geodesic_ocp.arrays import Array, as_integer, as_positive
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.ipopt import STOPPED
from geodesic_ocp.ocp.callback import Callback
from geodesic_ocp.ocp.conditions import Conditions
from geodesic_ocp.ocp.guesses import Attempts, Guesses
from geodesic_ocp.ocp.motion_problem import MotionPhases, MotionProblem
from geodesic_ocp.ocp.motion_solution import MotionSolution
from geodesic_ocp.ocp.nlp import ProblemDefinition
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.ocp.refinement import halved, meeting_conditions, refine, resolving
from geodesic_ocp.ocp.scales import measured
from geodesic_ocp.ocp.solution import Solution, describe_failure, with_effort_of
from geodesic_ocp.ocp.solve_motion import MotionGuess, solve_motion
from geodesic_ocp.ocp.solver import FEASIBLE, LOOSE, MODERATE, MOST_ITERATIONS, TIGHT, Solver
from geodesic_ocp.ocp.violations import path_samples
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

# From as many equal segments on, a solution on half of them comes first.
_MANY = 16
_MOST_SEGMENTS = 32  # on which a guess is solved anew, as it led through obstacles on fewer
_SAME = 1e-5  # relative difference of the objectives of one solution on one grid


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
@overload
def solve(
    problem: MotionProblem | MotionPhases,
    *,
    grid: Grid | None = None,
    guess: MotionGuess | None = None,
    tolerance: float | None = None,
    throw: bool = True,
    callback: Callback | None = None,
    ipopt: Mapping[str, Any] | None = None,
    num_starts: int = 1,
) -> MotionSolution: ...
def solve(
    problem: Problem | MotionProblem | MotionPhases,
    *,
    grid: Grid | None = None,
    guess: Path | Solution | MotionGuess | None = None,
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

    If the problem gives several guesses, the better of two solutions is kept. Where the first one,
    by default the straight line, violates path constraints in q, a detour around them comes before
    it, or, if none is clear, a path of a sampling planner; guesses that lead to no solution are
    followed by others, up to 2000 iterations of Ipopt, or 3000 in all among many bodies, or up to a
    limit in `ipopt`, such as `max_iter`, that one of them reaches. The same call always gives the
    same solution; `stats.guess` names the guess that led to it.

    Args:
        problem: an instance of a subclass of Problem; or of MotionProblem or `ocp.MotionPhases`,
            with arguments of the same names: see `geodesic_ocp.ocp.solve_motion.solve_motion`.
        grid: grid of the nodes; the solution has this grid. None: the problem's own, refined where
            conditions are violated between the nodes by more than 1e-4, each in its scale: about
            how much its value changes over the size of the problem (docs/how-to/problem.md).
        guess: path or solution to start from, on any grid, alone; by default the problem's guess,
            or the straight line. A solution is a warm start. From a path that meets the conditions,
            such as `Path.through(metric, waypoints)`, the search stays near it.
        tolerance: refine the grid until the conditions hold to this everywhere, each in its scale,
            and the relative error of the objective is estimated to be less;
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
    num_starts = as_integer("num_starts", num_starts, 1)
    if guess is not None and num_starts > 1:
        raise ValueError("num_starts: other guesses are found only where no guess is given")
    if not isinstance(grid, Grid | None):
        raise ValueError(f"grid must be a Grid, got {grid!r}")
    if not isinstance(ipopt, Mapping | None):
        raise ValueError(f"ipopt must be options of Ipopt by name, got {ipopt!r}")
    if isinstance(problem, MotionProblem | MotionPhases):
        if not isinstance(guess, MotionGuess | None):
            raise ValueError(f"guess must be a motion or a solution that is one, got {guess!r}")
        return solve_motion(
            problem,
            grid=grid,
            guess=guess,
            tolerance=tolerance,
            throw=throw,
            callback=callback,
            ipopt=ipopt,
            num_starts=num_starts,
        )
    if not isinstance(problem, Problem):
        raise ValueError(f"problem must be an instance of a Problem class, got {problem!r}")
    if getattr(problem, "metric", None) is None:
        raise ValueError(f"{type(problem).__name__} defines no metric")
    if not isinstance(guess, Path | Solution | None):
        raise ValueError(f"guess must be a Path or a Solution, got {guess!r}")
    definition = problem.definition()
    definition = replace(definition, guess=_remembered(definition.guess))
    conditions = definition.conditions
    if guess is not None:
        path = guess.path if isinstance(guess, Solution) else guess
        if path.metric.dim != definition.metric.dim:
            raise ValueError(
                f"guess has {path.metric.dim} coordinates, the problem {definition.metric.dim}"
            )
    if conditions.via and num_starts > 1:
        raise ValueError("num_starts: problems with via points are solved from one guess")
    if tolerance is not None:
        tolerance = as_positive("tolerance", tolerance)
        _check_refinable(conditions)
    settings = dict(ipopt or {})
    are_many = conditions.are_many
    tight = LOOSE if are_many and tolerance is None else _ipopt_tolerance(tolerance)
    is_bounded = are_many and num_starts == 1
    tolerances = tight, tolerance
    first = _first_grid(definition, grid)
    solver = Solver(problem, definition, conditions, settings, callback, *tolerances, is_bounded)
    try:
        start = definition.initial_path(first, None) if guess is None else path
        definition = measured(definition, start)
        solver = replace(solver, definition=definition, conditions=definition.conditions)
        search = _Search(solver, grid, tolerance)
        if guess is not None or conditions.via:
            solution = search.finish(search.begin(guess), guess, ())
        else:
            solution = _best_of(search, Guesses(definition, first), num_starts)
    except NotConverged as error:  # inverse kinematics, for the problem's own guess
        if throw:
            raise
        straight = replace(definition, guess=lambda s: None)
        last = replace(solver, definition=straight, ipopt={**settings, "max_iter": 0})(first, None)
        return replace(last, stats=replace(last.stats, success=False, status=str(error)))
    if throw and not solution.stats.success:
        raise NotConverged(describe_failure(solution), solution)
    return solution


def _first_grid(definition: ProblemDefinition, grid: Grid | None) -> Grid:
    """Return the grid of the first solve from a guess of the problem's own: a given one, or one of
    half the segments of the problem's own, if these are many and equal.
    """
    own = definition.grid if grid is None else grid
    if grid is not None or own.segments < _MANY or own.ends:
        return own
    return Grid(own.segments // 2, own.degree)


def _remembered(guess: Callable[[Array], Array | None]) -> Callable[[Array], Array | None]:
    """Return a guess that is computed once on every grid, as inverse kinematics may be slow."""
    memory: dict[bytes, Array | None] = {}

    def remembered(s: Array) -> Array | None:
        if (key := s.tobytes()) not in memory:
            memory[key] = guess(s)
        return memory[key]

    return remembered


_ATTEMPTS = 6  # guesses, if none leads to a solution
# Violation between nodes of first solutions that go around obstacles: others may jump through them.
_AROUND = 3e-2
_CLOSE = 1.4  # ratio of lengths of a path and its solution, up to which that is near


def _best_of(search: _Search, guesses: Guesses, num_starts: int) -> Solution:
    """Return the best of the solutions from so many guesses; if there is none, the last iterate
    from the problem's guess.

    Of one guess, which is clear of obstacles; otherwise of two on the first grid, those on which
    the path goes around obstacles first, the planner's last; of one, if the second is a deformation
    of the first.
    """
    found: list[Solution] = []
    failed: list[Solution] = []
    waiting: list[tuple[Solution, Path | None]] = []
    attempts = Attempts()

    def finish(one: tuple[Solution, Path | None]) -> bool:
        """Return whether the search is over."""
        first, path = one
        waiting.remove(one)
        solution = _named(search.finish(first, path, found), first.stats.guess)
        (found if solution.stats.success else failed).append(solution)
        return search.solver.was_ended(solution) or len(found) >= num_starts or is_spent()

    def is_spent() -> bool:
        return num_starts == 1 and search.solver.effort.iterations > MOST_ITERATIONS

    def around() -> list[tuple[Solution, Path | None]]:
        return sorted(
            (one for one in waiting if _goes_around(one[0])), key=lambda one: one[0].stats.objective
        )

    def over() -> bool:
        several = num_starts > 1
        simple = guesses.simple(several, attempts)
        further = guesses.further(several, attempts)
        last = guesses.last(attempts)
        for enough, stage in ((2, simple), (1, further), (1, simple), (1, further), (1, last)):
            for name, path in stage:
                if not several and any(_leads_to(one, path, guesses) for one in around()):
                    break
                first = _named(search.begin(path), name)
                waiting.append((first, path))
                is_clear = not name and len(waiting) + len(failed) == 1 and not guesses.second
                wanted = num_starts if several else 1 if is_clear else enough
                tried = len(waiting) + len(failed) + len(found)
                if search.solver.was_ended(first):
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
    is_ended = bool(failed) and search.solver.was_ended(failed[-1])
    if is_ended and failed[-1].stats.status == STOPPED:
        return failed[-1]
    if found:
        return min(found, key=lambda each: each.stats.objective)
    last = failed[-1] if is_ended else min(failed, key=lambda each: each.stats.guess != "")
    if is_ended:
        end = ", which ended the search"
    elif is_spent():
        end = f", and {MOST_ITERATIONS} iterations in all ended the search"
    else:
        end = ""
    tried = f" (tried: {', '.join(attempts.names)})" if len(attempts.names) > 1 else ""
    return replace(last, stats=replace(last.stats, status=f"{last.stats.status}{end}{tried}"))


def _named(solution: Solution, name: str) -> Solution:
    return replace(solution, stats=replace(solution.stats, guess=name))


def _goes_around(first: Solution) -> bool:
    violation = first.stats.max_path_violation if first.conditions.along_q else 0.0
    return first.stats.success and violation <= _AROUND


def _leads_to(one: tuple[Solution, Path | None], path: Path | None, guesses: Guesses) -> bool:
    """Return whether a path leads to the solution of another one: it deforms into that clear of
    obstacles, and that is not far from its solution.
    """
    solution, other = one
    if path is None or other is None or other.length > _CLOSE * solution.path.length:
        return False
    return guesses.deform(path, other)


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
    return TIGHT if tolerance is None else float(np.clip(tolerance / 10.0, TIGHT, MODERATE))


@dataclass(eq=False)
class _Search:
    """From guesses to solutions, on the problem's own grid, on a given one, or to a tolerance.

    It remembers the grids of the last guesses. On half the segments Ipopt takes as many iterations,
    at half the cost, and few from there.
    """

    solver: Solver
    grid: Grid | None
    tolerance: float | None

    def __post_init__(self) -> None:
        self._grids = lru_cache(_ATTEMPTS)(self._grids_of)

    def begin(self, guess: Path | Solution | None) -> Solution:
        """Return the solution on the first grid; from a path on a finer one where it would jump
        through obstacles, from which refinement leads nowhere.
        """
        first, own = self._grids(guess)
        solver = self.solver if first is own else replace(self.solver, tolerance=LOOSE)
        solution = solver.solve_from(first, guess)
        conditions = self.solver.conditions
        may_jump = conditions.along_q and not conditions.via and self.grid is None
        if not may_jump or not isinstance(guess, Path):
            return solution
        fails = not solution.stats.success or solution.stats.max_path_violation > FEASIBLE
        if fails and (found := self.solver.descend(own, guess)) is not None:
            return with_effort_of(solution.stats, found)
        while solution.stats.max_path_violation > FEASIBLE:
            first = own if first is not own else halved(own, np.ones(own.segments, dtype=bool))
            if not solution.stats.success or first.segments > _MOST_SEGMENTS:
                break
            own = first
            before = solution
            kept = before.iterate.nlp.conditions.kept
            solution = with_effort_of(before.stats, self.solver(first, guess, kept))
        return solution

    def _grids_of(self, guess: Path | Solution | None) -> tuple[Grid, Grid]:
        """Return the first grid, and the one that the solution has at least."""
        if self.grid is not None:
            return self.grid, self.grid
        own = self.solver.definition.grid
        conditions = self.solver.conditions
        half = own if isinstance(guess, Solution) else _first_grid(self.solver.definition, None)
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
        is_coarse = first.path.grid.segments < own.segments
        anew = True
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
