"""The program over all synergies: derivatives, optimality, limits."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
import pytest
from known_models import planar_arm
from numpy.testing import assert_allclose
from scipy.interpolate import interp1d
from short_reprs import check_reprs

import geodesic_ocp as go
from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.manifold.metrics import metric_of
from geodesic_ocp.retargeting.candidates import Candidates
from geodesic_ocp.retargeting.paired_arm import Pose
from geodesic_ocp.retargeting.paths_program import (
    ArmPart,
    MotionProgram,
    places_at,
    positions_at,
)
from geodesic_ocp.retargeting.synergy_paths import ArmProblem, PlannedPaths, plan_synergies
from geodesic_ocp.retargeting.waypoints import ArmWaypoints, ObjectiveWeights

CONFIGURATIONS = np.array(
    [
        [0.2, 0.1, -0.3, 0.9, 0.1, 0.0, 0.1],
        [0.7, 0.3, -0.1, 1.4, 0.3, 0.2, -0.1],
        [0.3, 0.6, -0.5, 1.1, -0.2, 0.1, 0.2],
    ]
)
DIRECTION = np.array([0.3, -1.0, 0.2])
TIMES = np.array([0.0, 0.5, 1.1])


def no_limits(n: int) -> JointLimits:
    return JointLimits(*np.full((4, n), np.inf))


def hand_between(arm: go.Model, ends: Array, numbers: Array) -> tuple[Pose, ...]:
    """Poses of a hand whose joints move evenly from one configuration to the next."""
    poses = arm.hand_pose(interp1d(np.arange(len(ends)), ends, axis=0)(numbers))
    return tuple(map(Pose, *poses))


@pytest.fixture(scope="module")
def arm() -> go.Model:
    return go.human_arm("right").with_armature(0.05)


@pytest.fixture(scope="module")
def waypoints(arm: go.Model) -> ArmWaypoints:
    poses = [Pose(*arm.hand_pose(q)) for q in CONFIGURATIONS]
    return ArmWaypoints(
        arm=arm,
        limited=True,
        alignment=go.retargeting.align(arm),
        begins=TIMES[:-1],
        ends=TIMES[1:],
        poses=tuple(poses),
        target_at=partial(hand_between, arm, CONFIGURATIONS),
        start=CONFIGURATIONS[0],
        limits=no_limits(arm.dof),
        offsets=None,
    )


def planned(*arms: ArmWaypoints, clearance: Clearance | None = None) -> PlannedPaths:
    return plan_synergies(arms, clearance=clearance, likeness=0.0, throw=False)


@pytest.fixture(scope="module")
def found(waypoints: ArmWaypoints) -> PlannedPaths:
    result = planned(waypoints)
    assert result.success
    return result


def speed_limited(waypoints: ArmWaypoints) -> ArmWaypoints:
    none = np.full(7, np.inf)
    return replace(waypoints, limits=JointLimits(np.full(7, 1.0), none, none, none))


def dear_first_joint(arm: go.Model, q: ca.SX, v: ca.SX) -> ca.SX:
    """Moving it costs more."""
    return 0.1 * v[0] ** 2 * (1.0 + q[1] ** 2)


def beyond_plane(
    lowest: float, arm: go.Model, q: ca.SX, v: ca.SX
) -> list[tuple[float, ca.SX, float]]:
    """The hand stays on one side of it."""
    distance = ca.dot(DIRECTION, arm.hand_pose(q)[1])
    return [(lowest, distance, np.inf), (-9.0, ca.dot(v, v), 1e4)]


@pytest.mark.slow
def test_derivatives_are_those_of_the_program(waypoints: ArmWaypoints) -> None:
    """CasADi's own gradient, Jacobian and Hessian, at a point near the straight lines."""
    given = replace(
        speed_limited(waypoints), offsets=np.full((3, 3), 0.1), path_tolerance=(0.03, 0.1)
    )
    part = ArmPart.evenly(
        given,
        ArmProblem(given, dear_first_joint, partial(beyond_plane, -np.inf)).definition(),
        np.array([0.0, 0.0, 50.0]),
        1,
        3,
    )
    weights = ObjectiveWeights(2.0, 1.1, 5.0, 0.3, 0.7, 1.0)
    q = ca.SX.sym("q", 7)
    _, position = waypoints.arm.hand_pose(q)
    above = Clearance(ca.Function("d", [q], [position[2]]), np.zeros(1), ("hand",))
    program = MotionProgram([part], TIMES, weights, above, {(0, 0.2): 0.0, (0, 0.9): 0.0})
    rng = np.random.default_rng(0)
    x = program.guess([part.nodes_on_lines(CONFIGURATIONS)])
    x += 0.05 * rng.standard_normal(x.size)
    functions = program.program.functions
    nlp = functions["nlp"]
    lam = rng.standard_normal(nlp.size1_out(1))
    z = ca.MX.sym("z", x.size)
    f, g = nlp(z, [])
    check = ca.Function("check", [z], [f, ca.gradient(f, z), g, ca.jacobian(g, z)])
    value, gradient, constraints, jacobian = (each.full() for each in check(x))
    again, slope = functions["grad_f"](x, [])
    assert_allclose(float(again), value[0, 0], rtol=1e-12)
    assert_allclose(slope.full(), gradient, atol=1e-8 * np.abs(gradient).max())
    other, derivative = functions["jac_g"](x, [])
    assert_allclose(other.full(), constraints, atol=1e-10)
    assert_allclose(derivative.full(), jacobian, atol=1e-8)
    lagrangian_slope = ca.Function("slope", [z], [ca.gradient(f + ca.dot(lam, g), z)])
    step = 1e-6
    upper = functions["hess_lag"](x, [], 1.0, lam).full()
    full = np.triu(upper) + np.triu(upper, 1).T
    for _ in range(5):
        direction = rng.standard_normal(x.size)
        ahead, behind = (
            lagrangian_slope(x + sign * step * direction).full()[:, 0] for sign in (1, -1)
        )
        expected = (ahead - behind) / (2 * step)
        assert_allclose(full @ direction, expected, atol=1e-5 * np.abs(expected).max())


