"""One problem solved on one grid after the other, each time from a path or another solution."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import in_rounds
from geodesic_ocp.ipopt import LIMITS, NO_VALUE, NOT_FINITE, STOPPED, Ipopt, Outcome, Relay
from geodesic_ocp.ocp.callback import Callback, relay_paths
from geodesic_ocp.ocp.certificate import FinalIterate, descent_direction
from geodesic_ocp.ocp.conditions import Conditions
from geodesic_ocp.ocp.descent import descend, is_at_edge, still_moving
from geodesic_ocp.ocp.nlp import NLP, ProblemDefinition, build_nlp
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.ocp.refinement import halved, with_optimal_via_points
from geodesic_ocp.ocp.solution import Solution, Stats, with_effort_of
from geodesic_ocp.ocp.transcription import Transcription
from geodesic_ocp.ocp.violations import (
    MAY_CHANGE,
    Kept,
    joined,
    left_out,
    may_become_active,
    path_samples,
)
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

# With a free end, polynomials of a higher degree need an initial guess, solved on this grid.
_STIFF = 8
_COARSE = Grid(4, 4)
# Tolerances of Ipopt: of a guess for the next grid; of a path to a tolerance; of others.
LOOSE = 1e-6
MODERATE = 1e-7
TIGHT = 1e-10
_ROUGH = 1e-4  # of a step of a descent, at most
_SADDLE = "Ipopt found a stationary path, a saddle point: it is not locally minimizing"
# Largest displacement of a node, relative to the path's extent, by which a saddle point is left.
_STEP = 0.1
# A step may increase the energy only if it reduces the violation of the conditions by this
# fraction, without a second-order correction: otherwise one step can replace a good guess by a path
# of fifty times its energy, and the result depends on rounding.
_FILTER = {"gamma_theta": 0.9, "max_soc": 0}
# Programs are scaled, and small: preparing and checking the linear systems would take as long as
# solving them.
_SYSTEMS = {
    "mumps_permuting_scaling": 0,
    "mumps_scaling": 0,
    "min_refinement_steps": 0,
    "fast_step_computation": "yes",
}
# If the guess is nearly a solution, Ipopt must not push it far from its bounds.
_NEAR = {"bound_push": 1e-6, "bound_frac": 1e-6, "mu_init": 1e-4}
# From a path beside obstacles it stays on their side; on `_NEAR` it stops at the first optimum.
_BESIDE = {**_NEAR, "mu_init": 1e-3}
# Times as far as by a force at a free end a path may move, in the metric's softest direction; nodes
# at which that is computed.
_SOFT = 10.0
_SAMPLES = 8
FEASIBLE = 1e-2  # violation at the nodes of a path to stay near to
# Among many bodies, nodes of a solution move by at most this, in sizes of the problem, from one
# program to the next, `_GROWTH` times as far where they did, and less after a failure, from which
# it grows by `_AGAIN`: from a small barrier, Ipopt's first steps may lead far away, and through
# thin bodies.
_WITHIN = 0.02
_CLOSEST = 0.003
_FARTHEST = 0.1
_GROWTH = 3.0
_AGAIN = 1.5
_NEARBY = 0.03  # rows for such steps: bounds within this share of the range of a condition's values
_SMALL_BARRIER = 1e-6  # from a solution on a coarser grid among many bodies
_NEARLY_CLEAR = 3e-2  # violation along a path from which steps lead to a clear one
_STRAYS = 2  # solves from a path whose solutions jump through bodies, before other grids are tried
_FEW_ITERATIONS = 100  # of Ipopt, for one step of a descent
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

# Where new rows or nodes are violated by more than this, other conditions become active, which is
# slow from the smallest barrier.
# Above `_NEARLY`, the multipliers of the coarser grid no longer help.
_CHANGED = 1e-3
_MODERATE_BARRIER = 1e-5
_NEARLY = 5e-3

# Rounds at most in which conditions are added, and how many solves of these may fail.
_MOST_ROUNDS = 30
_FAILURES = 2
_Start: TypeAlias = tuple[ProblemDefinition, Path | Solution | None]
_Settings: TypeAlias = tuple[tuple[str, Any], ...]  # Ipopt's options, by name
# Iterations of Ipopt after which no other guess is tried, and among many bodies, where each takes
# long, no other program; where variables and rows are more than `_SIZE`, they count for more.
MOST_ITERATIONS = 2000
_MOST_AMONG_MANY = 3000
_SIZE = 2000


class Effort:
    """Record of the iterations of Ipopt that solves have taken, which count for more in programs
    with more than `_SIZE` variables and rows.
    """

    def __init__(self) -> None:
        self.iterations = 0

    def note(self, outcome: Outcome) -> None:
        """Add those of one solve."""
        size = (outcome.x.size + outcome.g.size) / _SIZE
        self.iterations += int(outcome.iterations * max(1.0, size))


@dataclass(frozen=True, eq=False)
class Solver:
    """A problem with everything that stays the same from one grid to the next."""

    problem: Problem
    definition: ProblemDefinition
    conditions: Conditions
    ipopt: Mapping[str, Any]
    callback: Callback | None
    tolerance: float
    path_tolerance: float | None = None
    is_bounded: bool = False  # whether all solves together end after `_MOST_AMONG_MANY`
    effort: Effort = field(default_factory=Effort)  # of all solves, also with other settings
    within: float = np.inf  # how far [rad or m] nodes may move from a guess

    def __call__(
        self,
        grid: Grid,
        guess: Path | Solution | None,
        known: Kept = MappingProxyType({}),
        stays: bool = False,
    ) -> Solution:
        """Return the solution or last iterate on a grid, from a path or another solution.

        Of many conditions, those far from their bounds are left out until a path violates them,
        unless they are known to count.

        Args:
            known: conditions that count.
            stays: whether the solution is searched near a path, too.
        """
        whole = self.definition.conditions
        if not whole.are_many:
            return self._solve_on(grid, guess)
        is_near = stays or isinstance(guess, Solution)
        given = guess.path if isinstance(guess, Solution) else guess
        path = self.definition.initial_path(grid, given)
        within = np.inf
        share = MAY_CHANGE
        size = self.definition.size
        growth = _GROWTH
        if is_near:
            within = _WITHIN * size
            share = _NEARBY
        first = self.definition.restricted(joined(known, may_become_active(whole, path, share)))

        last: Solution | None = None

        def solve(start: _Start) -> Solution:
            nonlocal last
            definition, guess = start
            found = replace(self, definition=definition, within=within)._solve_on(grid, guess)
            last = found if last is None else with_effort_of(last.stats, found)
            return last

        def examine(number: int, found: Solution) -> tuple[Solution, _Start | None]:
            nonlocal path, within, growth
            kept = found.iterate.nlp.conditions.kept
            is_held = is_at_edge(path, found.path, within)
            missing = left_out(whole, kept, found.path)
            failed = not found.stats.success
            is_closest = within <= _CLOSEST * size
            fails = failed and (is_closest if is_near else number >= _FAILURES)
            again = missing or is_held or (failed and is_near)
            if found.stats.status == STOPPED or fails or not again:
                return found, None
            strays = guess is not None and found.stats.max_path_violation > FEASIBLE
            if strays and (not (missing or failed) if is_near else number >= _STRAYS):
                return found, None
            if is_held and number + 1 == _MOST_ROUNDS:
                return still_moving(found), None
            near = {} if strays else may_become_active(whole, found.path, share)
            more = self.definition.restricted(joined(kept, missing, near))
            if strays or failed:
                within = within / _GROWTH
                growth = _AGAIN
                return found, (more, path if is_near else guess)
            path = found.path
            within *= growth if is_held and within < _FARTHEST * size else 1.0
            # Where it moves on, multipliers of the path before mislead Ipopt.
            return found, (more, path if is_held else found)

        return in_rounds((first, guess), solve, examine, _MOST_ROUNDS)

    def was_ended(self, solution: Solution) -> bool:
        """Return whether the user ended a solve, by the callback or a limit among the options."""
        limits = {LIMITS[name] for name in self.ipopt if name in LIMITS}
        return solution.stats.status == STOPPED or solution.stats.status in limits

    def descend(self, grid: Grid, guess: Path) -> Solution | None:
        """Return the solution from a path, by short steps and then on a grid of twice as many
        segments; None if there are few conditions, or the path is not nearly clear of them.
        """
        if not self.conditions.are_many:
            return None
        path = self.definition.initial_path(grid, guess)
        samples = path_samples(self.definition.conditions)
        if samples.excess(path, roughly=True)[1].max() > _NEARLY_CLEAR:
            return None

        def solve(nlp: NLP, within: float, tolerance: float) -> Solution:
            tolerance = float(np.clip(tolerance, LOOSE, _ROUGH))
            solver = replace(self, definition=nlp.definition, tolerance=tolerance, within=within)
            return solver._solve_nlp(nlp, {**_BESIDE, "max_iter": _FEW_ITERATIONS})

        path, last = descend(self.definition, solve, path)
        if last.stats.status == STOPPED:  # the path that far, in the program of its own conditions
            own = self.definition.restricted(may_become_active(self.definition.conditions, path))
            nlp = build_nlp(own, path.grid, path)
            alone = replace(self, callback=None, ipopt={})
            there = with_effort_of(last.stats, alone._solve_nlp(nlp, {"max_iter": 0}))
            return replace(there, stats=replace(there.stats, success=False, status=STOPPED))
        finer = halved(path.grid, np.ones(path.grid.segments, dtype=bool))
        return with_effort_of(last.stats, self(finer, path, stays=True))

    def _solve_on(self, grid: Grid, guess: Path | Solution | None) -> Solution:
        """Return the solution or last iterate under the conditions of this solver."""
        is_held = self.within < np.inf
        near = {**_NEAR, "max_iter": _FEW_ITERATIONS} if is_held else _NEAR
        if isinstance(guess, Solution):
            nlp = build_nlp(self.definition, grid, guess.path)
            if nlp.violation <= _NEARLY and (multipliers := _multipliers(nlp, guess)):
                warm = {**_NEAR, **_WARM_START}
                if is_held:
                    warm |= {"mu_init": _SMALL_BARRIER, "max_iter": _FEW_ITERATIONS}
                if nlp.violation > _CHANGED:
                    warm["mu_init"] = _MODERATE_BARRIER
                found = self._solve_nlp(nlp, warm, multipliers)
                if not (found.stats.success or found.stats.status == STOPPED or is_held):
                    found = with_effort_of(found.stats, self._solve_nlp(nlp, near))
            else:
                found = self._solve_nlp(nlp, near)
            return self._optimize_via(found)
        has_free_end = bool(self.definition.conditions.ends)
        if guess is None and has_free_end and grid.degree > _STIFF:
            return self._solve_from_coarse(grid)
        nlp = build_nlp(self.definition, grid, guess)
        if is_held:
            near = {**near, "mu_init": _MODERATE_BARRIER}
        else:
            near = _BESIDE if guess is not None and nlp.violation <= FEASIBLE else {}
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
            solution, lambda grid, start: self._solve_once(grid, start, _NEAR)
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
        given = {**_FILTER, **_SYSTEMS, "tol": self.tolerance, **usual}
        if (tolerance := self.path_tolerance) is not None:
            # The sum over all active bounds is an error of the objective, of coordinates one of two
            # at most; twice as exact for functions, as these are often active all along the path.
            finite = {key: np.isfinite(values[key]) for key in ("lbx", "ubx", "lbg", "ubg")}
            active = (finite["lbx"] | finite["ubx"]).sum() + finite["lbg"].sum()
            most = 0.7 * tolerance / max(1, active + finite["ubg"].sum())
            given["compl_inf_tol"] = 10.0 * most  # Ipopt's barrier ends at an eleventh of that
            given["bound_relax_factor"] = min(1e-8, 1e-2 * tolerance)  # at first 1e-8
            if given.get("mu_init") == _WARM_START["mu_init"]:
                given["mu_init"] = most
        given |= self.ipopt
        if is_spent := self.is_bounded and self.effort.iterations > _MOST_AMONG_MANY:
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
            outcome = _shared_ipopt(self.definition, shape, settings)(**values)
        else:
            outcome = _ipopt(nlp.transcription, settings)(**values)
        self.effort.note(outcome)
        if is_spent and not outcome.success:
            status = f"no solution was found in {_MOST_AMONG_MANY} iterations of Ipopt"
            outcome = replace(outcome, status=status)
        if outcome.status == NOT_FINITE and (names := nlp.not_finite()):
            status = f"already on the initial guess, {NO_VALUE}: {', '.join(names)}"
            outcome = replace(outcome, status=status)
        solution = _solution(self.problem, self.conditions, nlp, outcome, tolerance)
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
    old = before.iterate
    units = nlp.units
    before_g = old.lam_g / old.nlp.bounds.scales_g
    carried = nlp.bounds.carried(old.lam_bounds, before_g, old.nlp.bounds)
    if carried is None:
        return {}
    energies = old.nlp.units.scale / units.scale
    lengths = units.length / old.nlp.units.length
    lam_g = carried[1] * energies * nlp.bounds.scales_g
    return {"lam_x0": carried[0] * energies * lengths, "lam_g0": lam_g}


def _ipopt(transcription: Transcription, settings: _Settings, relay: Relay | None = None) -> Ipopt:
    return transcription.program.solver(dict(settings), relay)


@lru_cache(maxsize=32)
def _shared_ipopt(definition: ProblemDefinition, shape: Grid, settings: _Settings) -> Ipopt:
    """Return Ipopt for all problems with one key, on all grids of a shape (with equal segments)."""
    return _ipopt(definition.transcription(shape), settings)


def _solution(
    problem: Problem,
    conditions: Conditions,
    nlp: NLP,
    outcome: Outcome,
    tolerance: float | None,
) -> Solution:
    """Return the solution under all conditions of a problem, from an NLP with some of them."""
    bounds = nlp.bounds
    units = nlp.units
    iterate = FinalIterate(nlp, outcome.x, outcome.lam_x, outcome.lam_g)
    path = iterate.path
    violation, worst = bounds.worst(path.nodes, outcome.g)
    between = path_samples(conditions).excess(path)[1].max()
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
        max_path_violation=max(violation, float(between)),
        gap=units.scale * _gap(nlp, outcome, tolerance),
    )
    return Solution(problem, conditions, path, stats, iterate)


def _gap(nlp: NLP, outcome: Outcome, tolerance: float | None) -> float:
    """Return the sum of all bounds' multipliers times distances: the duality gap if the program is
    convex.

    Inactive bounds of coordinates are most of it, and hardly an error of the objective. If half the
    tolerance is exceeded, distances count up to how far the path would move without the forces of
    the bounds that are farther away.
    """
    bounds = nlp.bounds
    units = nlp.units
    ends = [units.scaled(each).ravel() for each in (bounds.lower, bounds.upper)]
    forces, distances = _at_bounds(outcome.x, outcome.lam_x, *ends)
    in_g = _at_bounds(outcome.g, outcome.lam_g, bounds.lower_g, bounds.upper_g)
    gap = float(forces @ distances + in_g[0] @ in_g[1])
    if tolerance is None or not outcome.success or not nlp.conditions.cost.is_zero():
        return gap
    if gap <= tolerance / 2.0 * abs(outcome.objective):
        return gap
    q = units.positions(outcome.x.reshape(nlp.nodes.shape))[:: max(1, len(nlp.nodes) // _SAMPLES)]
    softest = np.linalg.eigvalsh([nlp.definition.metric.matrix(each) for each in q]).min()
    order = np.argsort(-distances)
    far = distances[order]
    moves = np.cumsum(forces[order]) * (_SOFT * units.scale / units.length**2)
    if not softest > 0.0 or not (inactive := int(np.sum(moves < softest * far))):
        return gap
    farthest = max(moves[inactive - 1] / softest, np.append(far, 0.0)[inactive])
    return float(forces @ np.minimum(distances, farthest) + in_g[0] @ in_g[1])


def _at_bounds(values: Array, lam: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return sizes of the multipliers of finite bounds, and distances from these."""
    bound = np.where(lam > 0.0, upper, lower)
    some = np.isfinite(bound)
    return np.abs(lam[some]), np.abs((values - bound)[some])
