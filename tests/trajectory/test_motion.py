"""Motion: what it refuses, filtering, resampling."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_filter

import geodesic_ocp as go

TIME = np.arange(60) / 100.0


def parabola() -> go.Motion:
    """Two joints on parabolas, which a filter of order 2 leaves as they are."""
    q = np.column_stack([1.0 + 2.0 * TIME - 3.0 * TIME**2, -TIME + TIME**2])
    return go.Motion(TIME, q, ("a", "b"))


def test_filter_preserves_parabolas_and_gives_their_velocity() -> None:
    motion = parabola().filtered()
    assert motion.q == pytest.approx(parabola().q, abs=1e-12)
    expected = np.column_stack([2.0 - 6.0 * TIME, -1.0 + 2.0 * TIME])
    assert motion.velocity == pytest.approx(expected, abs=1e-10)


def test_filter_reduces_noise(rng: np.random.Generator) -> None:
    noise = 0.005 * rng.normal(size=(60, 2))
    noisy = go.Motion(TIME, parabola().q + noise, ("a", "b")).filtered()
    # 21 samples, order 2: the variance falls to 9/84 or so in the middle.
    assert np.std((noisy.q - parabola().q)[10:-10]) < 0.5 * np.std(noise)


@pytest.mark.parametrize(("window", "order"), [(21, 2), (5, 4), (3, 1), (51, 3)])
def test_filter_agrees_with_scipy(window: int, order: int) -> None:
    q = np.random.default_rng(2).normal(size=(51, 3))
    found = go.Motion(0.01 * np.arange(51), q, ("a", "b", "c")).filtered(window, order)
    assert found.q == pytest.approx(savgol_filter(q, window, order, axis=0), abs=1e-10)
    slope = savgol_filter(q, window, order, deriv=1, delta=0.01, axis=0)
    assert found.velocity == pytest.approx(slope, abs=1e-8)


def test_motion_is_immutable_and_copies_its_arrays() -> None:
    q = parabola().q.copy()
    motion = go.Motion(TIME, q, ("a", "b"))
    q[:] = 0.0
    assert motion.q[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        motion.q[0, 0] = 5.0
    with pytest.raises(AttributeError):
        motion.q = q


def test_selected_joints_and_resampling() -> None:
    motion = parabola().filtered()
    swapped = motion.select(["b", "a"])
    assert np.array_equal(swapped.q, motion.q[:, ::-1])
    assert np.array_equal(swapped.velocity, motion.velocity[:, ::-1])
    with pytest.raises(ValueError, match="there is no joint c; there are a, b"):
        motion.select(["a", "c"])
    dense = motion.resampled(250.0)
    assert len(dense) == 148
    assert dense.rate == pytest.approx(250.0)
    expected = 1.0 + 2.0 * dense.time - 3.0 * dense.time**2
    assert dense.q[:, 0] == pytest.approx(expected, abs=1e-10)


def test_interpolation_passes_through_the_samples() -> None:
    motion = parabola()
    with pytest.raises(ValueError, match=r"s must lie in \[0, 0\.59\] s"):
        motion([0.3, 0.6])
    assert motion(TIME) == pytest.approx(motion.q, abs=1e-14)
    assert motion([0.2], 1)[0] == pytest.approx([0.8, -0.6], abs=1e-10)


@pytest.mark.parametrize(
    ("time", "q", "message"),
    [
        ([0.0], [[1.0, 2.0]], "at least two samples, got 1"),
        ([0.0, 0.1, 0.1], np.zeros((3, 2)), r"sample 2 is at 0\.1 s, the one before at 0\.1 s"),
        ([0.0, np.nan], np.zeros((2, 2)), "time is nan at sample 1"),
        ([0.0, 0.1], [[0.0, 0.0], [0.0, np.inf]], "q of b is inf at sample 1"),
        ([0.0, 0.1], np.zeros((2, 3)), r"got shapes \(2,\) and \(2, 3\)"),
    ],
)
def test_wrong_samples_are_named(time: object, q: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.Motion(time, q, ("a", "b"))


def test_a_part_has_what_is_known_of_its_samples() -> None:
    whole = parabola().filtered()
    part = whole.part(20, 39)
    assert whole.velocity is not None
    assert whole.unfiltered is not None
    for name in ("time", "q", "velocity", "unfiltered"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[20:40])
    assert part.filter is whole.filter
    for wrong in ((-1, 9), (5, 5), (50, 60)):
        with pytest.raises(ValueError, match="samples must be in 0 to 59, got"):
            whole.part(*wrong)


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(ValueError, match="joint names must differ"):
        go.Motion([0.0, 0.1], np.zeros((2, 2)), ("a", "a"))
    with pytest.raises(ValueError, match=r"velocity must have the shape \(2, 2\) of q"):
        go.Motion([0.0, 0.1], np.zeros((2, 2)), ("a", "b"), np.zeros((2, 3)))


def test_filter_names_wrong_windows_and_uneven_samples() -> None:
    with pytest.raises(ValueError, match="needs as many samples, not 60"):
        parabola().filtered(window=61)
    for window, order in ((20, 2), (3, 3), (5, 0)):
        with pytest.raises(ValueError, match="window must be odd and above order"):
            parabola().filtered(window, order)
    with pytest.raises(ValueError, match=r"duration 0.01 s is 1 sample at \S+ Hz; at least 3 \("):
        parabola().filtered(duration=0.01)
    uneven = TIME.copy()
    uneven[30:] += 0.03
    with pytest.raises(ValueError, match=r"sample 29 is 0\.0147.* s off the even grid"):
        go.Motion(uneven, parabola().q, ("a", "b")).filtered()


def test_rounded_time_stamps_count_as_evenly_spaced() -> None:
    """Milliseconds at 120 Hz are; a frame that is missing is not."""
    time = np.round(np.arange(61) / 120.0, 3)
    go.Motion(time[:60], parabola().q, ("a", "b")).filtered()
    with pytest.raises(ValueError, match="evenly spaced"):
        go.Motion(np.delete(time, 30), parabola().q, ("a", "b")).filtered()