def test_poses_are_attained_by_paths_that_meet(
    found: PlannedPaths, waypoints: ArmWaypoints
) -> None:
    one, other = found.paths[0]
    assert_allclose(one.nodes[-1], other.nodes[0], atol=0)
    assert_allclose(one.nodes[0], CONFIGURATIONS[0], atol=1e-12)
    for q, pose in zip((one.nodes[-1], other.nodes[-1]), waypoints.poses[1:], strict=True):
        assert max(pose.error(waypoints.arm, q)) < 1e-7
    assert found.within_reach == ((True, True, True),)


def test_paths_are_geodesics(found: PlannedPaths, arm: go.Model) -> None:
    """No limit is active: between its ends each path is the shortest way."""
    metric = metric_of(arm)
    for path in found.paths[0]:
        direct = go.geodesic(metric, path.nodes[0], path.nodes[-1])
        assert path.length == pytest.approx(direct.length, rel=1e-4)
        s = np.linspace(0.0, 1.0, 9)
        assert_allclose(path(s), direct(s), atol=2e-3)


def test_configurations_are_chosen_for_the_whole(
    found: PlannedPaths, waypoints: ArmWaypoints
) -> None:
    """The first movement ends where the second one is cheap, not where it alone is least."""
    alone = planned(
        replace(waypoints, begins=TIMES[:1], ends=TIMES[1:2], poses=waypoints.poses[:2])
    )
    start = alone.paths[0][0].nodes[-1]
    second = planned(
        replace(
            waypoints,
            begins=TIMES[1:2],
            ends=TIMES[2:],
            poses=waypoints.poses[1:],
            target_at=partial(hand_between, waypoints.arm, CONFIGURATIONS[1:]),
            start=start,
        )
    )
    assert found.action < alone.action + second.action
    assert alone.action <= found.paths[0][0].energy / TIMES[1] * (1.0 + 1e-6)


