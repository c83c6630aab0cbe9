"""CSV of Vicon Nexus, TSV of Qualisys, and Motion-BIDS: layouts, units, gaps, what is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from small_recordings import BIDS, QUALISYS, VICON

import geodesic_ocp as go
from geodesic_ocp.recordings.formats.recognise import recognise
from geodesic_ocp.recordings.read_recording import read_markers
from geodesic_ocp.recordings.read_recordings import recording_files

NAN = [np.nan] * 3
EXPECTED = np.array(
    [
        [[0.100, 0.200, 1.400], [0.120, 0.210, 1.100]],
        [[0.101, 0.201, 1.401], NAN],
        [[0.102, 0.202, 1.402], [0.122, 0.212, 1.102]],
    ]
)
TITLES = QUALISYS[QUALISYS.index("Frame") : QUALISYS.index("1\t0.0000")]
POINTS = "name\tcomponent\ttype\ttracked_point\tunits\tplacement\n" + "".join(
    f"{point}_{axis}\t{axis}\tPOS\t{point}\tmm\tn/a\n"
    for point in ("RSHO", "RELB")
    for axis in "zyx"
)
PLACES = """1400\t200\t100\t1100\t210\t120
1401\t201\t101\tn/a\tn/a\tn/a
1402\t202\t102\t1102\t212\t122
"""


def changed(content: str, changes: dict[str, str]) -> str:
    for old, new in changes.items():
        assert re.search(old, content, re.M)
        content = re.sub(old, new, content, flags=re.M)
    return content


def write(folder: Path, name: str, content: str) -> Path:
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(content.encode("latin-1"))
    return file


@pytest.mark.parametrize(
    ("content", "changes"),
    [
        (VICON, {}),
        (VICON, {"Anna:": ""}),
        (VICON, {"Trajectories": "Model Outputs\n100\n,,A\n\nTrajectories"}),
        (VICON, {"$": ",,,", ",,,$(?=\n1,0,0.1)": ",,,,,"}),  # as spreadsheets save them
        (VICON, {r"(\d)\.(\d)": r"\1,\2", r"(?<=\d),(?=\d+,0)|,": ";"}),
        (VICON, {",": "\t"}),
        (
            VICON,
            {
                "Z,X": "Z,X',X",
                "(RSHO|RELB),,": r"\1,,,",
                "mm,mm,mm": "mm,mm,mm,mm/s",
                r"^(\d,0)((,[^,\n]*){3})((,[^,\n]*){3})": r"\1\2,9\4,9",
            },
        ),
        (
            VICON
            + "\nModel Outputs\n100\n,,A,,\nFrame,Sub Frame,X,Y,Z\n,,deg,deg,deg\n1,0,1,2,3\n",
            {},
        ),
        (QUALISYS, {}),
        (
            QUALISYS,
            {"^NO_OF_FRAMES": "FILE_VERSION\t2.0.0\nNO_OF_FRAMES", "\t\t\t$": "\tNaN\tNaN\tNaN"},
        ),
        (QUALISYS, {"\t\t\t$": "\t0.000\t0.000\t0.000", "^TRAJ.*\n": "", "^EVENT.*\n": ""}),
        (QUALISYS, {"\n": "\t\n", "--": "Gehen, Übung"}),
        (QUALISYS, {TITLES: ""}),
        (QUALISYS, {TITLES: "", r"^\d\t0\.0\d000\t": ""}),
        (QUALISYS, {"Frame\tTime\t": "", r"^\d\t0\.0\d000\t": ""}),
    ],
)
def test_layouts_of_markers(content: str, changes: dict[str, str], tmp_path: Path) -> None:
    markers = read_markers(write(tmp_path, "file", changed(content, changes)))
    assert markers.names == ("RSHO", "RELB")
    assert markers.time == pytest.approx([0.0, 0.01, 0.02])
    assert markers.positions == pytest.approx(EXPECTED, nan_ok=True)
    assert markers.subject.name == ("Anna" if "Anna" in changed(content, changes) else "")


def test_a_frame_without_any_marker_keeps_its_time(tmp_path: Path) -> None:
    changes = {TITLES: "", r"^\d\t0\.0\d000\t": "", "101.0\t201.0\t1401.0": "\t\t"}
    markers = read_markers(write(tmp_path, "file", changed(QUALISYS, changes)))
    assert markers.time == pytest.approx([0.0, 0.01, 0.02])
    assert np.isnan(markers.positions[1]).all()


@pytest.mark.parametrize(
    ("content", "old", "new", "message"),
    [
        (
            VICON,
            "Trajectories",
            "Joints",
            "has no section Trajectories, .* there are Devices, Joints",
        ),
        (VICON, ",101,", ",soon,", "line 15: X is not a number: 'soon'"),
        (VICON, ",101,", ",,", "line 15: Anna:RSHO has some of its three coordinates only"),
        (VICON, ",201,1401", ",201", "line 15 has 10 entries, 11 are needed"),
        (VICON, "^100$", "0", "the rate of frames must be"),
        (VICON, "^100$", "1e999", "has no section Trajectories"),
        (VICON, "^,,mm.*$", ",,ft,ft,ft", "line 13 must give the unit m, cm or mm, not ', ft'"),
        (VICON, "RELB", "RSHO", "line 11: Anna:RSHO is named twice"),
        (VICON, "^,,Anna:R.*$", "", "line 11 names no markers"),
        (VICON, "X,Y,Z,X,Y,Z,", "X,Y,Z,X,Y,W,", "line 11: Anna:RELB has no columns X, Y and Z"),
        (VICON, "^Frame,Sub Frame,X", "Frames,Sub,X", "line 12 must begin with Frame, Sub Frame"),
        (VICON, "^3,0", "2,0", "time must increase: sample "),
        (QUALISYS, "102.0\t", "soon\t", "line 16: RSHO X is not a number: 'soon'"),
        (QUALISYS, "\t1102.0", "", "line 16 has 7 entries, 8 are needed"),
        (QUALISYS, "^MARKER_NAMES.*\n", "", "no line MARKER_NAMES; it is of 3D data"),
        (QUALISYS, "RELB", "RSHO", "MARKER_NAMES names RSHO more than once"),
        (QUALISYS, "^FREQUENCY.*\n", "", "FREQUENCY has 0 numbers, not 1"),
        (QUALISYS, "^FREQUENCY\t100", "FREQUENCY\tfast", "line 4: FREQUENCY is not numeric"),
        (QUALISYS, "^FREQUENCY\t100", "FREQUENCY\t-1", "the rate of frames must be"),
    ],
)
def test_bad_markers(content: str, old: str, new: str, message: str, tmp_path: Path) -> None:
    file = write(tmp_path, "bad", changed(content, {old: new}))
    with pytest.raises(go.RecordingError, match=f"{re.escape(str(file))}: .*{message}"):
        read_markers(file)


def test_the_count_of_frames_of_qualisys_that_is_wrong_is_told(tmp_path: Path) -> None:
    file = write(tmp_path, "walk.tsv", QUALISYS.replace("NO_OF_FRAMES\t3", "NO_OF_FRAMES\t250"))
    with pytest.warns(RuntimeWarning, match=r"walk\.tsv: its header says 250 frames, it has 3"):
        assert len(read_markers(file)) == 3


def test_points_of_motion_bids(tmp_path: Path) -> None:
    """What holds for all runs is said once, above; a nearer file is preferred."""
    name = "sub-Anna/ses-1/motion/sub-Anna_ses-1_task-reach_tracksys-optical_run-2"
    file = write(tmp_path, f"{name}_motion.tsv", PLACES)
    write(tmp_path, "task-reach_motion.json", '{"SamplingFrequency": 50}')
    write(tmp_path, "task-sit_motion.json", '{"SamplingFrequency": 25}')
    write(tmp_path, f"{name[:-6]}_channels.tsv", POINTS)
    write(tmp_path, "participants.tsv", "participant_id\nsub-Anna\n")
    markers = read_markers(file)
    assert markers.subject.name == "Anna"
    assert markers.names == ("RSHO", "RELB")
    assert markers.time == pytest.approx([0.0, 0.02, 0.04])
    assert markers.positions == pytest.approx(EXPECTED, nan_ok=True)
    write(tmp_path, f"{name}_motion.json", '{"SamplingFrequency": 100.0}')
    assert read_markers(file).time == pytest.approx([0.0, 0.01, 0.02])
    assert recording_files(tmp_path, recursive=True) == [file]


def test_angles_of_motion_bids(tmp_path: Path) -> None:
    """Channels that are named as the joints are, and those of a convention."""
    for name, content in BIDS.items():
        write(tmp_path, name, content)
    motion = go.read_motion(tmp_path / "sub-01_motion.tsv")
    assert motion.joint_names == ("BPx_joint", "BPz_joint")
    assert motion.time == pytest.approx([0.0, 0.01, 0.02])
    assert motion.q == pytest.approx(
        np.array([[0.1, 10.0], [0.2, 11.0], [0.3, 12.0]]) * [1, np.pi / 180]
    )
    renamed = go.read_motion(
        tmp_path / "sub-01_motion.tsv", columns={"RSx_joint": {"name": "BPz_joint", "sign": -1}}
    )
    assert renamed.q == pytest.approx(-motion.q[:, 1:])
    write(tmp_path, "sub-01_motion.tsv", BIDS["sub-01_motion.tsv"].replace("0.2\t11", "n/a\t11"))
    assert np.array_equal(
        go.read_motion(tmp_path / "sub-01_motion.tsv", ["BPz_joint"]).q, motion.q[:, 1:]
    )
    columns = ("arm_flex_r", "arm_add_r", "arm_rot_r")
    lines = [f"{name}\tn/a\tJNTANG\tn/a\tdeg" for name in columns]
    lines = [*BIDS["sub-01_channels.tsv"].splitlines()[:1], *lines, "t\tn/a\tLATENCY\tn/a\ts"]
    write(tmp_path, "sub-01_channels.tsv", "\n".join(lines))
    file = write(tmp_path, "sub-01_motion.tsv", "10\t20\t30\t2.5\n11\t21\t31\t2.6\n")
    other = write(
        tmp_path,
        "same.mot",
        f"inDegrees=yes\nendheader\ntime {' '.join(columns)}\n2.5 10 20 30\n2.6 11 21 31\n",
    )
    joints = ("RSx_joint", "RSz_joint", "RSy_joint")
    assert np.array_equal(go.read_motion(file, joints).q, go.read_motion(other, joints).q)
    assert go.read_motion(file, joints).time == pytest.approx([2.5, 2.6])


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        (
            "channels",
            "JNTANG",
            "GYRO",
            r"of type GYRO, VEL; those of JNTANG \(joint angles\) or POS",
        ),
        ("channels", "units", "unit", r"channels\.tsv: line 1 names no column units"),
        ("channels", "trunk\trad", "trunk", r"channels\.tsv: line 2 has 4 entries, 5 are needed"),
        ("channels", "trunk\tdeg", "trunk\trpm", "BPz_joint has the unit 'rpm', not rad or deg"),
        ("channels", "speed.*\n", "", "line 1 has 3 entries, 2 are needed"),
        ("channels", "BPz", "BPx", "BPx_joint more than once"),
        ("motion", "^0.2", "soon", "line 2: BPx_joint is not a number"),
        (
            "motion",
            "^0.2",
            "n/a",
            r"BPx_joint is missing at 0\.010 s; .*no part is whole for 0\.5 s",
        ),
        ("motion", "^0.2", "20", "BPx_joint .* degrees"),
    ],
)
def test_bad_motion_bids(name: str, old: str, new: str, message: str, tmp_path: Path) -> None:
    for each, content in BIDS.items():
        changes = {old: new} if each == f"sub-01_{name}.tsv" else {}
        write(tmp_path, each, changed(content, changes))
    with pytest.raises(go.RecordingError, match=message):
        go.read_motion(tmp_path / "sub-01_motion.tsv")


def test_motion_bids_without_the_files_beside_it(tmp_path: Path) -> None:
    file = write(tmp_path, "sub-01_motion.tsv", BIDS["sub-01_motion.tsv"])
    with pytest.raises(go.RecordingError, match=r"sub-01_channels\.tsv, .* is not beside it"):
        recognise(file)
    write(tmp_path, "sub-01_channels.tsv", BIDS["sub-01_channels.tsv"])
    for content in ("", "7", "[]"):
        if content:
            write(tmp_path, "sub-01_motion.json", content)
        with pytest.raises(go.RecordingError, match=r"no sub-01_motion\.json .* gives Sampling"):
            go.read_motion(file)
    write(tmp_path, "sub-01_motion.json", '{"SamplingFrequency": "n/a"}')
    with pytest.raises(go.RecordingError, match="the rate of frames must be"):
        go.read_motion(file)
