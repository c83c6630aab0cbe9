"""Guesses that `solve` finds by itself, and paths that it is given."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import geodesic_ocp as go
from geodesic_ocp.ocp import guesses
from geodesic_ocp.ocp.callback import Iterate

DISC = ((0.0, 0.1, 0.5),)
# A cup, open to the left, in which the start lies; the goal lies behind it.
CUP = tuple((0.8 * np.cos(angle), 0.8 * np.sin(angle), 0.2) for angle in np.linspace(-2.2, 2.2, 15))
RING = tuple(
    (2.0 + 0.6 * np.cos(angle), 0.6 * np.sin(angle), 0.2) for angle in np.linspace(-3.0, 3.0, 13)
)


@dataclass(frozen=True)
class AmongDiscs(go.Problem):
    """From a point of the plane to another, or to a line x = const, around discs (x, y, radius)."""

    discs: tuple[tuple[float, float, float], ...] = DISC
    start: tuple[float, float] = (-1.0, 0.0)
    goal: tuple[float, float] = (1.0, 0.0)
    on_line: bool = False

    @property
    def metric(self) -> go.Metric:
        return go.Euclidean(2)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        end = (2.0 * q1[0], 2.0 * self.goal[0]) if self.on_line else (q1, self.goal)
        return [(q0, self.start), end]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [
            (radius, ca.norm_2(q - ca.DM([x, y])), np.inf, f"disc {number}")
            for number, (x, y, radius) in enumerate(self.discs)
        ]

    def clearance(self, path: go.Path) -> float:
        q = path(np.linspace(0.0, 1.0, 2001))
        return min(np.linalg.norm(q - (x, y), axis=1).min() - r for x, y, r in self.discs)


class FromAbove(AmongDiscs):
    """With a guess of its own, on the longer side of the disc."""

    def guess(self, s: np.ndarray) -> np.ndarray:
        return np.column_stack([2.0 * s - 1.0, np.sin(np.pi * s)])


@pytest.mark.parametrize("on_line", [False, True])
def test_a_planner_leads_out_of_a_cup(on_line: bool) -> None:
    problem = AmongDiscs(CUP, (0.0, 0.0), (2.0, 0.0), on_line)
    definition = problem.definition()
    found = guesses.Guesses(definition, definition.grid).further(False, guesses.Attempts())
    path = next(path for name, path in found if name.startswith("planner"))
    assert path is not None
    assert problem.clearance(path) > -2e-3  # lines are checked every 0.05
    assert path(0.0) == pytest.approx([0.0, 0.0])
    assert path(1.0)[: 2 - on_line] == pytest.approx([2.0, 0.0][: 2 - on_line])


def test_a_tree_grows_along_what_blocks_it() -> None:
    """One line towards the goal is blocked by a disc: others lead around it."""
    problem = AmongDiscs()
    space = guesses.FreeSpace(problem.definition())
    start, goal = np.array([[-1.0, 0.0]]), np.array([[1.0, 0.0]])
    assert not space.is_free(np.vstack([start, goal]))
    found = guesses.connect(space, start, goal, (goal, goal), np.random.default_rng(0), 1)
    assert found is not None
    assert np.array_equal(found[[0, -1]], np.vstack([start, goal]))
    assert problem.clearance(go.Path.through(problem.metric, found)) > -2e-3


def test_shortcuts_straighten_single_coordinates() -> None:
    """Between walls nothing else is free, but the third coordinate need not turn."""
    wall = tuple((x, 0.0, 0.3) for x in np.linspace(-0.6, 0.6, 7))

    class Turning(AmongDiscs):
        @property
        def metric(self) -> go.Metric:
            return go.Euclidean(3)

        def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
            return [(q0, (-1.0, 0.0, 0.0)), (q1, (1.0, 0.0, 0.0))]

        def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
            return super().constraints(q[:2], v)

    space = guesses.FreeSpace(Turning(wall).definition())
    q = np.array([(-1, 0, 0), (-0.9, 0.31, 3), (0, 0.31, -3), (0.9, 0.31, 3), (1, 0, 0)], float)
    found = guesses.shortcut(space, q, np.random.default_rng(0))
    assert space.is_free(found)
    assert np.array_equal(found[[0, -1]], q[[0, -1]])
    assert np.abs(found[:, 2]).max() < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("on_line", [False, True])
def test_a_straight_line_out_of_a_cup_is_no_end(on_line: bool) -> None:
    problem = AmongDiscs(CUP, (0.0, 0.0), (2.0, 0.0), on_line)
    solution = go.solve(problem)
    assert solution.stats.guess
    assert problem.clearance(solution.path) > -2e-4


def test_the_better_of_two_guesses_is_kept(arm: go.Model) -> None:
    start = np.array([0.9, -0.8, -1.2, 0.9, 1.1, -0.1, -1.1])
    reach = go.Reach(arm, start, [0.2, -0.36, -0.44])
    lines = reach.guess(np.linspace(0.0, 1.0, 9))
    assert lines.ndim == 3
    assert lines[:, 0] == pytest.approx(np.tile(start, (len(lines), 1)), abs=1e-12)
    solution = go.solve(reach)
    first = go.solve(reach, guess=go.Path.through(reach.metric, lines[0]))
    assert solution.stats.guess == "initial guess 2"
    assert solution.stats.objective < 0.97 * first.stats.objective


def test_another_guess_is_tried_where_the_first_fails() -> None:
    class Stays(AmongDiscs):
        def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
            return [(q0, (0.0, 0.0)), (q1[0] ** 2, 1.0), (q1[1] - 0.3 * q1[0], 0.0)]

        def guess(self, s: np.ndarray) -> np.ndarray:
            return s[:, None] * np.array([[[0.0, 0.0]], [[-1.0, -0.3]]])

    solution = go.solve(Stays(discs=()))
    assert solution.stats.guess == "initial guess 2"
    assert solution.stats.objective == pytest.approx(1.09 / 2.0, rel=1e-9)


@pytest.mark.slow
def test_several_starts_find_the_shorter_side() -> None:
    one, several = (go.solve(FromAbove(), num_starts=count) for count in (1, 2))
    assert one.path(0.5)[1] > 0.5
    assert several.path(0.5)[1] < -0.3
    assert (one.stats.guess == "") > (several.stats.guess == "")
    assert several.path.length < one.path.length
    again = go.solve(FromAbove(), num_starts=2)
    assert np.array_equal(several.path.nodes, again.path.nodes)


def test_what_was_tried_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guesses, "_SAMPLES", 50)
    closed = AmongDiscs((*RING, (1.4, 0.0, 0.2)), (0.0, 0.0), (2.0, 0.0))
    with pytest.raises(
        go.NotConverged, match=r"tried: .*planner that found no path in 50"
    ) as error:
        go.solve(closed, grid=go.Grid(4, 4))
    assert not error.value.solution.stats.success  # type: ignore[attr-defined]


def test_a_limit_of_the_user_ends_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither a planner nor another solve follows, and the status says so."""
    monkeypatch.setattr(guesses, "connect", None)
    found = go.solve(AmongDiscs(), throw=False, ipopt={"max_iter": 3})
    assert re.search(r"limit \(ipopt=.*, which ended the search", found.stats.status)
    assert found.stats.iterations == 3


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_search_stays_on_the_side_of_given_waypoints(side: float) -> None:
    """Whatever the number of waypoints, and though one side is longer."""
    problem = AmongDiscs()
    corners = [(-1.0, 0.0), (-0.7, 0.7 * side), (0.7, 0.7 * side), (0.7, 0.7 * side), (1.0, 0.0)]
    solution = go.solve(problem, guess=go.Path.through(problem.metric, corners))
    assert side * solution.path(0.5)[1] > 0.3
    assert not solution.stats.guess