def test_slow_joints_take_time_or_another_way(waypoints: ArmWaypoints, found: PlannedPaths) -> None:
    slow = speed_limited(waypoints)
    result = planned(slow)
    assert result.success
    seconds = np.diff(TIMES) * (1.0 + result.longer)
    assert seconds.sum() > TIMES[-1]
    for path, duration in zip(result.paths[0], seconds, strict=True):
        for half in ((0.0, 0.5), (0.5, 1.0)):
            change = np.abs(np.diff(path(half), axis=0)[0])
            assert (change / (duration / 2)).max() <= 1.0 / 1.5 + 1e-5
    assert np.all(found.longer < 1e-6)


def test_needed_times_are_those_of_a_joint_that_accelerates_from_rest(
    waypoints: ArmWaypoints,
) -> None:
    """Checked by the ways that joints with and without limits go in these times."""
    v, a = np.array([[1.0, 2.0, np.inf, np.inf], [5.0, np.inf, 8.0, np.inf]])
    limits = replace(no_limits(4), velocity=v, acceleration=a)
    ways = np.linspace(0.0, 1.5, 31)[:, None] * [1.0, -1.0, 1.0, 1.0]
    times = replace(waypoints, limits=limits).needed_times(ways)
    accelerating = np.minimum(times[:, 0], v[0] / a[0])
    assert_allclose(a[0] * accelerating**2 / 2.0 + v[0] * (times[:, 0] - accelerating), ways[:, 0])
    assert_allclose(v[1] * times[:, 1], -ways[:, 1])
    assert_allclose(a[2] * times[:, 2] ** 2 / 2.0, ways[:, 2])
    assert np.all(times[:, 3] == 0.0)


def test_hand_stays_nearer_to_the_persons_for_more_energy(
    waypoints: ArmWaypoints, found: PlannedPaths
) -> None:
    """Between the same poses, the person's hand takes a path 10 cm to the side."""

    def hand(numbers: Array) -> tuple[Pose, ...]:
        beside = 0.1 * np.sin(np.pi * numbers)[:, None] * DIRECTION
        poses = zip(waypoints.target_at(numbers), beside, strict=True)
        return tuple(Pose(pose.rotation, pose.position + by) for pose, by in poses)

    def strays(paths: PlannedPaths) -> float:
        s = np.linspace(0.0, 1.0, 51)
        _, own = waypoints.arm.hand_pose(paths.paths[0][0](s))
        return float(np.linalg.norm(own - [pose.position for pose in hand(s)], axis=1).mean())

    near = planned(replace(waypoints, target_at=hand, path_tolerance=(0.01, 0.1)))
    assert near.success
    assert strays(near) < 0.5 * strays(found)
    assert near.action > found.action


@pytest.mark.slow
def test_bounds_hold_between_the_nodes(waypoints: ArmWaypoints, found: PlannedPaths) -> None:
    """A shoulder that may be raised a little less than it is without the limit."""
    s = np.linspace(0.0, 1.0, 1001)
    limit = float(np.max([path(s)[:, 0].max() for path in found.paths[0]])) - 0.03
    limited = waypoints.arm.with_limits(upper={waypoints.arm.joint_names[0]: limit})
    result = planned(replace(waypoints, arm=limited))
    assert result.success
    assert max(path(s)[:, 0].max() for path in result.paths[0]) == pytest.approx(limit, abs=2e-6)
    assert result.action > found.action


@pytest.mark.slow
def test_pose_out_of_reach_is_replaced_by_the_nearest(
    waypoints: ArmWaypoints, arm: go.Model
) -> None:
    last = waypoints.poses[-1]
    assert last.position is not None
    far = Pose(None, last.position * 3.0)
    near = replace(
        waypoints,
        poses=(*(Pose(None, pose.position) for pose in waypoints.poses[:-1]), far),
    )
    result = planned(near)
    assert result.success
    assert result.within_reach[0] == (True, True, False)
    _, position = arm.hand_pose(result.paths[0][-1].nodes[-1])
    (shoulder,) = (arm.frame_pose(arm.joint_names[0], np.zeros(7))[1],)
    assert far.position is not None
    beyond = np.linalg.norm(far.position - shoulder) - arm.reach
    assert np.linalg.norm(far.position - position) == pytest.approx(beyond, abs=2e-3)


