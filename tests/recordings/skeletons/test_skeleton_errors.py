"""Malformed skeleton files are refused by a sentence with the file, the line and the reason."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
from recordings.motion_segments import segment_orientations
from recordings.skeletons.skeleton_files import (
    TREE,
    root_positions,
    rotations_in_file,
    smooth_motion,
    write_acclaim,
    write_bvh,
)

import geodesic_ocp as go
from geodesic_ocp.recordings.conventions.skeleton_convention import (
    SKELETON_CONVENTIONS,
    SkeletonConvention,
)
from geodesic_ocp.recordings.formats.amc import read_amc
from geodesic_ocp.recordings.formats.bvh import read_bvh
from geodesic_ocp.recordings.formats.smpl import read_smpl

NAMES = [name for name, *_ in TREE]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a.bvh, 07.asf, 07_01.amc and a.npz, three frames each."""
    place = tmp_path_factory.mktemp("good")
    motion = smooth_motion(1, count=3)
    joints = rotations_in_file(dict(segment_orientations(motion).rotations))
    assert motion.trunk is not None
    roots = root_positions(joints, motion.trunk.positions, 0.01)
    write_bvh(place / "a.bvh", joints, roots, 50.0, dict.fromkeys(NAMES, "ZXY"))
    frames = dict.fromkeys(NAMES, np.zeros(3))
    write_acclaim(place, joints, roots, dict.fromkeys(NAMES, "XYZ"), frames)
    np.savez(place / "a.npz", poses=np.tile(UPRIGHT, (3, 1)), mocap_frame_rate=60.0)
    return place


UPRIGHT = np.concatenate([[np.pi / 2, 0.0, 0.0], np.zeros(153)])  # of SMPL's pelvis


def changed(folder: Path, tmp_path: Path, name: str, pattern: str, new: str) -> Path:
    """The folder's files in another, one of them with the first match of a pattern replaced."""
    for file in folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    text = (folder / name).read_text()
    replaced = re.sub(pattern, new.replace("\\", "\\\\"), text, count=1, flags=re.S)
    assert replaced != text
    (tmp_path / name).write_text(replaced)
    return tmp_path


BVH = (
    ("HIERARCHY", "SKELETON", "line 1: a BVH begins with HIERARCHY, not 'SKELETON'"),
    ("{", "", "line 4: expected '{', found 'OFFSET'"),
    ("ROOT Hips", "JOINT Hips", "line 2: JOINT outside of a joint"),
    ("JOINT Spine\n", "ROOT Spine\n", "line .*: ROOT within a joint"),
    ("JOINT Spine\n", "JOINT\n", "line .*: JOINT without a name"),
    ("OFFSET [^\n]*", "OFFSET 0 0", "line 4: OFFSET has 2 numbers, not 3"),
    ("OFFSET [^\n]*", "OFFSET 0 x 0", "line 4: OFFSET is not numeric: '0 x 0'"),
    ("OFFSET [^\n]*", "OFFSET 0 nan 0", "line 4: OFFSET has the value nan"),
    ("OFFSET [^\n]*", "", "line 2: Hips has no OFFSET"),
    ("CHANNELS [^\n]*", "", "line 2: Hips has no CHANNELS"),
    ("CHANNELS 6", "CHANNELS 7", "line 5: CHANNELS needs a number up to 6, has '7'"),
    ("CHANNELS 6", "CHANNELS 5", "line 5: did not expect 'Yrotation' in Hips"),
    ("Zrotation", "Wrotation", "line 5: CHANNELS 6 must be followed by 6 different names"),
    ("CHANNELS 6", "ROTATE 6", "line 5: did not expect 'ROTATE' in Hips"),
    ("}\n}", "}", r"line .*: MOTION, but the joint Hips is not closed by '}'"),
    ("}\n}", "}\n}\nROOT Other", "line .*: a second ROOT: more than one person"),
    ("}\n}", "}\n}\n}", "line .*: '}' is outside of the skeleton"),
    ("MOTION.*", "", "the line MOTION is missing: is the file cut off"),
    ("Frames: 3", "Frames: 4", "line .*: 4 frames of 42 channels are stated, there are 3: is the"),
    (" [^ ]*\n$", "\n", "line .*: 3 frames of 42 .*, there are 2 and 41 numbers more"),
    ("Frames: 3", "Rows: 3", "line .*: expected 'Frames:', found 'Rows: 3'"),
    ("Frame Time: .*", "Frame Time: 0.02", "line .*: 3 frames of 42 .* are stated, there are 0"),
    ("Frame Time.*", "", "'Frame Time:' is missing"),
    ("Frame Time: [^\n]*", "Frame Time: 0", "line .*: a frame cannot last 0 s"),
    ("[^ ]*\n$", "12,5\n", "line .*: the frame is not numeric"),
)


