"""Where a robot's base stands to take over a motion, and scales at which its poses are reached."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from importlib.resources import files
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from installed_robots import needs_robots
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from small_retargeting import small_analysis

import geodesic_ocp as go
from geodesic_ocp.blocks import BlockProgram
from geodesic_ocp.execution.clearance import largest_lacks
from geodesic_ocp.progress import no_progress
from geodesic_ocp.retargeting.paired_arm import PairedArm
from geodesic_ocp.retargeting.pairing import paired_arms
from geodesic_ocp.retargeting.place_program import PlaceProgram
from geodesic_ocp.retargeting.reachability import nearest_poses, random_starts
from geodesic_ocp.retargeting.settings import BEYOND, motion_clearance

place_base = import_module("geodesic_ocp.retargeting.place_base")
retarget = import_module("geodesic_ocp.retargeting.retarget")
SCALE = 1.1
LENIENT = go.retargeting.RetargetingSettings(merge=0.4, self_collision=False)


@pytest.fixture(scope="module")
def robot() -> go.Model:
    """The arm of the person of the recording."""
    return small_analysis().model


def displaced(robot: go.Model, shift: Any, yaw: float) -> go.retargeting.Alignment:
    """Return the alignment of an arm that stands beside the person's, by shift [m] and yaw."""
    aligned = go.retargeting.align(robot)
    turn = Rotation.from_euler("z", -yaw).as_matrix()
    return replace(aligned, base=turn, shoulder=-turn @ np.asarray(shift))


def reached(pair: PairedArm) -> int:
    """Return how many poses at the ends of the synergies a robot reaches."""
    rotations, positions = (each[pair.key_samples] for each in pair.target_poses)
    starts = random_starts(pair.robot, len(positions))
    return int(nearest_poses(pair.robot, rotations, positions, starts, 40).within_reach.sum())


def paired(robot: go.Model, alignment: go.retargeting.Alignment, **changes: Any) -> PairedArm:
    chosen = replace(LENIENT, **changes)
    return paired_arms([small_analysis()], [robot], [alignment], None, None, None, chosen)[0]


@pytest.mark.slow
def test_a_displaced_base_is_found_again(robot: go.Model) -> None:
    """The person's own arm reaches all poses where it was, and hardly any from somewhere else."""
    planted = displaced(robot, (-0.1, 0.2, 0.15), -0.5)
    before = reached(paired(robot, planted))
    count = reached(paired(robot, go.retargeting.align(robot)))
    assert before < count
    found = go.retargeting.place_base(robot, small_analysis(), alignment=planted, settings=LENIENT)
    assert (found.reached_before, found.reached, found.count) == (before, count, count)
    assert reached(paired(robot, found.alignment)) == count
    assert f"{count} of {count} poses within reach, {before} at the default place" in str(found)
    # The motion is the same in the room: what the base moves by, the targets move back by.
    turn = Rotation.from_euler("z", found.yaw).as_matrix()
    points = np.random.default_rng(0).standard_normal((5, 3))
    rotations = Rotation.random(5, random_state=0).as_matrix()
    before_move = planted.to_robot(rotations, points, scale=1.0)
    moved = turn @ rotations, points @ turn.T + found.shift
    for one, other in zip(found.alignment.to_robot(*moved, scale=1.0), before_move, strict=True):
        assert_allclose(one, other, atol=1e-12)


@pytest.mark.slow
@settings(max_examples=3)
@given(shift=st.tuples(*(st.floats(-0.3, 0.3),) * 3), yaw=st.floats(-1.0, 1.0), wide=st.booleans())
def test_the_place_found_is_no_worse_than_the_default(
    shift: tuple[float, float, float], yaw: float, wide: bool, robot: go.Model
) -> None:
    bounds = {} if wide else {"yaw": (0.0, 0.0), "distance": (-0.05, 0.05)}
    aligned = displaced(robot, shift, yaw)
    found = go.retargeting.place_base(
        robot, [small_analysis()] * 2, alignment=aligned, settings=LENIENT, **bounds
    )
    assert found.reached >= found.reached_before
    assert found.reached > found.reached_before or found.cost <= found.cost_before
    if not wide:
        assert found.yaw == 0.0
        assert abs(found.shift[1]) <= 0.05


