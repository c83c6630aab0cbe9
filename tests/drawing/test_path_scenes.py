"""Paths, geodesics and solutions as scenes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from known_models import planar_arm
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.drawing.path_scenes import UNIT_BALLS, path_playback, solution_playback
from geodesic_ocp.drawing.scene import PARAMETER, Playback

GALLERY = Path(__file__).resolve().parents[2] / "problems"
ARM = go.human_arm()
START = (0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1)
TARGET = (0.10, 0.45, 0.10)
LAMP = go.Ball((0.20, 0.35, -0.15), 0.06, name="lamp")
STRAIGHT = go.Path(go.KineticEnergy(ARM), go.Grid(1, 2), np.linspace(START, np.add(START, 0.3), 3))


@dataclass(frozen=True)
class BesideLamp(go.Problem):
    """Between two configurations; the lamp is only shown."""

    arm: go.Model
    obstacles: tuple[go.Ball, ...] = (LAMP,)

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arm)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, np.full(3, 0.3)), (q1, np.full(3, 0.6))]


def check(playback: Playback) -> None:
    """All parts of the scene are finite, and for its samples or for all times."""
    (scene,) = playback.scenes
    count = len(scene.time)
    assert playback.time_label == PARAMETER
    assert (scene.time[0], scene.time[-1]) == (0.0, 1.0)
    assert np.diff(scene.time).min() > 1e-9
    moving: list[Any] = []
    for actor in scene.actors:
        moving += [*actor.rotations.values(), *actor.positions.values()]
        assert {mesh.link for mesh in actor.meshes} == set(actor.positions)
    moving += [trail.dot for trail in scene.trails if trail.dot is not None]
    moving += [each for frame in scene.frames for each in (frame.rotations, frame.positions)]
    moving += [each for track in scene.ellipsoids for each in (track.centres, track.axes)]
    moving += [each for gap in scene.gaps for each in (gap.starts, gap.ends, gap.distances)]
    for values in moving:
        assert len(values) in (1, count)
        assert np.all(np.isfinite(values))
    assert np.all(np.isfinite(scene.bounds()))
    for plot in playback.plots:
        for curve in plot.curves:
            assert np.array_equal(curve.time, scene.time)
            assert np.all(np.isfinite(curve.values))


@pytest.mark.slow
def test_the_arm_follows_the_path() -> None:
    playback = path_playback(STRAIGHT)
    check(playback)
    (scene,) = playback.scenes
    assert len(scene.time) == 101
    hand = ARM.hand_pose(STRAIGHT(scene.time))[1]
    assert_allclose(scene.trails[0].points, hand)
    assert_allclose(scene.ellipsoids[0].centres, hand)
    (frame,) = [track for track in scene.frames if track.name == ARM.hand]
    assert_allclose(frame.positions, hand)
    (joints, speed) = playback.plots
    assert len(joints.curves) == 7
    metric = STRAIGHT.metric
    expected = [metric.norm(STRAIGHT(s), STRAIGHT(s, 1)) for s in scene.time]
    assert_allclose(speed.curves[0].values, expected, rtol=1e-9)


def test_a_geodesic_has_a_constant_speed() -> None:
    path = go.geodesic(go.KineticEnergy(ARM), START, np.add(START, 0.3))
    playback = path_playback(path)
    assert "Geodesic" in playback.title
    assert_allclose(playback.plots[-1].curves[0].values, path.length, rtol=1e-4)


def test_metric_without_model_moves_the_model_that_is_given() -> None:
    path = go.Path(go.Euclidean(7), STRAIGHT.grid, STRAIGHT.nodes)
    check(path_playback(path, ARM))
    with pytest.raises(ValueError, match="Euclidean has no model, and a path of 7 coordinates"):
        path_playback(path)
    with pytest.raises(ValueError, match=r"model must have the path's 7 coordinates, .* has 2"):
        path_playback(path, planar_arm((1.0, 1.0), (1.0, 1.0), (0.5, 0.5), (0.1, 0.1)))


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_few_coordinates_are_a_curve(dim: int) -> None:
    nodes = np.column_stack([[0.0, 0.4, 1.0], [0.0, 0.3, 0.2], [0.1, 0.3, 0.2]])[:, :dim]
    path = go.Path(go.Euclidean(dim), go.Grid(1, 2), nodes)
    playback = path_playback(path, title="curve")
    check(playback)
    (scene,) = playback.scenes
    assert_allclose(scene.trails[0].points[:, :dim], path(scene.time))
    assert not scene.trails[0].points[:, dim:].any()
    assert not scene.actors
    rings = [trail for trail in scene.trails if trail.layer == UNIT_BALLS]
    assert len(rings) == (7 if dim == 2 else 0)
    if dim == 2:  # seen from above
        assert (playback.azimuth, playback.elevation) == (180.0, 89.0)
    for ring in rings:  # the Euclidean metric is the same everywhere, in all directions
        offsets = ring.points - ring.points[:-1].mean(axis=0)
        assert_allclose(np.linalg.norm(offsets, axis=1), 0.08 * np.ptp(nodes, axis=0).max())


def test_a_path_that_stays_where_it_is_is_shown() -> None:
    for metric in (go.Euclidean(2), go.KineticEnergy(ARM)):
        path = go.Path(metric, go.Grid(1, 2), np.tile(START[: metric.dim], (3, 1)))
        playback = path_playback(path)
        check(playback)
        assert not playback.plots[-1].curves[0].values.any()


def test_limits_that_are_reached_are_marked() -> None:
    wrist = ARM.joint_names.index("RWx_joint")
    nodes = np.array(STRAIGHT.nodes)
    nodes[:, wrist] = [0.0, 0.5 * ARM.upper[wrist], ARM.upper[wrist]]
    path = go.Path(STRAIGHT.metric, STRAIGHT.grid, nodes)
    assert path_playback(path).plots[0].marks == pytest.approx((ARM.upper[wrist],))
    assert path_playback(STRAIGHT).plots[0].marks == ()


def test_a_limit_that_is_touched_between_samples_is_marked() -> None:
    """A wrist that just reaches its limit does so at a node of the path."""
    wrist = ARM.joint_names.index("RWx_joint")
    grid = go.Grid(1, 4)
    nodes = np.tile(START, (grid.size, 1))
    nodes[:, wrist] = ARM.upper[wrist] - 10.0 * (grid.nodes - grid.nodes[1]) ** 2
    path = go.Path(STRAIGHT.metric, grid, nodes)
    assert path_playback(path).plots[0].marks == pytest.approx((ARM.upper[wrist],))


@pytest.mark.slow
def test_via_points_divide_the_path() -> None:
    mark = (0.30, 0.30, -0.20)
    solution = go.solve(go.Reach(ARM, START, (0.10, 0.45, -0.05), through=[mark]))
    playback = solution_playback(solution)
    check(playback)
    (cloud,) = playback.scenes[0].clouds
    assert_allclose(cloud.positions[0], [mark], atol=1e-6)
    first, second = playback.spans["path"]
    assert (first.start, second.stop) == (0.0, 1.0)
    assert first.stop == second.start == pytest.approx(solution.path.grid.via_s[0])


@pytest.mark.slow
def test_clearances_are_those_of_the_constraints() -> None:
    reach = go.Reach(
        *(ARM, START, TARGET), obstacles=[LAMP], links=["right hand", "right forearm"], margin=0.02
    )
    solution = go.solve(reach)
    playback = solution_playback(solution)
    (scene,) = playback.scenes
    assert [gap.name for gap in scene.gaps] == ["right hand to lamp", "right forearm to lamp"][::-1]
    clearance = playback.plots[-1]
    assert clearance.label == "clearance [m]"
    assert clearance.marks == (0.02,)
    least = min(curve.values.min() for curve in clearance.curves)
    assert least == pytest.approx(0.02, abs=2e-3)
    (bodies,) = [actor for actor in scene.actors if actor.layer == "collision bodies"]
    assert {mesh.link for mesh in bodies.meshes} == {"right hand", "right forearm"}
    assert "collision bodies" in playback.hidden
    assert "clearances" not in playback.hidden


def test_obstacles_are_shown_beside_a_model_without_bodies() -> None:
    arm = planar_arm((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), (0.5, 0.5, 0.5), (0.1, 0.1, 0.1))
    solution = go.solve(BesideLamp(arm))
    (scene,) = solution_playback(solution).scenes
    assert [solid.name for solid in scene.solids] == ["lamp"]
    assert scene.gaps == ()


def test_a_failed_solve_says_so() -> None:
    solution = go.solve(go.PointToPoint(STRAIGHT.metric, START, np.add(START, 0.3)))
    stats = replace(solution.stats, success=False, status="too many iterations")
    playback = solution_playback(replace(solution, stats=stats))
    assert playback.title == "PointToPoint: not solved"
    assert "failed: too many iterations" in playback.scenes[0].note


def test_a_planar_arm_is_seen_from_above() -> None:
    arm = planar_arm((1.0, 0.8), (1.0, 1.0), (0.5, 0.4), (0.1, 0.1))
    playback = path_playback(go.geodesic(go.KineticEnergy(arm), [0.2, 1.2], [1.1, 0.6]))
    check(playback)
    assert (playback.azimuth, playback.elevation) == (180.0, 89.0)