@pytest.mark.parametrize(("pattern", "new", "message"), BVH)
def test_malformed_bvh(folder: Path, tmp_path: Path, pattern: str, new: str, message: str) -> None:
    file = changed(folder, tmp_path, "a.bvh", pattern, new) / "a.bvh"
    with pytest.raises(go.RecordingError, match=f"^{re.escape(str(file))}: {message}"):
        read_bvh(file)


AMC = (
    ("\n1\n", "\n", "line .*: expected ':FULLY-SPECIFIED'"),
    ("\n2\n", "\n3\n", "line 18: frame 3 follows frame 1"),
    ("\nrhand [^\n]*", "", "line .*: frame 1 has no rhand"),
    ("\nrhand [^\n]*", "\nrhand 1 2", "line 13: rhand has 2 numbers, not 3"),
    ("\nrhand [^\n]*", "\nrhand 1 2 x", "line 13: rhand is not numeric: '1 2 x'"),
    ("\nrhand [^\n]*", "\nrhand 1 2 inf", "line 13: rhand has the value inf"),
    ("\nrhand [^\n]*", "\nrhumerus 1 2 3", "line 13: rhumerus comes twice in frame 1"),
    ("\nrhand [^\n]*", "\ntail 1 2 3", "line 13: the skeleton has no bone 'tail'"),
    ("\nrhand [^\n]*", "\nto_rfemur 1 2 3", "line 13: to_rfemur has no degrees of freedom"),
    (":DEGREES", ":GRADES", "line 3: expected ':FULLY-SPECIFIED', ':DEGREES', ':RADIANS'"),
    (":DEGREES", ":samples-per-second 0", "line 3: the rate is 0 Hz"),
    ("\n1\n.*", "\n", "there are no frames"),
    ("\n2\n.*", "\n", "a motion needs two frames, there are 1"),
    ("^.*$", ":version 1.10", "line 1: this is a skeleton"),
)


@pytest.mark.parametrize(("pattern", "new", "message"), AMC)
def test_malformed_amc(folder: Path, tmp_path: Path, pattern: str, new: str, message: str) -> None:
    file = changed(folder, tmp_path, "07_01.amc", pattern, new) / "07_01.amc"
    with pytest.raises(go.RecordingError, match=f"^{re.escape(str(file))}: {message}"):
        read_amc(file)


ASF = (
    ("^", "skeleton\n", "line 1: no section of an ASF: 'skeleton'"),
    (":hierarchy", ":tree", "an ASF needs the section :hierarchy"),
    (":hierarchy", ":root", "line .*: a second section :root"),
    ("length 2.54", "length 0", "line 5: the unit of length is 0"),
    ("angle deg", "angle turns", "line 6: the unit of angles must be deg or rad, not 'turns'"),
    ("order TX", "order RX", "line 8: the order of the root must consist of TX TY TZ RX RY RZ"),
    ("order [^\n]*", "", "the section :root does not state an order"),
    ("axis XYZ", "axis XYX", "line 9: the order of axes must be one of XYZ, .*, is 'XYX'"),
    ("orientation 0", "orientation 90", "line 11: a root whose orientation in the rest pose is"),
    ("begin\n", "", "line 13: 'id' is outside of a bone"),
    ("end\n", "", "line .*: 'begin' before the 'end' of a bone"),
    ("name to_rfemur", "", "line 13: bone .*has no name"),
    ("direction [^\n]*", "direction 0 0 0", "line 13: bone to_rfemur has no direction"),
    ("direction [^\n]*", "direction 0 1", "line 16: the direction has 2 numbers, not 3"),
    ("    length [^\n]*", "length -1", "line 13: bone to_rfemur has no length, or an invalid"),
    (
        "dof rx",
        "dof tx",
        "line .*: the degrees of freedom of rfemur are 'tx ry rz'; only rotations",
    ),
    ("dof rx", "dof l rx", "line .*: the degrees of freedom of rfemur are 'l rx ry rz'"),
    ("dof rx", "dofs rx", "line .*: 'dofs' is not known of a bone"),
    ("name rfemur", "name to_rfemur", "line .*: there are two bones to_rfemur"),
    ("to_rfemur rfemur", "to_rfemur tail", "line .*: there is no bone 'tail'"),
    ("root to_rfemur", "root to_rfemur thorax", "line .*: thorax has two parents"),
    ("root to_rfemur", "rfemur to_rfemur", "line 13: the hierarchy does not connect to_rfemur"),
)


