"""A recording of the CMU database: the arms of the model follow those of its own skeleton."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.recordings.conventions.segment_orientations import (
    SegmentOrientations,
    joint_angles,
)
from geodesic_ocp.recordings.formats.amc import read_amc, read_asf

CMU = Path(__file__).resolve().parents[4] / "shared" / "data" / "cmu"
METRES = 0.0254 / 0.45
pytestmark = pytest.mark.skipif(
    not (CMU / "02_05.amc").is_file(), reason="the recordings beside the checkout are absent"
)


@pytest.fixture(scope="module")
def orientations() -> SegmentOrientations:
    return read_amc(CMU / "02_05.amc")


@pytest.fixture(scope="module")
def bones() -> dict[str, dict[str, Array]]:
    """Start, end (k, 3) and rotation (k, 3, 3) of the bones of the trunk and both arms [m].

    An independent kinematics: the numbers of the skeleton's file are written out here.
    """
    chain = (  # bone, direction, length, axis [deg]; the root first
        ("lowerback", (0.00952301, 0.997604, -0.0685217), 2.05943, (0, 0, 0)),
        ("upperback", (0.00494399, 0.999577, -0.0286701), 2.06523, (0, 0, 0)),
        ("thorax", (0.000729686, 0.999992, 0.00388603), 2.06807, (0, 0, 0)),
        ("lclavicle", (0.967826, 0.247107, -0.0474446), 3.6598, (0, 0, 0)),
        ("lhumerus", (1, 0, 0), 4.86513, (180, -30, -90)),
        ("lradius", (1, 0, 0), 3.35554, (180, -30, -90)),
        ("lwrist", (1, 0, 0), 1.67777, (0, 90, 90)),
        ("lhand", (1, 0, 0), 0.661175, (0, 90, 90)),
        ("rclavicle", (-0.973174, 0.211421, -0.0907389), 3.59444, (0, 0, 0)),
        ("rhumerus", (-1, 0, 0), 5.02649, (180, 30, 90)),
        ("rradius", (-1, 0, 0), 3.36431, (180, 30, 90)),
        ("rwrist", (-1, 0, 0), 1.68216, (0, -90, -90)),
        ("rhand", (-1, 0, 0), 0.730406, (0, -90, -90)),
    )
    dofs = {"clavicle": (1, 2), "radius": (0,), "wrist": (1,), "hand": (0, 2)}
    numbers: dict[str, list[list[float]]] = {}
    for line in (CMU / "02_05.amc").read_text().splitlines():
        name, *values = line.split()
        if values and name in {"root", *(bone for bone, *_ in chain)}:
            numbers.setdefault(name, []).append([float(value) for value in values])
    root = np.array(numbers["root"])
    rotation = Rotation.from_euler("xyz", root[:, 3:], degrees=True).as_matrix()
    start = root[:, :3] * METRES
    result = {}
    for name, direction, length, axis in chain:
        angles = np.zeros((len(root), 3))
        angles[:, dofs.get(name[1:], (0, 1, 2))] = numbers[name]
        if name.endswith("clavicle"):
            start, rotation = result["thorax"]["end"], result["thorax"]["rotation"]
        frame = Rotation.from_euler("xyz", axis, degrees=True).as_matrix()
        turned = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
        rotation = rotation @ frame @ turned @ frame.T
        end = start + rotation @ np.array(direction) * length * METRES
        result[name] = {"start": start, "end": end, "rotation": rotation}
        start = end
    return result


# The file's space has y up; in the rest pose the person faces z, so that x is to the left.
TO_FILE = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])


def angle_between(first: Array, second: Array) -> Array:
    crossed = np.linalg.norm(np.cross(first, second), axis=1)
    return np.arctan2(crossed, np.sum(first * second, axis=1))


@pytest.mark.slow
@pytest.mark.parametrize("side", ["right", "left"])
def test_the_models_arm_follows_the_skeletons(
    side: Side, orientations: SegmentOrientations, bones: dict[str, dict[str, Array]]
) -> None:
    arm = human_arm(side)
    motion = joint_angles(orientations, arm.joint_names)
    thorax = bones["thorax"]["rotation"]
    worst = {"upper arm": 0.0, "forearm": 0.0, "hand": 0.0}
    hands = (
        np.swapaxes(orientations.rotations["thorax"], 1, 2) @ orientations.rotations[f"{side} hand"]
    )
    tool = Rotation.from_euler("x", 180, degrees=True).as_matrix()  # of the hand's frame
    for index in range(0, len(motion), 25):
        elbow, wrist, rotation = arm_points(motion.q[index])
        relative = TO_FILE.T @ thorax[index].T
        for segment, name, direction in (
            ("upper arm", f"{side[0]}humerus", elbow),
            ("forearm", f"{side[0]}radius", wrist - elbow),
        ):
            bone = relative @ (bones[name]["end"] - bones[name]["start"])[index]
            error = angle_between(bone[None], direction[None])[0]
            worst[segment] = max(worst[segment], error)
        np.testing.assert_allclose(arm.hand_pose(motion.q[index])[0] @ tool, rotation, atol=1e-12)
        turn = Rotation.from_matrix(rotation.T @ hands[index])
        worst["hand"] = max(worst["hand"], float(turn.magnitude()))
    assert max(worst.values()) < 1e-6


def arm_points(q: Array) -> tuple[Array, Array, Array]:
    """Elbow and wrist (3,) from the shoulder, and the hand's rotation, with unit lengths."""
    upper = Rotation.from_euler("XZY", q[:3]).as_matrix()
    forearm = upper @ Rotation.from_euler("XZ", q[3:5]).as_matrix()
    elbow = -upper[:, 2]
    return elbow, elbow - forearm[:, 2], forearm @ Rotation.from_euler("XY", q[5:]).as_matrix()


