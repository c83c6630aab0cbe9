"""Damaged files of every format: they are read as valid recordings, or refused with a sentence."""

from __future__ import annotations

import io
import re
import tempfile
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest
from damage import damaged
from hypothesis import given
from hypothesis import strategies as st
from small_recordings import small_recordings

import geodesic_ocp as go
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.recordings.read_recording import read_markers, read_motion

SEEDS = small_recordings()


def outcome(folder: Path, name: str, content: bytes) -> go.Motion | Markers | None:
    """The recording, if it is read; otherwise the message begins with the file's name."""
    (folder / name).write_bytes(content)
    file = folder / re.sub(r"sub-01_.*", "sub-01_motion.tsv", name.replace(".asf", ".amc"))
    try:
        with warnings.catch_warnings():  # of counts that programs leave as they were
            warnings.filterwarnings("ignore", ".*: its header (says|counts)", RuntimeWarning)
            result = read_markers(file) if name.startswith("markers") else read_motion(file)
    except go.RecordingError as failure:
        message = str(failure)
        assert message.startswith(str(file))
        assert len(message) > len(f"{file}: ")
        return None
    assert len(result) >= 2
    assert not np.any(np.isinf(values(result)))
    return result


def values(result: go.Motion | Markers) -> np.ndarray:
    return result.positions if isinstance(result, Markers) else result.q


def write_seeds(folder: Path) -> None:
    """The files of one recording, of which another one is damaged."""
    for name in SEEDS:
        if name.startswith(("motion.a", "sub-01")):
            (folder / name).write_bytes(SEEDS[name])


@pytest.mark.parametrize("name", SEEDS)
def test_the_undamaged_file_is_read(name: str, tmp_path: Path) -> None:
    write_seeds(tmp_path)
    assert outcome(tmp_path, name, SEEDS[name]) is not None


@pytest.mark.parametrize("name", SEEDS)
@given(data=st.data())
def test_damaged_files(name: str, data: st.DataObject) -> None:
    with tempfile.TemporaryDirectory() as folder:
        write_seeds(Path(folder))
        outcome(Path(folder), name, data.draw(damaged(SEEDS[name])))


@pytest.mark.slow
@pytest.mark.parametrize("name", SEEDS)
def test_files_cut_off_anywhere(name: str, tmp_path: Path) -> None:
    """What is read of a file that ends early is the beginning of the recording.

    Binary files and those with counts that must hold are not read at all.
    """
    write_seeds(tmp_path)
    content = SEEDS[name]
    whole = outcome(tmp_path, name, content)
    assert whole is not None
    for end in range(0, len(content) - 1, max(1, len(content) // 150)):
        part = outcome(tmp_path, name, content[:end])
        if part is not None:
            assert not name.endswith((".c3d", ".npz", ".xml", ".bvh", ".mvnx", ".json"))
            complete = len(part) - 1  # of the last row the last number may lack digits
            assert values(part)[:complete] == pytest.approx(values(whole)[:complete], nan_ok=True)


@pytest.mark.parametrize("name", SEEDS)
@pytest.mark.parametrize(
    "content",
    [b"", b"\0" * 2000, b"\xff" * 2000, b"\xff\xfe<\0M\0", b"\xef\xbb\xbf", b"\n" * 99, b"PK\3\4"],
)
def test_files_of_other_content(name: str, content: bytes, tmp_path: Path) -> None:
    assert outcome(tmp_path, name, content) is None


def archive(header: bytes, content: bytes) -> bytes:
    """An .npz with this header of an array."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as files:
        length = len(header).to_bytes(2, "little")
        files.writestr("poses.npy", b"\x93NUMPY\x01\x00" + length + header + content)
        files.writestr("mocap_framerate.npy", b"")
    return stream.getvalue()


@pytest.mark.parametrize("rows", [3, 10**6, 10**12])
def test_archives_that_claim_more_than_they_hold(rows: int, tmp_path: Path) -> None:
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, 156)}}\n".encode()
    assert outcome(tmp_path, "motion.npz", archive(header, b"\0" * 4_000_000)) is None


def test_a_hierarchy_without_joints(tmp_path: Path) -> None:
    """Which damaging files at random had come upon."""
    (tmp_path / "empty.bvh").write_text("HIERARCHY\nMOTION\nFrames: 2\nFrame Time: 0.1\n")
    with pytest.raises(
        go.RecordingError, match=r"empty\.bvh: line 2: MOTION, but there is no joint"
    ):
        read_motion(tmp_path / "empty.bvh")