def test_the_program_of_the_place_starts_on_its_equalities(
    robot: go.Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where poses are out of reach: elsewhere Ipopt's regularization may run away."""
    missed = []

    def solve(program: BlockProgram, x: Any, bounds: Any, *_: Any) -> Any:
        g = program.functions["nlp"](x, [])[1].full()[:, 0]
        lower, upper = program.bounds
        missed.append(np.abs((g - lower)[lower == upper]).max())
        return SimpleNamespace(x=x)

    monkeypatch.setattr(BlockProgram, "solve", solve)
    pair = paired(robot, displaced(robot, (0.3, 0.4, 0.3), -0.5))
    bounds = np.full(4, 0.3)
    search = place_base._BaseSearch((pair,), -bounds, bounds, False, None)
    search._polished(search.mounted(np.zeros(4), False), 0.9)
    assert max(missed) < 1e-9


@needs_robots
def test_bounds_from_where_links_overlapped_do_not_exclude_configurations_that_are_clear() -> None:
    robot = go.load_model("panda")
    clearance = motion_clearance([robot], go.retargeting.RetargetingSettings())
    assert clearance is not None
    q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (60, robot.dof))
    program = PlaceProgram((), (), (), np.zeros(4), np.zeros(4), clearance)
    lacks = largest_lacks(replace(clearance, lower=clearance.lower + BEYOND), q)
    kept = [program._small_distances(each[None], {})[0] for each in q[lacks > 0.02]]
    stricter = 0
    for each in q[lacks == 0.0]:
        distances = clearance.at(each[None])
        for bounds in kept:
            found, lack = program._small_distances(each[None], bounds)
            assert lack == 0.0
            assert bounds.keys() <= found.keys()
            assert all(least <= distances[key] + 1e-9 for key, least in found.items())
            stricter += sum(least > distances[key] for key, least in bounds.items())
    assert stricter > 0