@pytest.mark.slow
def test_distances_are_kept(waypoints: ArmWaypoints, found: PlannedPaths, arm: go.Model) -> None:
    """The hand stays above a plane that the free paths cross, between waypoints."""
    q = ca.SX.sym("q", 7)
    _, position = arm.hand_pose(q)
    distance = ca.dot(DIRECTION, position)
    clearance = Clearance(ca.Function("d", [q], [distance]), np.full(1, -np.inf), ("hand to wall",))

    def least(result: PlannedPaths) -> np.ndarray:
        curve = np.concatenate([path(np.linspace(0, 1, 200)) for path in result.paths[0]])
        return clearance.function.map(len(curve))(curve.T).full()[0]

    before = least(found)
    ends = [clearance.function(path.nodes[k]) for path in found.paths[0] for k in (0, -1)]
    bound = min(float(each) for each in ends) - 1e-3
    if before.min() >= bound:
        bound = float(before.min()) + 5e-3
    result = planned(waypoints, clearance=replace(clearance, lower=np.full(1, bound)))
    assert result.success
    assert least(result).min() >= bound - 1e-3
    assert not result.too_near
    assert result.least_distances[0] >= bound - 2e-4


@pytest.mark.slow
def test_two_arms_move_in_one_program(waypoints: ArmWaypoints, found: PlannedPaths) -> None:
    """Without distances between them, each moves as it does alone."""
    result = planned(waypoints, waypoints)
    assert result.success
    for paths in result.paths:
        for mine, alone in zip(paths, found.paths[0], strict=True):
            assert_allclose(mine.nodes[-1], alone.nodes[-1], atol=1e-4)


def planar(start: Array, last: Array, **changes: Any) -> ArmWaypoints:
    """Waypoints of a planar arm with two joints, which attains each position twice."""
    arm = planar_arm((0.4, 0.4), (1.0, 1.0), (0.2, 0.2), (0.01, 0.01)).with_armature(0.1)
    return ArmWaypoints(
        arm=arm.with_limits(lower=changes.pop("lower", [-3.0] * 2), upper=[3.0] * 2),
        limited=True,
        alignment=go.retargeting.Alignment(np.zeros(3), np.eye(3), np.eye(3), 0.8),
        begins=np.array([0.0]),
        ends=np.array([1.0]),
        poses=tuple(Pose(None, arm.hand_pose(q)[1]) for q in (start, last)),
        target_at=partial(hand_between, arm, np.array([start, last])),
        start=start,
        limits=no_limits(2),
        offsets=None,
        **changes,
    )


def above_floor(height: float) -> Clearance:
    """Return the distance of the elbow, an angle, from a floor."""
    q = ca.SX.sym("q", 2)
    function = ca.Function("d", [q], [q[0] - height])
    return Clearance(function, np.zeros(1), ("elbow to floor",))


@pytest.mark.slow
def test_another_posture_is_tried_before_a_pose_is_given_up() -> None:
    """Of the two configurations with the last position, the nearer one has the elbow too low."""
    start, low, high = np.array([[-0.15, 0.6], [-0.4, 0.8], [0.4, -0.8]])
    given = planar(start, low)
    assert_allclose(planned(given).paths[0][-1].nodes[-1], low, atol=1e-3)
    found = planned(given, clearance=above_floor(-0.2))
    assert found.success
    assert not found.too_near
    assert found.within_reach == ((True, True),)
    assert_allclose(found.paths[0][-1].nodes[-1], high, atol=1e-3)


