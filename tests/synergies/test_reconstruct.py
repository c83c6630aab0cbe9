"""Synergies: planned segments, and the motion that they predict."""

from __future__ import annotations

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.logarithm import log
from geodesic_ocp.manifold.exp import sample_geodesic

TIME = np.linspace(0.0, 0.8, 81)


@pytest.fixture(scope="module")
def metric() -> go.KineticEnergy:
    return go.KineticEnergy(go.human_arm("left"))


@pytest.fixture(scope="module")
def motion(metric: go.KineticEnergy) -> go.Motion:
    """A geodesic with a cubic time law, slow at first, then fast."""
    # A geodesic 1.5 times as long would not be the shortest between its ends.
    v = 0.6 * np.array([1.2, -0.3, 0.6, 0.9, -0.5, 0.2, 0.4])
    q = np.array([0.2, 0.1, 0.6, 0.7, 0.1, -0.1, 0.2])
    fraction = 0.3 * TIME + 0.9 * TIME**2 - 0.2 * TIME**3
    rate = 0.3 + 1.8 * TIME - 0.6 * TIME**2
    positions, velocities = sample_geodesic(metric, q, v, fraction, tolerance=1e-12)
    names = metric.model.joint_names
    return go.Motion(
        TIME, positions, names, velocities * rate[:, None], go.trajectory.Subject(name="me")
    )


def test_a_geodesic_with_a_cubic_law_is_predicted_exactly(
    metric: go.KineticEnergy, motion: go.Motion
) -> None:
    """In one segment or two: the geodesic and the cubic between the same ends are unique."""
    for segments in ([(0, 80)], [(0, 33), (33, 80)]):
        synergies, predicted = go.synergies.reconstruct(metric, motion, segments)
        assert predicted.q == pytest.approx(motion.q, abs=1e-7)
        assert predicted.velocity == pytest.approx(motion.velocity, abs=1e-5)
        assert np.array_equal(predicted.time, motion.time)
        assert predicted.subject == motion.subject
        assert [(s.start, s.stop) for s in synergies] == segments
        assert sum(s.duration for s in synergies) == pytest.approx(0.8)


def test_prediction_is_continuous_and_passes_through_the_ends(
    metric: go.KineticEnergy, motion: go.Motion
) -> None:
    wavy = go.Motion(TIME, motion.q + 0.1 * np.sin(20 * TIME)[:, None], motion.joint_names)
    wavy = wavy.filtered()
    segments = [(0, 10), (10, 45), (45, 80)]
    for its_metric in (metric, go.Euclidean(7)):
        synergies, predicted = go.synergies.reconstruct(its_metric, wavy, segments)
        for synergy in synergies:
            start, stop = synergy.start, synergy.stop
            assert predicted.q[start] == pytest.approx(wavy.q[start], abs=1e-12)
            assert synergy(wavy.time[stop]) == pytest.approx(wavy.q[stop], abs=1e-12)
            speed = its_metric.norm(wavy.q[start], wavy.velocity[start])
            found = its_metric.norm(wavy.q[start], synergy(wavy.time[start], 1))
            assert found == pytest.approx(speed, rel=1e-4)


def test_reprs_are_short(motion: go.Motion) -> None:
    result = go.synergies.reconstruct(go.Euclidean(7), motion, [(0, 80)])
    assert repr(result) == "Reconstruction(1 synergies, 0.800 s)"
    assert repr(result.synergies[0]).startswith(
        "Synergy(start=0, stop=80, start_time=0, duration=0.8, length="
    )


def test_euclidean_synergies_are_straight(motion: go.Motion) -> None:
    synergies, predicted = go.synergies.reconstruct(go.Euclidean(7), motion, [(0, 80)])
    along = motion.q[-1] - motion.q[0]
    off = predicted.q - motion.q[0]
    off = off - np.outer(off @ along / (along @ along), along)
    assert np.abs(off).max() < 1e-12
    assert synergies[0].length == pytest.approx(np.linalg.norm(along), rel=1e-12)


