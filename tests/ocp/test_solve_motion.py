"""Motions by every argument of solve: guesses, grids, free durations, phases, files."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.ocp.motion_solution import MotionSolution

LINE = go.Euclidean(1)


@dataclass(frozen=True)
class Pendulum(go.MotionProblem):
    """From hanging at rest to upright at rest with the least squared torque."""

    limit: float = 6.0  # [N m]
    metric: go.Metric = LINE
    duration: float = 3.0  # [s]

    def torque(self, q: ca.SX, v: ca.SX, a: ca.SX) -> Any:
        return 0.25 * a + 4.905 * ca.sin(q)

    def cost(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
        return torque[0] ** 2

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
        return [(q0, 0.0), (q1, np.pi, "upright"), (v0, 0.0), (v1, 0.0)]

    def constraints(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Sequence[Any]:
        return [(-self.limit, torque, self.limit, "torque")]


@dataclass(frozen=True)
class Slide(go.MotionProblem):
    """Of a mass from rest to rest."""

    duration: float | tuple[float, float] = 1.0
    start: float | None = 0.0
    end: float | None = 1.0
    mass: float = 1.0
    limit: float = np.inf
    price: float = 0.0  # of a second
    effort: float = 1.0
    metric: go.Metric = LINE

    def torque(self, q: ca.SX, v: ca.SX, a: ca.SX) -> Any:
        return self.mass * a

    def cost(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
        return self.price + self.effort * torque[0] ** 2

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
        first = [] if self.start is None else [(q0, self.start, "start"), (v0, 0.0)]
        last = [] if self.end is None else [(q1, self.end, "end"), (v1, 0.0)]
        return [*first, *last]

    def constraints(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Sequence[Any]:
        return [(-self.limit, a, self.limit, "acceleration")] if np.isfinite(self.limit) else []


@dataclass(frozen=True)
class Change(go.ocp.MotionPhases):
    """A slide whose mass changes on the way."""

    durations: tuple[Any, Any] = (1.0, 1.0)
    masses: tuple[float, float] = (1.0, 1.0)
    price: float = 0.0

    @property
    def phases(self) -> Sequence[go.MotionProblem]:
        first = Slide(self.durations[0], end=None, mass=self.masses[0], price=self.price)
        return first, replace(first, start=None, end=1.0, duration=self.durations[1])


LIMITS = [
    pytest.param(limit, marks=[] if limit in (3.0, 2.05) else [pytest.mark.slow])
    for limit in (6.0, 4.0, 3.0, 2.5, 2.1, 2.05, 2.0)
]


@pytest.mark.parametrize("limit", LIMITS)
def test_the_pendulum_finds_the_swing_that_needs_the_least_torque(limit: float) -> None:
    """It needs 1.968 N m, so that no limit changes it."""
    found = go.solve(Pendulum(limit))
    assert found.objective == pytest.approx(4.3429, abs=2e-4)
    assert np.abs(found.torques(np.linspace(0.0, 3.0, 301))).max() == pytest.approx(1.968, abs=1e-3)
    assert found.certificate.locally_minimizing
    assert len(found.attempts) >= 2
    assert min(each.objective for each in found.attempts if each.success) == found.objective


@pytest.fixture(scope="module")
def swing() -> MotionSolution:
    return go.solve(Pendulum(2.5))


@pytest.mark.parametrize("form", ["solution", "motion", "longer motion"])
def test_guesses_are_motions_of_any_duration(swing: MotionSolution, form: str) -> None:
    """A smaller limit is met near the guess, the only one."""
    guess: Any = swing if form == "solution" else swing.to_motion()
    if form == "longer motion":
        guess = go.Motion(2.0 * guess.time, guess.q, guess.joint_names)
    found = go.solve(Pendulum(1.95), guess=guess)
    assert found.objective == pytest.approx(4.3429, abs=3e-4)
    assert [each.guess for each in found.attempts] == [""]


def test_of_several_starts_the_best_is_returned() -> None:
    found = go.solve(Pendulum(3.0), num_starts=4)
    assert len(found.attempts) == 4
    assert found.objective == min(each.objective for each in found.attempts)


def test_a_given_grid_and_tolerance_are_those_of_the_solution() -> None:
    found = go.solve(Pendulum(), grid=go.Grid(12, 6), guess=None)
    assert len(found.times) == 13
    assert found.numbers.degree == 6
    fine = go.solve(Pendulum(2.5), tolerance=1e-6)
    assert fine.stats.max_path_violation <= 1e-6
    with pytest.raises(ValueError, match="polynomials of degree 5 and more"):
        go.solve(Pendulum(), grid=go.Grid(4, 4))


def test_the_callback_sees_motions_and_stops() -> None:
    seen: list[Any] = []

    def callback(iterate: Any) -> bool:
        seen.append(iterate)
        return len(seen) == 4

    with pytest.raises(go.NotConverged, match="the callback stopped Ipopt") as caught:
        go.solve(Pendulum(), callback=callback)
    assert [each.number for each in seen] == [0, 1, 2, 3]
    assert seen[-1].path(1.5).shape == (1,)
    assert caught.value.solution.stats.iterations == 3
    limited = go.solve(Pendulum(), ipopt={"max_iter": 2}, throw=False)
    assert "iteration limit" in limited.stats.status
    assert len(limited.attempts) == 1


def test_multipliers_are_derivatives_of_the_least_cost() -> None:
    """Of the cost 12 d^2 / T^3 by the distance d, with Ipopt's sign."""
    found = go.solve(Slide())
    assert found.objective == pytest.approx(12.0, rel=1e-9)
    assert found.multipliers["end"] == pytest.approx([-24.0], rel=1e-6)
    grid = go.Grid(16, 7)
    limited = go.solve(Slide(limit=5.0), grid=grid)
    along = limited.multipliers["acceleration"]
    assert len(along) == len(limited.multiplier_times["acceleration"])
    assert limited.certificate.active == ("acceleration",)
    more = go.solve(Slide(limit=5.0 + 1e-3), grid=grid)
    # One multiplier for each bound, of either sign.
    slope = (more.objective - limited.objective) / 1e-3
    assert -np.abs(along).sum() == pytest.approx(slope, rel=0.02)


