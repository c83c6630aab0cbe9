"""Refinement of the grid until the conditions hold to a tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from known_metrics import Sphere
from known_problems import PlaneAroundDisc

import geodesic_ocp as go
from geodesic_ocp.ocp import refinement
from geodesic_ocp.ocp.problem import parse_conditions
from geodesic_ocp.ocp.refinement import refine
from geodesic_ocp.ocp.violations import PathSamples


@pytest.mark.parametrize("tolerance", [1e-3, pytest.param(1e-7, marks=pytest.mark.slow)])
def test_path_around_a_disc_to_several_tolerances(tolerance: float) -> None:
    solution = go.solve(PlaneAroundDisc(), tolerance=tolerance)
    stats = solution.stats
    assert stats.max_path_violation <= tolerance
    assert solution.path.length == pytest.approx(PlaneAroundDisc().exact_length, rel=tolerance)
    s = np.linspace(0.0, 1.0, 5001)
    inside = 0.5 - np.linalg.norm(solution.path(s), axis=1)
    assert inside.max() <= 1.1 * tolerance  # also between the checked points
    assert stats.mesh_history[-1].max_path_violation == stats.max_path_violation
    assert stats.mesh_history[0].segments == 8  # half of those of the default grid


def test_one_grid_is_enough_where_the_error_of_its_objective_is_known() -> None:
    arm = go.human_arm()
    reach = go.Reach(arm, [0.3, 0.0, -0.4, 0.9, 0.0, 0.0, 0.0], position=(0.10, 0.45, -0.05))
    one, best = (go.solve(reach, tolerance=tolerance) for tolerance in (1e-6, 1e-9))
    assert len(one.stats.mesh_history) == 1 < len(best.stats.mesh_history)
    assert one.stats.objective == pytest.approx(best.stats.objective, rel=1e-6, abs=0.0)
    assert 0.0 < one.stats.gap < 1e-6 * one.stats.objective


class Wavy(go.Metric):
    """A line whose metric has many waves: nodes of a coarse grid all lie at the same phase."""

    dim = 1

    def __init__(self, waves: int) -> None:
        self.waves = waves

    def matrix(self, q: ca.SX) -> ca.SX:
        return 1.0 + 0.5 * ca.cos(2.0 * np.pi * self.waves * q)


@dataclass(frozen=True)
class AlongLine(go.Problem):
    waves: int = 8
    farthest: float = 10.0

    @property
    def metric(self) -> go.Metric:
        return Wavy(self.waves)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, [0.0]), (q1, [1.0])]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(-self.farthest, q, self.farthest)]


@pytest.mark.parametrize("waves", [8, 16, 32])
@pytest.mark.parametrize("farthest", [10.0, np.inf])
@pytest.mark.parametrize(("tolerance", "error"), [(None, 1e-2), (1e-3, 1e-3)])
def test_energy_is_right_where_a_coarse_grid_does_not_resolve_the_metric(
    waves: int, farthest: float, tolerance: float | None, error: float
) -> None:
    s = (np.arange(4096) + 0.5) / 4096.0
    exact = np.mean(np.sqrt(1.0 + 0.5 * np.cos(2.0 * np.pi * s))) ** 2 / 2.0
    solution = go.solve(AlongLine(waves, farthest), tolerance=tolerance)
    assert solution.stats.objective == pytest.approx(exact, rel=error, abs=0.0)


def test_error_of_the_energy_counts_many_active_limits() -> None:
    arm = go.human_arm()
    start = np.array([0.3, 0.0, -0.4, 0.9, 0.0, 0.0, 0.0])
    end = np.array([1.0, -0.4, 0.1, 1.5, -0.5, 0.3, 0.2])
    speed = tuple(1.2 * np.abs(end - start) + 0.01)
    problem = go.PointToPoint(go.KineticEnergy(arm), start, end, speed=speed)
    solution = go.solve(problem, tolerance=1e-5)
    assert solution.stats.gap <= 1e-5 * solution.stats.objective
    better = go.solve(problem, guess=solution, tolerance=1e-6)
    assert solution.stats.objective == pytest.approx(better.stats.objective, rel=1e-5, abs=0.0)


def test_tolerance_is_met_where_all_limits_are_one_sided_and_many_active(arm: go.Model) -> None:
    @dataclass(frozen=True, eq=False)
    class Above(go.Problem):
        start: tuple[float, ...] = (1.85, 0.19, -0.57, 0.82, 0.77, -0.29, 0.73)
        end: tuple[float, ...] = (1.85, 0.19, -0.48, 1.96, 0.64, -0.36, -0.43)

        @property
        def metric(self) -> go.Metric:
            return go.KineticEnergy(arm)

        def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
            return [(q0, self.start), (q1, self.end)]

        def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
            return [(np.minimum(self.start, self.end) - 1e-3, q, np.inf)]

    solution = go.solve(Above(), tolerance=1e-6)
    active = np.abs(solution.multipliers["constraints[0]"]) > 1e-4
    assert np.mean(active) > 0.2
    assert solution.stats.gap < 1e-6 * solution.stats.objective


class OneHeavyCoordinate(go.Metric):
    dim = 4

    def matrix(self, q: ca.SX) -> ca.SX:
        return ca.SX(ca.diag(ca.DM([1.0, 1e-6, 1e-6, 1e-6])))


@pytest.mark.slow
def test_error_of_the_energy_counts_limits_that_hold_light_coordinates() -> None:
    """They have no multipliers, and end far from their bounds, compared with Ipopt's barrier."""

    class ByLimits(go.Problem):
        metric = OneHeavyCoordinate()

        def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
            return [(q0, [0.0] * 4), (q1, [1.0, 0.0, 0.0, 0.0])]

        def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
            return [(0.0, q[1:], np.inf)]

        def guess(self, s: np.ndarray) -> np.ndarray:
            bent = s + 5.0 * np.sin(2.0 * np.pi * s)
            return np.column_stack([bent, *[0.5 * np.sin(np.pi * s)] * 3])

    for tolerance in (1e-4, 1e-6):
        solution = go.solve(ByLimits(), tolerance=tolerance)
        assert solution.stats.objective == pytest.approx(0.5, rel=tolerance, abs=0.0)


