"""Trajectories in time: limits everywhere, ends of paths, timing, two arms, clearance."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from known_models import planar_arm
from scipy.interpolate import BPoly

import geodesic_ocp as go
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory, plan_trajectory
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.interpolation import JERK_OVERSHOOT
from geodesic_ocp.trajectory.path import Path

LINE = Grid(1, 4)
DOWN = np.array([0.0, -9.81, 0.0])  # in the plane of the arm
KEPT = 1.0 + 1e-6  # of the limits


def two_links() -> Model:
    arm = planar_arm((0.5, 0.4), (2.0, 1.0), (0.25, 0.2), (0.05, 0.02))
    return arm.with_armature(0.05).with_limits([-3.0, -2.5], [3.0, 2.5])


def limits(
    velocity: float = 2.0, acceleration: float = 10.0, jerk: float = 1e3, torque: float = np.inf
) -> JointLimits:
    return JointLimits(*(np.full(2, each) for each in (velocity, acceleration, jerk, torque)))


def along(
    robot: Model, corners: list[list[float]], edges: list[float], bounds: JointLimits
) -> ArmPaths:
    """Straight paths through configurations."""
    metric, points = go.KineticEnergy(robot), np.array(corners, dtype=float)
    share = LINE.nodes[:, None]
    paths = [Path(metric, LINE, a + share * (b - a)) for a, b in pairwise(points)]
    return ArmPaths(robot, bounds, np.array(edges, dtype=float), paths, DOWN)


CORNERS = [[0.0, 0.2], [0.7, -0.4], [0.2, -1.0], [0.2, -1.0], [-0.5, 0.3]]
EDGES = [1.0, 1.4, 1.5, 1.8, 2.2]


@pytest.fixture(scope="module")
def zigzag() -> PlannedTrajectory:
    """With corners, and a rest in the third path."""
    return plan_trajectory([along(two_links(), CORNERS, EDGES, limits())])


def test_states_are_continuous_and_derivatives_of_each_other(zigzag: PlannedTrajectory) -> None:
    time = np.linspace(0.0, zigzag.duration, 20_001)
    q, v, a, j = zigzag.states(time)
    step = time[1]
    # Central differences of a cubic spline: exact up to j h^2 / 6, and j h across a knot.
    largest = np.abs(j).max()
    assert np.abs((q[2:] - q[:-2]) / (2 * step) - v[1:-1]).max() <= largest * step**2
    assert np.abs((v[2:] - v[:-2]) / (2 * step) - a[1:-1]).max() <= largest * step
    assert np.abs(np.diff(a, axis=0)).max() <= 1.01 * largest * step


def test_limits_hold_everywhere(zigzag: PlannedTrajectory) -> None:
    _, v, a, j = zigzag.states(np.random.default_rng(3).uniform(0.0, zigzag.duration, 20_000))
    bounds = zigzag.arms[0].limits
    for values, limit in ((v, bounds.velocity), (a, bounds.acceleration), (j, bounds.jerk)):
        assert np.all(np.abs(values) <= limit * KEPT)
    assert 0.99 <= zigzag.usage[0].largest <= KEPT
    assert zigzag.success


def test_ends_of_paths_are_passed_at_the_edges(zigzag: PlannedTrajectory) -> None:
    positions = zigzag.states(zigzag.robot_edges)[0]
    assert np.abs(positions - np.array(CORNERS)).max() <= 1e-9
    assert np.array_equal(zigzag.edges, EDGES)
    assert np.allclose(zigzag.robot_time(zigzag.edges), zigzag.robot_edges)


def test_from_rest_to_rest_and_still_in_a_rest(zigzag: PlannedTrajectory) -> None:
    q, v, a, _ = zigzag.states(np.array([0.0, zigzag.duration]))
    assert np.abs(v).max() <= 1e-9
    assert np.abs(a).max() <= 1e-6
    q, v, a, _ = zigzag.states(np.linspace(*zigzag.robot_edges[2:4], 50))
    assert np.abs(q - q[0]).max() <= 1e-9
    assert np.abs(v).max() <= 1e-9


def test_no_interval_is_shorter_than_the_persons(zigzag: PlannedTrajectory) -> None:
    ratio = np.diff(zigzag.robot_edges) / np.diff(zigzag.edges)
    assert np.all(ratio >= 1.0 - 1e-6)
    # A rest need not be longer, except with all that is slowed for the controller between samples.
    assert ratio[2] == pytest.approx(1.0, abs=1e-2)
    assert zigzag.stretch > 1.1


def test_corners_are_passed_without_stopping(zigzag: PlannedTrajectory) -> None:
    _, v, _, _ = zigzag.states(zigzag.robot_edges[1:2])
    assert np.abs(v).max() > 0.1


def test_samples_end_at_rest_and_agree_with_their_differences(zigzag: PlannedTrajectory) -> None:
    for rate in (100.0, 1000.0):
        found = zigzag.sampled(rate)
        assert np.allclose(np.diff(found.time), 1.0 / rate)
        assert zigzag.duration <= found.time[-1] + 1e-9 < zigzag.duration + 1.0 / rate + 1e-9
        assert not np.any(found.velocities[-1])
        differences = np.gradient(found.positions, 1.0 / rate, axis=0)[1:-1]
        assert np.abs(differences - found.velocities[1:-1]).max() <= 1e3 / rate**2
        assert found.efforts is not None
        assert found.efforts.shape == found.positions.shape
    with pytest.raises(ValueError, match="rate must be positive"):
        zigzag.sampled(0.0)


def test_after_the_end_the_robot_holds_still(zigzag: PlannedTrajectory) -> None:
    q, v, a, j = zigzag.states(np.array([zigzag.duration + 1.0]))
    assert np.allclose(q, CORNERS[-1])
    assert not np.any([v, a, j])
    with pytest.raises(ValueError, match="arm must be from 0 to 0"):
        zigzag.states(np.array([0.0]), arm=1)


def test_the_persons_timing_where_limits_allow_it() -> None:
    easy = along(two_links(), [[0.0, 0.0], [0.5, 0.3], [1.0, 0.6]], [0.0, 1.0, 2.0], limits())
    found = plan_trajectory([easy])
    assert found.stretch == pytest.approx(1.0, abs=1e-6)
    # One straight line in joint space.
    assert max(each.joint for each in found.path_deviation[0]) <= 1e-3


@pytest.mark.parametrize(
    ("velocity", "distance"), [(np.inf, 1.2), (0.8, 1.2)], ids=["triangle", "trapezoid"]
)
def test_a_fast_line_takes_the_least_time(velocity: float, distance: float) -> None:
    """Known for one joint from rest to rest: full acceleration, full speed, full deceleration."""
    acceleration = 5.0
    robot = planar_arm((0.5,), (1.0,), (0.2,), (0.1,))
    bounds = JointLimits(*(np.array([x]) for x in (velocity, acceleration, np.inf, np.inf)))
    found = plan_trajectory([along(robot, [[0.0], [distance]], [0.0, 0.1], bounds)])
    peak = min(velocity, np.sqrt(distance * acceleration))
    least = distance / peak + peak / acceleration
    # The acceleration takes one piece of the spline, some 5 % of the motion, to change its sign.
    assert least * (1.0 - 1e-4) <= found.duration <= 1.06 * least


def test_jerk_is_limited() -> None:
    bounds = limits(jerk=40.0)
    found = plan_trajectory([along(two_links(), CORNERS, EDGES, bounds)])
    _, _, _, j = found.states(np.linspace(0.0, found.duration, 5000))
    assert np.abs(j).max() <= 40.0 * KEPT
    # From one end to the other, an overshoot by the controller at both sides left out.
    assert found.usage[0].jerk.max() >= 0.99 / (1.0 + 2.0 * JERK_OVERSHOOT)


@pytest.mark.parametrize("rate", [30.0, 100.0, 1000.0])
def test_controllers_that_interpolate_samples_keep_the_limits(rate: float) -> None:
    """The quintic through positions, velocities and accelerations, as of ros2_control; by SciPy."""
    bounds = limits(jerk=200.0)
    found = plan_trajectory([along(two_links(), CORNERS, EDGES, bounds)], rate=rate)
    sampled = found.sampled(rate)
    states = np.stack([sampled.positions, sampled.velocities, sampled.accelerations], axis=1)
    quintic = BPoly.from_derivatives(sampled.time, states)
    inside = np.linspace(1e-6, 1.0 - 1e-6, 50)
    times = (sampled.time[:-1, None] + np.outer(np.diff(sampled.time), inside)).ravel()
    for order, limit in enumerate((bounds.velocity, bounds.acceleration, bounds.jerk), start=1):
        largest = np.abs(quintic.derivative(order)(times)).max(axis=0)
        assert np.all(largest <= limit * (1.0 + 1e-3)), (order, largest)
    # No more is left than the overshoot needs.
    assert np.abs(quintic.derivative(3)(times)).max() >= 0.9 * 200.0


def test_the_overshoot_of_a_quintic_over_a_step_of_the_jerk() -> None:
    """Closed form against SciPy: the largest over where the step is and where it is looked at."""
    largest = 0.0
    for u in np.linspace(0.01, 0.99, 99):
        end = [u**3 / 6.0, u**2 / 2.0, u]
        jerk = BPoly.from_derivatives([0.0, 1.0], [[0.0, 0.0, 0.0], end]).derivative(3)
        largest = max(largest, float(jerk(np.linspace(0.0, 1.0, 101)).max()))
    assert pytest.approx(largest - 1.0, abs=3e-4) == JERK_OVERSHOOT  # flat in u


def torques(found: PlannedTrajectory, count: int = 7001) -> np.ndarray:
    """By Pinocchio's own algorithm, for one arm."""
    arm = found.arms[0]
    model = arm.robot.pin.copy()
    model.gravity = pin.Motion(np.asarray(arm.gravity), np.zeros(3))
    data = model.createData()
    states = found.states(np.linspace(0.0, found.duration, count))[:3]
    return np.array([pin.rnea(model, data, *state) for state in zip(*states, strict=True)])


