"""Distances between links: bounds, rows of programs, and exact distances over a trajectory."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from installed_robots import needs_robots
from numpy.testing import assert_allclose, assert_array_equal
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.execution.clearance import active_rows, keep_clear, largest_lacks
from geodesic_ocp.execution.link_pairs import (
    LinkPairs,
    capsule_distances,
    exact_distance_at,
    link_pairs,
    place_solids,
    sampled_configurations,
)
from geodesic_ocp.execution.trajectory_clearance import trajectory_clearance
from geodesic_ocp.tables import text
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

SHOULDERS = [(-0.2, 0.0, 1.4), (0.2, 0.0, 1.4)]

# Three boxes on a chain that turns about x, z and x, on a base with a wall beside it.
_LINK = """<inertial><mass value="1"/>
  <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>"""
_BOX = """<collision><origin xyz="0 0 -0.2"/><geometry><box size="0.06 0.1 0.3"/></geometry>
  </collision>"""
_JOINT = """<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
  <origin xyz="{origin}"/><axis xyz="{axis}"/>
  <limit lower="-2.9" upper="2.9" effort="1" velocity="1"/></joint>"""


def boxes(geometry: str = _BOX) -> str:
    """URDF of a chain of three links with the given geometry."""
    joints = [("base", "one", "0 0 0", "1 0 0"), ("one", "two", "0 0 -0.4", "0 0.6 0.8")]
    joints += [("two", "three", "0 0 -0.2", "1 0 0")]
    links = "".join(
        f'<link name="{name}">{_LINK}{geometry}</link>' for name in ("one", "two", "three")
    )
    wall = geometry.replace("0 0 -0.2", "0 0.5 0")
    chain = "".join(
        _JOINT.format(name=f"to_{child}", parent=parent, child=child, origin=origin, axis=axis)
        for parent, child, origin, axis in joints
    )
    return f'<robot name="boxes"><link name="base">{wall}</link>{links}{chain}</robot>'


@pytest.fixture(scope="module")
def robot() -> go.Model:
    return go.load_model(boxes(), hand="three")


@pytest.fixture(scope="module")
def arms() -> tuple[go.Model, go.Model]:
    return go.human_arm("left"), go.human_arm("right")


@pytest.fixture(scope="module")
def found(robot: go.Model) -> LinkPairs:
    return link_pairs(robot)


def least_of(
    robot: go.Model, pair: tuple[str, str], q: np.ndarray
) -> tuple[np.ndarray, list[float]]:
    """Capsule and exact distances (k,) of two links."""
    placed = place_solids([robot])
    one, other = (placed.by_name[name] for name in pair)
    poses = placed.joint_poses(q)
    exact = [exact_distance_at(one, other, poses, k) for k in range(len(q))]
    return capsule_distances(one, other, poses).min(axis=0), exact


def test_neighbours_are_no_pairs_and_all_others_are(found: LinkPairs) -> None:
    pairs = {frozenset(pair) for pair in (*found.constrained, *found.exact_only)}
    assert pairs == {
        frozenset(pair) for pair in [("one", "three"), ("base", "two"), ("base", "three")]
    }
    assert found.unknown == ()


@pytest.mark.slow
def test_pairs_that_the_srdf_of_a_robot_disables_are_exempt(tmp_path: Path) -> None:
    """For any reason but "Default", the default configuration being one of many."""
    disabled = [("base", "two", "Never"), ("three", "one", "Default"), ("base", "gone", "User")]
    lines = "".join(
        f'<disable_collisions link1="{one}" link2="{other}" reason="{reason}"/>'
        for one, other, reason in disabled
    )
    srdf = f'<robot name="boxes">{lines}</robot>'
    for kind, content in (("urdf", boxes()), ("srdf", srdf)):
        (tmp_path / kind).mkdir()
        (tmp_path / kind / f"boxes.{kind}").write_text(content)
    arm = go.load_model(tmp_path / "urdf" / "boxes.urdf", hand="three")
    pairs = link_pairs(arm)
    assert pairs.exempt == {("base", "two"): "boxes.srdf"}
    assert {*pairs.constrained, *pairs.exact_only} == {("base", "three"), ("one", "three")}
    assert "1 pairs are exempt, as boxes.srdf disables" in str(pairs)
    beside = link_pairs([arm, arm], [(0.0, 0.0, 0.0), (0.5, 0.0, 0.0)])
    assert len(beside.exempt) == 2  # of each robot, not between them


def test_an_srdf_that_is_given_takes_the_place_of_the_one_beside_the_urdf(tmp_path: Path) -> None:
    pair = '<disable_collisions link1="{}" link2="three" reason="User"/>'
    content = '<robot name="{}">' + pair + "</robot>"
    (tmp_path / "srdf").mkdir()
    (tmp_path / "urdf").mkdir()
    (tmp_path / "urdf" / "boxes.urdf").write_text(boxes())
    (tmp_path / "srdf" / "boxes.srdf").write_text(content.format("boxes", "one"))
    file = tmp_path / "mine.srdf"

    def load() -> go.Model:
        return go.load_model(tmp_path / "urdf" / "boxes.urdf", hand="three", srdf=file)

    file.write_text(content.format("boxes", "base"))
    assert link_pairs(load()).exempt == {("base", "three"): "mine.srdf"}
    for given, message in (
        (content.format("spheres", "base"), "for the robot 'spheres'"),
        (content.format("boxes", "gone"), "disables no collisions of links of 'boxes'"),
        ("<robot", "no file of XML"),
    ):
        file.write_text(given)
        with pytest.raises(ValueError, match=message):
            load()
    with pytest.raises(ValueError, match="have no geometry"):
        go.load_model(go.human_arm().pin, hand="right hand", srdf=file)


def test_the_margin_of_a_pair_is_half_of_what_it_can_reach() -> None:
    """Two balls on the axis of both joints between them are 20 mm apart in any configuration."""
    balls = {"base": ("0 0 0.05", 0.04), "one": ("0.3 0 0", 0.02), "two": ("0 0 -0.05", 0.04)}
    links = "".join(
        f'<link name="{name}">{_LINK}<collision><origin xyz="{at}"/><geometry>'
        f'<sphere radius="{radius}"/></geometry></collision></link>'
        for name, (at, radius) in balls.items()
    )
    joints = "".join(
        _JOINT.format(name=child, parent=parent, child=child, origin="0 0 0", axis="0 0 1")
        for parent, child in pairwise(balls)
    )
    arm = go.load_model(f'<robot name="balls">{links}{joints}</robot>', hand="two")
    for margin, kept in ((0.005, 0.005), (0.015, 0.01), (0.5, 0.01)):
        pairs = link_pairs(arm, margin=margin)
        assert pairs.margin("base", "two", margin) == pytest.approx(kept)
        clearance = keep_clear(arm, pairs=pairs, margin=margin)
        assert clearance is not None
        assert_allclose(clearance.lower, kept)
        assert len(active_rows(clearance, sampled_configurations([arm], 8))) == 0
    assert "kept apart by 10 mm: base to two, which are at most 20 mm apart" in str(pairs)


def test_capsules_are_never_further_apart_than_the_links(robot: go.Model) -> None:
    q = sampled_configurations([robot], 100)
    for pair in [("one", "three"), ("base", "two"), ("base", "three")]:
        capsules, exact = least_of(robot, pair, q)
        assert np.all(capsules <= np.array(exact) + 1e-6)
        assert np.any(capsules > 0.0)


def test_the_function_of_a_program_is_the_distance_of_signed_distances(robot: go.Model) -> None:
    pairs = [("one", "three"), ("base", "three")]
    clearance = keep_clear(robot, pairs=pairs, margin=0.02)
    assert clearance is not None
    assert_array_equal(clearance.lower, 0.02)
    for q in sampled_configurations([robot], 8):
        expected = go.distances.signed_distances(robot, q, pairs=pairs)
        assert clearance.names == tuple(expected)
        assert_allclose(clearance.function(q).full()[:, 0], list(expected.values()), atol=1e-9)


def test_bounds_with_an_excess_leave_most_configurations(robot: go.Model) -> None:
    """No constrained pair excludes more than a quarter of the configurations without contact."""
    clearance = keep_clear(robot)
    assert clearance is not None
    assert clearance.exact is not None
    q = sampled_configurations([robot], 512)
    too_small = clearance.function(q.T).full() < clearance.lower[:, None]
    for row, wrong in enumerate(too_small):
        exact = np.array([clearance.exact(point, row) for point in q[wrong]])
        assert np.sum(exact >= clearance.lower[row]) <= 0.27 * len(q)


def test_rows_are_the_whole_function(arms: tuple[go.Model, go.Model]) -> None:
    table = go.HalfSpace((0.0, 0.0, 0.8), (0.0, 0.0, 1.0), name="table")
    clearance = keep_clear(arms, obstacles=[table], placements=SHOULDERS)
    assert clearance is not None
    assert any("to table" in name for name in clearance.names)
    q = sampled_configurations(arms, 3)[1]
    whole = clearance.function(q).full()[:, 0]
    rows = [float(clearance.row(index)(q)) for index in range(len(clearance.names))]
    assert_allclose(rows, whole, atol=1e-12)
    parts = map(clearance.part, range(len(clearance.names)))
    assert_allclose([float(part.expression(ca.SX(q))) for part in parts], whole, atol=1e-12)
    assert_allclose(clearance.row(2, 0)(q).full()[:, 0], whole[[2, 0]], atol=1e-12)
    assert clearance.row(0) is clearance.row(0)
    assert clearance.row(0).n_instructions() < clearance.function.n_instructions()
    with pytest.raises(ValueError, match="index must be from 0 to"):
        clearance.row(len(clearance.names))


@pytest.mark.slow
def test_left_and_right_arm_are_symmetric(arms: tuple[go.Model, go.Model]) -> None:
    clearance = keep_clear(arms, placements=SHOULDERS)
    swapped = keep_clear(arms[::-1], placements=SHOULDERS[::-1])
    assert clearance is not None
    assert swapped is not None
    q = sampled_configurations(arms, 2)[1]
    there = dict(zip(clearance.names, clearance.function(q).full()[:, 0], strict=True))
    back = dict(
        zip(
            swapped.names,
            swapped.function(np.concatenate([q[7:], q[:7]])).full()[:, 0],
            strict=True,
        )
    )
    assert len(there) == len(back)
    for name, distance in there.items():
        one, other = name.split(" to ")
        both = back.get(name, back.get(f"{other} to {one}"))
        assert distance == pytest.approx(both, abs=1e-9)


def test_arms_further_apart_have_larger_distances(arms: tuple[go.Model, go.Model]) -> None:
    """Stretched forwards, both arms are parallel: distances grow as the shoulders move apart."""
    between = [("left hand", "right hand"), ("left forearm", "right forearm")]
    q = np.zeros(14)
    values = []
    for half in (0.2, 0.35):
        clearance = keep_clear(
            arms, pairs=between, placements=[(-half, 0.0, 0.0), (half, 0.0, 0.0)]
        )
        assert clearance is not None
        values.append(clearance.function(q).full()[:, 0])
    assert_allclose(values[1] - values[0], 0.3, atol=1e-6)


@pytest.mark.slow
def test_without_placements_of_two_robots_it_is_said_that_clearance_is_unknown(
    robot: go.Model,
) -> None:
    apart = link_pairs([robot, robot])
    assert any("boxes 1 and boxes 2 is not known" in sentence for sentence in apart.unknown)
    crossing = [
        pair for pair in apart.constrained if pair[0].split("/")[0] != pair[1].split("/")[0]
    ]
    assert not crossing
    together = link_pairs([robot, robot], [(0.0, 0.0, 0.0), (0.5, 0.0, 0.0)])
    assert together.unknown == ()
    assert ("boxes 1/three", "boxes 2/three") in together.constrained


def test_arms_of_one_file_share_their_base(robot: go.Model) -> None:
    """Joints of one robot as two models: pairs between them, and the base is there once."""
    lower = go.load_model(boxes(), hand="one", joints=["to_one"])
    upper = go.load_model(boxes(), hand="three", joints=["to_three"])
    pairs = link_pairs([lower, upper])
    assert pairs.unknown == ()
    names = [each.name for each in pairs.solids.solids]
    assert len(names) == len(set(names))
    assert names.count("base") == 1


def test_a_robot_without_geometry_has_no_constraint_and_an_honest_report() -> None:
    bare = go.load_model(boxes(geometry=""), hand="three")
    assert keep_clear(bare) is None
    report = trajectory_clearance(bare, np.zeros((3, 3)))
    assert (report.least, report.pair, report.time) == (None, None, None)
    assert "pair=None" in repr(report)
    assert "no geometry" in text(report.table())


def test_active_rows_are_those_that_are_too_small(robot: go.Model) -> None:
    clearance = keep_clear(robot, pairs=[("one", "three"), ("base", "three")])
    assert clearance is not None
    q = sampled_configurations([robot], 200)
    values = clearance.function(q.T).full().T
    by_capsules = active_rows(replace(clearance, exact=None), q)
    marked = np.zeros(values.shape, dtype=bool)
    marked[by_capsules.samples, by_capsules.rows] = True
    assert_array_equal(marked, values < clearance.lower)
    by_links = active_rows(clearance, q)
    chosen = set(zip(by_links.samples.tolist(), by_links.rows.tolist(), strict=True))
    assert clearance.exact is not None
    assert clearance.closer is not None
    for sample, row in zip(by_capsules.samples.tolist(), by_capsules.rows.tolist(), strict=True):
        too_close = clearance.exact(q[sample], row) < clearance.lower[row]
        assert ((sample, row) in chosen) == too_close
        assert clearance.closer(q[sample], row, clearance.lower[row]) == too_close
    assert 0 < len(by_links) < len(by_capsules)
    worst = np.zeros(len(q))
    np.maximum.at(worst, by_links.samples, by_links.lacks)
    assert_allclose(largest_lacks(clearance, q), worst, atol=1e-12)
    assert_array_equal(largest_lacks(clearance, q, 0.0) > 0.0, worst > 0.0)
    assert np.all(by_links.lower <= clearance.lower[by_links.rows])
    assert len(active_rows(clearance, np.empty((0, 3)))) == 0
    with pytest.raises(ValueError, match=r"q must be finite, of shape \(k, 3\)"):
        active_rows(clearance, np.zeros(3))


def test_moving_along_the_gradient_of_violated_rows_removes_the_violation(robot: go.Model) -> None:
    """What a program with these rows does: it makes their distances larger."""
    clearance = keep_clear(robot, pairs=[("one", "three"), ("base", "three")])
    assert clearance is not None
    q = sampled_configurations([robot], 64)
    active = active_rows(clearance, q)
    point = q[active.samples[0]]
    for _ in range(400):
        rows = active_rows(clearance, point[None])
        if not len(rows):
            break
        row = clearance.row(int(rows.rows[0]))
        slope = row.factory("slope", ["q"], ["jac:d:q"])(point).full()[0]
        point = point + 0.01 * slope / np.linalg.norm(slope)
    assert len(active) > 0
    assert len(active_rows(clearance, point[None])) == 0


def test_the_least_exact_distance_of_a_trajectory_is_that_of_all_samples(
    robot: go.Model, found: LinkPairs
) -> None:
    steps = np.linspace(0.0, 1.0, 60)[:, None]
    q = (1.0 - steps) * np.array([0.1, -0.5, 0.3]) + steps * np.array([0.9, 0.8, 2.2])
    time = 0.1 * np.arange(60)
    moved = JointTrajectory(time, q, np.zeros_like(q), np.zeros_like(q), robot.joint_names)
    report = trajectory_clearance(robot, moved, pairs=found)
    for closest in report.closest:
        exact = least_of(robot, (closest.one, closest.other), q)[1]
        assert min(exact) <= closest.distance <= (min(exact) + 1.1e-4) / 0.95
        assert exact[closest.sample] == closest.distance
        assert closest.time == time[closest.sample]
    nearest = min(min(least_of(robot, (each.one, each.other), q)[1]) for each in report.closest)
    assert nearest <= report.closest[0].distance <= (nearest + 1.1e-4) / 0.99
    assert report.least == report.closest[0].distance
    assert report.pair == (report.closest[0].one, report.closest[0].other)
    assert f"least={report.least:.6g}" in repr(report)
    assert len(rows_of_table(report.table())) == len(report.closest) == report.pairs


def test_distances_change_by_no_more_than_links_move(arms: tuple[go.Model, go.Model]) -> None:
    clearance = keep_clear(arms, placements=SHOULDERS)
    assert clearance is not None
    assert clearance.exact is not None
    q = sampled_configurations(arms, 16)
    q[1::2] = q[::2] + (q[1::2] - q[::2]) / 20  # nearby, for the bound to tell something
    for index in range(len(clearance.names)):
        apart = np.array([clearance.exact(each, index) for each in q])
        moved = clearance.part(index).moved(q[::2], q[1::2])
        assert np.all(np.abs(apart[1::2] - apart[::2]) <= moved + 1e-9)
        assert np.all(moved < 1.0)


def test_links_that_touch_are_at_distance_zero(robot: go.Model, found: LinkPairs) -> None:
    q = sampled_configurations([robot], 128)
    touching = np.flatnonzero(np.array(least_of(robot, ("one", "three"), q)[1]) == 0.0)
    report = trajectory_clearance(robot, q[touching[:1]], pairs=found)
    assert report.least == 0.0
    assert report.pair == ("one", "three")
    assert report.time is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"pairs": [("one", "four")]}, "no link 'four'"),
        ({"pairs": [("one", "one")]}, "two different links"),
        ({"obstacles": [go.Ball((0.0, 0.0, 0.0), 0.1, link="one")]}, "must not be fixed"),
        ({"obstacles": ["table"]}, "obstacles must be"),
        ({"margin": np.nan}, "margin"),
        ({"placements": [(0.0, 0.0, 0.0)] * 2}, "one for each of 1 arms"),
    ],
)
def test_wrong_arguments_are_named(robot: go.Model, arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        keep_clear(robot, **arguments)


def test_wrong_trajectories_are_named(robot: go.Model, found: LinkPairs) -> None:
    with pytest.raises(ValueError, match=r"trajectory must be finite, of shape \(k, 3\)"):
        trajectory_clearance(robot, np.zeros((5, 2)), pairs=found)
    with pytest.raises(ValueError, match="other models"):
        trajectory_clearance(go.human_arm(), np.zeros((5, 7)), pairs=found)
    with pytest.raises(ValueError, match="arms must be one or more models"):
        link_pairs([])


@pytest.mark.slow
@needs_robots
def test_a_panda_keeps_its_links_apart_by_lower_bounds() -> None:
    robot = go.load_model("panda")
    pairs = link_pairs(robot)
    assert pairs.unknown == ()
    assert set(pairs.exempt.values()) == {"panda.srdf"}
    # It disables these for the reason "Default", which says nothing of other configurations.
    assert ("panda_link5", "panda_link7") in pairs.constrained
    known = (*pairs.constrained, *pairs.exact_only, *pairs.exempt)
    linked = {frozenset(pair) for pair in known}
    chain = [f"panda_link{number}" for number in range(8)]
    assert not any(frozenset(pair) in linked for pair in pairwise(chain))
    assert all(
        frozenset(pair) in linked
        for pair in combinations(chain, 2)
        if int(pair[1][-1]) - int(pair[0][-1]) > 2
    )
    q = sampled_configurations([robot], 40)
    for pair in pairs.constrained[::4]:
        capsules, exact = least_of(robot, pair, q)
        assert np.all(capsules <= np.array(exact) + 1e-6)
    middle = (robot.lower + robot.upper) / 2.0
    clearance = keep_clear(robot, pairs=pairs)
    assert clearance is not None
    assert len(active_rows(clearance, middle[None])) == 0