@pytest.mark.slow
def test_grid_is_finest_where_the_constraint_becomes_active() -> None:
    solution = go.solve(PlaneAroundDisc(), tolerance=1e-7)
    widths, ends = solution.path.grid.widths, solution.path.breakpoints
    assert solution.path.grid.segments < 40
    # The tangent points are (-+1/4, sqrt(3)/4): sqrt(3)/2 from the start and from the end.
    length = PlaneAroundDisc().exact_length
    for contact in (np.sqrt(0.75) / length, 1.0 - np.sqrt(0.75) / length):
        finest = int(np.argmin(np.where(np.abs(ends[:-1] - contact) < 0.1, widths, np.inf)))
        assert widths[finest] < widths.max() / 8.0
        assert abs(ends[finest] - contact) < 0.02


@dataclass(frozen=True)
class Limited(go.Problem):
    """The arm is raised; the geodesic would exceed a limit of the wrist."""

    model: go.Model

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.model)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        raised = [1.4, 0.2, -0.6, 0.3, 0.0, 0.0, 0.0]
        return [(q0, [-0.3, 0.0, -0.6, 0.3, 0.0, 0.0, 0.0]), (q1, raised)]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(self.model.lower, q, self.model.upper, "limits")]


@pytest.mark.slow
def test_joint_limits_hold_between_the_nodes(arm: go.Model) -> None:
    with pytest.raises(go.NotConverged, match=r"between them.*joint .* limit .* rad by") as failure:
        go.solve(Limited(arm), grid=go.Grid(16, 4))
    coarse = failure.value.solution
    assert coarse.stats.max_path_violation > 1e-4
    solution = go.solve(Limited(arm), tolerance=1e-6, guess=coarse)
    q = solution.path(np.linspace(0.0, 1.0, 5001))
    assert np.all(q >= arm.lower - 1.1e-6)
    assert np.all(q <= arm.upper + 1.1e-6)
    assert solution.path.energy == pytest.approx(coarse.path.energy, rel=1e-3)
    assert solution.certificate.locally_shortest