@pytest.mark.slow
def test_torques_are_limited_with_gravity_and_payload() -> None:
    strong = along(two_links().with_payload(1.0), CORNERS, EDGES, limits())
    free = np.abs(torques(plan_trajectory([strong]))).max(axis=0)
    still = np.array(CORNERS)
    weight = np.abs(strong.robot.inverse_dynamics(still, 0 * still, 0 * still, DOWN)).max(axis=0)
    allowed = 0.6 * weight + 0.4 * free
    assert np.all(allowed < free)
    weak = replace(strong, limits=replace(strong.limits, torque=allowed))
    found = plan_trajectory([weak])
    assert np.all(np.abs(torques(found)) <= allowed * (1.0 + 1e-5))
    assert found.usage[0].torque.max() >= 0.98


@pytest.mark.slow
def test_rates_of_torques_are_limited(zigzag: PlannedTrajectory) -> None:
    (free,) = zigzag.arms

    def rates(found: PlannedTrajectory) -> np.ndarray:
        return np.abs(np.diff(torques(found), axis=0)).max(axis=0) * 7000 / found.duration

    allowed = 0.5 * rates(zigzag)
    bounded = replace(free, limits=replace(free.limits, torque_rate=allowed))
    found = plan_trajectory([bounded])
    assert np.all(rates(found) <= allowed * (1.0 + 1e-5))
    assert found.usage[0].torque_rate.max() >= 0.95


