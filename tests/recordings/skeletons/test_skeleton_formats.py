"""ASF/AMC, BVH and SMPL archives: the orientations that were written come back."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recordings.motion_segments import segment_orientations
from recordings.skeletons.skeleton_files import (
    FILE,
    ORDERS,
    SIDES,
    TREE,
    local_rotations,
    root_positions,
    rotations_in_file,
    smooth_motion,
    write_acclaim,
    write_bvh,
    write_mvnx,
)
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.conventions.segment_orientations import (
    SegmentOrientations,
    joint_angles,
)
from geodesic_ocp.recordings.conventions.skeleton_convention import SKELETON_CONVENTIONS, SMPL
from geodesic_ocp.recordings.formats.amc import read_amc
from geodesic_ocp.recordings.formats.bvh import read_bvh
from geodesic_ocp.recordings.formats.mvnx import read_mvnx
from geodesic_ocp.recordings.formats.smpl import read_smpl

NAMES = [name for name, *_ in TREE]
CM = 0.01  # [m]
seeds = st.integers(0, 10_000)
orders = st.lists(st.sampled_from(ORDERS), min_size=len(TREE), max_size=len(TREE))


def in_files(motion: go.Motion, unit: float) -> tuple[SegmentOrientations, dict[str, Array], Array]:
    """The motion's segments, and the rotations and root positions of the files' skeleton."""
    segments = segment_orientations(motion)
    joints = rotations_in_file(dict(segments.rotations))
    assert motion.trunk is not None
    return segments, joints, root_positions(joints, motion.trunk.positions, unit)


def check_same(read: SegmentOrientations, motion: go.Motion, written: SegmentOrientations) -> None:
    """Files have twelve digits, so that orientations return within 1e-9."""
    np.testing.assert_allclose(read.time, motion.time, atol=1e-7)
    assert set(read.rotations) == set(written.rotations)
    for segment, rotations in written.rotations.items():
        np.testing.assert_allclose(read.rotations[segment], rotations, atol=1e-9, err_msg=segment)
    angles = joint_angles(read, motion.joint_names)
    np.testing.assert_allclose(angles.q, motion.q, atol=1e-6)


def check_trunk(read: SegmentOrientations, motion: go.Motion) -> None:
    assert read.trunk is not None
    assert motion.trunk is not None
    np.testing.assert_allclose(read.trunk.positions, motion.trunk.positions, atol=1e-8)
    np.testing.assert_allclose(read.trunk.rotations, motion.trunk.rotations, atol=1e-9)


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(seed=seeds, axes=orders)
def test_bvh_returns_the_angles_and_the_trunk_in_any_order_of_channels(
    seed: int, axes: list[str], tmp_path_factory: pytest.TempPathFactory
) -> None:
    motion = smooth_motion(seed)
    written, joints, roots = in_files(motion, CM)
    folder = tmp_path_factory.mktemp("bvh")
    file = write_bvh(folder / "a.bvh", joints, roots, 50.0, dict(zip(NAMES, axes, strict=True)))
    read = read_bvh(file, unit="cm")
    check_same(read, motion, written)
    check_trunk(read, motion)
    assert read_bvh(file).trunk is None


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(seed=seeds, axes=orders, radians=st.booleans())
def test_amc_returns_the_angles_and_the_trunk_in_any_axes_of_bones(
    seed: int, axes: list[str], radians: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    motion = smooth_motion(seed)
    written, joints, roots = in_files(motion, CM)
    folder = tmp_path_factory.mktemp("amc")
    random = np.random.default_rng(seed)
    frames = {name: random.uniform(-180.0, 180.0, 3) for name in NAMES}
    by_name = dict(zip(NAMES, axes, strict=True))
    file = write_acclaim(folder, joints, roots, by_name, frames, radians)
    read = read_amc(file, rate=50.0)
    check_same(read, motion, written)
    check_trunk(read, motion)
    assert read.subject.name == "07"
    assert read_amc(file, unit="cm").time[1] == pytest.approx(1.0 / 120.0)


def write_smpl(file: Path, motion: go.Motion, columns: int, **others: object) -> Path:
    """SMPL's body joints with the segments of the motion, in a space with z up."""
    segments = segment_orientations(motion).rotations
    local = local_rotations(rotations_in_file(dict(segments)))
    poses = np.zeros((len(motion), columns))
    joints = {"Hips": 0, "Spine": 6, "Spine1": 9, "LeftArm": 16, "RightArm": 17}
    joints |= {"LeftForeArm": 18, "RightForeArm": 19, "LeftHand": 20, "RightHand": 21}
    for name, joint in joints.items():
        rotations = local[name] if joint else FILE.T @ local[name]
        vectors = Rotation.from_matrix(rotations).as_rotvec()
        poses[:, 3 * joint : 3 * joint + 3] = vectors
    arrays = {"poses": poses, "mocap_framerate": 50.0, "gender": "female", "betas": np.zeros(16)}
    arrays["trans"] = np.zeros((len(motion), 3))
    np.savez(file, **{key: value for key, value in (arrays | others).items() if value is not None})
    return file


