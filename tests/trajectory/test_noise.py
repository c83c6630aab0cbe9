"""The noise of a recording, as its residuals tell it."""

from __future__ import annotations

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.trajectory.noise import RecordingNoise, surrogate

TIME = np.arange(1200) / 100.0
CURVE = np.column_stack([np.sin(3.0 * TIME), np.cos(2.0 * TIME)])
COVARIANCE = 1e-6 * np.array([[4.0, 2.4], [2.4, 9.0]])  # [rad^2]


def recorded(seed: int) -> go.Motion:
    noise = np.random.default_rng(seed).multivariate_normal([0.0, 0.0], COVARIANCE, len(TIME))
    return go.Motion(TIME, CURVE + noise, ("a", "b"))


@pytest.mark.parametrize("filtering", [{}, {"cutoff": 6.0}, {"duration": 0.21}])
def test_draws_have_the_spectrum_and_the_correlations_of_white_noise(
    filtering: dict[str, float],
) -> None:
    """Also below the cut-off, where residuals have none of the noise."""
    random, sums, low = np.random.default_rng(0), np.zeros((2, 2)), np.zeros(2)
    for seed in range(5):
        noise = RecordingNoise.of(recorded(seed).filtered(**filtering))
        for _ in range(10):
            draw = noise.draw(random)
            sums += draw.T @ draw / len(draw) / 50.0
            power = np.abs(np.fft.rfft(draw, axis=0)[1:36]) ** 2 / len(draw)  # up to 3 Hz
            low += power.mean(axis=0) / 50.0
    assert sums == pytest.approx(COVARIANCE, rel=0.2)
    assert low == pytest.approx(np.diag(COVARIANCE), rel=0.4)  # the floor is a median of few


def test_a_surrogate_is_filtered_as_the_recording_was() -> None:
    random = np.random.default_rng(0)
    for filtering in ({}, {"cutoff": 6.0}, {"window": 21, "order": 3}):
        motion = recorded(1).filtered(**filtering)
        again = surrogate(motion, RecordingNoise.of(motion), random)
        assert again.filter.kind == motion.filter.kind
        assert again.filter.cutoff == pytest.approx(motion.filter.cutoff, abs=1.5)
        assert again.filter.duration == motion.filter.duration
        assert again.filter.noise == pytest.approx(motion.filter.noise, rel=0.3)


def test_without_a_filter_there_is_no_noise() -> None:
    with pytest.raises(ValueError, match="taken without a filter"):
        RecordingNoise.of(recorded(0))