def test_a_segment_that_returns_to_its_start_has_length_zero(metric: go.KineticEnergy) -> None:
    """Whatever the speeds at its ends."""
    q = 0.3 + 0.2 * np.sin(np.pi * TIME / 0.8)[:, None] * np.ones(7)
    q[-1] = q[0]
    velocity = 0.2 * np.pi / 0.8 * np.cos(np.pi * TIME / 0.8)[:, None] * np.ones(7)
    there_and_back = go.Motion(TIME, q, metric.model.joint_names, velocity)
    synergies, predicted = go.synergies.reconstruct(metric, there_and_back, [(0, 80)])
    assert synergies[0].length == 0.0
    assert predicted.q == pytest.approx(np.tile(q[0], (81, 1)))
    assert not predicted.velocity.any()
    nearly = q.copy()
    nearly[-1] += 1e-4
    almost = go.Motion(TIME, nearly, metric.model.joint_names, velocity)
    _, predicted = go.synergies.reconstruct(metric, almost, [(0, 80)])
    assert np.abs(predicted.q - q[0]).max() < 2e-3


def test_prediction_never_moves_backwards(motion: go.Motion) -> None:
    """Not even where it is fast at both ends and slow between, unlike an unconstrained cubic."""
    flat = go.Euclidean(7)
    velocity = motion.velocity * (1.0 + 9.0 * (2.0 * TIME[:, None] / 0.8 - 1.0) ** 2)
    hasty = go.Motion(TIME, motion.q, motion.joint_names, velocity)
    synergies, predicted = go.synergies.reconstruct(flat, hasty, [(0, 80)])
    law = synergies[0].law
    free = go.trajectory.time_law(law.length, law.duration, float(law(0.0, 1)), float(law(0.8, 1)))
    assert free(TIME, 1).min() < -0.1
    along = motion.q[-1] - motion.q[0]
    assert (predicted.velocity @ along).min() > -1e-6


def test_straight_lines_need_no_nlp(motion: go.Motion, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object, **keywords: object) -> None:
        raise AssertionError("a straight line is known in closed form")

    monkeypatch.setattr(log, "find_by_newton", fail)
    monkeypatch.setattr(log, "find_by_ipopt", fail)
    monkeypatch.setattr("geodesic_ocp.manifold.exp.integrate_by_scipy", fail)
    segments = [(k, k + 8) for k in range(0, 80, 8)]
    synergies, predicted = go.synergies.reconstruct(go.Euclidean(7), motion, segments)
    assert len(synergies) == 10
    assert predicted.q[::8] == pytest.approx(motion.q[::8], abs=1e-12)


def test_progress_is_reported(motion: go.Motion) -> None:
    seen: list[int] = []
    go.synergies.reconstruct(go.Euclidean(7), motion, [(0, 40), (40, 80)], progress=seen.append)
    assert seen == [1, 2]


@pytest.mark.parametrize(
    "segments", [[], [(0, 79)], [(1, 80)], [(0, 30), (31, 80)], [(0, 80), (80, 80)]]
)
def test_segments_must_cover_the_motion(segments: list[tuple[int, int]], motion: go.Motion) -> None:
    with pytest.raises(ValueError, match=r"segments must cover|must end after it starts"):
        go.synergies.reconstruct(go.Euclidean(7), motion, segments)


def test_no_velocity_and_wrong_times_are_named(motion: go.Motion) -> None:
    bare = go.Motion(motion.time, motion.q, motion.joint_names)
    with pytest.raises(ValueError, match="has no velocities"):
        go.synergies.reconstruct(go.Euclidean(7), bare, [(0, 80)])
    synergy = go.synergies.reconstruct(go.Euclidean(7), motion, [(0, 80)]).synergies[0]
    with pytest.raises(ValueError, match=r"t must lie in \[0, 0\.8\] s"):
        synergy(0.9)
    with pytest.raises(ValueError, match="order must be 0, 1 or 2"):
        synergy(0.1, 3)
