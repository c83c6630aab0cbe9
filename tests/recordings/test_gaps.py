"""Numbers that stand for gaps are gaps in every format: of joint angles, segments and markers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from small_recordings import c3d

import geodesic_ocp as go
from geodesic_ocp.trajectory.files.series import Gaps

TIME = np.arange(150) / 100.0  # [s]
ARM = go.human_arm()
MIDDLE = (ARM.lower + ARM.upper) / 2.0
Q = MIDDLE + 0.3 * np.sin(2.0 * TIME[:, None] + np.arange(7))
GAP = slice(61, 75)


def rows(*columns: np.ndarray, separator: str = ",") -> str:
    return "\n".join(separator.join(map(repr, row)) for row in np.column_stack(columns).tolist())


def table(q: np.ndarray) -> str:
    return f"# unit: rad\ntime,{','.join(ARM.joint_names)}\n{rows(TIME, q)}\n"


def opensim(q: np.ndarray) -> str:
    names = "\t".join(ARM.joint_names)
    numbers = rows(TIME, np.degrees(q), separator="\t")
    return f"angles\ninDegrees=yes\nendheader\ntime\t{names}\n{numbers}\n"


def mmm(q: np.ndarray) -> str:
    joints = "".join(f'<Joint name="{name}"/>' for name in ARM.joint_names)
    frames = "".join(
        f"<MotionFrame><Timestep>{time}</Timestep><JointPosition>{' '.join(map(str, row))}"
        "</JointPosition></MotionFrame>"
        for time, row in zip(TIME.tolist(), q.tolist(), strict=True)
    )
    return (
        f'<MMM><Motion name="a"><JointOrder>{joints}</JointOrder><MotionFrames>{frames}'
        "</MotionFrames></Motion></MMM>"
    )


@pytest.mark.parametrize(("name", "text"), [("a.csv", table), ("a.mot", opensim), ("a.xml", mmm)])
@pytest.mark.parametrize("number", [0.0, np.radians(9999.0)])
def test_joint_angles(name: str, text: object, number: float, tmp_path: Path) -> None:
    q = Q.copy()
    q[GAP] = number
    file = tmp_path / name
    file.write_text(text(q))  # type: ignore[operator]
    message = r"RSx_joint is missing at 0\.610 s; in all 14 of 150 samples .* every joint jumps"
    with pytest.raises(Gaps, match=message) as gaps:
        go.read_recording(file)
    assert np.ravel(gaps.value.parts) == pytest.approx([0.0, 0.6, 0.75, 1.49])
    with pytest.warns(RuntimeWarning, match="7 gaps of up to 0.15 s bridged; 14 samples from 0.61"):
        motion = go.read_recording(file, fill=0.15).motion
    assert motion.q == pytest.approx(Q, abs=2e-3)  # the motion that was made
    with pytest.warns(RuntimeWarning, match="the part from 0.75 to 1.49 s alone"):
        part = go.read_motion(file, ARM.joint_names, part=2)
    assert part.time == pytest.approx(TIME[75:])
    assert part.q == pytest.approx(Q[75:], abs=1e-9)


@pytest.mark.parametrize(
    ("rate", "missing"), [(100.0, (61, 75)), (120.0, (20, 30)), (29.97, (30, 37)), (50.0, (0, 10))]
)
def test_what_a_message_of_gaps_proposes_reads_the_file(
    rate: float, missing: tuple[int, int], tmp_path: Path
) -> None:
    """Whatever the gap lasts; a gap at the beginning is left out by a part."""
    q = Q.copy()
    q[slice(*missing), 2:4] = np.nan
    q[80:83, 5] = np.nan
    time = np.round(TIME * 100.0 / rate, 5)
    file = tmp_path / "a.csv"
    file.write_text(table(q).replace(rows(TIME, q), rows(time, q)))
    with pytest.raises(Gaps) as gaps:
        go.read_motion(file)
    fill = float(re.search(r"--fill ([\d.]+)\) bridges all", str(gaps.value))[1])  # type: ignore[index]
    between = [time[83] - time[79]]
    if missing[0] > 0:
        between.append(time[missing[1]] - time[missing[0] - 1])
    assert fill - 1.1e-3 < max(between) <= fill * (1.0 + 1e-9)
    with pytest.warns(RuntimeWarning, match="bridged"):
        motion = go.read_motion(file, ARM.joint_names, fill=fill)
    assert motion.q == pytest.approx(Q[-len(motion) :], abs=0.02)
    with pytest.raises(Gaps, match=f"--fill {fill:g}"):
        go.read_motion(file, fill=0.5 * fill)


def test_a_joint_without_numbers_cannot_be_bridged(tmp_path: Path) -> None:
    q = Q.copy()
    q[:, 4] = np.nan
    file = tmp_path / "a.csv"
    file.write_text(table(q))
    with pytest.raises(Gaps, match=r"; no sample has REz_joint$"):
        go.read_motion(file)
    q = Q.copy()
    q[:30] = np.nan
    file.write_text(table(q))
    with pytest.raises(
        Gaps, match=r"joint; part=1 \(--part 1\) reads the part that is .*: 0\.30 to 1\.49 s$"
    ):
        go.read_motion(file)


def test_a_motion_from_rest_at_zero_has_no_gap(tmp_path: Path) -> None:
    s = np.clip((TIME - 0.3) / 0.6, 0.0, 1.0)
    q = (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)[:, None] * MIDDLE
    file = tmp_path / "a.csv"
    file.write_text(table(q))
    assert np.array_equal(go.read_motion(file, ARM.joint_names).q, q)


def test_gaps_of_columns_that_are_not_asked_for_do_not_matter(tmp_path: Path) -> None:
    """Of another joint, and of the other arm in a convention."""
    q = Q.copy()
    q[GAP, 6] = np.nan
    file = tmp_path / "a.mot"
    file.write_text(opensim(q))
    assert go.read_motion(file, ARM.joint_names[:6]).q == pytest.approx(Q[:, :6])
    with pytest.raises(Gaps, match="RWy_joint is missing at 0"):
        go.read_motion(file)
    names = [f"{name}_{side}" for side in "rl" for name in ("arm_flex", "arm_add", "arm_rot")]
    numbers = np.degrees(np.hstack([Q[:, :3], Q[:, :3]]))
    numbers[GAP, 3:] = np.nan
    header = f"inDegrees=yes\nendheader\ntime {' '.join(names)}\n"
    file.write_text(header + rows(TIME, numbers, separator=" "))
    assert len(go.read_motion(file, ["RSx_joint"])) == 150
    with pytest.raises(Gaps, match="arm_flex_l is missing at 0"):
        go.read_motion(file, ["LSx_joint"])


def test_segments(tmp_path: Path) -> None:
    """A frame of zeros in a BVH is the rest pose, to which every joint jumps."""
    turned = np.degrees(0.8 + 0.3 * np.sin(2.0 * TIME[:, None] + np.arange(3)))
    turned[GAP] = 0.0
    joints = ("Spine", "RightArm", "RightForeArm", "RightHand")
    offsets = ("0 50 0", "-15 0 0", "-30 0 0", "-25 0 0")
    text = "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 0\n"
    for name, offset in zip(joints, offsets, strict=True):
        channels = "3 Zrotation Xrotation Yrotation" if name == "RightArm" else "0"
        text += f"JOINT {name}\n{{\nOFFSET {offset}\nCHANNELS {channels}\n"
    text += "End Site\n{\nOFFSET -10 0 0\n}\n" + "}\n" * 5
    text += f"MOTION\nFrames: 150\nFrame Time: 0.01\n{rows(turned, separator=' ')}\n"
    file = tmp_path / "a.bvh"
    file.write_text(text)
    shoulder = ARM.joint_names[:3]
    with pytest.raises(Gaps, match=r"missing at 0\.610 s; in all 14 of 150"):
        go.read_motion(file, shoulder, unit="cm")
    with pytest.warns(RuntimeWarning, match="gaps of up to 0.15 s bridged"):
        bridged = go.read_motion(file, shoulder, unit="cm", fill=0.15)
    assert np.abs(np.diff(bridged.q, axis=0)).max() < 0.05


def points() -> np.ndarray:
    """Places of three markers [mm] with residuals."""
    places = np.zeros((150, 3, 4))
    places[:, :, :3] = [[300.0, 200.0, 1400.0], [310.0, 400.0, 1100.0], [300.0, 600.0, 1000.0]]
    places[:, :, 0] += 100.0 * np.sin(2.0 * TIME[:, None] + np.arange(3))
    return places


@pytest.mark.parametrize("scale", [-1.0, 1.0])
def test_numbers_that_systems_write_for_markers_they_do_not_see(
    scale: float, tmp_path: Path
) -> None:
    """NDI's -3.697314e28 without a negative residual; ezc3d gives the numbers as they are."""
    ezc3d = pytest.importorskip("ezc3d")
    places = points()
    sentinel = -3.697314e28 if scale < 0.0 else -32768.0
    places[GAP, 1, :3] = sentinel
    file = tmp_path / "a.c3d"
    file.write_bytes(c3d(places, ["A", "B", "C"], scale=scale))
    written = ezc3d.c3d(str(file))["data"]["points"][:3]
    written = np.moveaxis(written, 0, -1).swapaxes(0, 1)
    if scale < 0.0:
        markers = go.recordings.read_markers(file)  # far away in any unit: nothing to be said
    else:
        with pytest.warns(RuntimeWarning, match=r"a\.c3d: gaps, .*: B in 14 samples from 0\.610 s"):
            markers = go.recordings.read_markers(file)
    missing = np.isnan(markers.positions)
    assert np.array_equal(missing, np.isclose(written, sentinel))
    assert markers.positions[~missing] == pytest.approx(1e-3 * written[~missing])