@settings(max_examples=4, deadline=None)
@given(seed=seeds, columns=st.sampled_from([72, 156, 165]))
def test_smpl_returns_the_angles(
    seed: int, columns: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    motion = smooth_motion(seed)
    file = write_smpl(tmp_path_factory.mktemp("smpl") / "a.npz", motion, columns)
    read = read_smpl(file)
    check_same(read, motion, segment_orientations(motion))
    assert read.trunk is None


def test_smpl_may_be_divided_into_root_and_body(tmp_path: Path) -> None:
    whole = np.random.default_rng(0).normal(0.0, 0.1, (3, 72))
    whole[:, :3] += (np.pi / 2.0, 0.0, 0.0)
    parts = {"root_orient": whole[:, :3], "pose_body": whole[:, 3:66]}
    np.savez(tmp_path / "whole.npz", poses=whole, mocap_framerate=60.0)
    np.savez(tmp_path / "parts.npz", **parts, mocap_frame_rate=60.0)
    first, second = (go.read_motion(tmp_path / f"{name}.npz") for name in ("whole", "parts"))
    assert np.array_equal(first.q, second.q)


def test_smpl_in_a_space_with_y_up_must_say_so(tmp_path: Path) -> None:
    motion = smooth_motion(3)
    file = write_smpl(tmp_path / "z.npz", motion, 72)
    with np.load(file) as archive:
        arrays = dict(archive)
    upright = Rotation.from_rotvec(arrays["poses"][:, :3])
    arrays["poses"][:, :3] = (Rotation.from_matrix(FILE) * upright).as_rotvec()
    turned = tmp_path / "y.npz"
    np.savez(turned, **arrays)
    with pytest.raises(go.RecordingError, match=r"\+z should be vertical.*\(--up=y\) or up='z'"):
        read_smpl(turned)
    read = read_smpl(turned, replace(SMPL, space_up="+y"))
    check_same(read, motion, segment_orientations(motion))


def test_a_rotation_of_the_wrist_about_the_forearm_is_pronation(tmp_path: Path) -> None:
    # In many files the elbow only flexes and the wrist joint has all of the pronation.
    motion = smooth_motion(5)
    written, joints, roots = in_files(motion, CM)
    for side, rest in SIDES.items():
        elbow = motion.select([f"{side[0].upper()}Ex_joint"]).q
        flexed = Rotation.from_euler("x", elbow).as_matrix()
        forearm = written.rotations[f"{side} upper arm"] @ flexed
        joints[f"{side.title()}ForeArm"] = FILE @ forearm @ rest.T @ FILE.T
    file = write_bvh(tmp_path / "a.bvh", joints, roots, 50.0, dict.fromkeys(NAMES, "ZXY"))
    check_same(read_bvh(file), motion, written)


def test_a_file_without_hands_has_hands_that_follow_the_forearms(tmp_path: Path) -> None:
    motion = smooth_motion(7)
    written, joints, roots = in_files(motion, CM)
    file = write_bvh(tmp_path / "a.bvh", joints, roots, 50.0, dict.fromkeys(NAMES, "XYZ"))
    file.write_text(file.read_text().replace("RightHand", "RightTool").replace("LeftHand", "Tool"))
    read = read_bvh(file, unit="cm")
    for side in SIDES:
        np.testing.assert_array_equal(
            read.rotations[f"{side} hand"], read.rotations[f"{side} forearm"]
        )
        expected = written.rotations[f"{side} forearm"]
        np.testing.assert_allclose(read.rotations[f"{side} forearm"], expected, atol=1e-9)


def test_names_with_spaces_namespaces_and_split_frames(tmp_path: Path) -> None:
    motion = smooth_motion(9)
    written, joints, roots = in_files(motion, CM)
    file = write_bvh(tmp_path / "a.bvh", joints, roots, 50.0, dict.fromkeys(NAMES, "YXZ"))
    text = file.read_text()
    for name in NAMES:
        text = text.replace(f" {name}\n", f" mixamorig:{name}\n")
    head, _, rows = text.partition("Frame Time")
    first, _, rows = rows.partition("\n")
    file.write_text(head.upper() + "Frame Time" + first + "\n" + rows.replace(" ", "\n"))
    check_same(read_bvh(file), motion, written)
    biped = {"Hips": "Bip01 Pelvis", "Spine": "Bip01 Spine", "Spine1": "Bip01 Spine1"}
    for side in ("Right", "Left"):
        biped |= {
            f"{side}Arm": f"Bip01 {side[0]} UpperArm",
            f"{side}ForeArm": f"Bip01 {side[0]} Forearm",
            f"{side}Hand": f"Bip01 {side[0]} Hand",
            f"{side}Shoulder": f"Bip01 {side[0]} Clavicle",
        }
    for name in NAMES:
        text = text.replace(f" mixamorig:{name}\n", f" {biped.get(name, name)} {{\n")
    lines = text.split("\n")
    kept = [line for i, line in enumerate(lines) if line.strip() != "{" or "{" not in lines[i - 1]]
    file.write_text("\n".join(kept))
    check_same(read_bvh(file), motion, written)


def test_the_first_frame_can_be_the_rest_pose(tmp_path: Path) -> None:
    # The x axis of every joint lies along its bone, so that all bones have one direction at zero.
    motion = smooth_motion(11)
    written, joints, roots = in_files(motion, CM)
    heading = Rotation.from_euler("y", 0.7).as_matrix()  # the person need not face along an axis
    joints = {
        name: np.concatenate([heading[None], rotations]) for name, rotations in joints.items()
    }
    turned = {name: np.eye(3) for name in NAMES}
    for _, parent, offset, _ in reversed(TREE[1:]):
        along = np.array([offset]) / np.linalg.norm(offset)
        turned[str(parent)] = Rotation.align_vectors(along, [[1.0, 0.0, 0.0]])[0].as_matrix()
    frames = np.concatenate([roots[:1], roots])
    axes = dict.fromkeys(NAMES, "ZYX")
    file = write_bvh(tmp_path / "a.bvh", joints, frames, 50.0, axes, turned)
    with pytest.raises(go.RecordingError, match="rest='first frame'"):
        read_bvh(file)
    human_ik = next(each for each in SKELETON_CONVENTIONS if "Mixamo" in each.name)
    read = read_bvh(file, replace(human_ik, rest="first frame"), unit="cm")
    # The space's horizontal axes are those of the body in the rest pose.
    turn = FILE.T @ heading.T @ FILE
    for segment, rotations in written.rotations.items():
        np.testing.assert_allclose(read.rotations[segment][1:], turn @ rotations, atol=1e-9)
    assert read.trunk is not None
    assert motion.trunk is not None
    expected = motion.trunk.positions @ turn.T
    np.testing.assert_allclose(read.trunk.positions[1:], expected, atol=1e-8)


def test_six_numbers_of_an_offset_state_the_rest_pose(tmp_path: Path) -> None:
    """The SOMA skeleton's joints have axes of their own; offsets end in angles about x, y, z."""
    motion = smooth_motion(12)
    written, joints, roots = in_files(motion, CM)
    frames = Rotation.random(len(TREE), random_state=np.random.default_rng(12)).as_matrix()
    turned = dict(zip(NAMES, frames, strict=True))
    file = write_bvh(tmp_path / "a.bvh", joints, roots, 50.0, dict.fromkeys(NAMES, "ZYX"), turned)
    lines = file.read_text().splitlines()
    resting = local_rotations(dict(zip(NAMES, frames[:, None], strict=True)))
    for name, rotations in resting.items():
        angles = Rotation.from_matrix(rotations[0]).as_euler("ZYX", degrees=True)[::-1]
        at = next(i for i, line in enumerate(lines) if line.split()[1:] == [name]) + 2
        lines[at] += "".join(f" {angle:.12g}" for angle in angles)
    file.write_text("\n".join(lines))
    read = read_bvh(file, unit="cm")
    check_same(read, motion, written)
    check_trunk(read, motion)


@pytest.mark.parametrize(("rest", "heading"), [("identity", 0.0), ("tpose", 2.0)])
def test_mvnx_returns_the_angles_and_the_trunk(rest: str, heading: float, tmp_path: Path) -> None:
    motion = smooth_motion(19)
    written, joints, roots = in_files(motion, CM)
    file = write_mvnx(tmp_path / "a.mvnx", joints, roots, 50.0, rest, heading)
    read = read_mvnx(file)
    assert read.subject.name == "Anna"
    check_same(read, motion, written)
    check_trunk(read, motion)
    still, moving, frames = file.read_text().partition('type="normal"')
    file.write_text(still + moving + re.sub("<position>.*?</position>", "", frames))
    check_same(read_mvnx(file), motion, written)
    assert read_mvnx(file).trunk is None
    file.write_text(re.sub("<joints>.*</joints>", "", still + moving + frames, flags=re.DOTALL))
    check_same(read_mvnx(file), motion, written)  # by MVN's names of segments
    check_trunk(read_mvnx(file), motion)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('type="identity"', 'type="npose"', "no <frame> of type identity or tpose"),
        ('type="normal"', 'type="other"', "two <frame> of type normal, has 0"),
        ("<subject ", '<subject label="B"/><subject ', "<mvnx> has 2 <subject>"),
        ("<connector2>T8/", "<connector2>T9/", "the joint jT8 connects L3 and T9"),
        ("<connector1>L3/jT8", "<connector1>Neck/jT8", "the segment T8 must come after Neck"),
        ('frameRate="50"', 'frameRate="60"', "last frame is at 0.22 s by its time, at 0.183333 s"),
        ('frameRate="50"', 'frameRate="fast"', "could not convert string to float: 'fast'"),
        (
            '(?s)(type="normal".*?<orientation>)[-.e0-9]+',
            r"\g<1>9",
            r"the orientation of segment 0 in frame 0 is \[9",
        ),
        (
            '(?s)(type="normal".*?<position>)[-.e0-9]+ ',
            r"\g<1>",
            r"position of frame 0 has 38 numbers",
        ),
        (
            '(?s)(type="normal".*?)<position>.*?</position>',
            r"\g<1>",
            "frame 0 has no position, others",
        ),
        ("T8", "T7", "no known convention names the segments"),
        (
            "orientation>",
            "sensorOrientation>",
            "only sensorOrientation, position: export MVNX with",
        ),
        (
            '(?s)"L3" (.*)"T8" (.*)<joints>.*</joints>',
            r'"T8" \1"L3" \2',
            "no <joint> in <joints>, and the segment T8 does not come after L3, as in MVN's list",
        ),
        (
            "(?s)<segments>.*</joints>",
            "<segments>" + "".join(f'<segment label="{k}"/>' for k in range(13)) + "</segments>",
            "the segments are not MVN's but 0, 1, .*: export MVNX with the joints",
        ),
    ],
)
def test_bad_mvnx(old: str, new: str, message: str, tmp_path: Path) -> None:
    _, joints, roots = in_files(smooth_motion(19), CM)
    file = write_mvnx(tmp_path / "a.mvnx", joints, roots, 50.0)
    text = file.read_text()
    assert re.search(old, text)
    file.write_text(re.sub(old, new, text, count=1 if "(" in old else 0))
    with pytest.raises(go.RecordingError, match=f"{re.escape(str(file))}: .*{message}"):
        go.read_motion(file)


