"""Angle conventions: what the built-in ones mean for the arm, round trips, and those of users."""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recordings.motion_segments import segment_orientations
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.recordings.conventions.angle_convention import (
    AngleConvention,
    AxisRotation,
    SegmentRelation,
    segments_of_angles,
)
from geodesic_ocp.recordings.conventions.known_angle_conventions import (
    ANGLE_CONVENTIONS,
    ISB,
    OPENSIM_FULL_BODY,
    OPENSIM_UPPER_LIMB,
    as_convention,
)
from geodesic_ocp.recordings.conventions.segment_orientations import joint_angles

TIME = np.array([0.0, 1.0])
RIGHT, FORWARD, UP = np.eye(3)
FULL_ARM = ("arm_flex", "arm_add", "arm_rot", "elbow_flex", "pro_sup", "wrist_flex", "wrist_dev")
UPPER_LIMB = ("elv_angle", "shoulder_elv", "shoulder_rot", "elbow_flexion", "pro_sup")
ISB_ARM = (
    "plane_of_elevation",
    "elevation",
    "axial_rotation",
    "elbow_flexion",
    "pronation",
    "wrist_flexion",
    "wrist_deviation",
)


def posed(convention: AngleConvention, names: list[str], **degrees: float) -> dict[str, np.ndarray]:
    """Orientations of the segments in a pose in which the columns not given are 0."""
    columns = {name: np.full(2, np.radians(degrees.get(name, 0.0))) for name in names}
    assert set(degrees) <= set(names)
    found = segments_of_angles(convention, TIME, columns).rotations
    return {segment: matrices[0] for segment, matrices in found.items()}


def down(rotation: np.ndarray) -> np.ndarray:
    """Direction from the proximal to the distal joint."""
    return -rotation[:, 2]


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_full_body_arm_moves_as_its_coordinates_are_called(side: str) -> None:
    end = f"_{side[0]}"
    names = [name + end for name in FULL_ARM]
    outward = RIGHT if side == "right" else -RIGHT

    def pose(**degrees: float) -> dict[str, np.ndarray]:
        named = {name + end: value for name, value in degrees.items()}
        return posed(OPENSIM_FULL_BODY, names, **named)

    neutral = pose(pro_sup=90.0)
    assert neutral[f"{side} upper arm"] == pytest.approx(np.eye(3))
    # The axis of pronation and the elbow's are not at right angles in the model.
    assert Rotation.from_matrix(neutral[f"{side} hand"]).magnitude() < np.radians(5.0)
    assert Rotation.from_matrix(neutral[f"{side} forearm"]).magnitude() < np.radians(5.0)
    assert down(pose(arm_flex=90.0)[f"{side} upper arm"]) == pytest.approx(FORWARD)
    assert down(pose(arm_add=-90.0)[f"{side} upper arm"]) == pytest.approx(outward)
    inward = pose(arm_rot=90.0, elbow_flex=90.0)[f"{side} forearm"]
    assert down(inward) @ -outward > 0.95
    assert down(pose(elbow_flex=90.0)[f"{side} forearm"]) @ FORWARD > 0.95
    # The palm faces inwards in the neutral pose: the wrist flexes inwards, and deviates backwards
    # to the side of the ulna.
    assert down(pose(pro_sup=90.0, wrist_flex=60.0)[f"{side} hand"]) @ -outward > 0.8
    assert down(pose(pro_sup=90.0, wrist_dev=30.0)[f"{side} hand"]) @ -FORWARD > 0.4
    thumb = pose(pro_sup=180.0)[f"{side} hand"][:, 1]
    assert thumb @ -outward > 0.95


def test_the_upper_limb_moves_as_its_coordinates_are_called() -> None:
    names = list(UPPER_LIMB)
    neutral = posed(OPENSIM_UPPER_LIMB, names)
    assert neutral["right upper arm"] == pytest.approx(np.eye(3))
    assert Rotation.from_matrix(neutral["right forearm"]).magnitude() < np.radians(8.0)
    aside = posed(OPENSIM_UPPER_LIMB, names, shoulder_elv=90.0)
    assert down(aside["right upper arm"]) @ RIGHT > 0.99
    ahead = posed(OPENSIM_UPPER_LIMB, names, shoulder_elv=90.0, elv_angle=90.0)
    assert down(ahead["right upper arm"]) @ FORWARD > 0.99
    bent = posed(OPENSIM_UPPER_LIMB, names, elbow_flexion=90.0)
    assert down(bent["right forearm"]) @ FORWARD > 0.99
    inward = posed(OPENSIM_UPPER_LIMB, names, elbow_flexion=90.0, shoulder_rot=90.0)
    assert down(inward["right forearm"]) @ -RIGHT > 0.99
    thumb = posed(OPENSIM_UPPER_LIMB, names, pro_sup=90.0)["right forearm"][:, 1]
    assert thumb @ -RIGHT > 0.99