def test_paths_on_either_side_of_an_obstacle_do_not_deform_into_each_other() -> None:
    problem = AmongDiscs()
    definition = problem.definition()
    found = guesses.Guesses(definition, definition.grid)
    near, far, below = (
        go.Path.through(problem.metric, [(-1.0, 0.0), (0.0, height), (1.0, 0.0)])
        for height in (1.0, 1.5, -1.0)
    )
    assert found.deform(near, far)
    assert not found.deform(near, below)
    assert not found.deform(below, far)


def test_a_second_detour_on_the_same_side_is_not_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would lead to the same solution; one on the other side may lead to a better one."""
    arc = np.column_stack([2.0 * guesses._S - 1.0, np.sin(np.pi * guesses._S)])
    monkeypatch.setattr(guesses, "_SAME", 0.01)
    programs = []
    for second in (0.85, -0.85):
        detours = [arc * (1.0, height) for height in (0.8, second)]
        monkeypatch.setattr(guesses, "_clear_detours", lambda *_, found=detours: found)
        iterates: list[Iterate] = []
        go.solve(AmongDiscs(), callback=iterates.append)
        begun = [each.path.grid for each in iterates if each.number == 0]
        programs.append(begun.count(begun[0]))
    assert programs == [1, 2]


@given(arrays(float, (6, 3), elements=st.floats(-3.0, 3.0, width=16)))
def test_a_polyline_passes_its_waypoints_at_constant_speed(points: np.ndarray) -> None:
    q = np.vstack([points, points[0] + 1.0])
    path = go.Path.through(go.Euclidean(3), q)
    pieces = np.linalg.norm(np.diff(q, axis=0), axis=1)
    s = np.append(0.0, np.cumsum(pieces)) / pieces.sum()
    np.testing.assert_allclose(path(np.minimum(s, 1.0)), q, atol=1e-9)
    assert path.length == pytest.approx(pieces.sum())
    assert path.energy == pytest.approx(pieces.sum() ** 2 / 2.0)


@pytest.mark.parametrize("bad", [[(0.0, 0.0)], [(1.0, 2.0), (1.0, 2.0)], [(0.0,), (1.0,)]])
def test_waypoints_are_checked(bad: Any) -> None:
    with pytest.raises(ValueError, match="waypoints"):
        go.Path.through(go.Euclidean(2), bad)


def test_starts_are_checked() -> None:
    line = go.Path.through(go.Euclidean(2), [(-1.0, 0.0), (1.0, 0.0)])
    with pytest.raises(ValueError, match="num_starts must be a positive integer, got 0"):
        go.solve(AmongDiscs(), num_starts=0)
    with pytest.raises(ValueError, match="num_starts: other guesses"):
        go.solve(AmongDiscs(), num_starts=2, guess=line)