@pytest.mark.parametrize("accelerations", [1.0, 4.0])
def test_the_least_time_is_that_of_full_acceleration_and_braking(accelerations: float) -> None:
    found = go.solve(Slide((0.1, 9.0), limit=accelerations, price=1.0, effort=0.0))
    assert found.duration == pytest.approx(2.0 / np.sqrt(accelerations), rel=1e-4)
    assert found.objective == pytest.approx(found.duration, rel=1e-9)


def test_a_free_duration_weighs_time_against_effort() -> None:
    """p T + 12 / T^3 is least at T^4 = 36 / p."""
    found = go.solve(Slide((0.2, 20.0), price=0.5))
    assert found.duration == pytest.approx(72.0**0.25, rel=1e-6)
    bounded = go.solve(Slide((0.2, 2.0), price=0.5))
    assert bounded.duration == pytest.approx(2.0, abs=1e-6)
    assert bounded.certificate.locally_minimizing


def test_phases_join_to_one_motion() -> None:
    """Two halves of one slide are that slide; times that are free are shared as is best."""
    whole = go.solve(Slide(2.0))
    halves = go.solve(Change())
    t = np.linspace(0.0, 2.0, 21)
    np.testing.assert_allclose(halves(t), whole(t), atol=1e-9)
    assert halves.objective == pytest.approx(whole.objective, rel=1e-9)
    free = go.solve(Change(((0.2, 9.0), (0.2, 9.0)), price=0.5))
    assert free.durations.sum() == pytest.approx(72.0**0.25, rel=1e-5)
    names = free.multipliers.keys()
    assert {"phase 0: start", "phase 1: end", "join of phases 0 and 1: velocity"} <= set(names)


