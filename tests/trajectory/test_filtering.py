"""Filters: their response, the noise they find, and that the sampling rate does not matter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import geodesic_ocp as go

RATES = (50.0, 100.0, 200.0, 1000.0)


def sampled(rate: float, duration: float = 6.0) -> go.Motion:
    """Two joints that swing at up to 2 Hz."""
    t = np.arange(round(duration * rate) + 1) / rate
    q = np.column_stack([np.sin(3.0 * t) + 0.3 * np.cos(9.0 * t), 0.5 * np.cos(5.0 * t)])
    return go.Motion(t, q, ("a", "b"))


def noisy(motion: go.Motion, sigma: float, seed: int = 0) -> go.Motion:
    noise = sigma * np.random.default_rng(seed).normal(size=motion.q.shape)
    return replace(motion, q=motion.q + noise)


def amplitude(rate: float, frequency: float, cutoff: float) -> float:
    """Of a filtered unit sine, in the middle of 8 s."""
    t = np.arange(round(8.0 * rate)) / rate
    found = go.Motion(t, np.sin(2.0 * np.pi * frequency * t)[:, None], ("a",))
    middle = (t > 3.0) & (t < 5.0)
    waves = np.sin(2.0 * np.pi * frequency * t[middle])
    return float(waves @ found.filtered(cutoff=cutoff).q[middle, 0] / (waves @ waves))


@pytest.mark.parametrize("rate", RATES)
def test_a_sine_at_the_cutoff_loses_half_its_power(rate: float) -> None:
    assert amplitude(rate, 6.0, 6.0) == pytest.approx(np.sqrt(0.5), abs=2e-3)


@settings(max_examples=4)
@given(frequency=st.floats(0.5, 20.0), cutoff=st.floats(2.0, 12.0))
def test_the_response_is_that_of_a_butterworth_filter_both_ways(
    frequency: float, cutoff: float
) -> None:
    expected = 1.0 / (1.0 + (np.sqrt(2.0) - 1.0) * (frequency / cutoff) ** 6)
    assert amplitude(200.0, frequency, cutoff) == pytest.approx(expected, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("rate", RATES)
def test_velocities_hardly_depend_on_the_rate(rate: float) -> None:
    found, finest = sampled(rate).filtered(cutoff=6.0), sampled(2000.0).filtered(cutoff=6.0)
    every = round(2000.0 / rate)
    assert found.q == pytest.approx(finest.q[::every], abs=2e-3)
    assert found.velocity == pytest.approx(finest.velocity[::every], abs=2e-2)
    inside = slice(len(found) // 6, -len(found) // 6)
    assert found.velocity[inside] == pytest.approx(finest.velocity[::every][inside], abs=1e-3)


@pytest.mark.parametrize("rate", RATES)
def test_a_motion_without_noise_stays_as_it_is(rate: float) -> None:
    motion = sampled(rate)
    found = motion.filtered()
    assert found.q == pytest.approx(motion.q, abs=5e-4)
    assert found.filter.noise == pytest.approx([0.0, 0.0], abs=5e-5)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("sigma", [1e-3, 5e-3])
def test_the_noise_is_found_and_reported(rate: float, sigma: float) -> None:
    found = noisy(sampled(rate), sigma).filtered().filter
    assert found.noise == pytest.approx([sigma, sigma], rel=0.25)
    assert 3.0 <= found.cutoff <= 12.0
    assert f"cut-off frequency of {found.cutoff:.3g} Hz, chosen from the noise floor" in str(found)


def test_more_noise_lowers_the_cutoff_and_filtering_reduces_it() -> None:
    quiet, loud = (noisy(sampled(100.0), sigma).filtered() for sigma in (3e-4, 1e-2))
    assert loud.filter.cutoff < quiet.filter.cutoff
    exact = sampled(100.0)
    t = exact.time
    slope = np.column_stack([3 * np.cos(3 * t) - 2.7 * np.sin(9 * t), -2.5 * np.sin(5 * t)])
    error = np.sqrt(np.mean((loud.velocity - slope)[20:-20] ** 2, axis=0))
    # Of what remains, noise is the part that the filter states; distortion adds to it.
    assert np.all(error < 2.0 * loud.filter.velocity_noise)
    assert np.all(loud.filter.velocity_noise < 0.2)


@pytest.mark.parametrize("rate", RATES)
def test_the_chosen_cutoff_does_not_depend_on_the_rate_of_resampling(rate: float) -> None:
    recorded = noisy(sampled(120.0), 3e-3)
    expected = recorded.filtered()
    found = recorded.resampled(rate).filtered()
    assert found.filter.cutoff == pytest.approx(expected.filter.cutoff, abs=0.2)
    inside = (found.time > 0.5) & (found.time < 5.5)
    assert found.q[inside] == pytest.approx(expected(found.time[inside]), abs=1e-3)


def test_rounded_angles_are_noise() -> None:
    """Steps of 0.01 rad are noise of 0.01 / sqrt(12) rad."""
    motion = sampled(100.0)
    found = replace(motion, q=np.round(motion.q, 2)).filtered().filter
    assert found.noise == pytest.approx(np.full(2, 0.01 / np.sqrt(12.0)), rel=0.25)


def test_repeated_samples_do_not_break_the_choice() -> None:
    """Recorded at 50 Hz, stored at 100 Hz with every sample twice."""
    motion = noisy(sampled(50.0), 2e-3)
    steps = np.repeat(motion.q, 2, axis=0)
    stored = go.Motion(np.arange(len(steps)) / 100.0, steps, ("a", "b"))
    chosen = motion.filtered().filter.cutoff
    assert stored.filtered().filter.cutoff == pytest.approx(chosen, abs=1.0)


def test_a_joint_that_does_not_move_has_no_say() -> None:
    motion = noisy(sampled(100.0), 2e-3)
    still = replace(motion, q=np.column_stack([motion.q, np.ones(len(motion))]), joint_names="abc")
    assert still.filtered().filter.cutoff == motion.filtered().filter.cutoff
    assert still.filtered().filter.noise[2] < 1e-4


def test_windows_by_duration_and_by_samples_agree() -> None:
    motion = noisy(sampled(100.0), 2e-3)
    by_time, by_count = motion.filtered(duration=0.21), motion.filtered(21, 2)
    assert np.array_equal(by_time.q, by_count.q)
    assert np.array_equal(by_time.velocity, by_count.velocity)
    assert by_time.filter.duration == pytest.approx(0.21)
    assert by_time.filter.cutoff is None
    assert by_time.filter.noise == pytest.approx([2e-3, 2e-3], rel=0.3)
    fine = noisy(sampled(1000.0), 2e-3).filtered(duration=0.21)
    assert fine.filter.duration == pytest.approx(0.21, abs=2e-3)
    assert fine.q[::10] == pytest.approx(by_time.q, abs=0.01)


def test_motions_remember_what_was_filtered() -> None:
    motion = noisy(sampled(100.0), 2e-3)
    found = motion.filtered()
    assert np.array_equal(found.unfiltered, motion.q)
    assert motion.filter is None
    chosen = found.select(["b"])
    assert np.array_equal(chosen.unfiltered, motion.q[:, 1:])
    assert chosen.filter.noise == pytest.approx(found.filter.noise[1:])
    part = replace(
        found,
        time=found.time[:50],
        q=found.q[:50],
        velocity=found.velocity[:50],
        unfiltered=found.unfiltered[:50],
    )
    assert part.filter is found.filter
    dense = found.resampled(200.0)
    assert dense.filter is dense.unfiltered is dense.velocity is None
    with pytest.raises(ValueError, match=r"unfiltered must have the shape \(601, 2\) of q"):
        replace(found, unfiltered=found.q[:50])


@pytest.mark.parametrize("last", [{}, {"cutoff": 5.0}, {"window": 21}, {"duration": 0.3}])
@pytest.mark.parametrize("first", [{}, {"cutoff": 3.0}, {"window": 31}])
def test_a_filter_starts_from_the_recording(
    first: dict[str, float], last: dict[str, float]
) -> None:
    recording = noisy(sampled(100.0), 5e-3)
    once, twice = recording.filtered(**last), recording.filtered(**first).filtered(**last)
    assert np.array_equal(twice.q, once.q)
    assert np.array_equal(twice.velocity, once.velocity)
    assert np.array_equal(twice.unfiltered, recording.q)
    assert twice.filter.cutoff == once.filter.cutoff
    assert np.array_equal(twice.filter.noise, once.filter.noise)


def test_resampling_to_a_lower_rate_does_not_alias() -> None:
    """A sine of 45 Hz would become one of 5 Hz at 50 Hz."""
    t = np.arange(1001) / 100.0
    motion = go.Motion(t, np.sin(2.0 * np.pi * 45.0 * t)[:, None], ("a",))
    inside = slice(50, -50)
    assert np.abs(motion.resampled(50.0).q[inside]).max() < 1e-3
    slow = sampled(100.0)
    coarse = slow.resampled(50.0)
    assert coarse.q[inside] == pytest.approx(slow.q[::2][inside], abs=1e-4)


def test_impossible_filters_are_named() -> None:
    motion = sampled(100.0)
    with pytest.raises(ValueError, match=r"got window=5 and cutoff=6\.0"):
        motion.filtered(window=5, cutoff=6.0)
    with pytest.raises(ValueError, match="cutoff must be below half the sampling rate, 50 Hz"):
        motion.filtered(cutoff=50.0)
    with pytest.raises(ValueError, match=r"cutoff must be positive \[Hz\]|cutoff must be positive"):
        motion.filtered(cutoff=-1.0)
    with pytest.raises(ValueError, match="at a sampling rate of 10 Hz motion and noise"):
        sampled(10.0).filtered()
    with pytest.raises(ValueError, match=r"too short to filter: to choose a cut-off takes 0\.3 s"):
        sampled(100.0, 0.2).filtered()
    with pytest.raises(ValueError, match="too short to filter: a window of 21"):
        sampled(100.0, 0.1).filtered(duration=0.21)
    assert sampled(100.0, 0.2).filtered(cutoff=6.0).velocity is not None
    slow = go.Motion([0.0, 10.0, 20.0, 30.0], np.eye(4, 2), ("a", "b")).filtered(cutoff=0.01)
    assert np.all(np.isfinite(slow.filter.noise))