@pytest.mark.parametrize(("scale", "factor"), [(None, 0.95), (1.0, 1.0)])
def test_positions_are_scaled_down_no_further_than_poses_need(
    scale: float | None, factor: float, robot: go.Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All four poses are within reach where positions are scaled by 0.95 or less."""
    tried = []

    def mounted(_: Any, place: Any, mirrored: bool, *__: int, factor: float = 1.0) -> Any:
        tried.append(factor)
        arm = SimpleNamespace(count=3)
        return place_base._Mounted(place, mirrored, factor, (arm,), (), 4 - (factor > 0.95), 1.0)

    search = place_base._BaseSearch
    monkeypatch.setattr(search, "mounted", mounted)
    monkeypatch.setattr(search, "_most_within_reach", lambda _: [])
    monkeypatch.setattr(search, "_polished", lambda *_: np.zeros(4))
    pair = paired(robot, go.retargeting.align(robot), scale=scale)
    moved, placed = place_base.best_place(pair, None)
    assert placed.factor == factor
    assert moved.mapping.scale == pytest.approx(factor * pair.mapping.scale)
    assert min(tried) == factor
    assert ("positions scaled by a further 0.95" in str(placed)) == (scale is None)


@pytest.mark.parametrize(("most", "taken"), [(1.3, 1.3), (1.0, 1.0), (0.0, 1.3 * 0.9)])
def test_a_long_arm_takes_positions_as_they_are_before_they_are_scaled_down(
    most: float, taken: float, robot: go.Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All four poses are within reach up to a scale; else three, and two with the default one."""
    tried = []

    def mounted(search: Any, place: Any, mirrored: bool, *_: int, factor: float = 1.0) -> Any:
        tried.append(factor * search.pairs[0].mapping.scale)
        reached = 4 if tried[-1] <= most + 1e-9 else 3 if factor < 0.94 else 2
        arm = SimpleNamespace(count=3)
        return place_base._Mounted(place, mirrored, factor, (arm,), (), reached, 1.0)

    search = place_base._BaseSearch
    monkeypatch.setattr(search, "mounted", mounted)
    monkeypatch.setattr(search, "_most_within_reach", lambda _: [])
    monkeypatch.setattr(search, "_polished", lambda *_: np.zeros(4))
    aligned = go.retargeting.align(robot)
    pair = paired(robot, replace(aligned, length=1.3 * aligned.length))
    moved, placed = place_base.best_place(pair, None)
    assert moved.mapping.scale == pytest.approx(taken)
    assert placed.factor == pytest.approx(taken / 1.3)
    assert placed.reached_before == (4 if most == 1.3 else 2)
    assert any(1.0 + 1e-6 < each < 1.3 - 1e-6 for each in tried) == (most == 0.0)


@pytest.mark.parametrize(
    ("length", "scale", "seconds", "taken"),
    [
        *((1.3, None, 2.0, 1.0), (1.3, None, 1.4, 1.3), (1.3, 1.3, 2.0, 1.3)),
        *((0.9, None, 2.0, 0.9), (1.3, None, 0.0, 1.0)),
    ],
)
def test_a_long_arm_takes_positions_as_they_are_where_it_is_too_slow_or_fails(
    length: float,
    scale: float | None,
    seconds: float,
    taken: float,
    robot: go.Model,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of a motion of one second that takes so long, or misses a pose if that is zero, and takes a
    third less and attains all poses with unscaled positions.
    """

    def motion(_: Any, pair: PairedArm) -> Any:
        unscaled = pair.mapping.scale == pytest.approx(1.0)
        lasts, wanting = (seconds or 1.0) / (1.5 if unscaled else 1.0), not (seconds or unscaled)
        times = SimpleNamespace(edges=np.arange(2.0), robot_edges=[0.0, lasts], stretch=lasts)
        arms = [SimpleNamespace(mapping=pair.mapping, missed={1: (1.0, 1.0)} if wanting else {})]
        found = SimpleNamespace(planned=times, stretch=lasts, arms=arms, is_wanting=wanting)
        return found, []

    monkeypatch.setattr(retarget._Plan, "_moved", motion)
    aligned = go.retargeting.align(robot)
    pair = paired(robot, replace(aligned, length=length * aligned.length), scale=scale)
    plan = retarget._Plan(None, 100.0, 1e-3, True, no_progress)
    found, notes = plan.of_robot(pair)
    assert found.arms[0].mapping.scale == pytest.approx(taken)
    assert len(notes) == (taken == 1.0)


@pytest.mark.slow
def test_a_robot_is_moved_if_poses_are_out_of_reach(robot: go.Model) -> None:
    """Poses a tenth farther from the shoulder are within reach of an arm that stands nearer."""
    chosen = replace(LENIENT, scale=SCALE, speed_limits=False, path_tolerance=(np.inf, np.inf))
    with pytest.warns(UserWarning, match="is moved, as it does not attain all poses: base "):
        found = go.retarget(small_analysis(), robot, settings=chosen, tolerance=1e-3)
    (arm,) = found.arms
    assert arm.placement is not None
    assert arm.placement.count == arm.placement.reached > arm.placement.reached_before
    assert not arm.missed
    assert_allclose(arm.mapping.target.shoulder, arm.placement.alignment.shoulder)
    assert arm.mapping.scale == SCALE  # as asked for


@pytest.mark.slow
def test_a_slow_robot_is_moved_where_it_is_quicker() -> None:
    arm = go.human_arm("right", 1.95, 90.0)
    chain = arm.pin.copy()
    chain.velocityLimit = np.full(arm.dof, 0.4)  # [rad/s]
    slow = go.Model(chain, arm.hand, shapes=arm.bodies)
    chosen = replace(LENIENT, scale=1.0, path_tolerance=(np.inf, np.inf))
    fixed = go.retarget(
        small_analysis(), slow, alignment=go.retargeting.align(slow), settings=chosen
    )
    with pytest.warns(UserWarning, match="is moved, as its motion is slow or fails: base "):
        found = go.retarget(small_analysis(), slow, settings=chosen)
    assert found.arms[0].placement is not None
    assert found.planned.stretch < fixed.planned.stretch


@needs_robots
@pytest.mark.slow
def test_a_late_motion_is_planned_with_more_weight_of_time_if_that_is_quicker(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An xArm 7 at half its speed takes over the bundled recording."""
    person, robot = go.human_arm("left", 1.78), go.load_model("xarm7")
    file = files("geodesic_ocp") / "data" / "climb.csv"
    analysis = go.analyse(person, go.read_motion(file, person.joint_names))
    limits = go.execution.joint_limits(robot)
    limits = replace(limits, velocity=limits.velocity / 2.0)
    given = {"alignment": go.retargeting.align(robot), "limits": limits}
    chosen = go.retargeting.RetargetingSettings(self_collision=False)
    found = go.retarget(analysis, robot, settings=chosen, **given)
    monkeypatch.setattr(retarget, "_QUICKER", 0.0)  # never
    usual = go.retarget(analysis, robot, settings=chosen, **given)
    assert usual.stretch > 1.05 > found.stretch
    assert found.success
    weights = [each.paths.program.stretch for each in (usual, found)]
    assert weights == pytest.approx([chosen.stretch_weight, 10.0 * chosen.stretch_weight])


@pytest.mark.slow
def test_a_scale_to_fit_is_the_largest_that_does(robot: go.Model) -> None:
    aligned = go.retargeting.align(robot)
    long = replace(aligned, length=1.3 * aligned.length)  # poses are farther than the arm is long

    default, fitted = paired(robot, long), paired(robot, long, scale="fit")
    assert default.mapping.scale == pytest.approx(1.3)
    larger = paired(robot, long, scale=fitted.mapping.scale + 0.05)
    assert reached(fitted) > reached(larger) >= reached(default)
    assert 1.0 <= fitted.mapping.scale < 1.3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"analyses": []}, "analyses: there must be at least one"),
        ({"height": (0.2, 0.1)}, r"height: the least must not be above the largest, got \(0.2"),
        ({"yaw": 0.5}, r"yaw must have shape \(2,\)"),
        (
            {"settings": go.retargeting.RetargetingSettings(position_weight=0.0)},
            "position_weight must be",
        ),
        (
            {"mirrored": True, "settings": go.retargeting.RetargetingSettings(mirror=False)},
            "mirrored: the side of the alignment must be known",
        ),
    ],
)
def test_wrong_arguments_are_named(robot: go.Model, change: dict[str, Any], message: str) -> None:
    given = {"analyses": small_analysis(), **change}
    with pytest.raises(ValueError, match=message):
        go.retargeting.place_base(robot, **given)


def test_an_unknown_scale_is_named() -> None:
    with pytest.raises(ValueError, match="scale must be a number, 'fit' or None, got 'large'"):
        go.retargeting.RetargetingSettings(scale="large")
