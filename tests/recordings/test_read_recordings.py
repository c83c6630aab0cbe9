"""Recordings from several files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.recordings.read_recording import read_recording

TIME = np.linspace(0.0, 1.0, 101)


def write(file: Path, q: np.ndarray, *notes: str, time: np.ndarray = TIME) -> Path:
    """A table of the right arm's joint angles."""
    lines = ["# unit: rad", *notes, ",".join(["time", *go.human_arm("right").joint_names])]
    lines += [",".join(f"{value:.9f}" for value in row) for row in np.column_stack([time, q])]
    file.write_text("\n".join(lines))
    return file


def swing(phase: float) -> np.ndarray:
    return 0.05 + 0.1 * np.sin(3.0 * TIME[:, None] + phase * np.arange(7.0))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path / "b.csv", swing(0.1), "# height: 1.9", "# mass: 80", "# subject: Bo")
    write(tmp_path / "a.csv", swing(0.2), "# height: 1.6", "# subject: An")
    (tmp_path / "notes.txt").write_text("not a recording")
    return tmp_path


def test_a_folder_is_read_with_an_arm_for_each_subject(folder: Path) -> None:
    first, second = go.recordings.read_recordings(folder)
    assert (first.name, first.subject) == ("a, right", "An")
    assert (second.name, second.subject) == ("b, right", "Bo")
    assert first.motion.velocity is not None
    expected = go.human_arm("right", 1.9, 80.0)
    assert second.model.mass == pytest.approx(expected.mass)
    q = np.full(7, 0.1)
    assert second.model.hand_pose(q)[1] == pytest.approx(expected.hand_pose(q)[1])
    assert first.model.mass == pytest.approx(go.human_arm("right", 1.6).mass)


def test_height_and_mass_can_be_given_and_models_are_shared(folder: Path) -> None:
    files = [folder / "b.csv", str(folder / "a.csv")]
    first, second = go.recordings.read_recordings(files, height=1.7, mass=60.0)
    assert [first.name, second.name] == ["b, right", "a, right"]
    assert first.model is second.model
    assert first.model.mass == pytest.approx(go.human_arm("right", 1.7, 60.0).mass)


def test_files_that_cannot_be_used_are_named_together(folder: Path) -> None:
    (folder / "c.xml").write_text("<MMM>")
    write(folder / "d.csv", swing(0.3)[:5], time=TIME[:5])
    write(folder / "e.csv", np.rad2deg(swing(0.4)))
    write(folder / "f.csv", swing(0.5), time=1000.0 * TIME)
    write(folder / "g.csv", swing(0.1) + 1e-8)
    with pytest.raises(go.RecordingError) as failure:
        go.recordings.read_recordings(folder)
    reasons = str(failure.value).split(";\n")  # on the command line in one line
    expected = {
        "c.xml": "broken XML",
        "d.csv": "",  # too short to filter
        "e.csv": "are these degrees?",
        "f.csv": "is time in milliseconds?",
        "g.csv": f"holds the same motion as {folder / 'b.csv'}",
    }
    assert len(reasons) == len(expected)
    for reason, (name, words) in zip(reasons, expected.items(), strict=True):
        assert reason.startswith(f"{folder / name}: ")
        assert words in reason
    with pytest.warns(UserWarning, match="left out: ") as warned:
        found = go.recordings.read_recordings(folder, skip=True)
    assert [each.name for each in found] == ["a, right", "b, right"]
    assert len(warned) == 5


def test_without_any_recording(tmp_path: Path) -> None:
    with pytest.raises(go.RecordingError, match=r"no file in this folder ends in \.xml, \.csv, "):
        go.recordings.read_recordings(tmp_path)
    with pytest.raises(go.RecordingError, match="there is no such file"):
        go.recordings.read_recordings(tmp_path / "a.csv", skip=True)
    with pytest.raises(go.RecordingError, match="none: there is no such file or folder"):
        go.recordings.read_recordings(tmp_path / "none")
    with pytest.raises(ValueError, match="paths must name at least one file or folder"):
        go.recordings.read_recordings([])


def test_wrong_arguments_are_not_reasons_to_skip(folder: Path) -> None:
    with pytest.raises(ValueError, match="side must be 'right' or 'left'"):
        go.recordings.read_recordings(folder, "both", skip=True)
    with pytest.raises(ValueError, match="height must be positive"):
        go.recordings.read_recordings(folder, height=-1.0, skip=True)
    with pytest.raises(ValueError, match="one of cutoff and duration, got 6 Hz and"):
        go.recordings.read_recordings(folder, cutoff=6.0, duration=0.2, skip=True)


def test_the_filter_can_be_chosen(folder: Path) -> None:
    raw = go.read_motion(folder / "a.csv")
    chosen, smooth = (go.recordings.read_recordings(folder, cutoff=each)[0] for each in (None, 4.0))
    assert chosen.motion.q == pytest.approx(raw.filtered().q)
    assert smooth.motion.velocity == pytest.approx(raw.filtered(cutoff=4.0).velocity)
    local = go.recordings.read_recordings(folder, duration=0.21)[0]
    assert local.motion.q == pytest.approx(raw.filtered(21).q)