@pytest.mark.parametrize("height", [-0.38, -0.3])
def test_a_pose_gives_way_within_the_tolerance_if_it_can(height: float) -> None:
    """Less energy takes the hand farther off; nowhere above -0.3 is it within the tolerance."""
    start, low = np.array([[-0.15, 0.6], [-0.4, 0.8]])
    given = planar(start, low, lower=[-3.0, 0.0], allowed=((0.0, 0.0), (0.01, 0.1)))
    found = planned(given, clearance=above_floor(height))
    assert found.success
    assert not found.too_near
    assert found.within_reach == ((True, False),)
    error, _ = given.poses[1].error(given.arm, found.paths[0][-1].nodes[-1])
    assert (error <= 0.01 + 1e-6) == (height < -0.35)


def test_paths_may_start_with_the_distances_that_were_too_small() -> None:
    """Obstacles added one after the other lead into a dead end, both at once around it."""
    given = planar(*np.array([[-0.5, 0.6], [0.6, 0.9]]))
    q, radius = ca.SX.sym("q", 2), 0.24  # of discs in the plane of the joints [rad]
    discs = np.array([[0.02, 0.89], [-0.05, 0.63]])
    distances = ca.vertcat(*(0.3 * (ca.norm_2(q - ca.DM(each)) - radius) for each in discs))
    clearance = Clearance(ca.Function("d", [q], [distances]), np.zeros(2), ("one", "other"))
    found = planned(given, clearance=clearance)
    assert found.success
    assert not found.too_near
    assert found.within_reach == ((True, True),)


def test_positions_at_instants_are_linear_in_the_variables(waypoints: ArmWaypoints) -> None:
    definition = ArmProblem(waypoints).definition()
    part = ArmPart.evenly(waypoints, definition, np.zeros(3), 2, 5)
    rng = np.random.default_rng(3)
    nodes = rng.standard_normal((part.grid.size, 7))
    times = np.array([0.0, 0.13, 0.5, 0.77, 1.1])
    expected = positions_at([part], [nodes], times)
    places = places_at([part], part.size, times)
    assert_allclose(places @ nodes.ravel(), expected.ravel(), atol=1e-12)


def test_a_small_error_may_save_a_detour() -> None:
    """The shortest path takes a configuration that misses a pose if those with it are far away."""
    exact = Candidates.attaining(np.array([2.0]), np.array([3.0]))
    far = Candidates(np.array([[0.0]]), np.array([0.01]), np.array([False]))
    near = replace(far, allowed=np.array([True]))
    assert exact.joined(far).q.tolist() == [[2.0], [3.0]]
    both = exact.joined(near)
    assert both.within_reach
    assert both.q.tolist() == [[2.0], [3.0], [0.0]]
    assert both.missed.tolist() == [0.0, 0.0, pytest.approx(1e4)]
    assert not near.within_reach


@pytest.mark.slow
def test_functions_add_constraints_and_costs(
    waypoints: ArmWaypoints, found: PlannedPaths, arm: go.Model
) -> None:
    def lowest(planned: PlannedPaths) -> float:
        curves = [path(np.linspace(0.0, 1.0, 201)) for path in planned.paths[0]]
        return float((arm.hand_pose(np.concatenate(curves))[1] @ DIRECTION).min())

    free = plan_synergies([waypoints], likeness=0.0, cost=dear_first_joint)
    check_reprs([free.program])
    assert free.action > found.action
    ends = [path.nodes[k] for path in found.paths[0] for k in (0, -1)]
    bound = float((arm.hand_pose(np.array(ends))[1] @ DIRECTION).min()) - 1e-3
    assert lowest(free) < bound - 1e-3
    kept = plan_synergies(
        [waypoints],
        likeness=0.0,
        cost=dear_first_joint,
        constraints=partial(beyond_plane, bound),
    )
    assert lowest(kept) >= bound - 2e-6
    assert kept.action > free.action


def test_arms_must_be_given() -> None:
    with pytest.raises(ValueError, match="arms must be at least one"):
        plan_synergies([])


def test_a_cost_must_be_a_function(waypoints: ArmWaypoints) -> None:
    with pytest.raises(ValueError, match=r"cost must be a function of \(model, q, v\), got 3.0"):
        plan_synergies([waypoints], cost=3.0)  # type: ignore[arg-type]
