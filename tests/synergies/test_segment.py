"""Segmentation of motions whose cuts are known."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import geodesic_ocp as go
from geodesic_ocp.manifold.exp import sample_geodesic

STEP = 0.01


def rotated(
    metric: go.Metric, q: np.ndarray, v: np.ndarray, angle: float, rng: np.random.Generator
) -> np.ndarray:
    """A vector of the same norm at this angle to v, in the metric, in a random direction."""
    other = rng.normal(size=v.size)
    other = other - metric.inner(q, v, other) / metric.inner(q, v, v) * v
    other = other * metric.norm(q, v) / metric.norm(q, other)
    return np.cos(angle) * v + np.sin(angle) * other


def chain_of_geodesics(
    metric: go.Metric, samples: Sequence[int], angle: float, rng: np.random.Generator
) -> tuple[go.Motion, list[tuple[int, int]]]:
    """Geodesics of the given numbers of steps, one after the other, at an angle to each other.

    The sample at a corner has the velocity of the geodesic that starts there.
    """
    q = rng.uniform(-0.4, 0.4, metric.dim)
    v = rng.uniform(-0.6, 0.6, metric.dim)
    positions, velocities, cuts = [q[None]], [v[None]], [0]
    for count in samples:
        path, speeds = sample_geodesic(metric, q, v, STEP * np.arange(count + 1))
        velocities[-1][-1] = v
        positions.append(path[1:])
        velocities.append(speeds[1:])
        q, v = path[-1], rotated(metric, path[-1], speeds[-1], angle, rng)
        cuts.append(cuts[-1] + count)
    stacked = np.vstack(positions)
    names = metric.joint_names or ()
    motion = go.Motion(STEP * np.arange(len(stacked)), stacked, names, np.vstack(velocities))
    return motion, list(pairwise(cuts))


@pytest.mark.slow
@settings(max_examples=10)
@given(
    samples=st.lists(st.integers(8, 40), min_size=1, max_size=5),
    angle=st.floats(0.75, 2.5),
    seed=st.integers(0, 2**32 - 1),
)
def test_cuts_between_geodesics_are_found_to_the_sample(
    arm_metric: go.KineticEnergy, samples: list[int], angle: float, seed: int
) -> None:
    """The velocity turns between a corner's sample and the one before."""
    motion, expected = chain_of_geodesics(arm_metric, samples, angle, np.random.default_rng(seed))
    found = go.segment(arm_metric, motion, 0.6, min_duration=0.05)
    assert within_a_sample(found, expected)


def within_a_sample(found: list[tuple[int, int]], expected: list[tuple[int, int]]) -> bool:
    """Whether every cut is that expected, or the sample before."""
    if len(found) != len(expected):
        return False
    early = np.array(expected) - np.array(found)
    return bool(np.all((early == 0) | (early == 1)))


def test_small_changes_of_direction_are_not_cuts(
    arm_metric: go.KineticEnergy, rng: np.random.Generator
) -> None:
    motion, _ = chain_of_geodesics(arm_metric, [30, 30], 0.3, rng)
    assert go.segment(arm_metric, motion, 0.6) == [(0, 60)]
    assert len(go.segment(arm_metric, motion, 0.2, hysteresis=0.05)) == 2
    # The angle rises above 0.25 rad, but not above 0.35 rad.
    assert len(go.segment(arm_metric, motion, 0.25, hysteresis=0.1)) == 1
    assert len(go.segment(arm_metric, motion, 0.25, hysteresis=0.0)) == 2


def test_no_segment_is_shorter_than_the_minimal_duration(
    arm_metric: go.KineticEnergy, rng: np.random.Generator
) -> None:
    """A geodesic of 60 ms between two of 300 ms is part of one of them unless asked for."""
    motion, expected = chain_of_geodesics(arm_metric, [30, 6, 30], 1.5, rng)
    assert len(go.segment(arm_metric, motion)) == 2
    found = go.segment(arm_metric, motion, min_duration=0.04)
    assert within_a_sample(found, expected)


def test_a_curved_geodesic_is_one_synergy_but_many_straight_lines(
    arm_metric: go.KineticEnergy,
) -> None:
    q = np.array([0.3, 0.2, -0.9, 1.2, 0.3, -0.1, 0.2])
    v = 2.0 * np.array([1.2, -0.4, 0.8, 1.1, -1.0, 0.6, 0.9])
    time = np.linspace(0.0, 1.0, 101)
    positions, velocities = sample_geodesic(arm_metric, q, v, time)
    motion = go.Motion(time, positions, arm_metric.joint_names, velocities)
    assert go.segment(arm_metric, motion, 0.1) == [(0, 100)]
    assert len(go.segment(go.Euclidean(7), motion, 0.1)) > 1


def with_rest(
    metric: go.Metric, before: int, rest: int, after: int, noise: float, rng: np.random.Generator
) -> go.Motion:
    """A geodesic, a rest whose velocity is noise, and the continuation of the geodesic."""
    q, v = rng.uniform(-0.4, 0.4, metric.dim), rng.uniform(-0.6, 0.6, metric.dim)
    path, velocity = sample_geodesic(metric, q, v, STEP * np.arange(before + after + 1))
    still = np.tile(path[before], (rest, 1))
    wobble = noise * np.abs(v).max() * rng.uniform(-1.0, 1.0, (rest, metric.dim))
    positions = np.vstack([path[:before], still, path[before:]])
    velocities = np.vstack([velocity[:before], wobble, velocity[before:]])
    time = STEP * np.arange(len(positions))
    return go.Motion(time, positions, metric.joint_names or (), velocities)


