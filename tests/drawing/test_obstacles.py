"""The obstacles of a problem, and how its figures show them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import pytest
from known_models import planar_arm
from matplotlib.figure import Figure

import geodesic_ocp as go
from geodesic_ocp.drawing.path_figure import draw_obstacles

BALL = go.Ball((0.2, 0.35, -0.15), 0.06, name="lamp")


@dataclass(frozen=True)
class InSpace(go.Problem):
    """Between two points of the plane, beside two balls."""

    radius: float = 0.5

    @property
    def metric(self) -> go.Metric:
        return go.Euclidean(2)

    @property
    def obstacles(self) -> Sequence[go.Ball]:
        return [go.Ball((0.0, 0.0, 0.0), self.radius), go.Ball((1.0, 0.0, 0.0), self.radius)]

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, (-1.0, 1.0)), (q1, (1.0, 1.0))]


@dataclass(frozen=True)
class OfTwoJoints(go.Problem):
    """Between two configurations of an arm with two joints, beside a lamp."""

    arm: go.Model = field(
        default_factory=lambda: planar_arm((1.0, 1.0), (1.0, 1.0), (0.5, 0.5), (0.1, 0.1))
    )
    obstacles: tuple[go.Ball, ...] = (BALL,)

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arm)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, np.zeros(2)), (q1, np.ones(2))]


def drawn(problem: go.Problem) -> list[object]:
    """Labels of what the problem adds to a figure."""
    axes = Figure().add_subplot()
    n = problem.metric.dim
    path = go.Path(problem.metric, go.Grid(1, 2), np.outer([0.0, 0.5, 1.0], np.ones(n)))
    draw_obstacles(problem, axes, path, (0, 1))
    return [artist.get_label() for artist in (*axes.patches, *axes.artists)]


def test_a_problem_has_no_obstacles_unless_it_says_so(arm: go.Model) -> None:
    metric = go.KineticEnergy(arm)
    plain = go.PointToPoint(metric, np.zeros(7), np.ones(7))
    assert tuple(plain.obstacles) == ()
    assert drawn(plain) == []


def test_obstacles_of_any_problem_are_drawn() -> None:
    assert drawn(InSpace()) == ["obstacles", None]
    assert drawn(go.Reach(go.human_arm(), np.zeros(7), BALL.centre, obstacles=[BALL])) == ["lamp"]


def test_obstacles_in_space_are_not_drawn_among_two_joints() -> None:
    """Axes that are angles have no place for them."""
    assert drawn(OfTwoJoints()) == []


@pytest.mark.parametrize("other", [0.3, np.zeros((2, 3)), [(0.0, 0.0, 0.1)], {"lamp": BALL}])
def test_an_attribute_that_means_something_else_is_said_not_to_be_drawn(other: Any) -> None:
    class OfPoints(InSpace):
        obstacles = other

    problem = OfPoints()
    with pytest.warns(UserWarning, match=r"OfPoints.obstacles are not drawn: .* go\.Ball"):
        assert drawn(problem) == []
    with pytest.warns(UserWarning, match="another name"):
        go.plot(go.solve(problem))


def test_obstacles_alone_are_no_condition() -> None:
    """A problem that lists them without a constraint is solved as if they were not there."""
    straight = go.solve(InSpace()).path
    assert straight.length == pytest.approx(2.0)