@pytest.mark.slow
def test_the_speed_of_the_hand_is_limited(zigzag: PlannedTrajectory) -> None:
    (free,) = zigzag.arms

    def fastest(found: PlannedTrajectory) -> float:
        q = found.states(np.linspace(0.0, found.duration, 7001))[0]
        steps = np.diff(free.robot.hand_pose(q)[1], axis=0)
        return float(np.linalg.norm(steps, axis=1).max() * 7000 / found.duration)

    allowed = 0.5 * fastest(zigzag)
    found = plan_trajectory([replace(free, limits=replace(free.limits, hand_speed=allowed))])
    assert fastest(found) <= allowed * (1.0 + 1e-5)  # it is kept at samples
    assert found.usage[0].hand_speed >= 0.99


@pytest.mark.slow
def test_an_arm_too_weak_for_its_weight_is_named_before_solving() -> None:
    bounds = replace(limits(), torque=np.array([2.0, 50.0]))
    weak = along(two_links(), CORNERS, EDGES, bounds)
    with pytest.raises(ValueError, match=r"too weak for its own weight.*joint1 has to bear"):
        plan_trajectory([weak])
    # Lying on its side it has no weight to bear.
    found = plan_trajectory([replace(weak, gravity=np.array([0.0, 0.0, -9.81]))])
    assert found.usage[0].torque.max() <= KEPT