def test_orientations_of_mvnx_that_contradict_the_positions_are_refused(tmp_path: Path) -> None:
    """As those of segments with other axes do, such as ISB's."""
    _, joints, roots = in_files(smooth_motion(19), CM)
    file = write_mvnx(tmp_path / "a.mvnx", joints, roots, 50.0)
    text = file.read_text()
    joints["RightArm"] = joints["RightArm"] @ Rotation.from_euler("y", 20, degrees=True).as_matrix()
    turned = write_mvnx(file, joints, roots, 50.0).read_text()
    pattern = "<orientation>.*?</orientation>"
    orientations = iter(re.findall(pattern, turned))
    file.write_text(re.sub(pattern, lambda _: next(orientations), text))
    with pytest.raises(go.RecordingError, match=r"RightUpperArm to RightForeArm .* by 20 deg"):
        read_mvnx(file)


def rotations_of_a_cube() -> list[Array]:
    matrices: list[Array] = Rotation.create_group("O").as_matrix().round()
    return list(matrices)


@pytest.mark.slow
@pytest.mark.parametrize("turn", rotations_of_a_cube())
def test_up_and_forward_are_found_from_the_rest_pose(turn: Array, tmp_path: Path) -> None:
    motion = smooth_motion(13)
    written, joints, roots = in_files(motion, CM)
    file = write_bvh(
        tmp_path / "a.bvh",
        {name: turn @ rotations for name, rotations in joints.items()},
        roots @ turn.T,
        50.0,
        dict.fromkeys(NAMES, "ZXY"),
        dict.fromkeys(NAMES, turn.T),
    )
    read = read_bvh(file, unit=CM)
    check_same(read, motion, written)
    check_trunk(read, motion)


