"""Which joints carry which segments: known names, and those that a user states."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from recordings.motion_segments import segment_orientations
from recordings.skeletons.skeleton_files import (
    TREE,
    root_positions,
    rotations_in_file,
    smooth_motion,
    write_bvh,
)

import geodesic_ocp as go
from geodesic_ocp.recordings.conventions.segment_orientations import SegmentOrientations
from geodesic_ocp.recordings.conventions.skeleton_convention import (
    SkeletonConvention,
    as_skeleton_convention,
)
from geodesic_ocp.recordings.formats.bvh import read_bvh

NAMES = [name for name, *_ in TREE]
MINE = {
    "name": "mine",
    "up": "+y",
    "forward": "+z",
    "unit": "cm",
    "joints": {
        "thorax": "Torso",
        "right upper arm": ["RUpper", "RArm"],
        "right forearm": "RLower",
        "right hand": "RPalm",
    },
}
OWN = {"Spine1": "Torso", "RightArm": "RArm", "RightForeArm": "RLower", "RightHand": "RPalm"}


def two_arms(body: dict[str, str], arm: dict[str, str]) -> dict[str, str]:
    """Names of both arms from those of the right one, as they replace the tree's."""
    left = {"Right": "Left", "R ": "L ", "r": "l"}
    names = dict(body)
    for joint, name in arm.items():
        letters = next(each for each in left if name.startswith(each) or f" {each}" in name)
        names[f"Right{joint}"] = name
        names[f"Left{joint}"] = name.replace(letters, left[letters], 1)
    return names


FAMILIES = {
    "HumanIK": {},
    "Biovision": two_arms(
        {"Spine": "Abdomen", "Spine1": "Chest"},
        {
            "Shoulder": "RightCollar",
            "Arm": "RightShoulder",
            "ForeArm": "RightElbow",
            "Hand": "RightWrist",
        },
    ),
    "Xsens MVN": two_arms(
        {"Spine": "Chest2", "Spine1": "Chest4"},
        {
            "Shoulder": "RightCollar",
            "Arm": "RightShoulder",
            "ForeArm": "RightElbow",
            "Hand": "RightWrist",
        },
    ),
    "MVN segments": two_arms(
        {"Hips": "Pelvis", "Spine": "L3", "Spine1": "T8"}, {"Arm": "RightUpperArm"}
    ),
    "Poser": two_arms(
        {"Hips": "hip", "Spine": "abdomen", "Spine1": "chest"},
        {"Shoulder": "rCollar", "Arm": "rShldr", "ForeArm": "rForeArm", "Hand": "rHand"},
    ),
    "lower case": {name: name.lower() for name in NAMES},
    "underscores": {name: f"person1:{name.replace('Right', 'Right_')}" for name in NAMES},
}


def renamed(folder: Path, names: dict[str, str]) -> tuple[Path, SegmentOrientations]:
    """A BVH whose joints have other names, and the orientations written."""
    motion = smooth_motion(2, count=4)
    written = segment_orientations(motion)
    joints = rotations_in_file(dict(written.rotations))
    assert motion.trunk is not None
    roots = root_positions(joints, motion.trunk.positions, 0.01)
    file = write_bvh(folder / "a.bvh", joints, roots, 50.0, dict.fromkeys(NAMES, "ZXY"))
    lines = []
    for line in file.read_text().split("\n"):
        start, space, name = line.rpartition(" ")
        key = start.strip() in ("ROOT", "JOINT")
        lines.append(start + space + names.get(name, name) if key else line)
    file.write_text("\n".join(lines))
    return file, written


@pytest.mark.parametrize("family", FAMILIES)
def test_known_names_are_recognised(tmp_path: Path, family: str) -> None:
    file, written = renamed(tmp_path, FAMILIES[family])
    read = read_bvh(file)
    assert set(read.rotations) == set(written.rotations)
    for segment, rotations in written.rotations.items():
        np.testing.assert_allclose(read.rotations[segment], rotations, atol=1e-9)


def test_unknown_names_are_listed_with_the_way_to_state_them(tmp_path: Path) -> None:
    file, written = renamed(tmp_path, OWN | {"LeftArm": "Wing"})
    message = r"no known convention .* Its joints are Hips, RightUpLeg.*RPalm.*convention=Skeleton"
    with pytest.raises(go.RecordingError, match=message):
        read_bvh(file)
    given = tmp_path / "mine.json"
    given.write_text(json.dumps(MINE))
    as_object = SkeletonConvention("mine", MINE["joints"], "+y", "+z")  # type: ignore[arg-type]
    for convention in (given, str(given), as_object):
        read = read_bvh(file, convention)
        assert set(read.rotations) == {"thorax", *MINE["joints"]}
        for segment, rotations in read.rotations.items():
            np.testing.assert_allclose(rotations, written.rotations[segment], atol=1e-9)


@pytest.mark.skipif(sys.version_info < (3, 11), reason="Python reads TOML from 3.11")
def test_a_convention_in_toml_is_the_same(tmp_path: Path) -> None:
    lines = [f"{key} = {json.dumps(value)}" for key, value in MINE.items() if key != "joints"]
    lines.append("[joints]")
    lines += [f"{json.dumps(key)} = {json.dumps(value)}" for key, value in MINE["joints"].items()]
    (tmp_path / "mine.toml").write_text("\n".join(lines))
    (tmp_path / "mine.json").write_text(json.dumps(MINE))
    first, second = (as_skeleton_convention(tmp_path / f"mine.{end}") for end in ("toml", "json"))
    assert first == second
    assert repr(first) == "SkeletonConvention('mine', 4 segments)"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is not a convention in JSON, TOML or YAML"),
        ("[1]", "a convention has the keys name, joints, up"),
        ('{"joints": {}, "colour": 1}', "a convention has the keys name, joints, up"),
        ('{"up": "+y"}', "of which 'joints' is required"),
        ('{"joints": {"tail": "Tail"}}', "joints must be given by segment"),
        ('{"joints": {"thorax": 3}}', "joints of the thorax must be names, got 3"),
        ('{"joints": {}, "up": "y", "forward": "+z"}', r"up must be one of \+x"),
        ('{"joints": {}, "up": 3, "forward": "+z"}', r"up must be one of \+x"),
        ('{"joints": {}, "up": "+y"}', "up and forward are given together"),
        ('{"joints": {}, "up": "+y", "forward": "-y"}', "up and forward must be two axes"),
        ('{"joints": {}, "rest": "last frame"}', "rest must be 'zero' or 'first frame'"),
        ('{"joints": {}, "twist": {"pelvis": 3}}', "twist must be given by segment"),
        ('{"joints": {}, "twist": {"left hand": "x"}}', "twist of the left hand must be a finite"),
        ('{"joints": {}, "unit": "parsec"}', "unit must be 'm'"),
    ],
)
def test_malformed_conventions(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "mine.json"
    file.write_text(text)
    with pytest.raises(go.RecordingError, match=rf"mine.json: .*{message}"):
        as_skeleton_convention(file)
    with pytest.raises(go.RecordingError, match=r"none.json: cannot be read"):
        as_skeleton_convention(tmp_path / "none.json")
    with pytest.raises(
        ValueError, match="convention must be a SkeletonConvention or a file, got 3"
    ):
        as_skeleton_convention(3)  # type: ignore[arg-type]


def test_two_joints_of_the_name_of_a_segment_are_ambiguous(tmp_path: Path) -> None:
    file, _ = renamed(tmp_path, {"Neck": "RightArm", "LeftArm": "Left_Arm"})
    with pytest.raises(go.RecordingError, match="2 joints are named RightArm"):
        read_bvh(file)