def test_two_arms_share_the_time_and_keep_their_own_edges() -> None:
    first = along(two_links(), [[0.0, 0.0], [1.0, 0.5], [0.2, 0.9]], [0.0, 0.3, 1.0], limits())
    second = along(
        two_links(), [[0.5, 0.5], [0.5, 0.5], [-0.4, 1.0]], [0.0, 0.55, 1.0], limits(1.0)
    )
    found = plan_trajectory([first, second])
    assert np.allclose(found.edges, [0.0, 0.3, 0.55, 1.0])
    assert len(found.joint_names) == len(set(found.joint_names)) == 4
    assert found.states(found.robot_time([0.3]), 0)[0][0] == pytest.approx([1.0, 0.5], abs=1e-9)
    waiting = np.linspace(0.0, found.robot_time([0.55])[0], 40)
    assert np.abs(found.states(waiting, 1)[0] - [0.5, 0.5]).max() <= 1e-9
    both, alone = found.states(waiting), found.states(waiting, 1)
    assert np.array_equal(both[1][:, 2:], alone[1])


def hand_height(robot: Model, lower: float) -> Clearance:
    q = ca.SX.sym("q", robot.dof)
    height = robot.hand_pose(q)[1][1]
    return Clearance(ca.Function("height", [q], [height]), np.array([lower]), ("hand to table",))


@pytest.mark.slow
def test_distances_are_kept() -> None:
    robot = two_links()
    arm = along(robot, [[-1.2, 1.2], [-0.6, -1.2]], [0.0, 1.0], limits())
    lowest = plan_trajectory([arm], clearances=[hand_height(robot, -np.inf)]).least_distances[0][0]
    ends = robot.hand_pose(np.array([[-1.2, 1.2], [-0.6, -1.2]]))[1][:, 1]
    table = ends.min() - 0.3 * (ends.min() - lowest)
    assert lowest < table - 0.01
    found = plan_trajectory([arm], clearances=[hand_height(robot, table)])
    q = found.states(np.linspace(0.0, found.duration, 3000))[0]
    assert robot.hand_pose(q)[1][:, 1].min() >= table - 1e-5
    assert found.least_distances[0][0] == pytest.approx(table, abs=1e-3)


def test_a_distance_that_the_paths_violate_at_their_ends_is_named() -> None:
    arm = along(two_links(), CORNERS, EDGES, limits())
    clearance = hand_height(arm.robot, 0.5)
    with pytest.raises(NotConverged, match=r"hand to table is .* m at .* s, where the paths fix"):
        plan_trajectory([arm], clearances=[clearance])
    attempt = plan_trajectory([arm], clearances=[clearance], throw=False)
    assert not attempt.success
    assert "hand to table" in attempt.status


def test_weight_of_the_deviation_trades_time_for_distance(zigzag: PlannedTrajectory) -> None:
    close = plan_trajectory(zigzag.arms, deviation_weight=100.0)
    assert close.duration > zigzag.duration
    farthest = [max(each.joint for each in found.path_deviation[0]) for found in (close, zigzag)]
    assert farthest[0] < farthest[1] / 2


