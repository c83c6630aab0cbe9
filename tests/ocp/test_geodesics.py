"""Several geodesics between two points, and what their certificates say."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from known_metrics import Sphere
from known_models import planar_arm
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.manifold.exponential import trajectory


@pytest.fixture(scope="module")
def two_link() -> go.KineticEnergy:
    """Uniform rods of 1 m and 1 kg."""
    return go.KineticEnergy(planar_arm((1.0, 1.0), (1.0, 1.0), (0.5, 0.5), (1 / 12, 1 / 12)))


def test_the_two_link_case_has_three_geodesics(
    two_link: go.KineticEnergy, known_geodesics: dict
) -> None:
    case = known_geodesics["two_link_log"]
    q0, q1 = case["q0"], case["q1"]
    lengths = [known["length"] for known in case["geodesics"]]
    found = go.geodesics(two_link, q0, q1)
    assert_allclose([path.length for path in found], lengths, rtol=0, atol=5e-7)  # six decimals
    assert go.distance(two_link, q0, q1, starts=5) == pytest.approx(lengths[0], abs=5e-7)
    assert_allclose(found[0].velocity, case["geodesics"][0]["v0"], rtol=0, atol=5e-6)
    for path in found:
        assert_allclose(path(1.0), q1, rtol=0, atol=1e-12)
        assert_allclose(go.exp(two_link, q0, path.velocity), q1, rtol=0, atol=1e-9)
    # Two are minima of the energy, the third is the pass between their valleys.
    assert [path.certificate.index for path in found] == [0, 0, 1]


def on_great_circle(length: float, start: tuple[float, float] = (1.2, 0.3)) -> go.Path:
    metric = Sphere()
    velocity = np.array([0.3, 1.0])
    velocity *= length / metric.norm(start, velocity)
    grid = go.Grid(4, 20)
    nodes, _ = trajectory(metric, start, velocity, grid.nodes)
    return go.Path(metric, grid, nodes)


@pytest.mark.parametrize("length", [0.5, 2.0, np.pi - 1e-3])
def test_before_the_antipode_a_great_circle_is_shortest(length: float) -> None:
    certificate = go.certify(on_great_circle(length))
    assert certificate.locally_shortest
    assert certificate.index == 0
    assert certificate.conjugate is None
    assert certificate.residual < 1e-6  # its velocity is the path's, not the integration's
    assert certificate.drift < 1e-6
    assert str(certificate).startswith("shortest among the paths near it; residual")


@pytest.mark.parametrize("length", [np.pi + 1e-3, 4.0, 2 * np.pi - 0.1, 2 * np.pi + 0.1])
def test_past_the_antipode_it_is_not(length: float) -> None:
    certificate = go.certify(on_great_circle(length))
    assert not certificate.locally_shortest
    assert certificate.index == int(length / np.pi)  # Morse: conjugate points inside
    assert certificate.conjugate == pytest.approx(np.pi / length, abs=1e-5)
    assert "stationary, not shortest" in str(certificate)


def test_every_solution_has_a_certificate(arm: go.Model) -> None:
    metric = go.KineticEnergy(arm)
    start = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
    goal = np.array([1.2, -0.2, -0.9, 1.6, -0.3, 0.1, 0.4])
    path = go.geodesic(metric, start, goal)
    assert path.certificate.locally_shortest
    assert path.certificate.residual <= 1e-9
    assert path.certificate.drift <= 1e-5
    solution = go.solve(go.PointToPoint(metric, start, goal))
    assert solution.certificate.locally_shortest
    assert solution.certificate.residual < 1e-4  # as accurate as the grid
    with pytest.raises(go.NotConverged) as failure:
        go.solve(go.PointToPoint(metric, start, goal), ipopt={"max_iter": 1})
    assert failure.value.solution.certificate.residual > 1e-4


class Half(go.Problem):
    """From a point of the sphere to a meridian: shortest up to the focal point, a quarter away."""

    def __init__(self, away: float) -> None:
        self.away = away

    @property
    def metric(self) -> go.Metric:
        return Sphere()

    def boundary(self, q0: ca.SX, q1: ca.SX) -> list:
        return [(q0, (np.pi / 2, 0.0)), (q1[1] * 1.0, self.away)]

    def guess(self, s: np.ndarray) -> np.ndarray:
        return np.column_stack([np.full_like(s, np.pi / 2), self.away * s])


@pytest.mark.parametrize(("away", "index"), [(1.4, 0), (1.8, 1), (4.0, 1)])
def test_free_ends_count_in_the_second_variation(away: float, index: int) -> None:
    """Along the equator to a meridian: beyond the pole's distance, any other way is shorter."""
    solution = go.solve(Half(away), throw=False)
    assert_allclose(solution.path.nodes[:, 0], np.pi / 2, rtol=0, atol=1e-6)
    assert solution.certificate.index == index