@pytest.mark.slow
def test_single_joints_of_the_skeleton_are_single_joints_of_the_model(
    orientations: SegmentOrientations,
) -> None:
    # The radius has the elbow's flexion alone, the wrist bone the pronation, 30 degrees from the
    # plane of flexion, and the hand the wrist's two angles in the order of the model's.
    numbers: dict[str, list[list[float]]] = {"rradius": [], "rwrist": [], "rhand": []}
    for line in (CMU / "02_05.amc").read_text().splitlines():
        name, *values = line.split()
        if name in numbers:
            numbers[name].append([float(value) for value in values])
    radius, wrist, hand = (np.array(numbers[name]) for name in ("rradius", "rwrist", "rhand"))
    q = np.degrees(
        joint_angles(orientations).select([f"R{x}_joint" for x in ("Ex", "Ez", "Wx", "Wy")]).q
    )
    expected = np.column_stack([radius, wrist + 30.0, hand[:, 1], hand[:, 0]])
    np.testing.assert_allclose(q, expected, atol=1e-6)
    assert q[:, 0].min() > 0.0
    assert q[:, 0].max() < 150.0


def test_segments_move_smoothly_and_the_thorax_is_upright(
    orientations: SegmentOrientations,
) -> None:
    assert set(orientations.rotations) == {
        *("pelvis", "abdomen", "thorax"),
        *(
            f"{side} {name}"
            for side in ("right", "left")
            for name in ("upper arm", "forearm", "hand")
        ),
    }
    for segment, rotations in orientations.rotations.items():
        steps = Rotation.from_matrix(np.swapaxes(rotations[:-1], 1, 2) @ rotations[1:]).magnitude()
        assert steps.max() < 0.2, segment  # 24 rad/s at 120 Hz
    assert np.all(np.abs(np.diff(joint_angles(orientations).q, axis=0)) < 0.2)
    upright = orientations.rotations["thorax"][:, 2, 2]
    assert np.median(upright) > 0.8
    assert upright.min() > 0.4  # the person leans forward


@pytest.mark.slow
def test_the_trunk_and_the_arms_have_the_size_of_a_person(
    orientations: SegmentOrientations, bones: dict[str, dict[str, Array]]
) -> None:
    assert orientations.trunk is not None
    height = orientations.trunk.positions[:, 2]
    assert 1.0 < height.min() < height.max() < 1.5
    # The shoulders are at one distance from the middle between them.
    right = bones["rhumerus"]["start"] @ TO_FILE - orientations.trunk.positions
    distance = np.linalg.norm(right, axis=1)
    assert np.ptp(distance) < 1e-3
    assert 0.1 < distance.mean() < 0.25
    skeleton = read_asf(CMU / "02.asf")
    assert skeleton.unit == pytest.approx(METRES)
    arm = sum(
        np.linalg.norm(skeleton.skeleton.offsets[skeleton.skeleton.names.index(name)])
        for name in ("rradius", "rwrist", "rhand")
    )
    assert 0.5 < arm * METRES < 0.65
    assert orientations.time[1] == pytest.approx(1.0 / 120.0)
    assert orientations.subject.name == "02"


def test_the_right_hand_punches_forward(
    orientations: SegmentOrientations, bones: dict[str, dict[str, Array]]
) -> None:
    relative = bones["rwrist"]["end"] - bones["rhumerus"]["start"]
    forward = np.einsum("ki,ki->k", relative @ TO_FILE, orientations.rotations["thorax"][:, :, 1])
    punch = int(np.argmax(forward))
    elbow = joint_angles(orientations, ["REx_joint"]).q[:, 0]
    assert forward[punch] > 0.4  # [m]: the arm reaches out in front of the chest ...
    assert elbow[punch] < 0.5 * elbow.max()  # ... with the elbow extended
