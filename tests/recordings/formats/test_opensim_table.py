"""OpenSim's .mot and .sto files: layouts, units, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.recordings.formats.opensim import read_opensim
from geodesic_ocp.recordings.formats.opensim_table import is_translation, read_coordinates

TABS = """Coordinates
version=1
nRows=2
nColumns=3
inDegrees=yes

If the header above contains a line with 'inDegrees', rotations are in degrees.

endheader
time\telbow\tpelvis_tx
0.0\t90\t0.5
0.1\t180\t0.6
"""


def write(folder: Path, text: str, name: str = "x.mot") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


@pytest.mark.parametrize("separator", ["\t", "   ", ",", ", "])
def test_every_separator_and_the_unit(separator: str, tmp_path: Path) -> None:
    table = read_coordinates(write(tmp_path, TABS.replace("\t", separator)))
    assert table.time == pytest.approx([0.0, 0.1])
    assert table.joint_names == ("elbow", "pelvis_tx")
    assert table.q == pytest.approx(np.array([[np.pi / 2, 0.5], [np.pi, 0.6]]))


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_encodings_of_older_programs(encoding: str, tmp_path: Path) -> None:
    file = tmp_path / "x.mot"
    file.write_bytes(TABS.replace("Coordinates", "Bewegung für µ").encode(encoding))
    expected = read_coordinates(write(tmp_path, TABS, "plain.mot"))
    assert read_coordinates(file).q == pytest.approx(expected.q)


def test_radians_and_translations_of_other_names(tmp_path: Path) -> None:
    radians = TABS.replace("yes", "no").replace("180", "1.8").replace("90", "0.9")
    file = write(tmp_path, radians)
    assert read_coordinates(file).q[:, 0] == pytest.approx([0.9, 1.8])
    lengths = read_coordinates(write(tmp_path, TABS), translations=["elbow"])
    assert lengths.q[:, 0] == pytest.approx([90.0, 180.0])
    assert [
        name for name in ("pelvis_tx", "box_transX", "box_rotX", "matrix") if is_translation(name)
    ] == [
        "pelvis_tx",
        "box_transX",
    ]


def test_states_of_opensim_4(tmp_path: Path) -> None:
    text = (
        "states\nDataType=double\nversion=3\nOpenSimVersion=4.5\ninDegrees=no\nendheader\n"
        "time\t/jointset/shoulder/elv_angle/value\t/jointset/shoulder/elv_angle/speed\t"
        "/forceset/biceps/activation\n0\t0.5\t9\t0.01\n1\t0.6\t9\t0.01\n"
    )
    table = read_coordinates(write(tmp_path, text, "x.sto"))
    assert table.joint_names == ("elv_angle",)
    assert table.q[:, 0] == pytest.approx([0.5, 0.6])


def test_another_number_of_rows_is_not_silent(tmp_path: Path) -> None:
    with pytest.warns(RuntimeWarning, match="says 5 rows, it has 2; these are read"):
        table = read_coordinates(write(tmp_path, TABS.replace("nRows=2", "nRows=5")))
    assert len(table.time) == 2
    with pytest.warns(RuntimeWarning, match="says 4 columns, it has 3"):
        read_coordinates(write(tmp_path, TABS.replace("nColumns=3", "nColumns=4")))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("endheader", "end", "no line 'endheader'"),
        ("inDegrees=yes\n", "", "must have inDegrees=yes or inDegrees=no"),
        ("inDegrees=yes", "inDegrees=oui", "not 'inDegrees=oui'"),
        ("version=1", "DataType=Quaternion", "DataType is quaternion"),
        ("time\t", "frame\t", "line 10 must name the columns, time first, is 'frame"),
        ("elbow", "pelvis_tx", "line 10 names pelvis_tx more than once"),
        ("elbow\t", "\t", "line 10: column 2 has no name"),
        ("180\t", "", "line 12 has 2 entries, the names of columns 3"),
        ("180", "x", "line 12: elbow is not a number: 'x'"),
        (
            "180",
            "nan",
            r"elbow is missing at 0\.100 s; in all 1 of 2 samples .*no part is whole for",
        ),
        ("180", "inf", "line 12: elbow is inf"),
        ("0.1\t", "0.0\t", "time must increase: sample 1"),
        ("0.1\t180\t0.6\n", "", "at least two samples"),
        (TABS[TABS.index("time") :], "", "no line with the names of columns"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*its header says")
def test_malformed_files_name_the_line(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert old in TABS
    file = write(tmp_path, TABS.replace(old, new))
    with pytest.raises(go.RecordingError, match=message) as raised:
        read_opensim(file)
    assert str(raised.value).startswith(str(file))


def test_columns_of_no_convention_are_a_motion_of_their_own(tmp_path: Path) -> None:
    file = write(tmp_path, TABS)
    motion = read_opensim(file)
    assert motion.joint_names == ("elbow", "pelvis_tx")
    assert read_opensim(file, ["elbow"]).q[:, 0] == pytest.approx([np.pi / 2, np.pi])
    with pytest.raises(
        go.RecordingError, match=r"fits its columns elbow, pelvis_tx; .*convention="
    ):
        read_opensim(file, ["RSx_joint"])


def test_columns_with_the_names_of_the_model_are_read_as_they_are(tmp_path: Path) -> None:
    file = write(tmp_path, TABS.replace("elbow", "REx_joint"))
    motion = read_opensim(file)
    assert motion.joint_names == ("REx_joint",)
    with pytest.raises(go.RecordingError, match="there is no joint"):
        read_opensim(file, ["REx_joint", "REz_joint"])


def full_body(folder: Path, names: list[str]) -> Path:
    rows = "\n".join("\t".join([str(0.1 * i), *["5"] * len(names)]) for i in range(3))
    labels = "\t".join(["time", *names])
    return write(folder, f"Coordinates\ninDegrees=yes\nendheader\n{labels}\n{rows}\n")


def test_a_known_convention_gives_the_joints_of_the_model(tmp_path: Path) -> None:
    names = [
        f"{name}_r"
        for name in ("arm_flex", "arm_add", "arm_rot", "elbow_flex", "pro_sup", "wrist_flex")
    ]
    file = full_body(tmp_path, [*names, "wrist_dev_r"])
    assert read_opensim(file).joint_names == go.human_arm("right").joint_names
    assert read_opensim(file, names).joint_names == tuple(names)
    assert read_opensim(file, convention="opensim_full_body").q == pytest.approx(
        read_opensim(file).q
    )
    with pytest.raises(go.RecordingError, match=r"LSx_joint: .*left upper arm: there is no column"):
        read_opensim(file, ["LSx_joint"])
    file = full_body(tmp_path, names)
    assert read_opensim(file).joint_names == go.human_arm("right").joint_names[:5]
    with pytest.raises(go.RecordingError, match="right hand: there is no column wrist_dev_r"):
        read_opensim(file, ["RWx_joint"])


def test_without_columns_of_the_hand_the_wrist_is_straight(tmp_path: Path) -> None:
    """OpenCap's models have no wrist; with columns of zeros they would be the same."""
    names = [
        f"{name}_{side}"
        for side in "rl"
        for name in ("arm_flex", "arm_add", "arm_rot", "elbow_flex", "pro_sup")
    ]
    wrists = ["wrist_flex_r", "wrist_dev_r"]
    rows = "\n".join(f"{0.1 * i} {'40 ' * len(names)}0 0" for i in range(3))
    text = "Coordinates\ninDegrees=yes\nendheader\n"
    labels = " ".join(["time", *names, *wrists])
    joints = go.human_arm("right").joint_names
    still = read_opensim(write(tmp_path, f"{text}{labels}\n{rows}\n"), joints)
    file = write(tmp_path, f"{text}{labels}\n{rows}\n".replace("wrist", "finger"))
    assert not {"RWx_joint", "LWy_joint"} & set(read_opensim(file).joint_names)
    with pytest.warns(
        RuntimeWarning, match=r"x\.mot: no column is of the right hand: the wrist is"
    ):
        motion = read_opensim(file, joints)
    assert np.array_equal(motion.q, still.q)
    with pytest.warns(RuntimeWarning, match="of the right hand or the left hand"):
        read_opensim(file, [*joints, *go.human_arm("left").joint_names])


