"""Several geodesics between two points: initial guesses, periods, and messages."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from gadget import FAN
from known_metrics import HalfPlane, OutsideEllipse, Sphere
from known_models import free_rotor, planar_arm
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import geodesic_ocp as go


@pytest.fixture(scope="module")
def two_link() -> go.KineticEnergy:
    """Uniform rods of 1 m and 1 kg."""
    return go.KineticEnergy(planar_arm((1.0, 1.0), (1.0, 1.0), (0.5, 0.5), (1 / 12, 1 / 12)))


@pytest.mark.slow
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
    # Two are minima of the energy, the third is a saddle point between them.
    assert [path.certificate.morse_index for path in found] == [0, 0, 1]


class Cylinder(go.Metric):
    """Of radius one, in angle and height: flat, with one periodic coordinate."""

    dim = 2
    periods = (2 * np.pi, np.inf)

    def matrix(self, q: ca.SX) -> ca.SX:
        return type(q).eye(2)


def test_goals_a_period_away_are_the_same_point() -> None:
    start, goal = np.array([0.1, 0.0]), np.array([6.0, 0.3])
    period = np.array([2 * np.pi, 0.0])
    helices = [goal - period - start, goal - start, goal - 2 * period - start]  # shortest first
    found = go.geodesics(Cylinder(), start, goal, num_starts=3)
    assert_allclose([path.velocity for path in found], helices, rtol=0, atol=1e-9)
    assert_allclose(found[0](1.0), goal - period, rtol=0, atol=1e-9)
    assert_allclose(go.log(Cylinder(), start, goal, num_starts=3), helices[0], rtol=0, atol=1e-9)
    assert_allclose(go.log(Cylinder(), start, goal), helices[0], rtol=0, atol=1e-9)
    assert_allclose(go.log(Cylinder(), start, goal, wrap=False), helices[1], rtol=0, atol=1e-9)
    (only,) = go.geodesics(Cylinder(), start, goal, num_starts=3, wrap=False)
    assert_allclose(only.velocity, helices[1], rtol=0, atol=1e-9)


def test_continuous_joints_take_the_shorter_rotation() -> None:
    """Configurations a full revolution apart are the same."""
    metric = go.KineticEnergy(go.load_model(FAN, hand="blade"))
    assert metric.periods == (2 * np.pi,)
    found = go.geodesics(metric, [-3.0], [3.0], num_starts=3)
    rotations = [path.velocity[0] for path in found]
    assert_allclose(rotations, [6.0 - 2 * np.pi, 6.0, 6.0 - 4 * np.pi], rtol=0, atol=1e-9)
    around = go.distance(
        metric, [0.0], [6 * np.pi + 0.1], num_starts=2
    )  # three revolutions and 0.1 rad
    assert around == pytest.approx(np.sqrt(2.0) * 0.1, abs=1e-8)


class Torus(go.Metric):
    """Flat, of eight angles."""

    dim = 8
    periods = (2 * np.pi,) * 8

    def matrix(self, q: ca.SX) -> ca.SX:
        return type(q).eye(8)


def test_any_of_many_coordinates_may_be_periodic() -> None:
    goal = 6.0 * np.eye(8)[7]
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

    along = go.manifold.RegionAvoiding(Cylinder(), band)
    assert along.periods == (2 * np.pi, np.inf)
    short = go.distance(along, [0.1, 0.0], [6.0, 0.0], num_starts=2)
    assert short == pytest.approx(2 * np.pi - 5.9, abs=1e-8)
    assert go.manifold.RegionAvoiding(Cylinder(), disc, configuration=(1.0, 0.0)).periods == (
        np.inf,
        np.inf,
    )


def test_an_undefined_straight_line_is_one_start_among_others() -> None:
    """The straight line through the ellipse fails, other starts may succeed."""
    ends = [-1.0, 0.0], [1.0, 0.0]
    with pytest.raises(ValueError, match="not finite and positive along the guess"):
        go.log(OutsideEllipse(), *ends)
    with pytest.raises(go.NotConverged, match=r"from any of 2 starts\. From the straight"):
        go.log(OutsideEllipse(), *ends, num_starts=2, seed=3)


@pytest.mark.slow
def test_likely_causes_are_named() -> None:
    rotor = go.KineticEnergy(free_rotor((1.0, 2.0, 3.5)))
    message = "joint1 and joint3 are linearly dependent"
    with pytest.raises(go.NotConverged, match=message) as failure:
        go.log(rotor, [0.3, 1.0, 0.2], [0.9, 1e-4, -0.8])  # near gimbal lock
    assert len(str(failure.value)) < 900
    with pytest.raises(go.NotConverged, match=r"along q\[0\] grows by .* a boundary"):
        go.log(HalfPlane(), [-100.0, 0.001], [100.0, 0.001])


@pytest.mark.parametrize("seed", ["x", 1.5, -1])
def test_seed_must_be_a_non_negative_integer(seed: object) -> None:
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


def gimbal_wrist(ring: float) -> go.Model:
    """A hand of 0.4 kg in a gimbal of three continuous hinges, about x, y and z through one point.

    The rings between them have moments of inertia `ring` [kg m^2]: the metric is nearly singular
    where the first axis and the last one coincide.
    """
    parts, parent = ['<robot name="gimbal"><link name="base"/>'], "base"
    hand = "0 0 0.05", 0.4, (8e-4, 6e-4, 3e-4)
    bodies = [("0 0 0", 1e3 * ring, (ring,) * 3)] * 2 + [hand]
    for number, (centre, mass, moments) in enumerate(bodies):
        axis = " ".join("1" if k == number else "0" for k in range(3))
        inertia = " ".join(f'i{a}{a}="{m}"' for a, m in zip("xyz", moments, strict=True))
        parts.append(
            f'<link name="link{number}"><inertial><origin xyz="{centre}"/><mass value="{mass}"/>'
            f'<inertia {inertia} ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="joint{number}" type="continuous"><parent link="{parent}"/>'
            f'<child link="link{number}"/><axis xyz="{axis}"/></joint>'
        )
        parent = f"link{number}"
    return go.load_model("".join(parts) + "</robot>", hand=parent)


@pytest.mark.parametrize(
    "rows", [[8], pytest.param([0, 2, 5], marks=pytest.mark.slow)], ids=["one pair", "three"]
)
def test_several_starts_find_the_same_from_both_ends(rows: list[int]) -> None:
    """Geodesics that can be integrated from one end alone. No path is shorter than a rotation of
    the hand by the same angle about its easiest axis.
    """
    metric = go.KineticEnergy(gimbal_wrist(2e-7))
    starts, goals = np.random.default_rng(0).uniform(-2.8, 2.8, (2, 16, 3))[:, rows]
    there = go.distance(metric, starts, goals, num_starts=3)
    back = go.distance(metric, goals, starts, num_starts=3)
    assert_allclose(there, back, rtol=1e-8)
    turns = [Rotation.from_euler("XYZ", q) for q in (starts, goals)]
    angles = (turns[0].inv() * turns[1]).magnitude()
    assert np.all(there >= np.sqrt(3e-4) * angles)


@pytest.mark.slow
def test_both_parts_of_a_great_circle_are_found() -> None:
    """The longer of the two is not minimizing."""

    class Globe(Sphere):
        periods = (np.inf, 2 * np.pi)

    found = go.geodesics(Globe(), [1.0, 0.0], [1.4, 1.9], num_starts=10, seed=1)
    assert found[0].length + found[1].length == pytest.approx(2 * np.pi, abs=1e-8)
    assert [path.certificate.morse_index for path in found[:2]] == [0, 1]