@given(st.sampled_from(["right", "left"]), st.integers(0, 2**32 - 1))
def test_isb_angles_give_the_motion_that_they_describe(side: str, seed: int) -> None:
    """ISB angles by SciPy's Euler angles, whose branch may jump, come back as a smooth motion."""
    arm = go.human_arm(side)
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 2.0, 101)
    waves = np.sin(2.0 * np.pi * rng.uniform(0.3, 0.8, 7) * time[:, None] + rng.uniform(0, 6, 7))
    q = 0.5 * (arm.lower + arm.upper) + 0.45 * (arm.upper - arm.lower) * waves
    rotations = segment_orientations(go.Motion(time, q, arm.joint_names)).rotations
    palm = Rotation.from_euler("y", -90.0, degrees=True).as_matrix()
    change = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    mirror = np.diag([1.0, 1.0, 1.0 if side == "right" else -1.0])

    def isb(segment: str, neutral: np.ndarray) -> np.ndarray:
        return mirror @ (change.T @ rotations[segment] @ change) @ mirror @ neutral.T

    upper = isb(f"{side} upper arm", np.eye(3))
    forearm, hand = isb(f"{side} forearm", palm), isb(f"{side} hand", palm)
    elbow, wrist = np.swapaxes(upper, 1, 2) @ forearm, np.swapaxes(forearm, 1, 2) @ hand
    flexion, carrying, pronation = Rotation.from_matrix(elbow).as_euler("ZXY").T
    assert np.abs(carrying).max() < 1e-9
    angles = [
        *Rotation.from_matrix(upper).as_euler("YXY").T,
        flexion,
        pronation,
        *Rotation.from_matrix(wrist).as_euler("ZXY").T,
    ]
    names = [*ISB_ARM, "wrist_rotation"]
    columns = {f"{n}_{side[0]}": angle for n, angle in zip(names, angles, strict=True)}
    found = joint_angles(segments_of_angles(ISB, time, columns), arm.joint_names)
    assert found.q == pytest.approx(q, abs=1e-7)


def test_isb_elevation_is_negative_and_90_degrees_of_plane_is_forward() -> None:
    names = [f"{name}_r" for name in ISB_ARM]
    aside = posed(ISB, names, elevation_r=-90.0)
    assert down(aside["right upper arm"]) == pytest.approx(RIGHT)
    ahead = posed(ISB, names, elevation_r=-90.0, plane_of_elevation_r=90.0)
    assert down(ahead["right upper arm"]) == pytest.approx(FORWARD)
    left = posed(ISB, [f"{name}_l" for name in ISB_ARM], elevation_l=-90.0)
    assert down(left["left upper arm"]) == pytest.approx(-RIGHT)
    palm = posed(ISB, names, pronation_r=90.0)
    assert palm["right hand"] == pytest.approx(np.eye(3), abs=1e-12)


def test_the_trunk_of_the_full_body_is_its_pelvis_and_lumbar_joint() -> None:
    columns = dict.fromkeys(
        ["pelvis_tilt", "pelvis_list", "pelvis_rotation", "lumbar_bending", "lumbar_rotation"],
        np.zeros(2),
    )
    columns |= {"lumbar_extension": np.full(2, -0.4), "pelvis_tx": np.zeros(2)}
    columns |= {"pelvis_ty": np.ones(2), "pelvis_tz": np.full(2, 0.1)}
    found = segments_of_angles(OPENSIM_FULL_BODY, TIME, columns)
    motion = joint_angles(found)
    assert motion.joint_names[:2] == ("BPx_joint", "BPz_joint")
    # bending forward is negative about x, in halves
    assert motion.q[0] == pytest.approx([-0.2, 0.0, 0.0, -0.2, 0.0, 0.0], abs=1e-12)
    assert found.trunk is not None
    expected = [0.1, -0.1007 + 0.3715 * np.sin(0.4) + 0.003155 * np.cos(0.4)]
    assert found.trunk.positions[0, :2] == pytest.approx(expected)
    del columns["lumbar_bending"]
    with pytest.raises(go.RecordingError, match=r"no column lumbar_bending \(of the thorax\)"):
        segments_of_angles(OPENSIM_FULL_BODY, TIME, columns)