def test_a_periodic_motion_is_an_equality_of_its_ends() -> None:
    """Through 1 at half the period, 0 at the ends, whose velocity is free: two cubics."""

    class Periodic(Slide):
        def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
            return [(q0, 0.0), (q1 - q0, 0.0), (v1 - v0, 0.0, "period")]

        def via(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
            return [(1.0, [(q, 1.0)])]

    found = go.solve(Periodic(2.0))
    t = np.array([0.25, 0.5])
    np.testing.assert_allclose(found(t)[:, 0], 3.0 * t**2 - 2.0 * t**3, atol=1e-8)


def test_an_impact_is_a_join_of_its_own() -> None:
    """A mass that takes on another one keeps its momentum, not its velocity."""

    class Impact(Change):
        def join(self, number: int, q0: ca.SX, v0: ca.SX, q1: ca.SX, v1: ca.SX) -> Sequence[Any]:
            return [(q1 - q0, 0.0), (3.0 * v1 - v0, 0.0, "momentum")]

    found = go.solve(Impact(masses=(1.0, 3.0)))
    before, after = found([1.0 - 1e-9, 1.0], 1)[:, 0]
    assert after == pytest.approx(before / 3.0, abs=1e-6)
    assert found.stats.success


class CartPole(go.Metric):
    """Of a cart of 1 kg with a pole, a point of 0.3 kg at 0.5 m."""

    dim = 2

    def matrix(self, q: ca.SX) -> ca.SX:
        mixed = 0.15 * ca.cos(q[1])
        return ca.vertcat(ca.horzcat(1.3, mixed), ca.horzcat(mixed, 0.075))


@dataclass(frozen=True)
class SwingUp(go.MotionProblem):
    """Of a cart's pole, Kelly (2017), SIAM Review 59, section 6."""

    duration: float = 2.0

    @property
    def metric(self) -> go.Metric:
        return CartPole()

    def torque(self, q: ca.SX, v: ca.SX, a: ca.SX) -> Any:
        return super().torque(q, v, a) + ca.vertcat(0.0, 0.15 * 9.81 * ca.sin(q[1]))

    def cost(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
        return torque[0] ** 2

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
        return [(q0, 0.0), (q1, [1.0, np.pi]), (v0, 0.0), (v1, 0.0)]

    def constraints(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Sequence[Any]:
        bounds = [(-20.0, torque[0], 20.0, "force"), (-2.0, q[0], 2.0, "track")]
        return [(0.0, torque[1], 0.0, "passive joint"), *bounds]


@pytest.mark.slow
def test_a_passive_joint_is_an_equality_along_the_motion() -> None:
    found = go.solve(SwingUp())
    assert found.objective == pytest.approx(58.81, abs=0.02)
    assert np.abs(found.torques(np.linspace(0.0, 2.0, 401))[:, 1]).max() < 1e-3
    assert found.certificate.locally_minimizing
    assert found.certificate.active == ("passive joint",)


def test_solutions_are_saved_read_and_pickled(tmp_path: Path, swing: MotionSolution) -> None:
    again = go.ocp.load_solution(swing.save(tmp_path / "swing.json"), Pendulum(2.5))
    for each in (again, pickle.loads(pickle.dumps(swing))):
        assert each.stats == swing.stats
        assert each.attempts == swing.attempts
        np.testing.assert_array_equal(each.resample(7), swing.resample(7))
        assert each.multipliers["upright"] == pytest.approx(swing.multipliers["upright"])
        assert each.certificate == swing.certificate
    with pytest.raises(go.RecordingError, match="has a solution of Pendulum, not of Slide"):
        go.ocp.load_solution(tmp_path / "swing.json", Slide())


@pytest.mark.parametrize(
    ("problem", "options", "message"),
    [
        (Slide((2.0, 1.0)), {}, "the shortest and the longest one, got"),
        (Slide((0.0, 1.0)), {}, "the shortest and the longest one, got"),
        (Slide(), {"guess": 3.0}, "guess must be a motion"),
        (Slide(), {"guess": go.Motion([0.0, 1.0], np.zeros((2, 2)), ("a", "b"))}, "2 coordinates"),
        (Slide(), {"num_starts": 0}, "num_starts must be"),
        (Slide(), {"tolerance": -1.0}, "tolerance must be positive"),
        (type("None_", (Change,), {"phases": ()})(), {}, "has no phases"),
    ],
)
def test_wrong_arguments_are_named(problem: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.solve(problem, **options)
