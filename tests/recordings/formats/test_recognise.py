"""Formats are told by content."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from small_recordings import small_recordings

import geodesic_ocp as go
from geodesic_ocp.recordings.formats.recognise import recognise
from geodesic_ocp.recordings.read_recording import read_markers, read_motion

FORMATS = {
    "legacy.xml": "mmm",
    "two.xml": "mmm",
    "table.csv": "table",
    "motion.mot": "opensim",
    "motion.bvh": "bvh",
    "motion.mvnx": "mvnx",
    "motion.asf": "amc",
    "motion.amc": "amc",
    "motion.npz": "smpl",
    "markers.trc": "trc",
    "markers.csv": "marker table",
    "markers.c3d": "c3d",
    "markers_vicon.csv": "vicon",
    "markers_qualisys.tsv": "qualisys",
}


@pytest.mark.parametrize(("name", "expected"), FORMATS.items())
def test_no_suffix_counts(name: str, expected: str, tmp_path: Path) -> None:
    content = small_recordings()[name]
    for suffix in ("", ".xml", ".csv", ".c3d"):
        (tmp_path / f"file{suffix}").write_bytes(content)
        assert recognise(tmp_path / f"file{suffix}") == expected
    if name not in ("markers.c3d", "motion.npz"):
        for changed in (b"\xef\xbb\xbf" + content, content.replace(b"\n", b"\r\n")):
            (tmp_path / "file").write_bytes(changed)
            assert recognise(tmp_path / "file") == expected
        (tmp_path / "file").write_bytes(b"\xff\xfe" + content.decode().encode("utf-16-le"))
        assert recognise(tmp_path / "file") == expected


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"time,a\n0,1\n", "table"),
        (b"# a note\n\n# Unit : DEG\n", "table"),
        (b"time,a_x,a_y,a_z\n", "marker table"),
        (b"# unit: deg\ntime,a_x,a_y,a_z\n", "table"),
        (b"name arm\ndatacolumns 2\ndatarows 1\nendheader\ntime\tq\n", "opensim"),
        (b"1\nroot 0 0 0 0 0 0\n", "amc"),
        (b"# comment\n:FULLY-SPECIFIED\n", "amc"),
    ],
)
def test_headers(content: bytes, expected: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(content)
    assert recognise(tmp_path / "file") == expected


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\x1f\x8b\x08rest", "a gzip archive: unpack it first"),
        (b"Kaydara FBX Binary  \0", "an FBX file: export it as BVH"),
        (b"\x01\x02\0\x03", "binary data"),
        (b"1 2 3\n4 5 6\n", "a table of numbers without the names of joints"),
        (b"Dear reader\n", "text that begins with 'Dear reader'"),
    ],
)
def test_other_files_are_refused_with_what_they_look_like(
    content: bytes, words: str, tmp_path: Path
) -> None:
    (tmp_path / "file").write_bytes(content)
    with pytest.raises(go.RecordingError) as failure:
        read_motion(tmp_path / "file")
    expected = f"{tmp_path / 'file'}: is not a recording in a known format: it looks like {words}"
    assert str(failure.value).startswith(expected)
    assert "These are read: MMM XML" in str(failure.value)


def test_arguments_of_other_formats_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(small_recordings()["table.csv"])
    for argument, formats in {
        "unit": "ASF/AMC and BVH",
        "skeleton": "ASF/AMC",
        "convention": "ASF/AMC and BVH and OpenSim",
    }.items():
        with pytest.raises(ValueError, match=f"{argument} is for {formats}.*file is a table"):
            read_motion(tmp_path / "file", **{argument: 1.0})
    (tmp_path / "file").write_bytes(small_recordings()["motion.bvh"])
    for argument, formats in {"rate": "ASF/AMC and OpenSim", "degrees_in": "OpenSim"}.items():
        with pytest.raises(ValueError, match=f"{argument} is for {formats}.*file is BVH"):
            read_motion(tmp_path / "file", **{argument: 1.0})


@pytest.mark.slow
def test_recordings_under_names_that_mislead(shared: Path, tmp_path: Path) -> None:
    """Every file of these recordings is read the same under another suffix, or refused."""
    data = shared / "data"
    shutil.copy(data / "cmu" / "02.asf", tmp_path)
    found = dict.fromkeys(("mmm", "amc", "opensim", "c3d"), 0)
    folders = ("kit", "cmu", "models", "opensim")
    for file in sorted(each for name in folders for each in (data / name).glob("*.*")):
        if file.suffix in (".md", ".log"):
            with pytest.raises(go.RecordingError, match="is not a recording in a known format"):
                recognise(file)
            continue
        other = tmp_path / f"{file.stem}.dat"
        shutil.copy(file, other)
        found[recognise(other)] += 1
        if file.suffix == ".c3d":
            assert np.array_equal(read_markers(other).positions, read_markers(file).positions)
        elif file.name == "mmm.xml":
            with pytest.raises(go.RecordingError, match=r"expected <MMM> .* found <Robot>"):
                read_motion(other)
        elif file.suffix == ".mot":
            with pytest.warns(RuntimeWarning, match=r"\.dat: its header says 250 rows, it has 88"):
                assert len(read_motion(other)) == 88
        elif file.suffix != ".asf":
            assert np.array_equal(read_motion(other).q, read_motion(file).q)
    assert found == {"mmm": 7, "amc": 2, "opensim": 1, "c3d": 1}