def test_without_rest_it_begins_and_ends_in_motion() -> None:
    line = along(two_links(), [[0.0, 0.0], [0.5, 0.3], [1.0, 0.6]], [0.0, 1.0, 2.0], limits())
    found = plan_trajectory([line], rest=False)
    _, v, _, _ = found.states(np.array([0.0, found.duration]))
    assert v == pytest.approx(np.array([[0.5, 0.3]] * 2), abs=0.05)
    assert found.sampled().time[-1] <= found.duration + 1e-9


@pytest.mark.slow
def test_short_and_long_intervals() -> None:
    corners = [[0.0, 0.0], [0.3, 0.1], [0.25, 0.3], [1.0, 0.3], [0.0, 0.0]]
    found = plan_trajectory([along(two_links(), corners, [0.0, 0.05, 0.07, 20.0, 20.05], limits())])
    assert found.usage[0].largest <= KEPT
    assert found.duration < 22.0


def test_paths_that_end_at_a_position_limit() -> None:
    robot = two_links()
    corners = [[0.0, 0.0], [3.0, 0.5], [2.0, 1.0], [2.5, 2.5], [2.0, 2.0]]
    found = plan_trajectory([along(robot, corners, [0.0, 0.5, 1.0, 1.5, 2.0], limits())])
    q = found.states(np.linspace(0.0, found.duration, 20_000))[0]
    assert np.all((q <= robot.upper + 1e-6) & (q >= robot.lower - 1e-6))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_any_kinks(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-2.0, 2.0, (7, 2)).tolist()
    edges = np.concatenate([[0.0], np.cumsum(rng.uniform(0.05, 0.6, 6))]).tolist()
    found = plan_trajectory([along(two_links(), corners, edges, limits(torque=60.0))])
    assert found.usage[0].largest <= KEPT


@pytest.mark.slow
def test_an_arm_of_seven_joints_with_weight() -> None:
    rng, robot = np.random.default_rng(5), go.human_arm("right").with_armature(0.05)
    middle, width = (robot.lower + robot.upper) / 2, robot.upper - robot.lower
    corners = (middle + 0.25 * width * rng.uniform(-1.0, 1.0, (4, 7))).tolist()
    bounds = JointLimits(*(np.full(7, each) for each in (3.0, 15.0, 500.0, 25.0)))
    arm = along(robot, corners, [0.0, 0.4, 0.5, 1.0], bounds)
    found = plan_trajectory([replace(arm, gravity=np.array([0.0, 0.0, -9.81]))])
    assert found.usage[0].largest <= KEPT
    assert np.all(np.abs(torques(found, 500)) <= 25.0 * (1.0 + 1e-5))


def test_wrong_arguments_are_named() -> None:
    arm = along(two_links(), CORNERS, EDGES, limits())
    with pytest.raises(ValueError, match="arms must be at least one"):
        plan_trajectory([])
    with pytest.raises(ValueError, match="edges must be 5 increasing times"):
        plan_trajectory([replace(arm, edges=arm.edges[::-1])])
    with pytest.raises(ValueError, match=r"paths\[1\] must begin where the one before ends"):
        plan_trajectory([replace(arm, paths=[arm.paths[0], *arm.paths[2:], arm.paths[1]])])
    with pytest.raises(ValueError, match=r"joint1 by 1 rad at 1\.4 s"):
        plan_trajectory([along(two_links(), [[0, 0], [4, 0], [0, 0]], [1, 1.4, 2], limits())])
    of_one = JointLimits(*(np.ones(1) for _ in range(4)))
    with pytest.raises(ValueError, match=r"limits\.velocity must be 2 numbers"):
        plan_trajectory([replace(arm, limits=of_one)])
    with pytest.raises(ValueError, match="all arms must begin and end at the same times"):
        plan_trajectory([arm, replace(arm, edges=arm.edges + 0.5)])
    with pytest.raises(ValueError, match="functions of the 4 joints of all arms"):
        plan_trajectory([arm, arm], clearances=[hand_height(arm.robot, 0.0)])