def test_smooth_path_is_refined_until_its_energy_converges() -> None:
    problem = go.PointToPoint(Sphere(), (0.4, 0.0), (0.5, 2.5))
    solution = go.solve(problem, grid=go.Grid(1, 4), tolerance=1e-9)
    assert solution.path.length == pytest.approx(
        go.distance(Sphere(), problem.q0, problem.q1), rel=1e-9
    )
    assert solution.stats.mesh_history[-1].segments > 1


@pytest.mark.slow
def test_unattainable_tolerance_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refinement, "_MAX_SEGMENTS", 60)
    with pytest.raises(
        go.NotConverged, match=r"PlaneAroundDisc was not solved: not solved to 1e-13"
    ) as info:
        go.solve(PlaneAroundDisc(), tolerance=1e-13)
    assert len(info.value.solution.stats.mesh_history) > 2


def test_refinement_stops_at_wrong_tolerances_and_failures() -> None:
    with pytest.raises(ValueError, match="tolerance must be positive"):
        go.solve(PlaneAroundDisc(), tolerance=0.0)
    with pytest.raises(ValueError, match="grid must be a Grid, got 8"):
        go.solve(PlaneAroundDisc(), grid=8)  # type: ignore[call-overload]
    with pytest.raises(ValueError, match="guess must be a Path or a Solution"):
        go.solve(PlaneAroundDisc(), guess=np.zeros((3, 2)))  # type: ignore[call-overload]
    sphere = go.PointToPoint(Sphere(), (0.4, 0.0), (0.5, 2.5))
    record = go.solve(sphere, tolerance=1e-6, throw=False, ipopt={"max_iter": 1})
    assert not record.stats.success
    assert record.stats.iterations == 1


@pytest.mark.slow
def test_low_degree_gives_the_guess_where_high_degrees_fail() -> None:
    """Finer grids fail here until polynomials of degree two have been tried."""
    problem, seen = PlaneAroundDisc(), []

    def solve_on(grid: go.Grid, guess: go.Path | go.ocp.Solution | None) -> go.ocp.Solution:
        near = isinstance(guess, go.ocp.Solution)
        path = guess.path if isinstance(guess, go.ocp.Solution) else guess
        solution = go.solve(problem, grid=grid, guess=path)
        seen.append((grid.degree, guess is None, near))
        failed = near and all(degree > 2 for degree, _, _ in seen)
        return replace(solution, stats=replace(solution.stats, success=not failed))

    samples = PathSamples(parse_conditions(problem))
    found = refine(solve_on, samples, solve_on(go.Grid(8, 4), None), 1e-5, None)
    assert found.stats.success
    assert found.stats.max_path_violation <= 1e-5
    assert seen[:4] == [(4, True, False), (4, False, True), (2, True, False), (4, False, False)]
    assert all(near for _, _, near in seen[4:])
    first, _, low_degree, again = [each.segments for each in found.stats.mesh_history[:4]]
    assert (first, low_degree, again) == (8, 32, 16)


@pytest.mark.slow
def test_reach_whose_coarse_solution_jumps_between_nodes() -> None:
    """Near the extended elbow a coarse grid has solutions that no continuous path resembles."""
    arm, rng = go.human_arm(), np.random.default_rng(5)
    for _ in range(18):
        start, end = rng.uniform(arm.lower, arm.upper, (2, 7))
    reach = go.Reach(arm, start, arm.hand_pose(end)[1])
    solution = go.solve(reach, tolerance=1e-6)
    assert solution.stats.max_path_violation <= 1e-6
    # On the first grid the objective is 0.6488, and the path through its nodes costs 0.7512.
    assert solution.path.energy == pytest.approx(0.56081265, rel=1e-5)