@pytest.mark.parametrize("number", ["0.0", "9999999", "-9999"])
def test_markers_in_tables(number: str, tmp_path: Path) -> None:
    places = points()[:, :, :3].reshape(150, 9)
    lines = rows(TIME, places).split("\n")
    for k in range(61, 75):
        cells = lines[k].split(",")
        lines[k] = ",".join([*cells[:4], *3 * [number], *cells[7:]])
    names = [f"{name}_{axis}" for name in "ABC" for axis in "xyz"]
    file = tmp_path / "a.csv"
    file.write_text("\n".join(["# unit: mm", f"time,{','.join(names)}", *lines]))
    with pytest.warns(RuntimeWarning, match="B in 14 samples from 0.610 s on"):
        markers = go.recordings.read_markers(file)
    missing = np.isnan(markers.positions).all(axis=2)
    assert np.argwhere(missing).tolist() == [[k, 1] for k in range(61, 75)]
    assert markers.positions[~missing] == pytest.approx(1e-3 * places.reshape(150, 3, 3)[~missing])


def test_an_angle_that_is_wrapped_at_pi(tmp_path: Path) -> None:
    """It is unwrapped as by numpy, in the revolution of the joint's range; a wrap is no gap."""
    q = Q.copy()
    q[:, 0] = 3.1 + 0.15 * np.sin(4.0 * TIME)  # most of it beyond pi
    wrapped = q.copy()
    wrapped[:, 0] = (q[:, 0] + np.pi) % (2.0 * np.pi) - np.pi
    wrapped[80:90, 0] = wrapped[80, 0]
    q[80:90, 0] = q[80, 0]
    file = tmp_path / "a.csv"
    file.write_text(table(wrapped))
    with pytest.warns(RuntimeWarning, match="RSx_joint at .* steps by .* deg"):
        motion = go.read_recording(file).motion
    assert motion.unfiltered == pytest.approx(q, abs=1e-12)
    assert np.unwrap(wrapped[:, 0]) == pytest.approx(q[:, 0])