@pytest.mark.parametrize(("pattern", "new", "message"), ASF)
def test_malformed_asf(folder: Path, tmp_path: Path, pattern: str, new: str, message: str) -> None:
    place = changed(folder, tmp_path, "07.asf", pattern, new)
    with pytest.raises(go.RecordingError, match=f"^{re.escape(str(place / '07.asf'))}: {message}"):
        read_amc(place / "07_01.amc")


def test_the_skeleton_is_found_or_asked_for(folder: Path, tmp_path: Path) -> None:
    file = tmp_path / "07_01.amc"
    file.write_bytes((folder / file.name).read_bytes())
    with pytest.raises(go.RecordingError, match=r"07_01.amc: an AMC needs its skeleton.* no .asf"):
        read_amc(file)
    with pytest.raises(go.RecordingError, match=r"other.asf: cannot be read: No such file"):
        read_amc(file, tmp_path / "other.asf")
    assert read_amc(file, folder / "07.asf").subject.name == "07"
    text = (folder / "07.asf").read_bytes()
    (tmp_path / "anyone.asf").write_bytes(text)  # the only one
    assert read_amc(file).subject.name == "anyone"
    (tmp_path / "07.ASF").write_bytes(text)
    assert read_amc(file).subject.name == "07"
    (tmp_path / "07.ASF").rename(tmp_path / "08.asf")
    with pytest.raises(go.RecordingError, match=r"where there is 08.asf, anyone.asf"):
        read_amc(file)
    with pytest.raises(ValueError, match="rate must be positive"):
        read_amc(file, folder / "07.asf", rate=0.0)


def test_a_stated_rate_is_that_of_the_motion(folder: Path, tmp_path: Path) -> None:
    place = changed(folder, tmp_path, "07_01.amc", ":DEGREES", ":DEGREES\n:SAMPLES-PER-SECOND 60")
    assert read_amc(place / "07_01.amc").time[1] == pytest.approx(1 / 60)
    assert read_amc(place / "07_01.amc", rate=30.0).time[1] == pytest.approx(1 / 30)


NPZ = (
    ({"poses": None}, r"there is no 'poses' in it"),
    (
        {"poses": None, "root_orient": np.zeros((3, 3)), "pose_body": np.zeros((4, 63))},
        r"root_orient and pose_body must have 3 and 63 columns, .* \(3, 3\) and \(4, 63\)",
    ),
    ({"mocap_frame_rate": None}, r"there is no 'mocap_framerate' or 'mocap_frame_rate' in it"),
    ({"poses": np.zeros((3, 70))}, r"'poses' must have 66, 72, 156 or 165 columns.*\(3, 70\)"),
    ({"poses": np.zeros(72)}, r"'poses' must have 66, 72, 156 or 165 columns"),
    ({"poses": np.full((3, 72), np.nan)}, r"'poses' is nan in frame 0"),
    ({"poses": np.full((3, 72), 90.0)}, r"'poses' is 90 in frame 0: are .* vectors in degrees"),
    ({"poses": np.array([["a"] * 72] * 3)}, r"'poses' must be numbers, is <U1"),
    ({"poses": np.array([[None] * 72] * 3)}, r"'poses' cannot be read: it holds Python objects"),
    ({"poses": np.tile(UPRIGHT, (1, 1))}, r"a motion needs two frames, there are 1"),
    ({"mocap_frame_rate": 0.0}, r"the rate of the recording is 0.0 Hz"),
    ({"mocap_frame_rate": [60.0, 60.0]}, r"'mocap_frame_rate' must be a number"),
    ({"poses": np.zeros((3, 72))}, r"\+z should be vertical, but the thorax points along \+y"),
)


@pytest.mark.parametrize(("arrays", "message"), NPZ)
def test_malformed_npz(tmp_path: Path, arrays: dict[str, object], message: str) -> None:
    file = tmp_path / "a.npz"
    every = {"poses": np.tile(UPRIGHT, (3, 1)), "mocap_frame_rate": 60.0} | arrays
    np.savez(file, **{key: value for key, value in every.items() if value is not None})
    with pytest.raises(go.RecordingError, match=f"^{re.escape(str(file))}: {message}"):
        read_smpl(file)


