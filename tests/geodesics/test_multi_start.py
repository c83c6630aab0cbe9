"""Several geodesics between two points, and what their certificates say."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from known_metrics import HalfPlane, Sphere
from known_models import planar_arm
from known_problems import PlaneAroundDisc
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.manifold.exp import sample_geodesic


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
    assert go.distance(two_link, q0, q1, num_starts=5) == pytest.approx(lengths[0], abs=5e-7)
    assert_allclose(found[0].velocity, case["geodesics"][0]["v0"], rtol=0, atol=5e-6)
    for path in found:
        assert_allclose(path(1.0), q1, rtol=0, atol=1e-12)
        assert_allclose(go.exp(two_link, q0, path.velocity), q1, rtol=0, atol=1e-9)
    # Two are minima of the energy, the third is the pass between their valleys.
    assert [path.certificate.morse_index for path in found] == [0, 0, 1]


def on_great_circle(length: float, start: tuple[float, float] = (1.2, 0.3)) -> go.Path:
    metric = Sphere()
    velocity = np.array([0.3, 1.0])
    velocity *= length / metric.norm(start, velocity)
    grid = go.Grid(4, 20)
    nodes, _ = sample_geodesic(metric, start, velocity, grid.nodes)
    return go.Path(metric, grid, nodes)


@pytest.mark.parametrize("length", [0.5, 2.0, np.pi - 1e-3])
def test_before_the_antipode_a_great_circle_is_shortest(length: float) -> None:
    certificate = go.certify(on_great_circle(length))
    assert certificate.locally_shortest
    assert certificate.morse_index == 0
    assert certificate.first_conjugate_point is None
    assert certificate.endpoint_error < 1e-6  # its velocity is the path's, not the integration's
    assert certificate.drift < 1e-6
    assert str(certificate).startswith("shortest among the paths near it; residual")


@pytest.mark.parametrize("length", [np.pi + 1e-3, 4.0, 2 * np.pi - 0.1, 2 * np.pi + 0.1])
def test_past_the_antipode_it_is_not(length: float) -> None:
    certificate = go.certify(on_great_circle(length))
    assert not certificate.locally_shortest
    assert certificate.morse_index == int(length / np.pi)  # Morse: conjugate points inside
    assert certificate.first_conjugate_point == pytest.approx(np.pi / length, abs=1e-5)
    assert "stationary, not shortest" in str(certificate)


def test_every_solution_has_a_certificate(arm: go.Model) -> None:
    metric = go.KineticEnergy(arm)
    start = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
    goal = np.array([1.2, -0.2, -0.9, 1.6, -0.3, 0.1, 0.4])
    path = go.geodesic(metric, start, goal)
    assert path.certificate.locally_shortest
    assert path.certificate.endpoint_error <= 1e-9
    assert path.certificate.drift <= 1e-5
    solution = go.solve(go.PointToPoint(metric, start, goal))
    assert solution.certificate.locally_shortest
    assert solution.certificate.endpoint_error < 1e-4  # as accurate as the grid
    with pytest.raises(go.NotConverged) as failure:
        go.solve(go.PointToPoint(metric, start, goal), ipopt={"max_iter": 1})
    assert failure.value.solution.certificate.endpoint_error > 1e-4
    assert not failure.value.solution.certificate.stationary
    assert str(failure.value.solution.certificate).startswith("not stationary")


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
    assert solution.certificate.morse_index == index


class Strip(go.Metric):
    """Flat, but no metric in an ellipse about the origin."""

    dim = 2

    def matrix(self, q: ca.SX) -> ca.SX:
        outside = q[1] ** 2 + 4.0 * q[0] ** 2 > 0.3
        return type(q).eye(2) * ca.if_else(outside, 1.0, np.nan)


def test_a_path_that_a_constraint_bends_is_no_geodesic_but_shortest() -> None:
    certificate = go.solve(PlaneAroundDisc()).certificate
    assert certificate.locally_shortest
    assert certificate.endpoint_error > 0.1


def test_zero_length_has_a_certificate() -> None:
    path = go.geodesic(Sphere(), [1.0, 0.0], [1.0, 0.0])
    assert path.certificate == go.Certificate(0.0, 0.0, True, 0)


class Cylinder(go.Metric):
    """Of radius one, in angle and height: flat, but it comes round."""

    dim = 2
    periods = (2 * np.pi, np.inf)

    def matrix(self, q: ca.SX) -> ca.SX:
        return type(q).eye(2)


def test_goals_a_period_away_are_the_same_place() -> None:
    start, goal = np.array([0.1, 0.0]), np.array([6.0, 0.3])
    turn = np.array([2 * np.pi, 0.0])
    helices = [goal - turn - start, goal - start, goal - 2 * turn - start]  # shortest first
    found = go.geodesics(Cylinder(), start, goal, num_starts=3)
    assert_allclose([path.velocity for path in found], helices, rtol=0, atol=1e-9)
    assert_allclose(found[0](1.0), goal - turn, rtol=0, atol=1e-9)
    assert_allclose(go.log(Cylinder(), start, goal, num_starts=3), helices[0], rtol=0, atol=1e-9)
    assert_allclose(go.log(Cylinder(), start, goal), helices[1], rtol=0, atol=1e-9)


def test_continuous_joints_turn_the_short_way() -> None:
    """Half a turn further the other way is the same configuration."""
    text = (
        '<robot name="fan"><link name="base"/><link name="blade"><inertial><mass value="1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="2"/></inertial></link>'
        '<joint name="axle" type="continuous"><parent link="base"/><child link="blade"/>'
        '<axis xyz="0 0 1"/></joint></robot>'
    )
    metric = go.KineticEnergy(go.load_model(text, hand="blade"))
    assert metric.periods == (2 * np.pi,)
    found = go.geodesics(metric, [-3.0], [3.0], num_starts=3)
    turns = [path.velocity[0] for path in found]
    assert_allclose(turns, [6.0 - 2 * np.pi, 6.0, 6.0 - 4 * np.pi], rtol=0, atol=1e-9)
    around = go.distance(metric, [0.0], [6 * np.pi + 0.1], num_starts=2)  # three turns and a bit
    assert around == pytest.approx(np.sqrt(2.0) * 0.1, abs=1e-8)


class Torus(go.Metric):
    """Flat, of eight angles."""

    dim = 8
    periods = (2 * np.pi,) * 8

    def matrix(self, q: ca.SX) -> ca.SX:
        return type(q).eye(8)


@pytest.mark.parametrize("coordinate", [0, 7])
def test_any_of_many_coordinates_may_come_round(coordinate: int) -> None:
    goal = 6.0 * np.eye(8)[coordinate]
    assert go.distance(Torus(), np.zeros(8), goal, num_starts=2) == pytest.approx(2 * np.pi - 6.0)


@pytest.mark.parametrize(
    "periods", [(2 * np.pi,), 5.0, (None, 1.0), ("x", 1.0), (0.0, 1.0), (-1.0, 1.0), (np.nan, 1.0)]
)
def test_wrong_periods_are_named(periods: object) -> None:
    class Odd(Sphere):
        pass

    Odd.periods = periods  # type: ignore[assignment]
    with pytest.raises(ValueError, match=r"Odd.periods must be 2 positive numbers"):
        go.distance(Odd(), [1.0, 0.0], [1.0, 1.0], num_starts=2)


def test_periods_in_which_the_metric_changes_are_named() -> None:
    class Odd(HalfPlane):
        periods = (np.inf, 1.0)

    with pytest.raises(ValueError, match=r"not the same at .* and 1 further in q\[1\]"):
        go.distance(Odd(), [0.0, 1.0], [0.0, 2.0], num_starts=2)


def test_regions_keep_the_periods_that_they_have() -> None:
    def band(q: ca.SX) -> list:
        return [1.0 - q[1], 1.0 + q[1]]

    def disc(q: ca.SX) -> list:
        return [ca.dot(q, q) - 0.1]

    along = go.RegionAvoiding(Cylinder(), band)
    assert along.periods == (2 * np.pi, np.inf)
    short = go.distance(along, [0.1, 0.0], [6.0, 0.0], num_starts=2)
    assert short == pytest.approx(2 * np.pi - 5.9, abs=1e-8)
    assert go.RegionAvoiding(Cylinder(), disc, configuration=(1.0, 0.0)).periods == (np.inf, np.inf)


def test_a_forbidden_straight_line_is_one_start_among_others() -> None:
    """A metric that is none in an ellipse: the straight line fails."""
    ends = [-1.0, 0.0], [1.0, 0.0]
    with pytest.raises(ValueError, match="not finite and positive along the guess"):
        go.log(Strip(), *ends)
    with pytest.raises(go.NotConverged, match=r"from any of 2 starts\. From the straight"):
        go.log(Strip(), *ends, num_starts=2, seed=3)


def test_no_certificate_where_there_is_no_metric() -> None:
    grid = go.Grid(1, 20)
    straight = np.column_stack([2.0 * grid.nodes - 1.0, 0.0 * grid.nodes])
    certificate = go.certify(go.Path(Strip(), grid, straight))
    assert not certificate.stationary
    assert not certificate.locally_shortest
    assert certificate.morse_index is None
    assert certificate.drift == np.inf
    with pytest.raises(go.IntegrationFailed):
        go.exp(Strip(), [-1.0, 0.0], [2.0, 0.0])


def test_a_path_that_is_no_geodesic_is_not_stationary() -> None:
    grid = go.Grid(1, 20)
    wave = np.column_stack([1.2 + 0.3 * np.sin(6.0 * grid.nodes), grid.nodes])
    certificate = go.certify(go.Path(Sphere(), grid, wave))
    assert not certificate.stationary
    assert not certificate.locally_shortest
    coarse = go.solve(go.PointToPoint(Sphere(), [0.1, 0.0], [0.1, 3.0]), grid=go.Grid(1, 2))
    assert not coarse.certificate.stationary


def test_certify_names_wrong_arguments() -> None:
    path = on_great_circle(1.0)
    with pytest.raises(ValueError, match=r"velocity must have shape \(2,\)"):
        go.certify(path, [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="velocity must be finite"):
        go.certify(path, [np.nan, 1.0])
    with pytest.raises(ValueError, match="path must be a Path"):
        go.certify(3)  # type: ignore[arg-type]


def test_causes_are_named_in_few_words(arm_metric: go.KineticEnergy) -> None:
    q0 = [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]
    q1 = [0.3, np.pi / 2 - 1e-4, -0.4, 0.9, 0.1, 0.0, 0.1]
    with pytest.raises(go.NotConverged, match="RSx_joint and RSy_joint undo each other") as failure:
        go.log(arm_metric, q0, q1)
    assert len(str(failure.value)) < 900
    box = go.RegionAvoiding(go.Euclidean(2), lambda q: [1.0 - q[0], 1.0 + q[0]])
    with pytest.raises(go.NotConverged, match=r"along q\[0\] grows by .* a boundary"):
        go.log(box, [0.1, 0.0], [1.0 - 1e-9, 0.0])


@pytest.mark.parametrize("seed", ["x", 1.5, -1])
def test_seed_must_be_natural(seed: object) -> None:
    for starts in (1, 2):
        with pytest.raises(ValueError, match="seed must be a non-negative integer"):
            go.log(Sphere(), [1.0, 0.0], [1.0, 1.0], num_starts=starts, seed=seed)  # type: ignore[arg-type]


@pytest.mark.parametrize("num_starts", [0, -1, 1.5, "many"])
def test_starts_must_be_a_positive_integer(num_starts: object) -> None:
    with pytest.raises(ValueError, match="num_starts must be a positive integer"):
        go.log(Sphere(), [1.0, 0.0], [1.0, 1.0], num_starts=num_starts)  # type: ignore[arg-type]


def test_the_same_seed_gives_the_same_geodesics(two_link: go.KineticEnergy) -> None:
    ends = [0.0, 0.3], [1.5, -2.0]
    first, second = (go.geodesics(two_link, *ends, num_starts=6, seed=7) for _ in range(2))
    assert [path.length for path in first] == [path.length for path in second]
    lengths = [path.length for path in first]
    assert lengths == sorted(lengths)


def test_rows_take_starts(two_link: go.KineticEnergy) -> None:
    goals = np.array([[1.0, 0.5], [2.0, -1.0]])
    rows = go.log(two_link, [0.0, 0.3], goals, num_starts=3)
    assert np.array_equal(rows[1], go.log(two_link, [0.0, 0.3], goals[1], num_starts=3))


class TorusOfRevolution(go.Metric):
    """In angles about the tube and about the axis, both of which come round."""

    dim = 2
    periods = (2 * np.pi, 2 * np.pi)

    def matrix(self, q: ca.SX) -> list:
        return [[1.0, 0.0], [0.0, (3.0 + ca.cos(q[0])) ** 2]]


def test_what_log_finds_can_be_drawn() -> None:
    """Errors grow along this one: its points are known to 1e-9, not to 1e-10."""
    ends = [0.3, 0.0], [2.0, 5.5]
    path = go.geodesic(TorusOfRevolution(), *ends)
    assert path.length == pytest.approx(go.distance(TorusOfRevolution(), *ends), rel=1e-9)
    assert path.certificate.endpoint_error < 1e-8


def test_the_way_back_round_the_sphere_is_found() -> None:
    """Two parts of one great circle, of which the longer is no minimum."""

    class Globe(Sphere):
        periods = (np.inf, 2 * np.pi)

    found = go.geodesics(Globe(), [1.0, 0.0], [1.4, 1.9], num_starts=10, seed=1)
    assert found[0].length + found[1].length == pytest.approx(2 * np.pi, abs=1e-8)
    assert [path.certificate.morse_index for path in found[:2]] == [0, 1]
