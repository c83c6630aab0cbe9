"""Timing of a robot's paths: handover speeds, scaled time, several arms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.retargeting.time_scaling import ArmPaths, handover_speeds, scale_time
from geodesic_ocp.trajectory.timed_path import states_at


def lines(*corners: tuple[float, float]) -> list[go.Path]:
    points = np.array(corners)
    return [
        go.Path(go.Euclidean(2), go.Grid(1, 2), np.array([a, (a + b) / 2.0, b]))
        for a, b in pairwise(points)
    ]


def arm(paths: list[go.Path], limit: float, edges: tuple[float, ...] | None = None) -> ArmPaths:
    count = len(paths)
    instants = np.arange(count + 1.0) if edges is None else np.array(edges)
    lengths = np.array([path.length for path in paths])
    speeds = handover_speeds(np.ones(count + 1), np.ones(count), np.diff(instants), lengths)
    return ArmPaths(instants, paths, speeds, np.full(2, limit))


def velocities(found: ArmPaths, number: int, laws: tuple[go.TimeLaw, ...]) -> np.ndarray:
    law = laws[number]
    return states_at(found.paths[number], law, np.linspace(0.0, law.duration, 501))[1]


def test_time_is_unchanged_within_speed_limits() -> None:
    one = arm(lines((0, 0), (1, 0), (1, 1), (0, 1)), 10.0)
    timing = scale_time([one])
    assert_allclose(timing.factors, 1.0)
    assert_allclose(timing(one.edges), one.edges)
    for before, after in zip(timing.laws[0][:-1], timing.laws[0][1:], strict=True):
        assert before.speeds[-1] == pytest.approx(after.speeds[0], rel=1e-9)
    assert [law.duration for law in timing.laws[0]] == pytest.approx([1.0, 1.0, 1.0])


def test_time_is_scaled_to_speed_limits_and_speeds_stay_continuous() -> None:
    one = arm(lines((0, 0), (1, 0), (1, 4), (0, 4)), 2.0)
    timing = scale_time([one])
    assert timing.factors[1] > 2.0
    assert np.all(timing.factors >= 1.0)
    fastest = [np.abs(velocities(one, number, timing.laws[0])).max() for number in range(3)]
    assert max(fastest) <= 2.0 + 1e-9
    assert fastest[1] == pytest.approx(2.0, rel=5e-3)
    for before, after in zip(timing.laws[0][:-1], timing.laws[0][1:], strict=True):
        assert before.speeds[-1] == pytest.approx(after.speeds[0], rel=1e-9)
    assert timing(one.edges)[-1] == pytest.approx(np.sum(timing.factors))


def test_arms_share_the_scaled_time() -> None:
    quick = arm(lines((0, 0), (0.1, 0), (0.2, 0)), 2.0, (0.0, 1.5, 3.0))
    slow = arm(lines((0, 0), (1, 0), (1, 4), (0, 4)), 2.0)
    timing = scale_time([quick, slow])
    assert_allclose(timing.edges, [0.0, 1.0, 1.5, 2.0, 3.0])
    for each, laws in zip((quick, slow), timing.laws, strict=True):
        ends = timing(each.edges)
        assert_allclose([law.duration for law in laws], np.diff(ends), rtol=1e-12)
        assert np.abs(velocities(each, 1, laws)).max() <= 2.0 + 1e-9


def test_time_is_unchanged_without_speed_limits() -> None:
    one = arm(lines((0, 0), (100, 0)), np.inf)
    assert_allclose(scale_time([one]).factors, 1.0)


def test_handover_speeds_are_proportional_and_zero_at_rests() -> None:
    speeds = np.array([0.2, 1.0, 0.5, 0.4, 0.3])
    lengths, durations = np.array([1.0, 2.0, 0.0, 1.0]), np.ones(4)
    paths = np.array([2.0, 6.0, 0.0, 3.0])
    found = handover_speeds(speeds, lengths, durations, paths)
    assert_allclose(found, [0.4, 1.0 * (2.0 + 3.0) / 2.0, 0.0, 0.0, 0.9])
    # Never more than three times the mean speed on either side.
    fast = handover_speeds(np.full(3, 100.0), np.ones(2), np.ones(2), np.array([1.0, 0.1]))
    assert_allclose(fast, [3.0, 0.3, 0.3])


def test_velocities_and_accelerations_match_finite_differences() -> None:
    """On a path with varying |q'(s)|, against central differences in time."""
    grid = go.Grid(4, 5)
    metric = go.KineticEnergy(go.human_arm())
    angles = np.outer(np.sin(2.0 * grid.nodes), np.linspace(0.2, 0.9, 7)) + grid.nodes[:, None] ** 2
    path = go.Path(metric, grid, 0.5 * angles)
    law = go.time_law(path.length, 2.0, 0.1, 0.3)
    inside = np.array([0.31, 0.72, 1.1, 1.63])
    q, velocity, acceleration = states_at(path, law, inside)
    step = 1e-4
    before, after = (states_at(path, law, inside + sign * step) for sign in (-1.0, 1.0))
    assert_allclose(velocity, (after[0] - before[0]) / (2.0 * step), atol=1e-6)
    assert_allclose(acceleration, (after[1] - before[1]) / (2.0 * step), atol=1e-5)
    assert_allclose(q, path(path.at_length(law(inside))), atol=1e-12)