def test_conventions_are_read_from_files(tmp_path: Path) -> None:
    record = {
        "extends": "opensim_upper_limb",
        "relations": [
            {
                "segment": "right hand",
                "parent": "right forearm",
                "rotations": [
                    {"axis": "-z", "column": "deviation"},
                    {"axis": [2, 0, 0], "column": "flexion", "offset": 10},
                ],
            }
        ],
    }
    (tmp_path / "mine.json").write_text(json.dumps(record))
    mine = as_convention(tmp_path / "mine.json")
    assert mine is not None
    assert repr(mine) == (
        "AngleConvention('mine': thorax, right upper arm, right forearm, right hand)"
    )
    hand = mine.relations[-1]
    assert hand.columns == ("deviation", "flexion")
    assert hand.rotations[1] == AxisRotation((1.0, 0.0, 0.0), "flexion", offset=10.0)
    assert mine.relations[:-1] == OPENSIM_UPPER_LIMB.relations[:-1]
    assert as_convention("isb") is ISB
    assert as_convention(mine) is mine
    assert as_convention(None) is None


@pytest.mark.skipif(sys.version_info < (3, 11), reason="TOML is read since Python 3.11")
def test_a_convention_in_toml(tmp_path: Path) -> None:
    text = (
        'name = "t"\nup = "z"\nforward = "y"\n[[relations]]\nsegment = "thorax"\n'
        '[[relations]]\nsegment = "right upper arm"\nparent = "thorax"\n'
        'rotations = [{axis = "x", column = "a"}]\n'
    )
    (tmp_path / "t.toml").write_text(text)
    mine = as_convention(tmp_path / "t.toml")
    assert mine is not None
    assert mine.to_right_forward_up == pytest.approx(np.eye(3))
    columns = {"a": np.full(2, 0.3)}
    motion = joint_angles(segments_of_angles(mine, TIME, columns))
    assert motion.q[0] == pytest.approx([0.3, 0.0, 0.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is not a convention in JSON, TOML or YAML"),
        ("[]", "a convention has the keys name, relations"),
        ('{"relations": 3}', "relations must be a list"),
        (
            '{"relations": [{"parent": null}]}',
            "a relation has the keys segment, .*, of which 'segment' is required",
        ),
        ('{"relations": [{"segment": "thorax", "parent": "x"}]}', "the parent 'x' of the thorax"),
        ('{"extends": "foo"}', "extends must be one of isb, "),
        ('{"extends": []}', "extends must be one of isb, "),
        ('{"relations": [], "up": "x"}', "forward and up must be different axes"),
        ('{"relations": [], "up": 3}', "axis must"),
        (
            '{"relations": [{"segment": "thorax", "rotations": [{"axis": "w"}]}]}',
            "axis must be one of x, y",
        ),
        (
            '{"relations": [{"segment": "thorax", "rotations": [{"axis": "x", "sign": "+"}]}]}',
            "sign must be a finite number",
        ),
    ],
)
def test_malformed_conventions_are_refused(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "bad.json").write_text(text)
    with pytest.raises(go.RecordingError, match=message) as raised:
        as_convention(tmp_path / "bad.json")
    assert str(raised.value).startswith(str(tmp_path / "bad.json"))


KEYS = st.sampled_from(
    [
        each.name
        for kind in (AngleConvention, SegmentRelation, AxisRotation)
        for each in fields(kind)
    ]
    + ["extends"]
)
VALUES = st.recursive(
    st.none() | st.booleans() | st.floats() | st.sampled_from(["x", "thorax", "isb", "-y", ""]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=4),
)


@pytest.mark.slow
@given(st.dictionaries(KEYS, VALUES, max_size=4))
def test_any_record_is_a_convention_or_refused(record: dict) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "any.json"
        file.write_text(json.dumps(record))
        try:
            found = as_convention(file)
        except go.RecordingError:
            return
        assert isinstance(found, AngleConvention)
        assert len(repr(found)) > 0


def test_what_is_no_convention() -> None:
    with pytest.raises(ValueError, match="convention must be an AngleConvention, one of isb"):
        as_convention(3)  # type: ignore[arg-type]
    with pytest.raises(go.RecordingError, match="built-in conventions are isb"):
        as_convention("ISB2005")
    with pytest.raises(ValueError, match="two relations of the thorax"):
        AngleConvention("two", (SegmentRelation("thorax"), SegmentRelation("thorax")))
    with pytest.raises(ValueError, match="must have no column"):
        SegmentRelation("thorax", neutral=(AxisRotation("x", "a"),))


def test_every_convention_names_its_source() -> None:
    for name, convention in ANGLE_CONVENTIONS.items():
        assert convention.name == name
        assert "(20" in convention.source
