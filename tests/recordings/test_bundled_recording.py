"""The bundled recording against the positions from which it was derived."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import geodesic_ocp as go

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def derivation() -> ModuleType:
    """The script that derived the recording."""
    file = ROOT / "tools" / "derive_demo_recording.py"
    spec = importlib.util.spec_from_file_location("derive_demo_recording", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def recorded() -> tuple[np.ndarray, dict[str, np.ndarray], dict[str, str]]:
    """Samples, positions by name [m] in the torso frame, and the notes of the file."""
    lines = (ROOT / "tests" / "data" / "climb_positions.csv").read_text().splitlines()
    notes = dict(line[2:].split(": ", 1) for line in lines if line.startswith("# "))
    table = [line.split(",") for line in lines if not line.startswith("#")]
    header, values = table[0], np.array(table[1:], dtype=float)
    names = [name.removesuffix("_x") for name in header if name.endswith("_x")]
    points = {n: values[:, [header.index(f"{n}_{axis}") for axis in "xyz"]] for n in names}
    return values[:, 0].astype(int), points, notes


def test_forward_kinematics_returns_the_recorded_points(
    bundled_file: Path, recorded: tuple[np.ndarray, dict[str, np.ndarray], dict[str, str]]
) -> None:
    """With the person's own segment lengths, and directions from the arm model."""
    samples, points, notes = recorded
    arm = go.human_arm("left")
    motion = go.read_motion(bundled_file, arm.joint_names)
    lengths = [float(notes[name].split()[0]) for name in ("upper arm", "forearm")]
    for row, sample in enumerate(samples):
        # Orientation of each segment: that of the hand with all joints beyond it at zero.
        orientation = []
        for joints in (3, 5, 7):
            q = np.where(np.arange(7) < joints, motion.q[sample], 0.0)
            orientation.append(arm.hand_pose(q)[0] @ np.diag([1.0, -1.0, -1.0]))
        upper, forearm, hand = orientation
        elbow = -lengths[0] * upper[:, 2]
        wrist = elbow - lengths[1] * forearm[:, 2]
        # Angles are given to 1e-6 rad and lengths to 1e-6 m.
        assert elbow == pytest.approx(points["elbow"][row], abs=3e-6)
        assert wrist == pytest.approx(points["wrist"][row], abs=3e-6)
        for finger in ("Index", "Middle", "Ring", "Pinky"):
            offset = notes[f"Hand{finger}1 in the hand frame"].removesuffix(" m")
            knuckle = wrist + hand @ np.array(offset.split(), dtype=float)
            assert knuckle == pytest.approx(points[finger.lower()][row], abs=3e-6)


def test_derived_angles_invert_forward_kinematics(
    derivation: ModuleType, rng: np.random.Generator
) -> None:
    arm = go.human_arm("left")
    angles = rng.uniform(arm.lower + 0.05, arm.upper - 0.05, (500, 7))
    lengths, knuckles = np.array([0.31, 0.25]), np.array([[0, 0.02, -0.08], [0, 0, -0.08]])
    points = derivation.forward(angles, lengths, knuckles)
    upper, forearm = points[:, 0], points[:, 1] - points[:, 0]
    index, middle = points[:, 2] - points[:, 1], points[:, 3] - points[:, 1]
    y = index - middle
    hand = derivation.frame(np.cross(y, -middle), y, -middle)
    assert derivation.arm_angles(upper, forearm, hand) == pytest.approx(angles, abs=1e-9)


def test_the_file_states_its_origin(bundled_file: Path, derivation: ModuleType) -> None:
    text = bundled_file.read_text()
    assert bundled_file.stat().st_size < 200_000
    for word in ("unit: rad", "licence: Apache-2.0", "source: holosoma-retargeting==0.1.0"):
        assert f"# {word}" in text
    assert derivation.MOTION in text
    assert (bundled_file.parent / "LICENSE.Apache-2.0").is_file()
    arm = go.human_arm("left")
    motion = go.read_motion(bundled_file, arm.joint_names)
    assert motion.subject.height == 1.78
    assert 4.0 <= motion.duration <= 8.0
    assert np.all(motion.q >= arm.lower)
    assert np.all(motion.q <= arm.upper)
    hand = arm.hand_pose(motion.q)[1]
    assert np.ptp(hand, axis=0).max() > 0.5
    speed = np.linalg.norm(np.gradient(hand, motion.time, axis=0), axis=1)
    assert np.mean(speed < 0.1) < 0.1  # it moves nearly all the time