@pytest.mark.slow
def test_narrow_violations_between_nodes_are_found() -> None:
    """With four check points per node, this reach exceeded a limit by 3e-5."""
    arm, rng = go.human_arm(), np.random.default_rng(5)
    for _ in range(9):
        start, end = rng.uniform(arm.lower, arm.upper, (2, 7))
    path = go.solve(go.Reach(arm, start, arm.hand_pose(end)[1]), tolerance=1e-6).path
    q = path(np.linspace(0.0, 1.0, 20_001))
    assert np.max([arm.lower - q, q - arm.upper]) <= 1.05e-6


@pytest.mark.slow
def test_speed_limit_holds_between_the_nodes_by_default() -> None:
    """On 16 segments the speed would exceed its limit between the nodes by more than 1e-3."""
    problem = go.PointToPoint(Sphere(), (0.25, 0.0), (0.25, 2.7), speed=2.9)
    solution = go.solve(problem)
    assert 0.0 < solution.stats.max_path_violation <= 1e-4
    assert np.abs(solution.path(np.linspace(0.0, 1.0, 5001), 1)).max() <= 2.9 + 1.1e-4
    first, *_, last = solution.stats.mesh_history
    assert first.segments == 16
    assert first.max_path_violation > 1e-3
    assert last.segments == solution.path.grid.segments > 16
    assert solution.stats.total_iterations > solution.stats.iterations


def test_own_grid_is_kept_and_violations_between_its_nodes_are_no_solution() -> None:
    problem = go.PointToPoint(Sphere(), (0.25, 0.0), (0.25, 2.7), speed=2.9)
    message = (
        r"meets its conditions at the nodes, but not between them; leave grid out, or set tolerance"
        r".* exceeds 2.9 by 0\.\d+ at s = 0\.\d\d \(condition 'speed'\)"
    )
    with pytest.raises(go.NotConverged, match=message) as failure:
        go.solve(problem, grid=go.Grid(6, 4))
    solution = failure.value.solution
    assert solution.path.grid == go.Grid(6, 4)
    assert solution.stats.mesh_history == ()
    assert solution.stats.max_path_violation > 1e-4
    assert not solution.certificate.stationary


def test_limits_that_hold_need_no_finer_grid_and_no_warning() -> None:
    problem = go.PointToPoint(Sphere(), (1.0, 0.0), (1.0, 0.3), speed=2.9)
    for grid in (None, go.Grid(8, 4)):
        assert go.solve(problem, grid=grid).stats.mesh_history == ()


@dataclass(frozen=True)
class Wall(go.Problem):
    """In the plane from one side of a wall without a gap to the other: there is no path."""

    thickness: float = 0.2
    metric: go.Metric = field(default_factory=lambda: go.Euclidean(2))

    def boundary(self, q0: Any, q1: Any) -> Any:
        return [(q0, (0.0, 0.0)), (q1, (1.0, 0.3))]

    def constraints(self, q: Any, v: Any) -> Any:
        return [((self.thickness / 2.0) ** 2, (q[0] - 0.5) ** 2, np.inf, "wall")]


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"grid": go.Grid(8, 4)}])
def test_paths_through_an_obstacle_are_no_solutions(options: Any) -> None:
    with pytest.raises(go.NotConverged) as failure:
        go.solve(Wall(), **options)
    solution = failure.value.solution
    assert not solution.stats.success
    assert not solution.certificate.stationary
    with pytest.raises(go.NotConverged):
        solution.to_motion(1.0)


def test_multipliers_are_carried_to_another_grid() -> None:
    """A fine grid takes fewer iterations from the solution on a coarse one than from its path."""
    problem, fine = PlaneAroundDisc(), go.Grid(32, 3)
    coarse = go.solve(problem, grid=go.Grid(16, 3))
    carried = go.solve(problem, grid=fine, guess=coarse)
    plain = go.solve(problem, grid=fine, guess=coarse.path)
    assert carried.stats.objective == pytest.approx(plain.stats.objective, rel=1e-9)
    assert carried.stats.iterations < 0.7 * plain.stats.iterations
