"""Segments do not depend on the sampling rate of a recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from motion_files import motion_in
from scipy.interpolate import CubicSpline

import geodesic_ocp as go
from geodesic_ocp.manifold.exp import sample_geodesic

RATES = (50.0, 100.0, 200.0, 1000.0)
NOISE = np.deg2rad(0.15)
RIGHT = tuple(f"R{each}_joint" for each in ("Sx", "Sz", "Sy", "Ex", "Ez", "Wx", "Wy"))


@dataclass(frozen=True)
class Segments:
    """Times of the cuts [s]."""

    cuts: np.ndarray

    def __len__(self) -> int:
        return len(self.cuts) - 1

    def unmatched(self, other: Segments) -> int:
        """Cuts on either side without one on the other within 20 ms."""
        apart = np.abs(self.cuts[:, None] - other.cuts)
        return int((apart.min(axis=0) > 0.0201).sum() + (apart.min(axis=1) > 0.0201).sum())


def with_inertia(arm: go.Model) -> go.KineticEnergy:
    return go.KineticEnergy(arm.with_armature(0.07))


def segments(metric: go.Metric, motion: go.Motion) -> Segments:
    found = go.segment(metric, motion.filtered())
    return Segments(np.append(motion.time[[start for start, _ in found]], motion.time[-1]))


def chain_of_geodesics(metric: go.KineticEnergy, count: int, seed: int) -> CubicSpline:
    """Geodesics between random configurations of the arm, one after the other, as q(t)."""
    rng = np.random.default_rng(seed)
    lower, upper = metric.model.lower, metric.model.upper
    middle, width = (lower + upper) / 2.0, 0.3 * (upper - lower)
    q = middle
    times, points = [0.0], [q]
    for _ in range(count):
        toward = middle + width * rng.uniform(-1.0, 1.0, q.size) - q
        path, _ = sample_geodesic(metric, q, toward, np.linspace(0.0, 1.0, 101))
        duration = rng.uniform(0.4, 0.9)
        times += (times[-1] + duration * np.linspace(0.0, 1.0, 101)[1:]).tolist()
        points += list(path[1:])
        q = path[-1]
    return CubicSpline(times, points)


def noisy(curve: CubicSpline, rate: float, seed: int) -> go.Motion:
    t = np.arange(int(curve.x[-1] * rate)) / rate
    noise = NOISE * np.random.default_rng(seed).normal(size=(t.size, 7))
    return go.Motion(t, curve(t) + noise, RIGHT)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_a_resampled_synthetic_recording_has_the_same_segments(arm: go.Model, seed: int) -> None:
    metric = with_inertia(arm)
    recorded = noisy(chain_of_geodesics(metric, 6, seed), 100.0, seed)
    expected = segments(metric, recorded)
    for rate in RATES:
        found = segments(metric, recorded.resampled(rate))
        assert len(found) == len(expected)
        assert found.unmatched(expected) == 0


@pytest.mark.slow
def test_geodesics_are_found_at_every_rate_with_noise_of_their_own(arm: go.Model) -> None:
    """White noise of 0.15 degrees, drawn anew: the figures of the old rule were 7 to 369."""
    metric = with_inertia(arm)
    curve = chain_of_geodesics(metric, 6, 2)
    for seed, rate in enumerate(RATES):
        assert len(segments(metric, noisy(curve, rate, seed))) == 6


def recordings(shared: Path) -> list[tuple[str, go.Model, go.Motion]]:
    found = []
    for name in (
        "hand_to_mouth_right_arm_01",
        "hand_to_mouth_right_arm_02",
        "take_book_from_shelf_right_arm_02",
        "take_book_from_shelf_right_arm_03",
        "Trial_75",
    ):
        for side in ("right", "left") if name == "Trial_75" else ("right",):
            joints = [each.replace("R", side[0].upper(), 1) for each in RIGHT]
            motion = motion_in(shared / "data" / "kit" / f"{name}.xml", joints)
            found.append((name, go.human_arm(side, motion.subject.height), motion))
    return found


@pytest.mark.slow
def test_resampled_real_recordings_have_the_same_segments(shared: Path) -> None:
    """Counts within one in ten; cuts within 20 ms, but for 3 in 100: angles that graze a limit."""
    unmatched = total = 0
    for name, arm, motion in recordings(shared):
        metric = with_inertia(arm)
        expected = segments(metric, motion)
        for rate in RATES:
            found = segments(metric, motion.resampled(rate))
            assert abs(len(found) - len(expected)) <= 0.1 * len(expected), (name, rate)
            unmatched += found.unmatched(expected)
            total += len(found.cuts) + len(expected.cuts)
    assert unmatched < 0.03 * total


@pytest.mark.slow
def test_zero_velocity_segments_of_resampled_recordings(shared: Path) -> None:
    for name, _, motion in recordings(shared):
        counts = [
            len(go.synergies.segment_zero_velocity(motion.resampled(rate).filtered()))
            for rate in RATES
        ]
        assert max(counts) - min(counts) <= max(1.0, 0.1 * min(counts)), (name, counts)


@pytest.mark.parametrize("min_duration", [0.05, 0.1, 0.3])
def test_no_cut_of_a_noisy_motion_is_closer_to_another_than_the_minimal_duration(
    arm: go.Model, min_duration: float
) -> None:
    metric = with_inertia(arm)
    motion = noisy(chain_of_geodesics(metric, 6, 3), 100.0, 3).filtered()
    found = go.segment(metric, motion, 0.3, rest=0.0, min_duration=min_duration)
    lengths = [stop - start for start, stop in found]
    assert len(found) > 1
    assert min(lengths) >= min_duration * 100.0 - 1.0  # cuts are rounded to samples
