"""Obstacle avoidance, self-collision avoidance, and free directions of a reach."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pytest
from known_metrics import Sphere
from numpy.testing import assert_allclose
from scipy.linalg import null_space

import geodesic_ocp as go

START = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
TARGET = (0.1, 0.45, 0.1)  # [m]
LAMP = go.Ball((0.2, 0.35, -0.15), 0.06, name="lamp")


def smallest_distance(arm: go.Model, path: go.Path, **bodies: object) -> float:
    configurations = path(np.linspace(0.0, 1.0, 301))
    return min(
        min(go.distances.signed_distances(arm, q, **bodies).values()) for q in configurations
    )


@pytest.mark.slow
def test_arm_avoids_a_ball_with_and_without_margin(arm: go.Model) -> None:
    free = go.solve(go.Reach(arm, START, TARGET))
    assert smallest_distance(arm, free.path, obstacles=[LAMP]) < -0.01
    around = go.solve(go.Reach(arm, START, TARGET, obstacles=[LAMP]), tolerance=1e-6)
    assert smallest_distance(arm, around.path, obstacles=[LAMP]) > -2e-6
    assert around.path.energy > free.path.energy
    assert np.abs(around.multipliers["right forearm to lamp"]).max() > 1e-4
    wider = go.solve(go.Reach(arm, START, TARGET, obstacles=[LAMP], margin=0.02), tolerance=1e-4)
    assert smallest_distance(arm, wider.path, obstacles=[LAMP]) > 0.02 - 2e-4
    assert wider.path.energy > around.path.energy


@pytest.mark.slow
def test_only_the_named_links_avoid_obstacles(arm: go.Model) -> None:
    hand = go.solve(go.Reach(arm, START, TARGET, obstacles=[LAMP], links=["right hand"]))
    assert "right hand to lamp" in hand.multipliers
    assert "right forearm to lamp" not in hand.multipliers


@pytest.mark.slow
def test_hand_avoids_the_upper_arm(arm: go.Model) -> None:
    """Full elbow flexion brings the hand to the shoulder."""
    pairs = [("right upper arm", "right hand")]
    goal = [0.3, 0.1, -0.4, 2.5, 0.1, 0.0, 0.1]
    metric = go.KineticEnergy(arm)
    there = go.distances.signed_distances(arm, goal, pairs=pairs)["right upper arm to right hand"]
    with pytest.raises(
        ValueError, match=r"end violates a constraint: right upper arm to right hand falls below"
    ):
        go.solve(go.PointToPoint(metric, START, goal, pairs=pairs, margin=there + 0.01))
    clear = go.PointToPoint(metric, START, goal, pairs=pairs, margin=there - 1e-3)
    assert (
        smallest_distance(arm, go.solve(clear, tolerance=1e-5).path, pairs=pairs) > there - 1.1e-3
    )


def test_start_in_collision_is_reported_before_the_solve(arm: go.Model) -> None:
    shelf = go.HalfSpace((0.0, 0.0, -0.3), (0.0, 0.0, 1.0), "shelf")
    with pytest.raises(
        ValueError,
        match=r"start violates a constraint: .*upper arm to shelf \(2\) falls below 0 by 0\.0",
    ):
        go.solve(go.PointToPoint(go.KineticEnergy(arm), START, START + 0.2, obstacles=[shelf]))


@pytest.mark.slow
def test_target_behind_a_wall_is_reported_before_the_solve(arm: go.Model) -> None:
    ceiling = go.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), "ceiling")
    reach = go.Reach(arm, START, TARGET, obstacles=[ceiling], links=["right hand"])
    with pytest.raises(
        go.NotConverged,
        match="within its limits, clear of collision bodies, was found for the hand's",
    ):
        go.solve(reach)


@pytest.mark.slow
def test_other_obstacles_need_another_nlp(arm: go.Model) -> None:
    grid, one = go.Grid(4, 4), go.Reach(arm, START, TARGET, obstacles=[LAMP])
    moved = go.Reach(arm, START + 0.01, (0.1, 0.4, 0.1), obstacles=[LAMP])
    other = go.Reach(arm, START, TARGET, obstacles=[go.Ball((0.2, 0.35, -0.14), 0.06)])
    assert moved.nlp(grid).transcription is one.nlp(grid).transcription
    assert other.nlp(grid).transcription is not one.nlp(grid).transcription


def test_metric_without_bodies_and_wrong_margin_are_named() -> None:
    with pytest.raises(ValueError, match="obstacles: Sphere has no model with bodies"):
        go.PointToPoint(Sphere(), (1.0, 0.0), (1.2, 0.3), obstacles=[LAMP])
    with pytest.raises(ValueError, match="margin must be a finite number"):
        go.Reach(go.human_arm(), START, TARGET, obstacles=[LAMP], margin=np.nan)


@pytest.mark.slow
@pytest.mark.parametrize("free", [(0.0, 0.0, 2.0), [(0.0, 0.0, 1.0), (1.0, 1.0, 0.0)]])
def test_hand_arrives_on_a_line_or_a_plane(arm: go.Model, free: object) -> None:
    """Orthogonally, in the metric, to all configurations with the hand there."""
    problem = go.Reach(arm, START, TARGET, free=free, limits=False)
    solution = go.solve(problem, tolerance=1e-9)
    end, velocity = solution.path(1.0), solution.path(1.0, 1)
    directions = np.atleast_2d(free) / np.linalg.norm(np.atleast_2d(free), axis=1, keepdims=True)
    prescribed = null_space(directions).T
    position = arm.hand_pose(end)[1]
    assert_allclose(prescribed @ (position - TARGET), 0.0, atol=1e-8)
    assert np.linalg.norm(position - TARGET) > 0.01
    tangents = null_space(prescribed @ arm.hand_jacobian(end)[:3])
    assert tangents.shape[1] == 4 + len(directions)
    momentum = problem.metric.matrix(end) @ velocity
    assert np.abs(tangents.T @ momentum).max() < 1e-4 * np.linalg.norm(momentum)
    assert solution.path.length < go.solve(go.Reach(arm, START, TARGET, limits=False)).path.length


def test_wrong_free_directions_are_named(arm: go.Model) -> None:
    for free in ((0.0, 0.0, 0.0), np.eye(3), (1.0, 0.0), (np.nan, 0.0, 0.0)):
        with pytest.raises(ValueError, match="free must be a direction"):
            go.Reach(arm, START, TARGET, free=free)
    with pytest.raises(ValueError, match="free: directions are those of a position"):
        go.Reach(arm, START, rotation=np.eye(3), free=(0.0, 0.0, 1.0))


def test_clearance_constraints_for_a_users_own_problem(arm: go.Model) -> None:
    """`clearance_constraints` returns entries for `Problem.constraints`."""
    q = ca.SX.sym("q", arm.dof)
    rows = go.distances.clearance_constraints(
        arm, q, [LAMP], pairs=[("right upper arm", "right hand")], margin=0.01
    )
    assert [row[3] for row in rows] == [
        "right upper arm to lamp",
        "right forearm to lamp",
        "right hand to lamp",
        "right upper arm to right hand",
    ]
    assert all(row[0] == 0.01 and row[2] == np.inf for row in rows)


@dataclass(frozen=True)
class AroundMovedBall(go.Problem):
    """Past a ball whose position and radius may change from solve to solve."""

    arm: go.Model
    centre: tuple[float, ...] = LAMP.centre
    radius: float = LAMP.radius
    height: tuple[float, ...] = (0.0, 0.0, -0.65)
    parameters = ("centre", "radius", "height")

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arm)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, START), (self.arm.hand_pose(q1)[1], TARGET)]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        bodies = [
            go.Ball(self.centre, self.radius, name="lamp"),
            go.HalfSpace(self.height, (0, 0, 1)),
        ]
        return [
            (self.arm.lower, q, self.arm.upper, "limits"),
            *go.distances.clearance_constraints(self.arm, q, bodies),
        ]


@pytest.mark.slow
def test_obstacles_may_depend_on_parameters(arm: go.Model) -> None:
    first, other = AroundMovedBall(arm), AroundMovedBall(arm, (0.2, 0.35, -0.1), 0.05)
    assert first.nlp(first.grid).transcription is other.nlp(other.grid).transcription
    lamp = go.Ball(other.centre, other.radius)
    solution = go.solve(other, tolerance=1e-5)
    assert -2e-5 < smallest_distance(arm, solution.path, obstacles=[lamp]) < 1e-3
    with pytest.raises(ValueError, match=r"centre must have shape \(3, 1\)"):
        go.Ball(ca.SX.sym("c", 2), 0.1)


def test_single_values_in_place_of_lists_are_named(arm: go.Model) -> None:
    with pytest.raises(ValueError, match="obstacles must be a list, got Ball"):
        go.Reach(arm, START, TARGET, obstacles=LAMP)
    with pytest.raises(ValueError, match="links must be a list, got 'right hand'"):
        go.Reach(arm, START, TARGET, obstacles=[LAMP], links="right hand")
    with pytest.raises(ValueError, match="pairs must be a list of pairs"):
        go.Reach(arm, START, TARGET, pairs=("right upper arm", "right hand"))


@dataclass(frozen=True)
class PastThinDisc(go.Problem):
    """A point moves 10 m past a disc of 3 mm, or of another size, near its straight line."""

    radius: float = 2.99e-3
    centre: tuple[float, float] = (4.8267, 1.95e-4)

    @property
    def metric(self) -> go.Metric:
        return go.Euclidean(2)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, [0.0, 0.0]), (q1, [10.0, 0.0])]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(self.radius, ca.norm_2(q - ca.DM(self.centre)), np.inf)]


@pytest.mark.parametrize("tolerance", [None, 1e-3, 1e-6])
@pytest.mark.parametrize("centre", [(4.8267, 1.95e-4), (7.1758, 2.09e-3)])
def test_a_thin_body_between_two_samples_is_seen(
    tolerance: float | None, centre: tuple[float, float]
) -> None:
    problem = PastThinDisc(centre=centre)
    path = go.solve(problem, tolerance=tolerance).path
    distances = np.linalg.norm(path(np.linspace(0.0, 1.0, 100_001)) - np.array(centre), axis=1)
    assert distances.min() >= problem.radius - 1.1 * (tolerance or 1e-4)