@pytest.mark.slow
def test_recordings_of_the_database(shared: Path) -> None:
    """One recording is there in two layouts of the format."""
    pattern = str(shared / "data" / "kit" / "*.xml")
    with pytest.raises(go.RecordingError, match=r"arm_02\.xml: holds the same motion as .*mmm2"):
        go.recordings.read_recordings(pattern)
    with pytest.warns(UserWarning, match="holds the same motion"):
        found = go.recordings.read_recordings(pattern, mass=70.0, skip=True)
    assert [each.subject for each in found] == ["subject_id_969", *4 * ["subject_id_1229"]]


def test_folders_within_a_folder_and_patterns(folder: Path) -> None:
    (folder / "more").mkdir()
    write(folder / "more" / "c.csv", swing(0.3))
    assert len(go.recordings.read_recordings(folder)) == 2
    for paths in ({"paths": folder, "recursive": True}, {"paths": f"{folder}/**/*.csv"}):
        names = [each.name for each in go.recordings.read_recordings(**paths)]
        assert names == ["a, right", "b, right", "c, right"]
    assert len(go.recordings.read_recordings([folder, folder / "a.csv"])) == 2  # each file once
    with pytest.raises(go.RecordingError, match="no file matches this pattern"):
        go.recordings.read_recordings(f"{folder}/*.bvh")


def test_people_of_equal_stature_share_the_model(tmp_path: Path) -> None:
    files = [
        write(tmp_path / f"{name}.csv", swing(phase), "# height: 1.7")
        for name, phase in (("a", 0.1), ("b", 0.2))
    ]
    first, second = go.recordings.read_recordings(files)
    assert first.model is second.model


@pytest.mark.slow
def test_markers_are_fitted_by_the_arm_of_the_person(shared: Path) -> None:
    pytest.importorskip("ezc3d")
    kit = shared / "data" / "kit"
    (fitted,) = go.recordings.read_recordings(kit / "take_book_from_shelf_right_arm_02.c3d")
    (angles,) = go.recordings.read_recordings(kit / "take_book_from_shelf_right_arm_02.xml")
    assert fitted.motion.joint_names == angles.motion.joint_names
    assert len(fitted.motion) == len(angles.motion)
    # The flexion of the elbow, up to an offset of the person's arm.
    elbow = angles.motion.joint_names.index("REx_joint")
    flexions = (fitted.motion.q[:, elbow], angles.motion.q[:, elbow])
    assert np.corrcoef(*flexions)[0, 1] > 0.99


def test_what_a_format_leaves_open_can_be_given(folder: Path) -> None:
    with pytest.raises(ValueError, match=r"unit is for .*; .*a\.csv is a table"):
        read_recording(folder / "a.csv", unit="cm")


@pytest.mark.slow
def test_of_several_formats_each_takes_what_applies_to_it(folder: Path, shared: Path) -> None:
    """The wrist of this person bends further than the model's: a warning, not a refusal."""
    file = shared / "data" / "cmu" / "02_05.amc"
    with pytest.warns(RuntimeWarning, match=r"02_05\.amc: RWx_joint reaches 55 deg"):
        found = go.recordings.read_recordings([folder / "a.csv", file], rate=60.0, up="y")
    assert [each.motion.rate for each in found] == pytest.approx([100.0, 60.0])
    with pytest.raises(ValueError, match="up must be one of x, y"):
        go.recordings.read_recordings(folder, up="upwards")


@pytest.mark.slow
def test_the_skeleton_of_a_file_can_be_given(tmp_path: Path, shared: Path) -> None:
    cmu = shared / "data" / "cmu"
    alone = tmp_path / "02_05.amc"
    alone.write_bytes((cmu / "02_05.amc").read_bytes())
    with pytest.raises(go.RecordingError, match=r"state skeleton=\.\.\. \(--skeleton\)"):
        read_recording(alone)
    with pytest.warns(RuntimeWarning, match="RWx_joint"):
        recording = read_recording(alone, skeleton=cmu / "02.asf")
    assert recording.motion.rate == pytest.approx(120.0)


def test_a_joint_beyond_its_limits_for_long_is_asked_about(folder: Path) -> None:
    """An elevation of the upper arm with the other sign puts the arm behind the back."""
    q = swing(0.3)
    q[:, 0] = -1.9
    file = write(folder / "back.csv", q)
    with pytest.warns(RuntimeWarning, match=r"RSx_joint reaches -109 .* right swapped"):
        read_recording(file)
    q[20:, 0] = 0.0
    q[:20, 0] = -1.9 * np.cos(np.linspace(0.0, np.pi / 2.0, 20))
    read_recording(write(file, q))  # for a short time, no question


def test_folders_of_results_are_no_recordings(folder: Path) -> None:
    before = {each.name for each in go.recordings.read_recordings(folder)}
    for name in ("out/recordings.csv", "out/synergies.csv", "out/results/a.json"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("recording\n")
    assert {each.name for each in go.recordings.read_recordings(folder, recursive=True)} == before