@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1), rest=st.integers(11, 60))
def test_a_rest_is_a_segment_of_its_own(arm_metric: go.KineticEnergy, seed: int, rest: int) -> None:
    """The velocity there changes its direction at every sample, but the rest is not cut."""
    motion = with_rest(arm_metric, 25, rest, 30, 1e-3, np.random.default_rng(seed))
    stop = 25 + rest
    expected = [(0, 25), (25, stop), (stop, 55 + rest)]
    assert within_a_sample(go.segment(arm_metric, motion, 0.6), expected)


def test_a_short_pause_is_not_cut(arm_metric: go.KineticEnergy, rng: np.random.Generator) -> None:
    motion = with_rest(arm_metric, 25, 5, 30, 1e-3, rng)
    assert go.segment(arm_metric, motion, 0.6) == [(0, 60)]
    assert len(go.segment(arm_metric, motion, 0.6, rest_duration=0.03)) == 3
    # Without rests, a minimal duration and hysteresis, noise is taken for changes of direction.
    bare = go.segment(arm_metric, motion, 0.6, rest=0.0, min_duration=0.0, hysteresis=0.0)
    assert len(bare) > 3


def test_rest_is_below_two_hundredths_of_the_largest_speed(
    arm_metric: go.KineticEnergy, rng: np.random.Generator
) -> None:
    """Half a second at 1.9 % is a rest, at 2.1 % a movement."""
    q, v = rng.uniform(-0.4, 0.4, 7), rng.uniform(-0.6, 0.6, 7)
    for fraction, count in ((0.019, 3), (0.021, 1)):
        rates = np.concatenate([np.full(30, 1.0), np.full(50, fraction), np.full(30, 1.0)])
        along = STEP * np.concatenate([[0.0], np.cumsum(rates[:-1])])
        path, velocity = sample_geodesic(arm_metric, q, v, along)
        time = STEP * np.arange(len(rates))
        names = arm_metric.joint_names
        motion = go.Motion(time, path, names, velocity * rates[:, None])
        assert len(go.segment(arm_metric, motion)) == count


def test_rests_at_the_ends(arm_metric: go.KineticEnergy, rng: np.random.Generator) -> None:
    motion = with_rest(arm_metric, 0, 20, 30, 1e-3, rng)
    assert within_a_sample(go.segment(arm_metric, motion, 0.6), [(0, 20), (20, 50)])
    motion = with_rest(arm_metric, 30, 20, 0, 1e-3, rng)
    # The last sample of the path follows the rest and moves again.
    assert within_a_sample(go.segment(arm_metric, motion, 0.6)[:2], [(0, 30), (30, 50)])


def test_a_segment_that_starts_in_a_pause_takes_the_first_direction_of_motion(
    arm_metric: go.KineticEnergy, rng: np.random.Generator
) -> None:
    motion = with_rest(arm_metric, 0, 5, 30, 1e-3, rng)
    assert go.segment(arm_metric, motion, 0.6) == [(0, 35)]


def still() -> go.Motion:
    q = np.full((50, 7), 0.3)
    return go.Motion(STEP * np.arange(50), q, tuple("abcdefg"), np.zeros((50, 7)))


def test_bad_arguments_are_named(arm_metric: go.KineticEnergy, rng: np.random.Generator) -> None:
    motion, _ = chain_of_geodesics(arm_metric, [20], 1.0, rng)
    bare = go.Motion(motion.time, motion.q, motion.joint_names)
    for threshold in (0.0, -0.6, np.nan):
        with pytest.raises(ValueError, match=r"threshold must be positive \[rad\]"):
            go.segment(arm_metric, motion, threshold)
    with pytest.raises(ValueError, match="threshold must be below pi rad"):
        go.segment(arm_metric, motion, 4.0)
    with pytest.raises(ValueError, match=r"has no velocities; use motion\.filtered\(\)"):
        go.segment(arm_metric, bare)
    with pytest.raises(ValueError, match="never moves"):
        go.segment(arm_metric, still())
    backwards = motion.select(motion.joint_names[::-1])
    with pytest.raises(ValueError, match=r"are not the metric's in its order.*motion\.select"):
        go.segment(arm_metric, backwards)
    with pytest.raises(ValueError, match="metric has dimension 2, the motion 7 joints"):
        go.segment(go.Euclidean(2), motion)
    with pytest.raises(ValueError, match=r"rest must be in \[0, 1\)"):
        go.segment(arm_metric, motion, rest=1.0)
    with pytest.raises(ValueError, match=r"min_duration must not be negative \[s\], got -0\.1"):
        go.segment(arm_metric, motion, min_duration=-0.1)
    with pytest.raises(ValueError, match=r"hysteresis must not be negative \[rad\], got -1"):
        go.segment(arm_metric, motion, hysteresis=-1)


class WithGap(go.Metric):
    """Not defined for q[0] between 0.493 and 0.507."""

    dim = 2

    def matrix(self, q: Any) -> Any:
        outside = ca.sqrt((q[0] - 0.493) * (q[0] - 0.507))
        return ca.SX.eye(2) * (1.0 + q[1] ** 2 + 1e-30 * outside)


def test_a_metric_that_is_undefined_between_two_samples_is_an_error() -> None:
    time = np.linspace(0.0, 1.0, 101)
    time = time[(time < 0.49) | (time > 0.51)]
    velocity = np.tile([1.0, 0.3], (time.size, 1))
    motion = go.Motion(time, time[:, None] * velocity, ("x", "y"), velocity)
    with pytest.raises(go.IntegrationFailed, match="parallel transport"):
        go.segment(WithGap(), motion)
