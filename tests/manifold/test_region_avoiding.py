"""Region-avoiding metrics: closed forms, bounds, joint limits and errors."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np
import pytest
from gadget import FAN
from known_metrics import PolarPlane, in_plane
from known_models import planar_arm

import geodesic_ocp as go

# The default tolerance of log and exp is 1e-9.
EXACT = 1e-7
S = np.linspace(0.0, 1.0, 101)


def height(q: Any) -> Any:
    return q[1]


def outside_disc(q: Any) -> Any:
    return ca.norm_2(q) - 1.0


def arc_length(y: float, margin: float) -> float:
    """Integral of sqrt(1 + (margin / y)^2) over y."""
    return math.hypot(y, margin) - margin * math.asinh(margin / y)


def excess(model: go.Model, q: np.ndarray) -> float:
    """Largest violation of the joint limits by configurations (k, n) [rad]; negative inside."""
    return float(max((model.lower - q).max(), (q - model.upper).max()))


def inside(model: go.Model, rng: np.random.Generator, count: int) -> np.ndarray:
    return rng.uniform(model.lower + 0.1, model.upper - 0.1, (count, model.dof))


def test_the_tensor_for_a_hand_above_a_table(arm: go.Model, rng: np.random.Generator) -> None:
    """The apparent mass of the hand, 1 / (J G^-1 J'), is added along its height."""
    q, configuration = inside(arm, rng, 2)
    metric = go.manifold.RegionAvoiding(
        go.KineticEnergy(arm),
        lambda q: arm.hand_pose(q)[1][2] + 1.0,
        margin=0.05,
        configuration=configuration,
    )
    reference, row = arm.hand_jacobian(configuration)[2], arm.hand_jacobian(q)[2]
    mass = 1.0 / (reference @ np.linalg.inv(arm.mass_matrix(configuration)) @ reference)
    stretch = mass * (0.05 / (arm.hand_pose(q)[1][2] + 1.0)) ** 2
    expected = arm.mass_matrix(q) + stretch * np.outer(row, row)
    assert metric.matrix(q) == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_the_tensor_within_joint_limits(arm: go.Model, rng: np.random.Generator) -> None:
    (q,) = inside(arm, rng, 1)
    margins = np.linspace(0.05, 0.2, 7)
    metric = go.manifold.RegionAvoiding(go.KineticEnergy(arm), margin=margins)
    weights = 1.0 / np.diag(np.linalg.inv(arm.mass_matrix((arm.lower + arm.upper) / 2.0)))
    nearness = (margins / (q - arm.lower)) ** 2 + (margins / (arm.upper - q)) ** 2
    expected = arm.mass_matrix(q) + np.diag(weights * nearness)
    assert metric.matrix(q) == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert metric.joint_names == arm.joint_names
    assert metric.model is arm


def test_joints_without_limits_are_not_affected() -> None:
    """One limit for two joints: its weight is evaluated at zero, with its own margin."""
    native = planar_arm((1.0, 0.8), (1.3, 0.7), (0.4, 0.5), (0.2, 0.1)).pin.copy()
    native.upperPositionLimit = np.array([np.inf, 2.0])
    plain = go.KineticEnergy(go.Model(native, "tip"))
    metric = go.manifold.RegionAvoiding(plain, margin=[0.5, 0.2])
    q = np.array([7.0, 1.5])
    weight = 1.0 / np.linalg.inv(plain.matrix(np.zeros(2)))[1, 1]
    expected = np.diag([0.0, weight * (0.2 / 0.5) ** 2])
    assert metric.matrix(q) - plain.matrix(q) == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("margin", [0.1, 2.0])
def test_the_half_plane_is_flat(margin: float) -> None:
    """dx^2 + (1 + (margin / y)^2) dy^2 is flat in x and the arc length along y."""
    metric = go.manifold.RegionAvoiding(go.Euclidean(2), height, margin=margin)
    a, b = np.array([0.0, 0.3]), np.array([1.0, 0.05])
    rise = arc_length(b[1], margin) - arc_length(a[1], margin)
    assert go.distance(metric, a, b) == pytest.approx(np.hypot(1.0, rise), rel=EXACT)
    path = go.geodesic(metric, a, b)(S)
    assert [arc_length(y, margin) for y in path[:, 1]] == pytest.approx(
        arc_length(a[1], margin) + path[:, 0] * rise, abs=EXACT / 0.05
    )


@pytest.mark.parametrize("length", [1.0, 4.0, 16.0])
def test_the_boundary_is_infinitely_distant(length: float) -> None:
    """Straight down, y decreases like exp(-length / margin), below 1e-6 but not to zero."""
    metric = go.manifold.RegionAvoiding(go.Euclidean(2), height, margin=1.0)
    down = np.array([0.0, -1.0])
    velocity = length * down / metric.norm([0.0, 1.0], down)
    _, y = go.exp(metric, [0.0, 1.0], velocity, tolerance=1e-11)
    assert 0.0 < y < 2.0 * np.exp(-length)
    # The derivative of the integral is at most 1 + 1 / y.
    assert arc_length(y, 1.0) == pytest.approx(
        arc_length(1.0, 1.0) - length, abs=1e-11 * (1 + 1 / y)
    )


@pytest.mark.slow
def test_the_length_bounds_the_approach(
    arm_metric: go.KineticEnergy, rng: np.random.Generator
) -> None:
    """|log h1 / h0| <= length / (margin sqrt(w)), where plain geodesics leave the limits."""
    arm = arm_metric.model
    metric = go.manifold.RegionAvoiding(arm_metric, margin=0.2)
    weights = 1.0 / np.diag(np.linalg.inv(arm.mass_matrix((arm.lower + arm.upper) / 2.0)))
    for q, v in zip(inside(arm, rng, 4), rng.uniform(-2.0, 2.0, (4, 7)), strict=True):
        assert excess(arm, go.exp(arm_metric, q, v)[None]) > 0.1
        arrival = go.exp(metric, q, v)
        assert excess(arm, arrival[None]) < 0.0
        bound = metric.norm(q, v) / (0.2 * np.sqrt(weights))
        assert np.all(np.abs(np.log((arrival - arm.lower) / (q - arm.lower))) <= bound)
        assert np.all(np.abs(np.log((arm.upper - arrival) / (arm.upper - q))) <= bound)


REACHES = {
    "wrist": ([0.3, 0.1, -0.4, 0.9, 0.1, 0.2, 0.1], [1.5, -0.3, -1.2, 0.6, 0.4, 0.2, -0.3]),
    "arm raised": ([-0.3, 0.0, -0.6, 0.3, 0.0, 0.0, 0.0], [1.4, 0.2, -0.6, 0.3, 0.0, 0.0, 0.0]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["wrist", "arm raised"])
def test_reaches_stay_within_joint_limits(name: str, arm_metric: go.KineticEnergy) -> None:
    """The plain geodesic violates the limits; a smaller margin gives a smaller detour."""
    q0, q1 = REACHES[name]
    free = go.geodesic(arm_metric, q0, q1)
    assert excess(arm_metric.model, free(S)) > 0.1
    lengths = [free.length]
    for margin in (0.1, 0.3):
        path = go.geodesic(go.manifold.RegionAvoiding(arm_metric, margin=margin), q0, q1)
        assert excess(arm_metric.model, path(S)) < 0.0
        lengths.append(go.Path(arm_metric, path.grid, path.nodes).length)
    assert lengths == sorted(lengths)


def test_for_small_margins_it_converges_to_the_given_metric() -> None:
    """The difference is proportional to the square of the margin."""
    rods = planar_arm((1.0, 0.8), (1.3, 0.7), (0.4, 0.5), (0.2, 0.1))
    metric = go.KineticEnergy(rods.with_limits([-0.5, 0.2], [1.5, 2.0]))
    q0, q1 = [0.3, 0.5], [1.1, 1.4]
    plain = go.log(metric, q0, q1)
    first, second = (
        np.abs(go.log(go.manifold.RegionAvoiding(metric, margin=margin), q0, q1) - plain).max()
        for margin in (0.02, 0.01)
    )
    assert first > 1e-4  # far above the tolerance of log
    assert first / second == pytest.approx(4.0, rel=0.05)  # the next term is of order margin^4


def test_coordinates_and_units_of_the_functions_do_not_matter() -> None:
    """Around a disc, in polar and Cartesian coordinates, with any unit of the function."""
    polar = go.manifold.RegionAvoiding(PolarPlane(), lambda q: q[0] - 1.0, configuration=(2.0, 0.0))
    plane = go.manifold.RegionAvoiding(go.Euclidean(2), outside_disc, configuration=(2.0, 0.0))
    unit = go.manifold.RegionAvoiding(
        go.Euclidean(2), lambda q: [1000.0 * outside_disc(q)], (100.0,), configuration=(2.0, 0.0)
    )
    a, b = np.array([1.2, 0.0]), np.array([1.5, 0.8])
    expected = go.distance(polar, a, b)
    assert go.distance(plane, in_plane(a), in_plane(b)) == pytest.approx(expected, rel=EXACT)
    assert go.distance(unit, in_plane(a), in_plane(b)) == pytest.approx(expected, rel=EXACT)


@pytest.mark.slow
def test_regions_can_be_nested(arm: go.Model, rng: np.random.Generator) -> None:
    """An arm under gravity above a table and within its limits; the model is that of the arm."""
    inner = go.manifold.RegionAvoiding(
        go.manifold.JacobiMetric(arm, 40.0), lambda q: arm.hand_pose(q)[1][2] + 1.0, margin=0.05
    )
    (q,) = inside(arm, rng, 1)
    outer = go.manifold.RegionAvoiding(inner)
    added = np.diag(outer.matrix(q) - inner.matrix(q))
    assert np.all(added > 0.0)
    arrival = go.exp(outer, q, rng.uniform(-1.0, 1.0, 7))
    assert excess(arm, arrival[None]) < 0.0
    assert arm.hand_pose(arrival)[1][2] > -1.0
    with pytest.raises(ValueError, match="distance of RWx_joint to its upper limit"):
        outer.point("q", [*q[:5], 1.0, 0.0])


def test_metrics_are_shown_in_a_line(arm_metric: go.KineticEnergy) -> None:
    limits = go.manifold.RegionAvoiding(arm_metric, margin=np.linspace(0.1, 0.4, 7))
    assert repr(limits) == f"RegionAvoiding({arm_metric!r}, joint limits, margin=0.1 to 0.4)"
    plane = go.manifold.RegionAvoiding(go.Euclidean(2), height, margin=0.2)
    assert repr(plane) == "RegionAvoiding(Euclidean(dim=2), 1 function, margin=0.2)"


def test_metrics_are_values(arm_metric: go.KineticEnergy) -> None:
    assert go.manifold.RegionAvoiding(arm_metric) == go.manifold.RegionAvoiding(
        arm_metric, None, 0.1
    )
    assert go.manifold.RegionAvoiding(arm_metric) != go.manifold.RegionAvoiding(
        arm_metric, margin=0.2
    )
    one, same = (
        go.manifold.RegionAvoiding(go.Euclidean(2), height, np.array([0.2])) for _ in range(2)
    )
    assert one == same
    assert hash(one) == hash(same)
    assert one != go.manifold.RegionAvoiding(go.Euclidean(2), lambda q: q[1], [0.2])


BAD_FUNCTIONS: dict[str, tuple[Any, str]] = {
    "no function": (3, "functions must be callable with q, got 3"),
    "none of them": (lambda q: [], r"must be a column or a list of scalars, is \[\]"),
    "a row": (lambda q: q.T, r"must be a column or a list of scalars, is SX"),
    "a number": (lambda q: 1.0, "must be a column or a list of scalars, is 1.0"),
    "numbers": (lambda q: [q[0], 1.0], r"functions\[1\] must be a CasADi scalar, is 1.0"),
    "vectors": (lambda q: [q], r"functions\[0\] must be a CasADi scalar, is SX"),
    "a constant": (lambda q: ca.SX(2.0), r"functions\[0\] does not depend on q"),
    "free": (lambda q: q[0] + ca.SX.sym("r"), r"functions\[0\] depends on other symbols than q"),
    "no slope": (lambda q: ca.sumsqr(q) - 1.0, r"configuration: functions\[0\] has no gradient at"),
}


@pytest.mark.parametrize("name", BAD_FUNCTIONS)
def test_bad_functions_are_named(name: str) -> None:
    functions, message = BAD_FUNCTIONS[name]
    with pytest.raises(ValueError, match=message):
        go.manifold.RegionAvoiding(go.Euclidean(2), functions)


def test_points_outside_are_named(arm_metric: go.KineticEnergy) -> None:
    plane = go.manifold.RegionAvoiding(go.Euclidean(2), lambda q: [q[1], 1.0 - q[0]])
    with pytest.raises(ValueError, match=r"q: .* inside the region: functions\[0\] is -0.5$"):
        go.exp(plane, [0.0, -0.5], [1.0, 0.0])
    with pytest.raises(ValueError, match=r"q1: .* functions\[0\] is 0, functions\[1\] is -1$"):
        go.log(plane, [0.0, 1.0], [2.0, 0.0])
    limited = go.manifold.RegionAvoiding(arm_metric)
    with pytest.raises(ValueError, match=r"distance of RSy_joint to its upper limit 0 is -0\.2"):
        go.log(limited, [0.1, 0.0, 0.2, 0.5, 0.0, 0.0, 0.0], [0.1, 0.0, -0.2, 0.5, 0.0, 0.0, 0.0])
    disc = go.manifold.RegionAvoiding(go.Euclidean(2), outside_disc, configuration=(2.0, 0.0))
    with pytest.raises(ValueError, match=r"the guess at 0\.3: .* is not inside the region"):
        go.log(disc, [-2.0, 0.1], [2.0, 0.1])


def test_bad_margins_and_metrics(arm_metric: go.KineticEnergy) -> None:
    for margin in (0.0, -1.0, [0.1, 0.0]):
        with pytest.raises(ValueError, match="margin must be positive"):
            go.manifold.RegionAvoiding(
                go.Euclidean(2), lambda q: q, margin, configuration=(1.0, 1.0)
            )
    with pytest.raises(ValueError, match=r"margin must have shape \(7,\), got \(2,\)"):
        go.manifold.RegionAvoiding(arm_metric, margin=[0.1, 0.2])
    with pytest.raises(ValueError, match=r"configuration must have shape \(2,\), got \(1,\)"):
        go.manifold.RegionAvoiding(go.Euclidean(2), height, configuration=[1.0])
    with pytest.raises(ValueError, match="configuration: the metric is not positive definite"):
        go.manifold.RegionAvoiding(PolarPlane(), height)
    with pytest.raises(ValueError, match="Euclidean has no model: give functions"):
        go.manifold.RegionAvoiding(go.Euclidean(2))
    free = go.KineticEnergy(planar_arm((1.0,), (1.3,), (0.5,), (0.1,)))
    with pytest.raises(ValueError, match="no joint of 'planar arm with 1 links' has a finite"):
        go.manifold.RegionAvoiding(free)
    with pytest.raises(ValueError, match="metric must be an instance of a Metric class"):
        go.manifold.RegionAvoiding(arm_metric.model)


@pytest.mark.parametrize("speed", [8.0, 10.25, 1000.0])
def test_geodesics_that_rounding_reflects_at_the_boundary_are_errors(speed: float) -> None:
    """1 - q loses its digits near the boundary, in every integration alike."""
    segment = go.manifold.RegionAvoiding(go.Euclidean(1), lambda q: [1.0 - q[0], 1.0 + q[0]])
    with pytest.raises(go.IntegrationFailed):
        go.exp(segment, [0.1], [speed])


@pytest.mark.parametrize(
    ("count", "fastest"), [(18, 2.0), pytest.param(40, 5.0, marks=pytest.mark.slow)]
)
def test_exp_towards_a_boundary_is_right_or_an_error(
    count: int, fastest: float, rng: np.random.Generator
) -> None:
    """In a box, no coordinate reverses its direction."""
    box = go.manifold.RegionAvoiding(
        go.Euclidean(2), lambda q: [1.0 - q[0], 1.0 + q[0], 1.0 - q[1], 1.0 + q[1]]
    )
    answers = 0
    for velocity in rng.normal(size=(count, 2)) * np.exp(rng.uniform(-1.0, fastest, (count, 1))):
        try:
            arrival = go.exp(box, [0.1, 0.0], velocity)
        except go.IntegrationFailed:
            continue
        answers += 1
        assert np.all(np.sign(arrival - [0.1, 0.0]) == np.sign(velocity))
    assert answers > 5


def test_continuous_joints_are_not_limited() -> None:
    fan = go.load_model(FAN, hand="blade")
    with pytest.raises(ValueError, match="no joint of 'fan' has a finite limit"):
        go.manifold.RegionAvoiding(go.KineticEnergy(fan))
    limited = fan.with_limits([-2.0], [2.0])
    walled = go.manifold.RegionAvoiding(go.KineticEnergy(limited))
    assert walled.periods == (np.inf,)
    assert go.exp(walled, [0.0], [1.5])[0] < 2.0


def test_outside_the_limits_every_function_says_so(arm: go.Model, rng: np.random.Generator) -> None:
    metric = go.manifold.RegionAvoiding(go.KineticEnergy(arm))
    (start,), v = inside(arm, rng, 1), np.full(arm.dof, 0.3)
    outside = start.copy()
    outside[3] = arm.upper[3] + 0.1
    time, names = np.linspace(0.0, 1.0, 20), arm.joint_names
    motion = go.Motion(
        time, np.linspace(start, outside, 20), names, np.tile(outside - start, (20, 1))
    )
    metric.kernels.available()
    for call in (
        lambda: metric.matrix(outside),
        lambda: metric.norm(outside, v),
        lambda: metric.angle(outside, v, np.eye(arm.dof)[0]),
        lambda: metric.christoffel(outside),
        lambda: metric.acceleration(outside, v),
        lambda: go.exp(metric, outside, v),
        lambda: go.log(metric, start, outside),
        lambda: go.manifold.scalar_curvature(metric, outside),
        lambda: go.segment(metric, motion),
    ):
        with pytest.raises(ValueError, match=rf"not inside the region: .* {names[3]} to its up"):
            call()
