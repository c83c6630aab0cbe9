"""Joint angles from orientations of segments: round trips, the extended elbow, gimbal lock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recordings.motion_segments import segment_orientations

import geodesic_ocp as go
from geodesic_ocp.recordings.conventions.continuous_angles import (
    axis_rotation,
    continuous_angles,
    successive_rotations,
)
from geodesic_ocp.recordings.conventions.segment_orientations import (
    SegmentOrientations,
    joint_angles,
)
from geodesic_ocp.trajectory.motion import FrameMotion

ARMS = {side: go.human_arm(side) for side in ("right", "left")}
SIDE = st.sampled_from(["right", "left"])
SEED = st.integers(0, 2**32 - 1)
TIME = np.linspace(0.0, 2.0, 201)
TRUNK = tuple(f"B{name}_joint" for name in ("Px", "Pz", "Py", "Tx", "Tz", "Ty"))


def smooth(seed: int, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Sines of up to 1.5 Hz that reach both limits."""
    rng = np.random.default_rng(seed)
    rates = rng.uniform(0.3, 1.5, len(lower))
    waves = np.sin(2.0 * np.pi * rates * TIME[:, None] + rng.uniform(0.0, 6.3, len(lower)))
    return 0.5 * (lower + upper) + 0.5 * (upper - lower) * waves


@pytest.mark.slow
@given(SIDE, SEED)
def test_motions_within_the_limits_come_back(side: str, seed: int) -> None:
    arm = ARMS[side]
    rotations = successive_rotations("zxy", smooth(seed, -np.ones(3), np.ones(3)))
    trunk = FrameMotion(rotations, np.zeros((len(TIME), 3)))
    motion = go.Motion(
        TIME,
        np.hstack([smooth(seed, arm.lower, arm.upper), smooth(seed, -np.ones(6), np.ones(6))]),
        arm.joint_names + TRUNK,
        subject=go.trajectory.Subject(1.8, 80.0, "somebody"),
        trunk=trunk,
    )
    back = joint_angles(segment_orientations(motion), motion.joint_names)
    assert back.q == pytest.approx(motion.q, abs=1e-9)
    assert back.subject == motion.subject
    assert back.trunk is trunk


@pytest.mark.slow
@given(SIDE, SEED, st.floats(0.0, 0.25))
def test_an_elbow_through_full_extension_has_no_jump(side: str, seed: int, over: float) -> None:
    """Down to 14 degrees of hyperextension the angles are those of the motion."""
    arm = ARMS[side]
    low = arm.lower.copy()
    low[3] = -over
    motion = go.Motion(TIME, smooth(seed, low, arm.upper), arm.joint_names)
    back = joint_angles(segment_orientations(motion))
    assert back.joint_names == arm.joint_names
    assert back.q == pytest.approx(motion.q, abs=1e-9)


@pytest.mark.slow
@given(SEED, st.floats(0.0, 0.3))
def test_a_carrying_angle_leaves_the_hand_exact_and_the_angles_smooth(
    seed: int, carrying: float
) -> None:
    arm = ARMS["right"]
    motion = go.Motion(TIME, smooth(seed, arm.lower, arm.upper), arm.joint_names)
    exact = segment_orientations(motion)
    upper, forearm = exact.rotations["right upper arm"], exact.rotations["right forearm"]
    elbow = np.swapaxes(upper, 1, 2) @ forearm
    tilted = upper @ axis_rotation("y", carrying) @ elbow
    given_ = replace(exact, rotations={**exact.rotations, "right forearm": tilted})
    back = joint_angles(given_)
    found = segment_orientations(back).rotations
    assert found["right hand"] == pytest.approx(exact.rotations["right hand"], abs=1e-12)
    assert found["right upper arm"][:, :, 2] == pytest.approx(upper[:, :, 2], abs=1e-12)
    flexed = np.sin(motion.q[:, 3]) > 0.55
    assert found["right forearm"][flexed, :, 2] == pytest.approx(tilted[flexed, :, 2], abs=1e-9)
    off = np.linalg.norm(found["right forearm"][:, :, 2] - tilted[:, :, 2], axis=1)
    assert off.max() <= carrying + 1e-9


@pytest.mark.parametrize("flexion", [-0.2, 0.0, 0.1])
def test_an_elbow_that_never_flexes(flexion: float) -> None:
    q = np.tile([0.3, 0.2, -0.1, flexion, 0.4, 0.1, -0.2], (2, 1))
    motion = go.Motion([0.0, 1.0], q, ARMS["right"].joint_names)
    assert joint_angles(segment_orientations(motion)).q == pytest.approx(q, abs=1e-12)


def test_a_skewed_elbow_axis_does_not_turn_the_shoulder() -> None:
    """The upper arm rests and only its elbow, whose axis is skewed by 13 degrees, moves."""
    flexion = 0.5 * np.pi * (1.0 - np.cos(np.pi * TIME)) * 0.8
    upright = np.broadcast_to(np.eye(3), (len(TIME), 3, 3))
    skewed = axis_rotation("z", np.full(len(TIME), 0.227))
    forearm = skewed @ axis_rotation("x", flexion)
    found = joint_angles(
        SegmentOrientations(
            TIME, {"thorax": upright, "right upper arm": upright, "right forearm": forearm}
        )
    )
    assert found.q[:, 1] == pytest.approx(0.227, abs=1e-9)
    assert found.q[:, 3] == pytest.approx(flexion, abs=1e-9)


