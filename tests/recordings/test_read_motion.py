"""Motions from files, valid and malformed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import geodesic_ocp as go

LEGACY = """<?xml version='1.0'?>
<MMM>
  <Motion name='box'><Model/></Motion>
  <Motion name='walker'>
    <ModelProcessorConfig type='Winter'><Height>1.7</Height><Mass>65</Mass></ModelProcessorConfig>
    <JointOrder><Joint name='b'/><Joint name='a'/></JointOrder>
    <MotionFrames>
      <MotionFrame><Timestep>0</Timestep><JointPosition>0.5 -1.0 </JointPosition></MotionFrame>
      <MotionFrame><Timestep>0.01</Timestep><JointPosition>0.6 -1.1</JointPosition></MotionFrame>
      <MotionFrame><Timestep>0.02</Timestep><JointPosition>0.7 -1.3</JointPosition></MotionFrame>
    </MotionFrames>
  </Motion>
</MMM>
"""
VERSION_2 = """<MMM version="2.0">
  <Motion name="walker">
    <Sensors>
      <Sensor type="ModelPose"><Configuration/><Data>
        <Measurement timestep="0"><RootPosition>0 0 0</RootPosition></Measurement></Data></Sensor>
      <Sensor type="Kinematic">
        <Configuration><Joint name="b"/><Joint name="a"/></Configuration>
        <Data>
          <Measurement timestep="0"><JointPosition>0.5 -1.0</JointPosition></Measurement>
          <Measurement timestep="0.01"><JointPosition>0.6 -1.1</JointPosition></Measurement>
          <Measurement timestep="0.02"><JointPosition>0.7 -1.3</JointPosition></Measurement>
        </Data>
      </Sensor>
    </Sensors>
  </Motion>
