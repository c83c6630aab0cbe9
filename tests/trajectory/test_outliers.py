"""What in a recording is no motion is found, named and kept out."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import geodesic_ocp as go

TIME = np.arange(300) / 100.0
CURVE = np.column_stack([np.sin(3.0 * TIME), np.cos(4.0 * TIME), 0.3 * np.sin(9.0 * TIME)])
NAMES = ("shoulder", "elbow", "wrist")
Q = CURVE + 2e-3 * np.random.default_rng(0).normal(size=CURVE.shape)


def cleaned(q: np.ndarray, match: str) -> go.Motion:
    with pytest.warns(RuntimeWarning, match=match):
        return go.Motion(TIME, q, NAMES).without_outliers()


def test_noise_is_no_outlier() -> None:
    for seed in range(20):
        noise = np.random.default_rng(seed).normal(size=Q.shape)
        for size in (0.0, 1e-5, 2e-3, 2e-2):
            q = CURVE + size * noise
            assert np.array_equal(go.Motion(TIME, q, NAMES).without_outliers().q, q)


@given(
    sample=st.integers(2, 297),
    joint=st.integers(0, 2),
    size=st.floats(0.1, 5.0),
    sign=st.sampled_from([-1.0, 1.0]),
)
def test_a_spike_is_replaced_by_interpolation(
    sample: int, joint: int, size: float, sign: float
) -> None:
    q = Q.copy()
    q[sample, joint] += sign * size
    found = cleaned(q, rf"{NAMES[joint]} at {TIME[sample]:.3f} s .*spike")
    assert [each.kind for each in found.outliers] == ["spike"]
    assert np.abs(found.q - CURVE).max() < 0.012  # six standard deviations of the noise
    others = np.arange(len(TIME)) != sample
    assert np.array_equal(found.q[others], Q[others])
    assert found.outliers[0].size == pytest.approx(sign * size, abs=0.012)


def test_a_spike_does_not_change_what_is_filtered() -> None:
    q = Q.copy()
    q[150, 1] += np.radians(60.0)
    with pytest.warns(RuntimeWarning, match=r"elbow at 1.500 s is 1 rad off"):
        filtered = go.Motion(TIME, q, NAMES).filtered()
    undisturbed = go.Motion(TIME, Q, NAMES).filtered()
    assert filtered.q == pytest.approx(undisturbed.q, abs=2e-3)
    assert filtered.filter.cutoff == pytest.approx(undisturbed.filter.cutoff, abs=0.2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # it is said once
        again = filtered.select(("shoulder", "elbow")).filtered(cutoff=5.0)
        assert [each.joint for each in again.outliers] == ["elbow"]
        assert filtered.select(("wrist",)).outliers == ()


def test_a_step_by_a_revolution_is_undone() -> None:
    q = Q.copy()
    q[100:200, 0] -= 2.0 * np.pi
    found = cleaned(q, r"shoulder at 1.000 s steps by -360 deg \(wrap, undone\)")
    assert found.q == pytest.approx(Q, abs=1e-12)
    assert [each.start for each in found.outliers] == [1.0, 2.0]


def test_a_repeated_frame_is_interpolated() -> None:
    q = CURVE.copy()
    q[60:62] = q[59]
    found = cleaned(q, r"all joints at 0.600 s repeat the frame before")
    assert found.q == pytest.approx(CURVE, abs=1e-4)


def test_a_frozen_sensor_is_named_and_kept() -> None:
    q = Q.copy()
    q[100:131, 1] = q[100, 1]
    found = cleaned(q, r"elbow from 1.000 to 1.300 s repeats one number while others move")
    assert np.array_equal(found.q, q)


def test_a_recording_that_is_held_and_then_jumps_is_frozen() -> None:
    """As programs fill gaps with the last frame; a rest ends smoothly, and a spike comes back."""
    q = Q.copy()
    q[100:141] = q[100]
    found = cleaned(q, r"shoulder from 1.000 to 1.400 s repeats one number .* beside a jump")
    assert {each.kind for each in found.outliers} == {"frozen"}
    q = np.minimum(TIME, 1.0)[:, None] * [1.0, 0.5, 0.2] + np.maximum(TIME - 1.5, 0.0)[:, None]
    q[130, 1] += 0.5
    found = cleaned(q, "spike")
    assert [each.kind for each in found.outliers] == ["spike"]


def test_rests_and_joints_at_their_limits_are_not_frozen() -> None:
    rest = np.minimum(TIME, 1.5)[:, None] * [1.0, 0.5, 0.2]
    held = Q.copy()
    held[:, 1] = np.maximum(held[:, 1], -0.5)
    for q in (rest, held):
        assert go.Motion(TIME, q, NAMES).without_outliers().outliers == ()


def test_a_wrapped_angle_stays_where_it_was_most_of_the_time() -> None:
    """As scipy's, or numpy's, unwrap; a median would move this one by a revolution."""
    angle = 3.4 + 0.5 * np.sin(4.0 * TIME)
    wrapped = (angle + np.pi) % (2.0 * np.pi) - np.pi
    q = np.column_stack([wrapped, CURVE[:, 1]])
    with pytest.warns(RuntimeWarning, match="wrap, undone"):
        cleaned = go.Motion(TIME, q, NAMES[:2]).without_outliers()
    unwrapped = np.unwrap(wrapped)
    assert np.ptp(cleaned.q[:, 0] - unwrapped) == pytest.approx(0.0, abs=1e-12)
    assert np.mean(np.abs(cleaned.q[:, 0] - wrapped) < 1e-12) >= 0.5


@pytest.mark.parametrize("bits", [10, 12, 14])
def test_an_encoder_that_stands_within_its_step_is_not_frozen(bits: int) -> None:
    """Three joints that move and rest by turns for 10 s, to the step of their encoders."""
    time = np.arange(1000) / 100.0
    q = np.zeros((1000, 3))
    for joint in range(3):
        for start in np.arange(0.2 + 0.2 * joint, 9.0, 1.6):
            s = np.clip((time - start) / 0.8, 0.0, 1.0)
            sign = (-1.0) ** round(start / 1.6)
            q[:, joint] += sign * 0.7 * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
    step = 2.0 * np.pi / 2**bits
    q = step * np.round(q / step)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert go.Motion(time, q, NAMES).without_outliers().outliers == ()
    fastest = int(np.argmax(np.abs(np.diff(q[:, 0]))))
    q[fastest - 10 : fastest + 10, 0] = q[fastest - 10, 0]
    with pytest.warns(RuntimeWarning, match=r"shoulder from .*\(frozen"):
        found = go.Motion(time, q, NAMES).without_outliers().outliers
    assert [each.kind for each in found] == ["frozen"]


@pytest.mark.parametrize("slow", [0.1, 0.2, 0.3])
def test_steps_of_coarse_sensors_are_no_repeated_frames(slow: float) -> None:
    """Three joints may repeat a frame together, and then step once or twice each."""
    time = np.arange(1000) / 100.0
    angles = np.sin(2.0 * np.pi * slow * time[:, None] * [1.0, 0.8, 1.2] + [0.0, 2.0, 4.0])
    step = np.radians(0.5)
    noise = 0.2 * np.random.default_rng(0).normal(size=angles.shape)
    q = step * np.round(angles / step + noise)
    assert go.Motion(time, q, NAMES).without_outliers().outliers == ()