def test_without_the_hand_the_forearm_gives_the_elbow() -> None:
    arm = ARMS["left"]
    motion = go.Motion(TIME, smooth(5, arm.lower, arm.upper), arm.joint_names)
    full = segment_orientations(motion)
    some = {name: full.rotations[name] for name in ("thorax", "left upper arm", "left forearm")}
    back = joint_angles(SegmentOrientations(TIME, some))
    assert back.joint_names == arm.joint_names[:5]
    assert back.q == pytest.approx(motion.q[:, :5], abs=1e-9)
    with pytest.raises(go.RecordingError, match=r"LWx_joint: .* no orientation of left hand; it"):
        joint_angles(SegmentOrientations(TIME, some), ["LSx_joint", "LWx_joint"])
    with pytest.raises(go.RecordingError, match=r"RSx_joint: .* right upper arm"):
        joint_angles(SegmentOrientations(TIME, some), ["RSx_joint"])
    with pytest.raises(go.RecordingError, match="no joint knee"):
        joint_angles(SegmentOrientations(TIME, some), ["knee"])
    with pytest.raises(go.RecordingError, match=r"no joint .* from the segments thorax"):
        joint_angles(SegmentOrientations(TIME, {"thorax": some["thorax"]}))


def test_without_the_abdomen_the_trunk_bends_by_halves() -> None:
    bend = axis_rotation("x", 0.8 * TIME)
    upright = np.broadcast_to(np.eye(3), bend.shape)
    back = joint_angles(SegmentOrientations(TIME, {"pelvis": upright, "thorax": bend}))
    assert back.joint_names == TRUNK
    expected = np.zeros((len(TIME), 6))
    expected[:, 0] = expected[:, 3] = 0.4 * TIME
    assert back.q == pytest.approx(expected, abs=1e-12)


@pytest.mark.slow
@given(
    st.permutations("xyz"), SEED, st.floats(-1e-3, 1e-3) | st.just(0.0), st.sampled_from([1, -1])
)
def test_through_and_past_gimbal_lock_no_angle_jumps(
    axes: list[str], seed: int, miss: float, sign: int
) -> None:
    """A path that crosses the lock at a sample, or near it, keeps steps as small as its own."""
    order = "".join(axes)
    rng = np.random.default_rng(seed)
    slopes, start = rng.uniform(-2.0, 2.0, 3), rng.uniform(-1.0, 1.0, 3)
    s = TIME[:, None] - TIME[100]
    angles = start + slopes * s
    angles[:, 1] = sign * (0.5 * np.pi + miss + s[:, 0])
    rotations = successive_rotations(order, angles)
    found = continuous_angles(rotations, order, angles[0] - 0.1, angles[0] + 0.1)
    assert successive_rotations(order, found) == pytest.approx(rotations, abs=1e-9)
    assert found == pytest.approx(angles, abs=1e-9)


@pytest.mark.slow
@given(st.permutations("xyz"), st.sampled_from([1, -1]), st.floats(-3.0, 3.0), st.booleans())
def test_a_path_that_stays_in_gimbal_lock_is_as_smooth_as_its_rotation(
    axes: list[str], sign: int, slope: float, leaves: bool
) -> None:
    order = "".join(axes)
    angles = np.stack([2.0 * TIME, 0.0 * TIME, slope * TIME], axis=1)
    angles[:, 1] = sign * 0.5 * np.pi
    if leaves:
        angles[:, 1] -= sign * np.maximum(0.0, np.abs(TIME - 1.0) - 0.3)
    rotations = successive_rotations(order, angles)
    found = continuous_angles(rotations, order)
    assert successive_rotations(order, found) == pytest.approx(rotations, abs=1e-6)
    step = np.abs(np.diff(angles, axis=0)).sum(axis=1).max()
    assert np.abs(np.diff(found, axis=0)).max() <= step + 1e-6


def test_the_first_sample_is_within_the_limits() -> None:
    """190 degrees of Sx, which the principal values of the angles do not contain."""
    arm = ARMS["right"]
    q = np.tile([3.3, 1.2, -2.7, 2.7, 1.5, 0.3, -1.5], (2, 1))
    motion = go.Motion([0.0, 1.0], q, arm.joint_names)
    assert joint_angles(segment_orientations(motion)).q == pytest.approx(q, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": [0.0]}, "at least two samples"),
        ({"time": [0.0, 0.0]}, "time must increase: sample 1 is at 0 s"),
        ({"rotations": {"tail": np.eye(3)[None].repeat(2, 0)}}, "no segment 'tail'"),
        ({"rotations": {"thorax": np.eye(3)}}, r"must have shape \(2, 3, 3\)"),
        ({"rotations": {"thorax": -np.eye(3)[None].repeat(2, 0)}}, "at sample 0 is not a rotation"),
        ({"rotations": {"thorax": np.full((2, 3, 3), np.nan)}}, "thorax: the pose is not finite"),
        ({"trunk": FrameMotion(np.eye(3)[None], np.zeros((1, 3)))}, "trunk must have 2 samples"),
    ],
)
def test_what_segment_orientations_reject(change: dict, message: str) -> None:
    good = SegmentOrientations(np.array([0.0, 1.0]), {"thorax": np.eye(3)[None].repeat(2, 0)})
    assert repr(good) == "SegmentOrientations(2 samples of thorax)"
    with pytest.raises(ValueError, match=message):
        replace(good, **change)