def test_a_twist_turns_a_segment_about_its_long_axis(tmp_path: Path) -> None:
    motion = smooth_motion(15)
    written, joints, roots = in_files(motion, CM)
    file = write_bvh(tmp_path / "a.bvh", joints, roots, 50.0, dict.fromkeys(NAMES, "ZXY"))
    human_ik = next(each for each in SKELETON_CONVENTIONS if "Mixamo" in each.name)
    read = read_bvh(file, replace(human_ik, twist={"right upper arm": 30.0}))
    turn = Rotation.from_euler("z", 30.0, degrees=True).as_matrix()
    expected = dict(written.rotations)
    expected["right upper arm"] = expected["right upper arm"] @ turn
    for segment, rotations in expected.items():
        np.testing.assert_allclose(read.rotations[segment], rotations, atol=1e-9)


def test_one_arm_is_enough_but_has_no_middle_between_the_shoulders(tmp_path: Path) -> None:
    motion = smooth_motion(17)
    written, joints, roots = in_files(motion, CM)
    file = write_bvh(tmp_path / "a.bvh", joints, roots, 50.0, dict.fromkeys(NAMES, "ZXY"))
    file.write_text(file.read_text().replace("LeftArm", "Wing"))
    read = read_bvh(file, unit="cm")
    assert read.trunk is None
    assert "left upper arm" not in read.rotations
    expected = written.rotations["right hand"]
    np.testing.assert_allclose(read.rotations["right hand"], expected, atol=1e-9)