class AroundDisc(go.Problem):
    """In the plane, around a disc on the straight line."""

    @property
    def metric(self) -> go.Metric:
        return go.Euclidean(2)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> list:
        return [(q0, (-1.0, 0.0)), (q1, (1.0, 0.0))]

    def constraints(self, q: ca.SX, v: ca.SX) -> list:
        return [(0.25, ca.dot(q, q), np.inf)]

    def guess(self, s: np.ndarray) -> np.ndarray:
        return np.column_stack([2.0 * s - 1.0, 2.0 * s * (1.0 - s)])


def test_a_path_that_a_constraint_bends_is_no_geodesic_but_shortest() -> None:
    certificate = go.solve(AroundDisc()).certificate
    assert certificate.locally_shortest
    assert certificate.residual > 0.1


def test_zero_length_has_a_certificate() -> None:
    path = go.geodesic(Sphere(), [1.0, 0.0], [1.0, 0.0])
    assert path.certificate == go.Certificate(0.0, 0.0, 0)


class Cylinder(go.Metric):
    """Of radius one, in angle and height: flat, but it comes round."""

    dim = 2
    periods = (2 * np.pi, np.inf)

    def matrix(self, q: ca.SX) -> ca.SX:
        return type(q).eye(2)


def test_goals_a_period_away_are_the_same_place() -> None:
    start, goal = np.array([0.1, 0.0]), np.array([6.0, 0.3])
    turn = np.array([2 * np.pi, 0.0])
    helices = [goal - turn - start, goal - start, goal + turn - start]  # shortest first
    found = go.geodesics(Cylinder(), start, goal, starts=3)
    assert_allclose([path.velocity for path in found], helices, rtol=0, atol=1e-9)
    assert_allclose(found[0](1.0), goal - turn, rtol=0, atol=1e-9)
    assert_allclose(go.log(Cylinder(), start, goal, starts=3), helices[0], rtol=0, atol=1e-9)
    assert_allclose(go.log(Cylinder(), start, goal), helices[1], rtol=0, atol=1e-9)


def test_continuous_joints_turn_the_short_way() -> None:
    """Half a turn further the other way is the same posture."""
    text = (
        '<robot name="fan"><link name="base"/><link name="blade"><inertial><mass value="1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="2"/></inertial></link>'
        '<joint name="axle" type="continuous"><parent link="base"/><child link="blade"/>'
        '<axis xyz="0 0 1"/></joint></robot>'
    )
    metric = go.KineticEnergy(go.load_model(text, hand="blade"))
    assert metric.periods == (2 * np.pi,)
    found = go.geodesics(metric, [-3.0], [3.0], starts=3)
    turns = [path.velocity[0] for path in found]
    assert_allclose(turns, [6.0 - 2 * np.pi, 6.0, 6.0 + 2 * np.pi], rtol=0, atol=1e-9)


def test_a_forbidden_straight_line_is_one_start_among_others() -> None:
    """A metric that is none in a strip: the straight line fails, waypoints go round it."""

    class Strip(go.Metric):
        dim = 2

        def matrix(self, q: ca.SX) -> ca.SX:
            height = q[1] ** 2 + 4.0 * q[0] ** 2 - 0.3
            return type(q).eye(2) * ca.if_else(height > 0, 1.0, np.nan)

    ends = [-1.0, 0.0], [1.0, 0.0]
    with pytest.raises(ValueError, match="not finite and positive along the guess"):
        go.log(Strip(), *ends)
    with pytest.raises(go.NotConverged, match="from any of 2 starts; from the straight line"):
        go.log(Strip(), *ends, starts=2, seed=3)


@pytest.mark.parametrize("starts", [0, -1, 1.5, "many"])
def test_starts_must_be_a_positive_integer(starts: object) -> None:
    with pytest.raises(ValueError, match="starts must be a positive integer"):
        go.log(Sphere(), [1.0, 0.0], [1.0, 1.0], starts=starts)  # type: ignore[arg-type]


def test_the_same_seed_gives_the_same_geodesics(two_link: go.KineticEnergy) -> None:
    ends = [0.0, 0.3], [1.5, -2.0]
    first, second = (go.geodesics(two_link, *ends, starts=6, seed=7) for _ in range(2))
    assert [path.length for path in first] == [path.length for path in second]
    lengths = [path.length for path in first]
    assert lengths == sorted(lengths)


def test_rows_take_starts(two_link: go.KineticEnergy) -> None:
    goals = np.array([[1.0, 0.5], [2.0, -1.0]])
    rows = go.log(two_link, [0.0, 0.3], goals, starts=3)
    assert np.array_equal(rows[1], go.log(two_link, [0.0, 0.3], goals[1], starts=3))
