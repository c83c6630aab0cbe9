"""Tables of joint angles as laboratories write them: spelling, columns and gaps."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.trajectory.files.series import Gaps

JOINTS = ("RSx_joint", "REx_joint")
TIME = np.arange(301) / 100.0
Q = np.column_stack([0.4 * np.sin(TIME), 0.8 - 0.3 * np.cos(1.5 * TIME)])


def table(names: Iterable[str], columns: Iterable[np.ndarray], notes: str = "# unit: rad") -> str:
    """Return the text of a table with points and commas."""
    rows = np.column_stack(list(columns)).tolist()
    lines = [",".join(map(repr, row)).replace("nan", "") for row in rows]
    return "\n".join([notes, ",".join(names), *lines, ""]).lstrip("\n")


def write(folder: Path, text: str, encoding: str = "utf-8") -> Path:
    """Write a file."""
    file = folder / "table.csv"
    file.write_bytes(text.encode(encoding))
    return file


PLAIN = table(("time", *JOINTS), [TIME, *Q.T])


MIXED = ("REx (°)", "Zeit", "note", "RSx [rad]")


def european(text: str) -> str:
    """Return the table with semicolons and decimal commas."""
    return text.replace(",", ";").replace(".", ",")


@pytest.mark.parametrize(
    ("text", "encoding", "assumed"),
    [
        (european(PLAIN), "utf-8", "semicolons between the columns; decimal commas"),
        (PLAIN.replace(",", "\t"), "utf-16", "tabs between the columns"),
        (PLAIN.replace("time,", "Time (s),"), "utf-8", r"'Time \(s\)' as the time in s"),
        (
            table(("t [ms]", "rsx", "REx"), [1e3 * TIME, *Q.T]),
            "utf-8",
            r"'t \[ms\]' as the time in ms; 'rsx' as RSx_joint; 'REx' as REx_joint",
        ),
        (
            table(("timestamp [ns]", *JOINTS), [1e9 * TIME, *Q.T]),
            "utf-8",
            r"'timestamp \[ns\]' as the time in ns",
        ),
        (
            european(table(MIXED, [np.degrees(Q[:, 1]), TIME, TIME, Q[:, 0]], "")),
            "latin-1",
            "semicolons .*decimal commas",
        ),
    ],
)
def test_every_spelling_gives_the_same_motion(
    text: str, encoding: str, assumed: str, tmp_path: Path
) -> None:
    with pytest.warns(RuntimeWarning, match=f"table.csv: read with .*{assumed}"):
        motion = go.read_motion(write(tmp_path, text, encoding), JOINTS)
    assert motion.joint_names == JOINTS
    assert motion.time == pytest.approx(TIME)
    assert motion.q == pytest.approx(Q)


def test_columns_have_names_signs_units_and_offsets(tmp_path: Path) -> None:
    flexion = 90.0 - np.degrees(Q[:, 1])  # so that REx = 90 deg - flexion
    file = write(tmp_path, table(("stamp", "flexion", "twist"), [TIME, flexion, Q[:, 0]]))
    elbow = {"name": "flexion", "sign": -1, "unit": "deg", "offset": 90.0}
    columns = {"time": "stamp", "REx_joint": elbow, "RSx_joint": "twist"}
    listed = tmp_path / "columns.csv"
    listed.write_text(
        "ours,theirs,sign,unit,offset\ntime,stamp,,,\nREx_joint,flexion,-1,deg,90\nRSx_joint,twist\n"
    )
    for given in (columns, listed):
        motion = go.read_motion(file, JOINTS, columns=given)
        assert motion.q == pytest.approx(Q)
    opensim = tmp_path / "angles.mot"
    rows = "\n".join(f"{t} {v}" for t, v in zip(TIME.tolist(), flexion.tolist(), strict=True))
    opensim.write_text(f"angles\ninDegrees=yes\nendheader\ntime flexion\n{rows}\n")
    motion = go.read_motion(opensim, columns={"REx_joint": elbow})
    assert motion.q[:, 0] == pytest.approx(Q[:, 1])


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"REx_joint": "elbow"}, "there is no column elbow; there are RSx_joint, REx_joint"),
        ({"REx_joint": {"name": "a", "sign": 2}}, "sign of a must be 1 or -1, got 2"),
        ({"REx_joint": {"name": "a", "units": "deg"}}, r"columns\['REx_joint'\] must be the name"),
        ({"REx_joint": {"name": "a", "unit": "gon"}}, "unit of a must be rad or deg"),
        ({}, "columns must give names of columns by joint"),
    ],
)
def test_wrong_columns_are_named(columns: object, message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=message):
        go.read_motion(write(tmp_path, PLAIN), columns=columns)


def test_errors_of_columns_name_their_file(tmp_path: Path) -> None:
    """Also those that are none of the file itself, but of what it is used with."""
    file, columns = write(tmp_path, PLAIN), tmp_path / "columns.csv"
    for text, message in {
        "ours,theirs\nREx_joint,elbow\nRSx_joint,RSx_joint\n": "there is no column elbow",
        "ours,theirs\nREx_joint,REx_joint\n": "columns give no joint RSx_joint",
    }.items():
        columns.write_text(text)
        with pytest.raises(go.RecordingError, match=rf"table\.csv: {message}.*columns\.csv\)$"):
            go.read_motion(file, JOINTS, columns=columns)
    columns.write_text("ours,theirs,sign\nREx_joint,REx_joint,up\n")
    with pytest.raises(go.RecordingError, match=r"columns\.csv: row 2: sign is not numeric: 'up'$"):
        go.read_motion(file, columns=columns)


def gappy(*spans: tuple[float, float]) -> str:
    """Return the table with the elbow missing between times [s]."""
    q = Q.copy()
    for start, end in spans:
        q[(start <= TIME) & (end >= TIME), 1] = np.nan
    return table(("time", *JOINTS), [TIME, *q.T])


@pytest.mark.parametrize("missing", ["NA", "n/a", "#N/A", "null", "NaN"])
def test_what_programs_write_for_missing_numbers_is_a_gap(missing: str, tmp_path: Path) -> None:
    cells = [[f"{number:.9g}" for number in row] for row in np.column_stack([TIME, Q])]
    cells[100][2] = missing
    rows = "\n".join(",".join(row) for row in cells)
    file = write(tmp_path, f"# unit: rad\ntime,{','.join(JOINTS)}\n{rows}\n")
    with pytest.raises(Gaps, match=r"REx_joint is missing at 1\.000 s; in all 1 of 301"):
        go.read_motion(file)


@pytest.mark.filterwarnings("ignore:outliers in the recording.*wrap, undone")
def test_angles_between_0_and_360_degrees_are_asked_about(tmp_path: Path) -> None:
    """An offset for those that are never wrapped reads the file; the others are unwrapped."""
    arm = go.human_arm()
    q = np.tile([0.3, 0.2, -0.8, 1.2, -0.1, 0.1, -0.05], (301, 1)) + 0.4 * Q[:, :1]
    text = table(("time", *arm.joint_names), [TIME, *(np.degrees(q) % 360.0).T], "# unit: deg")
    file = write(tmp_path, text)
    with pytest.raises(
        go.RecordingError, match=r"between 0 and 360 deg.* offset of -360 in columns"
    ):
        go.read_recording(file)
    columns = {name: go.trajectory.Column(name) for name in arm.joint_names}
    columns["RSy_joint"] = go.trajectory.Column("RSy_joint", offset=-360.0)
    motion = go.read_recording(file, columns=columns, unfiltered=True).motion
    assert motion.q == pytest.approx(q)


def test_short_gaps_are_bridged_on_request(tmp_path: Path) -> None:
    file = write(tmp_path, gappy((0.0, 0.05), (1.2, 1.27)))
    with pytest.raises(Gaps, match=r"REx_joint is missing at 0.000 s; in all 14 of 301 samples"):
        go.read_motion(file)
    with pytest.warns(RuntimeWarning, match="1 gap of up to 0.1 s bridged and the part from 0.06"):
        motion = go.read_motion(file, fill=0.1)
    assert motion.time == pytest.approx(TIME[6:])
    assert motion.q == pytest.approx(Q[6:], abs=1e-4)


def test_long_gaps_divide_a_recording(tmp_path: Path) -> None:
    arm = go.human_arm()
    q = (arm.lower + arm.upper) / 2.0 + 0.2 * Q[:, :1]
    q[(TIME > 1.2) & (TIME < 1.8), 3] = np.nan
    file = write(tmp_path, table(("time", *arm.joint_names), [TIME, *q.T]))
    with pytest.raises(Gaps, match=r"0\.00 to 1\.20 s, 1\.80 to 3\.00 s") as gaps:
        go.read_recording(file, fill=0.1)
    assert np.ravel(gaps.value.parts) == pytest.approx([0.0, 1.2, 1.8, 3.0])
    with pytest.warns(RuntimeWarning, match="the part from .* s alone"):
        parts = go.recordings.read_recordings(file, fill=0.1)
    assert [each.name for each in parts] == ["table, part 1, right", "table, part 2, right"]
    assert [len(each.motion) for each in parts] == [121, 121]
    with pytest.raises(ValueError, match="part must be a number from 1 to 2, got 3"):
        go.read_motion(file, part=3)