def test_an_uncertain_axis_is_refused_with_the_reason(tmp_path: Path) -> None:
    names = ["elv_angle", "shoulder_elv", "shoulder_rot", "elbow_flexion", "pro_sup"]
    file = full_body(tmp_path, [*names, "deviation", "flexion"])
    assert read_opensim(file).joint_names == go.human_arm("right").joint_names[:5]
    with pytest.raises(
        go.RecordingError, match="right hand: the axes and the sense of the columns"
    ):
        read_opensim(file, ["RWx_joint"])


def test_the_box_lift(shared: Path) -> None:
    """Comma separated, in degrees, with 88 of the 250 rows that its header promises."""
    file = shared / "data" / "opensim" / "inverse_kin.mot"
    with pytest.warns(RuntimeWarning, match="its header says 250 rows, it has 88; these are read"):
        motion = read_opensim(file)
    assert motion.q.shape == (88, 25)
    assert motion.time[[0, -1]] == pytest.approx([1.56, 2.43])
    assert motion.select(["elbow_flexion"]).q[0, 0] == pytest.approx(np.radians(42.06628447))
    assert motion.select(["thorax_tx", "box_transX"]).q[0] == pytest.approx(
        [-0.61262157, 0.19682993]
    )
    # The model that defines the axes of these columns is not known: refused, not guessed.
    with (
        pytest.warns(RuntimeWarning),
        pytest.raises(go.RecordingError, match=r"shoulder_plane, .*; describe their rotations"),
    ):
        read_opensim(file, ["RSx_joint"])


@pytest.mark.filterwarnings("ignore:.*its header says")
def test_a_user_convention_converts_the_box_lift(shared: Path, tmp_path: Path) -> None:
    """The elbow's flexion is that of the model's arm, whatever the axes of the shoulder are."""
    (tmp_path / "mine.json").write_text(
        '{"relations": [{"segment": "thorax", "rotations": [{"axis": "z", "column": "thorax_tilt"},'
        '{"axis": "x", "column": "thorax_list"}, {"axis": "y", "column": "thorax_rotation"}]},'
        '{"segment": "right upper arm", "parent": "thorax", "rotations": ['
        '{"axis": "y", "column": "shoulder_plane"}, {"axis": "-x", "column": "shoulder_ele"},'
        '{"axis": "y", "column": "shoulder_rotation"}]},'
        '{"segment": "right forearm", "parent": "right upper arm", "rotations": ['
        '{"axis": "z", "column": "elbow_flexion"}, {"axis": "y", "column": "pro_sup"}]}],'
        '"position": ["thorax_tx", "thorax_ty", "thorax_tz"]}'
    )
    file = shared / "data" / "opensim" / "inverse_kin.mot"
    motion = read_opensim(file, convention=tmp_path / "mine.json")
    own = read_opensim(file, ["elbow_flexion", "pro_sup"])
    elbow = motion.select(["REx_joint", "REz_joint"])
    assert elbow.q == pytest.approx(own.q, abs=1e-9)
    assert motion.trunk is not None
    assert motion.trunk.positions[0] == pytest.approx([0.11781027, -0.61262157, 0.59430148])
    assert np.abs(np.diff(motion.q, axis=0)).max() < 0.1
