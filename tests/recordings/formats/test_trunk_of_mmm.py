"""The trunk in recordings of the Master Motor Map."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.trajectory.files.mmm import TRUNK_JOINTS

TAKE_BOOK = "take_book_from_shelf_right_arm_02"
POSES = "<RootPosition>1 2 3</RootPosition><RootRotation>0 0 0</RootRotation>"


def recording(root: tuple[str, str] = (POSES, POSES), head: str = "<Height>2.0</Height>") -> str:
    joints = "".join(f"<Joint name='{name}'/>" for name in (*TRUNK_JOINTS, "RSx_joint"))
    frames = "".join(
        f"<MotionFrame><Timestep>{0.01 * index}</Timestep>{pose}"
        "<JointPosition>0 0 0 0 0 0 0.5</JointPosition></MotionFrame>"
        for index, pose in enumerate(root)
    )
    return (
        f"<MMM><Motion name='a'><ModelProcessorConfig>{head}</ModelProcessorConfig>"
        f"<JointOrder>{joints}</JointOrder><MotionFrames>{frames}</MotionFrames></Motion></MMM>"
    )


def read(folder: Path, text: str) -> go.Motion:
    file = folder / "recording.xml"
    file.write_text(text, encoding="utf-8")
    return go.read_motion(file, ["RSx_joint"])


def test_upright_the_thorax_is_above_the_pelvis(tmp_path: Path) -> None:
    """The root is given in millimetres; the trunk is 0.288 of the height."""
    trunk = read(tmp_path, recording()).trunk
    assert trunk is not None
    assert trunk.positions == pytest.approx(np.tile([0.001, 0.002, 0.003 + 2 * 0.288], (2, 1)))
    assert trunk.rotations == pytest.approx(np.tile(np.eye(3), (2, 1, 1)))


def test_roll_pitch_and_yaw_are_about_fixed_axes(tmp_path: Path) -> None:
    """First rolled by 90 degrees, z points against y; yaw then turns that to x."""
    pose = POSES.replace("0 0 0", "1.5707963267948966 0 1.5707963267948966")
    trunk = read(tmp_path, recording((pose, pose))).trunk
    assert trunk is not None
    assert trunk.rotations[0] @ [0.0, 0.0, 1.0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        recording(("", "")),
        recording(head=""),
        recording().replace("BTy_joint", "BTw_joint"),
    ],
    ids=["no root", "no height", "no joint"],
)
def test_without_root_height_or_joints_there_is_none(text: str, tmp_path: Path) -> None:
    assert read(tmp_path, text).trunk is None


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        ("", "frame 1 has no RootPosition, others have"),
        (POSES.split("<RootR")[0], "frame 1 has no RootRotation"),
        (POSES.replace("1 2 3", "1 2"), "RootPosition of frame 1 has 2 numbers, not 3"),
        (POSES.replace("1 2 3", "1 x 3"), "RootPosition of frame 1 is not numeric"),
        (POSES.replace("1 2 3", "1 nan 3"), "RootPosition of frame 1 has the value nan"),
    ],
)
def test_a_bad_root_is_named(pose: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(go.RecordingError, match=f"recording.xml: .*{re.escape(message)}"):
        read(tmp_path, recording((POSES, pose)))


def test_both_layouts_have_the_same_trunk(shared: Path) -> None:
    kit = shared / "data" / "kit"
    first, second = (go.read_motion(kit / f"{TAKE_BOOK}{end}") for end in (".xml", ".mmm2.xml"))
    assert first.trunk is not None
    assert second.trunk is not None
    assert np.array_equal(first.trunk.rotations, second.trunk.rotations)
    assert np.array_equal(first.trunk.positions, second.trunk.positions)


@pytest.mark.parametrize(
    "name", [TAKE_BOOK, "hand_to_mouth_right_arm_01", "hand_to_mouth_right_arm_02", "Trial_75"]
)
def test_recorded_people_stand_upright(name: str, shared: Path) -> None:
    motion = go.read_motion(shared / "data" / "kit" / f"{name}.xml")
    assert motion.trunk is not None
    assert motion.trunk.rotations[:, 2, 2].min() > 0.8
    height = motion.trunk.positions[:, 2] / float(motion.subject.height or 0.0)
    assert np.all((height > 0.70) & (height < 0.90))  # the shoulders, of the body height


def test_the_markers_of_the_chest_are_where_the_model_has_them(shared: Path) -> None:
    """In the reference model, per body height; the database's own error is of this size."""
    ezc3d = pytest.importorskip("ezc3d")
    kit = shared / "data" / "kit"
    trunk = go.read_motion(kit / f"{TAKE_BOOK}.xml").trunk
    assert trunk is not None
    file = ezc3d.c3d(str(kit / f"{TAKE_BOOK}.c3d"))
    labels = file["parameters"]["POINT"]["LABELS"]["value"]
    places = {"C7": (0.0, -0.0389454, 0.0213116), "CLAV": (-0.0002, 0.0518562, -0.009823)}
    for name, place in places.items():
        expected = 1e-3 * file["data"]["points"][:3, labels.index(name)].T
        found = trunk.positions + 1.83 * trunk.rotations @ np.array(place)
        assert np.linalg.norm(found - expected, axis=1).max() < 0.035


def test_the_thorax_is_that_of_the_upper_body_on_the_recorded_pelvis(shared: Path) -> None:
    motion = go.read_motion(shared / "data" / "kit" / "Trial_75.xml")
    assert motion.trunk is not None
    person = go.human_upper_body(1.84)
    inside = person.frame_pose("thorax", motion.select(person.joint_names).q)[0]
    pelvis = motion.trunk.rotations @ np.swapaxes(inside, 1, 2)
    assert pelvis[:, 2, 2].min() > 0.95  # the pelvis remains level while the person waves