def test_other_archives_are_no_npz(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    file.write_bytes(b"")
    with pytest.raises(go.RecordingError, match="is no archive of NumPy arrays"):
        read_smpl(file)
    np.save(tmp_path / "a.npy", np.zeros(3))
    with pytest.raises(go.RecordingError, match="is a single array"):
        read_smpl(tmp_path / "a.npy")
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("readme.txt", "hello")
    with pytest.raises(go.RecordingError, match="there is no 'poses' in it"):
        read_smpl(file)


def test_lengths_in_another_unit_are_noticed(folder: Path) -> None:
    with pytest.raises(go.RecordingError, match=r"the right arm is 55 m long.*argument unit"):
        read_bvh(folder / "a.bvh", unit="m")
    with pytest.raises(ValueError, match="unit must be 'm', 'cm', 'mm', 'in' or a number"):
        read_bvh(folder / "a.bvh", unit="parsec")
    with pytest.raises(ValueError, match="unit must be positive"):
        read_bvh(folder / "a.bvh", unit=-1.0)


def test_a_rest_pose_must_be_that_of_a_standing_person(folder: Path, tmp_path: Path) -> None:
    def message(joint: str, offset: str) -> str:
        pattern = rf"(JOINT {joint}\s+{{\s+)OFFSET[^\n]*"
        text = (folder / "a.bvh").read_text()
        file = tmp_path / "b.bvh"
        file.write_text(re.sub(pattern, rf"\1OFFSET {offset}", text))
        with pytest.raises(go.RecordingError) as raised:
            read_bvh(file)
        assert str(raised.value).startswith(f"{file}: ")
        return str(raised.value)

    assert "does not show which axis points up" in message("Spine1", "40 0 0")
    assert "does not show which axis points right" in message("RightArm", "-14 0 30")
    assert "arms do not mirror each other" in message("LeftForeArm", "0 -29 0")
    assert "the right arm points up" in message("RightForeArm", "0 29 0")
    assert "the right arm is folded" in message("RightForeArm", "29 0 0")
    assert "the right arm has no length" in message("RightForeArm", "0 0 0")


def test_positions_that_are_added_to_offsets_are_not_taken_for_positions(
    folder: Path, tmp_path: Path
) -> None:
    text = (folder / "a.bvh").read_text()
    three = "CHANNELS 3 Zrotation Xrotation Yrotation"
    head, motion = text.split("MOTION")
    head = head.replace(three, "CHANNELS 6 Xposition Yposition Zposition" + three[10:])
    lines = motion.strip().split("\n")

    def write(offsets: bool) -> Path:
        rows = []
        for line in lines[2:]:
            words = line.split()
            row = words[:6]
            for index, (_, _, offset, _) in enumerate(TREE[1:]):
                row += [f"{x}" for x in (offset if offsets else (0.0, 0.0, 0.0))]
                row += words[6 + 3 * index : 9 + 3 * index]
            rows.append(" ".join(row))
        file = tmp_path / "b.bvh"
        file.write_text(head + "\n".join(["MOTION", *lines[:2], *rows]))
        return file

    trunk = read_bvh(folder / "a.bvh", unit="cm").trunk
    again = read_bvh(write(offsets=True), unit="cm").trunk
    assert trunk is not None
    assert again is not None
    np.testing.assert_allclose(again.positions, trunk.positions, atol=1e-12)
    read_bvh(write(offsets=False))
    with pytest.raises(go.RecordingError, match="positions that are added to the offset are not"):
        read_bvh(write(offsets=False), unit="cm")


READERS = {"a.bvh": read_bvh, "07_01.amc": read_amc, "07.asf": read_amc, "a.npz": read_smpl}


@pytest.mark.parametrize("convention", SKELETON_CONVENTIONS, ids=lambda each: each.name)
def test_a_known_convention_that_does_not_fit_is_refused(
    folder: Path, convention: SkeletonConvention
) -> None:
    if "Mixamo" in convention.name:
        assert len(read_bvh(folder / "a.bvh", convention)) == 3
        return
    with pytest.raises(go.RecordingError, match=r"by the convention .* there must be a thorax"):
        read_bvh(folder / "a.bvh", convention)