</MMM>
"""
TABLE = "# unit: rad\n# height: 1.7\ntime,b,a\n0,0.5,-1.0\n0.01,0.6,-1.1\n0.02,0.7,-1.3\n"
DEGREES = "# unit: deg\ntime,b,a\n0,90,-180\n0.01,45,0\n"
EXPECTED = np.array([[-1.0, 0.5], [-1.1, 0.6], [-1.3, 0.7]])


def write(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


@pytest.mark.parametrize(
    ("name", "text", "subject"),
    [
        ("legacy.xml", LEGACY, go.trajectory.Subject(1.7, 65.0, "walker")),
        ("two.xml", VERSION_2, go.trajectory.Subject(None, None, "walker")),
        ("table.csv", TABLE, go.trajectory.Subject(1.7, None, "")),
    ],
)
def test_every_layout(name: str, text: str, subject: go.trajectory.Subject, tmp_path: Path) -> None:
    file = write(tmp_path, name, text)
    motion = go.read_motion(file, joints=("a", "b"))
    assert motion.time == pytest.approx([0.0, 0.01, 0.02])
    assert motion.q == pytest.approx(EXPECTED)
    assert motion.joint_names == ("a", "b")
    assert motion.subject == subject
    assert motion.velocity is None
    assert go.read_motion(str(file)).joint_names == ("b", "a")


def test_the_sensor_with_the_joints_is_read(tmp_path: Path) -> None:
    fingers = (
        "<Sensor type='Kinematic'><Configuration><Joint name='f'/></Configuration><Data/></Sensor>"
    )
    text = VERSION_2.replace("<Sensors>", "<Sensors>" + fingers)
    motion = go.read_motion(write(tmp_path, "hands.xml", text), joints=("a", "b"))
    assert motion.q == pytest.approx(EXPECTED)


def test_other_columns_may_contain_anything(tmp_path: Path) -> None:
    text = "# unit: rad\nframe,a,note,time,b\n1,-1.0,start,0,0.5\n2,-1.1,,0.01,0.6\n"
    motion = go.read_motion(write(tmp_path, "notes.csv", text), joints=("a", "b"))
    assert motion.q == pytest.approx(EXPECTED[:2])
    assert motion.time == pytest.approx([0.0, 0.01])


@pytest.mark.parametrize("unit", ["deg", "degrees", "Degree", "deg,,"])
def test_degrees_are_converted_to_radians(unit: str, tmp_path: Path) -> None:
    motion = go.read_motion(write(tmp_path, "deg.csv", DEGREES.replace("deg", unit)))
    assert motion.q == pytest.approx(np.array([[np.pi / 2, -np.pi], [np.pi / 4, 0.0]]))


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("cut.xml", LEGACY[:400], "broken XML at line"),
        ("empty.xml", "", "is empty"),
        ("html.xml", "<html><body/></html>", "expected <MMM> with a <Motion>, found <html>"),
        ("bare.xml", "<MMM/>", "expected <MMM> with a <Motion>"),
        ("nojoint.xml", LEGACY, "there is no joint c in this recording"),
        ("nothing.xml", "<MMM><Motion/></MMM>", "there is no joint a, b, c"),
        (
            "short.xml",
            LEGACY.replace("0.6 -1.1", "0.6"),
            "JointPosition of MotionFrame 1 has 1 numbers, not 2",
        ),
        (
            "words.xml",
            VERSION_2.replace("0.6 -1.1", "0.6 x"),
            "JointPosition of Measurement 1 is not numeric: '0.6 x'",
        ),
        (
            "notime.xml",
            LEGACY.replace("<Timestep>0.01</Timestep>", ""),
            "MotionFrame 1 has no time",
        ),
        ("still.xml", LEGACY.replace("0.02", "0.01"), "time must increase: sample 2"),
        ("flat.xml", LEGACY.replace("1.7", "-1.7"), "Height of the subject must be positive"),
        ("nojoint.csv", TABLE, "there is no joint c; there are b, a"),
        ("nounit.csv", TABLE[12:], "a line '# unit: rad' or '# unit: deg' must precede"),
        ("gon.csv", TABLE.replace("rad", "gon"), "not 'gon'"),
        ("empty.csv", "", "is empty"),
        ("blank.csv", " \n\t\n", "is empty"),
        ("comments.csv", "# unit: rad\n", "has no header"),
        (
            "headless.csv",
            "# unit: rad\n0,1,2\n",
            "line 2 must be a header with 'time' and names of columns",
        ),
        ("ragged.csv", TABLE + "0.03,1\n", "line 7 has 2 entries, the header 3"),
        ("words.csv", TABLE.replace("0.6", "soon"), "line 5: b is not a number: 'soon'"),
        (
            "nan.csv",
            TABLE.replace("-1.1", "nan"),
            r"a is missing at 0.010 s; .* 1 of 3 .*fill=0\.02 ",
        ),
        ("back.csv", TABLE.replace("0.02,", "0.005,"), "time must increase: sample 2"),
        ("one.csv", "# unit: rad\ntime,a,b\n0,1,2\n", "at least two samples, got 1"),
        ("none.csv", "# unit: rad\ntime,a,b\n", "at least two samples, got 0"),
        ("tall.csv", TABLE.replace("1.7", "tall"), "'# height: tall' must be a positive number"),
        ("twice.csv", TABLE.replace("time,b", "time,a"), "the header names a more than once"),
        ("units.csv", "# unit: deg\n" + TABLE, "line 2 gives the unit again, with another value"),
        ("long.csv", TABLE.replace("0.6", "9" * 140_000), "is not a table: field larger"),
        ("code.xml", "<?xml version='1.0' encoding='foo-8'?><MMM/>", "encoding"),
        (
            "bomb.xml",
            '<!DOCTYPE MMM [\n<!ENTITY a "b">\n]><MMM>&a;</MMM>',
            "line 2 defines the entity 'a', which is not supported",
        ),
        ("letter.bvh", "Dear reader,\n", "it looks like text that begins with 'Dear reader,'"),
        ("figures.csv", "0, 1\n2, 3\n", "it looks like a table of numbers without the names"),
        ("degrees.csv", DEGREES.replace("deg", "rad"), "a reaches -180 rad: are these degrees"),
    ],
)
def test_bad_files_are_named(name: str, text: str, message: str, tmp_path: Path) -> None:
    file = write(tmp_path, name, text)
    wanted = ("a", "b", "c") if "no joint" in message else ("a", "b")
    with pytest.raises(go.RecordingError, match=message) as info:
        go.read_motion(file, joints=wanted)
    assert str(info.value).startswith(str(file))
    assert isinstance(info.value, ValueError)


def test_missing_folder_and_binary_files(tmp_path: Path) -> None:
    with pytest.raises(go.RecordingError, match=r"missing\.xml: there is no such file"):
        go.read_motion(tmp_path / "missing.xml")
    with pytest.raises(go.RecordingError, match="is a folder, not a file"):
        go.read_motion(tmp_path)
    for joints in ("a", []):
        with pytest.raises(ValueError, match="joints must be a sequence of names"):
            go.read_motion(write(tmp_path, "good.csv", TABLE), joints)
    (tmp_path / "binary.csv").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(go.RecordingError, match=r"looks like a PNG image\. These are read: MMM"):
        go.read_motion(tmp_path / "binary.csv")
    (tmp_path / "latin.csv").write_bytes(TABLE.encode().replace(b",b,", b",\xe4,"))
    with pytest.raises(go.RecordingError, match="there is no joint b; there are ä, a"):
        go.read_motion(tmp_path / "latin.csv", ["b"])


def test_both_layouts_of_one_recording_agree(shared: Path) -> None:
    joints = go.human_arm("right").joint_names
    folder = shared / "data" / "kit"
    legacy, new = (
        go.read_motion(folder / f"take_book_from_shelf_right_arm_02{end}", joints)
        for end in (".xml", ".mmm2.xml")
    )
    assert np.array_equal(legacy.q, new.q)
    assert np.array_equal(legacy.time, new.time)
    assert legacy.subject == new.subject == go.trajectory.Subject(1.83, 100.0, "subject_id_1229")
    assert len(legacy) == 338


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            b"# unit: rad\nTime [h],elbow\n0,1\n",
            r"line 2: time must be in s, ms, us or ns, not 'h'",
        ),
        (b"<MMM><Motion>", r"broken XML at line 1, column 13: no element found; is the file cut"),
    ],
)
def test_messages_say_what_to_do(content: bytes, words: str, tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_bytes(content)
    with pytest.raises(go.RecordingError, match=words):
        go.read_motion(file)
