"""Scores in cases that are known in closed form."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from known_models import planar_arm
from scipy.spatial.transform import Rotation
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.synergies.scores import SCORES, area_between, nearest_on_path

TIME = np.linspace(0.0, 2.0, 201)
CENTRE = np.array([0.6, 0.1, -0.8, 1.3, 0.1, -0.1, -0.1])


def swing(arm: go.Model, progress: np.ndarray) -> go.Motion:
    """A curved path in joint space, at these values of its parameter."""
    q = CENTRE + 0.3 * np.sin(np.outer(progress, [1.0, 1.7, 0.8, 2.0, 1.3, 2.2, 0.9]))
    return go.Motion(TIME, q, arm.joint_names)


@pytest.fixture(scope="module")
def motion(arm: go.Model) -> go.Motion:
    return swing(arm, TIME)


def test_scores_of_equal_motions(arm: go.Model, motion: go.Motion) -> None:
    scores = go.synergies.score(arm, motion, motion, [(0, 77), (77, 200)])
    assert scores.speed_correlation == pytest.approx(1.0)
    for name in SCORES.keys() - {"speed_correlation"}:
        assert getattr(scores, name) == pytest.approx(0.0, abs=1e-14)


def test_a_constant_offset(arm: go.Model, motion: go.Motion) -> None:
    """The last joint rotated by 0.2 rad turns the hand by 0.2 rad, of which S^3 sees half."""
    shifted = motion.q.copy()
    shifted[:, 6] += 0.2
    scores = go.synergies.score(arm, motion, go.Motion(TIME, shifted, motion.joint_names))
    assert scores.joint_mean == pytest.approx(0.2 / 7, rel=1e-12)
    assert scores.joint_rms == pytest.approx(0.2 / np.sqrt(7), rel=1e-12)
    assert scores.rotation_angle == pytest.approx(0.2, rel=1e-9)
    lever = 1.75 * np.hypot(0.015, 0.037)  # from the wrist to the tool centre
    assert scores.position_mean == pytest.approx(2 * np.sin(0.1) * lever, rel=1e-9)
    assert scores.position_rms == pytest.approx(scores.position_mean, rel=1e-9)


def test_distance_on_the_three_sphere(arm: go.Model, motion: go.Motion) -> None:
    """From its definition, arccos |<a, b>| of unit quaternions."""
    other = go.Motion(TIME, motion.q + 0.1 * np.cos(TIME)[:, None], motion.joint_names)
    a, b = (Rotation.from_matrix(arm.hand_pose(each.q)[0]).as_quat() for each in (motion, other))
    expected = np.mean(np.arccos(np.abs(np.sum(a * b, axis=1))))
    assert go.synergies.score(arm, motion, other).quaternion_distance == pytest.approx(
        expected, rel=1e-6
    )


@pytest.mark.parametrize("segments", [None, [(0, 60), (60, 200)]])
def test_a_time_warp_changes_everything_but_the_path(
    arm: go.Model, motion: go.Motion, segments: list[tuple[int, int]] | None
) -> None:
    edges = [0, 2.0] if segments is None else [0.0, 0.6, 2.0]
    progress = TIME.copy()
    for start, stop in pairwise(edges):
        inside = (start <= TIME) & (stop >= TIME)
        fraction = (TIME[inside] - start) / (stop - start)
        progress[inside] = start + (stop - start) * fraction**2
    warped = swing(arm, progress)
    scores = go.synergies.score(arm, motion, warped, segments)
    assert scores.joint_mean > 0.03
    assert scores.position_mean > 0.02
    assert scores.speed_rms > 0.1
    # What is left is the sagitta of chords between samples.
    assert scores.path_joint < 2e-5
    assert scores.path_position < 2e-5
    assert scores.area < 1e-4


def test_path_scores_stay_within_their_segment(arm: go.Model) -> None:
    """Back and forth on one path: the way back is no prediction of the way there."""
    there_and_back = swing(arm, 1.0 - np.abs(TIME - 1.0))
    still = go.Motion(TIME, np.tile(there_and_back.q[0], (201, 1)), arm.joint_names)
    late = go.Motion(
        TIME, np.vstack([still.q[:100], there_and_back.q[100:]]), there_and_back.joint_names
    )
    assert go.synergies.score(arm, there_and_back, late).path_joint < 1e-3
    assert go.synergies.score(arm, there_and_back, late, [(0, 99), (99, 200)]).path_joint > 0.05


def test_the_speed_profile_of_a_rotating_rod() -> None:
    """A tip at 2 m that turns at 1 + t rad/s, predicted at 1 rad/s."""
    rod = planar_arm((2.0,), (1.0,), (0.5,), (0.1,))
    velocity = 1.0 + TIME
    fast = go.Motion(TIME, (TIME + TIME**2 / 2)[:, None], rod.joint_names, velocity[:, None])
    slow = go.Motion(TIME, TIME[:, None], rod.joint_names, np.ones((201, 1)))
    scores = go.synergies.score(rod, fast, slow)
    assert scores.speed_rms == pytest.approx(2.0 * np.sqrt(np.mean(TIME**2)), rel=1e-9)
    assert np.isnan(scores.speed_correlation)  # a constant speed correlates with nothing
    twice = go.Motion(TIME, 2.0 * fast.q, rod.joint_names, 2.0 * fast.velocity)
    assert go.synergies.score(rod, fast, twice).speed_correlation == pytest.approx(1.0)
    bare = go.Motion(TIME, fast.q, rod.joint_names)  # velocities of its spline
    assert go.synergies.score(rod, bare, slow).speed_rms == pytest.approx(
        scores.speed_rms, rel=1e-9
    )


def test_areas_of_plane_figures() -> None:
    s = np.linspace(0.0, 1.0, 50)[:, None]
    line = np.hstack([3.0 * s, 0.0 * s, 0.0 * s])
    assert area_between(line, line + np.array([0.0, 0.0, 2.0])) == pytest.approx(6.0)  # a rectangle
    assert area_between(line, line + np.array([0.0, 3.0, 4.0])) == pytest.approx(15.0)  # tilted
    assert area_between(line[[0, -1]], line[[0, 0]] + [0.0, 1.0, 0.0]) == pytest.approx(1.5)
    # Lines that cross in the middle: two triangles of base 1 and height 3/2, none negative.
    crossing = line + np.hstack([0.0 * s, 1.0 - 2.0 * s, 0.0 * s])
    assert area_between(line, crossing) == pytest.approx(1.5, rel=1e-3)
    # Quarter circles of radius 1 and 2, an annulus; and a half circle with its diameter.
    angle = np.linspace(0.0, np.pi, 401)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    assert area_between(circle[:201], 2 * circle[:201]) == pytest.approx(0.75 * np.pi, rel=1e-4)
    assert area_between(circle, circle[[0, -1]]) == pytest.approx(np.pi / 2, rel=1e-4)


def test_area_does_not_depend_on_sampling_or_order(rng: np.random.Generator) -> None:
    s = np.linspace(0.0, 1.0, 301)
    first, second = (
        np.column_stack([s, a * np.sin(np.pi * s), b * s**2]) for a, b in rng.normal(size=(2, 2))
    )
    area = area_between(first, second)
    assert area > 0.1
    assert area_between(second, first) == pytest.approx(area)
    assert area_between(first[::-1], second[::-1]) == pytest.approx(area)
    uneven = np.searchsorted(s, np.linspace(0.0, 1.0, 201) ** 2)
    assert area_between(first[uneven], second) == pytest.approx(area, rel=1e-3)


@given(st.integers(0, 10**6), st.integers(2, 6))
def test_the_nearest_point_is_nearest(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    path, points = rng.normal(size=(count, 3)), rng.normal(size=(5, 3))
    nearest = nearest_on_path(points, path)
    found = np.linalg.norm(points - nearest, axis=1)
    u = np.linspace(0.0, 1.0, 101)[:, None]
    dense = np.vstack([a + u * (b - a) for a, b in pairwise(path)])
    between = np.linalg.norm(points[:, None] - dense, axis=2).min(axis=1)
    assert np.all(found <= between + 1e-12)
    on_path = np.linalg.norm(nearest[:, None] - dense, axis=2).min(axis=1)
    assert np.all(on_path <= 0.01 * np.linalg.norm(np.diff(path, axis=0), axis=1).max())


def test_scores_show_themselves(arm: go.Model, motion: go.Motion) -> None:
    other = go.Motion(TIME, motion.q + 0.1 * np.cos(TIME)[:, None], motion.joint_names)
    scores = go.synergies.score(arm, motion, other)
    assert [row[0] for row in rows_of_table(scores.table())] == list(SCORES.values())
    assert dict(rows_of_table(scores.table()))["joints [rad]"] == scores.joint_mean


def test_bad_arguments_are_named(arm: go.Model, motion: go.Motion) -> None:
    late = go.Motion(TIME + 0.001, motion.q, motion.joint_names)
    with pytest.raises(ValueError, match="must have the same sample times"):
        go.synergies.score(arm, motion, late)
    with pytest.raises(ValueError, match="segments must cover samples 0 to 200"):
        go.synergies.score(arm, motion, motion, [(0, 150)])
    with pytest.raises(ValueError, match="there is no joint LSx_joint"):
        go.synergies.score(go.human_arm("left"), motion, motion)
