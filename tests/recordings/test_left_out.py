"""Units and rates that a file leaves out are given; what it says comes first."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_recordings import BIDS

import geodesic_ocp as go
from geodesic_ocp.recordings.recording_settings import RecordingSettings

TIME = np.arange(40) / 50.0  # [s]
JOINTS = ("RSx_joint", "REx_joint")
Q = np.column_stack([0.5 * np.sin(TIME), 0.8 - 0.3 * np.cos(1.5 * TIME)])  # [rad]
NAMES = ",".join(JOINTS)


def rows(*columns: np.ndarray) -> str:
    return "\n".join(",".join(map(repr, row)) for row in np.column_stack(columns).tolist())


# Without the unit, and without the rate.
UNITS = {
    "a.csv": f"time,{NAMES}\n{{}}\n",
    "a.mot": f"angles\nversion=1\nendheader\ntime,{NAMES}\n{{}}\n",
    "a.sto": f"name angles\ndatacolumns 3\ndatarows 40\nendheader\ntime,{NAMES}\n{{}}\n",  # SIMM's
}
RATES = {
    "a.csv": f"{NAMES}\n{{}}\n",
    "b.csv": f"# unit: rad\n{NAMES}\n{{}}\n",
    "a.mot": f"angles\ninDegrees=no\nendheader\n{NAMES}\n{{}}\n",
}


@pytest.mark.parametrize("name", UNITS)
def test_the_unit_of_angles(name: str, tmp_path: Path) -> None:
    file = tmp_path / name
    for degrees, numbers in ((True, np.degrees(Q)), (False, Q)):
        file.write_text(UNITS[name].format(rows(TIME, numbers)))
        with pytest.raises(go.RecordingError, match=r"degrees_in=True \(--degrees-in\) or .*False"):
            go.read_motion(file, JOINTS)
        assert go.read_motion(file, JOINTS, degrees_in=degrees).q == pytest.approx(Q)
    with pytest.warns(RuntimeWarning, match="are the angles in radians"):
        assert go.read_motion(file, JOINTS, degrees_in=True).q == pytest.approx(np.radians(Q))


@pytest.mark.parametrize("name", RATES)
def test_the_rate(name: str, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_text(RATES[name].format(rows(Q)))
    with pytest.raises(go.RecordingError, match=r"by rate \(--sample-rate\)"):
        go.read_motion(file, JOINTS)
    unit = False if name == "a.csv" else None
    motion = go.read_motion(file, JOINTS, rate=50.0, degrees_in=unit)
    assert motion.time == pytest.approx(TIME)
    assert motion.q == pytest.approx(Q)


def test_what_the_file_says_comes_first(tmp_path: Path) -> None:
    for name, unit in {"a.csv": "# unit: rad\n", "a.mot": "inDegrees=no\nendheader\n"}.items():
        file = tmp_path / name
        file.write_text(f"{unit}time,{NAMES}\n{rows(TIME, Q)}\n")
        assert len(go.read_motion(file, degrees_in=False, rate=50.0)) == 40
        with pytest.warns(
            RuntimeWarning, match=r"degrees_in\) is False, as the file states, not T"
        ):
            motion = go.read_motion(file, JOINTS, degrees_in=True)
        with pytest.warns(RuntimeWarning, match=r"\(rate\) is 50, as the file states, not 100"):
            again = go.read_motion(file, JOINTS, rate=100.0)
        for each in (motion, again):
            assert each.q == pytest.approx(Q)
            assert each.time == pytest.approx(TIME)


def test_the_rate_of_motion_bids(tmp_path: Path) -> None:
    for name, content in BIDS.items():
        if not name.endswith(".json"):
            (tmp_path / name).write_text(content)
    file = tmp_path / "sub-01_motion.tsv"
    with pytest.raises(go.RecordingError, match=r"nor does rate \(--sample-rate\)"):
        go.read_motion(file)
    assert go.read_motion(file, rate=50.0).time == pytest.approx([0.0, 0.02, 0.04])


def test_poses_of_smpl_from_video(tmp_path: Path) -> None:
    """`global_orient` and `body_pose` without a rate, y up; scipy turns the elbow."""
    flexion = 0.5 + 0.4 * np.sin(TIME)
    body = np.zeros((40, 21, 3))
    # In the T pose, palms down, the right forearm flexes forward about -y of the file.
    body[:, 18] = Rotation.from_euler("y", flexion[:, None]).as_rotvec()
    for name, poses in {
        "flat": body.reshape(40, 63),
        "joints": body,
        "smpl": np.hstack([body.reshape(40, 63), np.zeros((40, 6))]),
    }.items():
        file = tmp_path / f"{name}.npz"
        np.savez(file, global_orient=np.zeros((40, 3)), body_pose=poses)
        with pytest.raises(go.RecordingError, match=r"'mocap_frame.*by rate \(--sample-rate\)"):
            go.read_motion(file, ["REx_joint"], up="y")
        motion = go.read_motion(file, ["REx_joint"], up="y", rate=50.0)
        assert motion.time == pytest.approx(TIME)
        assert motion.q[:, 0] == pytest.approx(flexion)
    with pytest.raises(go.RecordingError, match=r"pass up='y' \(--up=y\)"):
        go.read_motion(file, ["REx_joint"], rate=50.0)
    np.savez(file, global_orient=np.zeros((40, 3)), body_pose=body[:, :20])
    with pytest.raises(go.RecordingError, match="body_pose must have 3 and 63 or 69 columns"):
        go.read_motion(file, rate=50.0)


def test_settings_name_them() -> None:
    settings = RecordingSettings(sample_rate=50.0, degrees_in=True)
    assert (settings.reading()["rate"], settings.reading()["degrees_in"]) == (50.0, True)
    with pytest.raises(ValueError, match="sample_rate must be"):
        RecordingSettings(sample_rate=-1.0)
