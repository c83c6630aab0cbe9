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
from hypothesis import given
from hypothesis import strategies as st
from small_recordings import small_recordings

import geodesic_ocp as go
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.recordings.read_recording import read_markers, read_motion

SEEDS = small_recordings()
NUMBERS = (b"nan", b"inf", b"-inf", b"1e308", b"-1e308", b"1e-320", b"0", b"-1", b"65536", b"")
NUMBERS += (b"99999999999999999999", b"1e9", b"x", b"\xe4", b"\0", b"0x10", b"1,5", b"1 2", b"\xff")


@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """The content after one to three of the accidents that happen to files."""
    for _ in range(draw(st.integers(1, 3))):
        if not content:
            break
        accident = draw(st.sampled_from(ACCIDENTS))
        content = accident(draw, content)
    return content


def place(draw: st.DrawFn, content: bytes) -> int:
    return draw(st.integers(0, max(len(content) - 1, 0)))


def truncated(draw: st.DrawFn, content: bytes) -> bytes:
    return content[: place(draw, content)]


def replaced_byte(draw: st.DrawFn, content: bytes) -> bytes:
    at = place(draw, content)
    return content[:at] + bytes([draw(st.integers(0, 255))]) + content[at + 1 :]


def swapped_bytes(draw: st.DrawFn, content: bytes) -> bytes:
    first, second = sorted([place(draw, content), place(draw, content)])
    changed = bytearray(content)
    changed[first], changed[second] = content[second], content[first]
    return bytes(changed)


def deleted_bytes(draw: st.DrawFn, content: bytes) -> bytes:
    at = place(draw, content)
    return content[:at] + content[at + draw(st.integers(1, 600)) :]


def repeated_bytes(draw: st.DrawFn, content: bytes) -> bytes:
    at = place(draw, content)
    end = at + draw(st.integers(1, 600))
    return content[:end] + content[at:]


def inserted_bytes(draw: st.DrawFn, content: bytes) -> bytes:
    at = place(draw, content)
    new = draw(st.sampled_from([b"\0", b"\xe4", b"\n", b'"', b"<", b"\xff\xff", b";"]))
    return content[:at] + new + content[at:]


def changed_lines(draw: st.DrawFn, content: bytes) -> bytes:
    """A line deleted, repeated, or exchanged with another."""
    lines = content.split(b"\n")
    first, second = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
    kind = draw(st.sampled_from(["delete", "repeat", "exchange"]))
    if kind == "delete":
        del lines[first]
    elif kind == "repeat":
        lines.insert(second, lines[first])
    else:
        lines[first], lines[second] = lines[second], lines[first]
    return b"\n".join(lines)


def changed_number(draw: st.DrawFn, content: bytes) -> bytes:
    """A word between blanks, commas, brackets or signs of equality, of which most are numbers."""
    ends = [i for i, byte in enumerate(content) if byte in b" \t\n,=<>'\""]
    if len(ends) < 2:
        return content
    index = draw(st.integers(0, len(ends) - 2))
    new = draw(st.sampled_from(NUMBERS))
    return content[: ends[index] + 1] + new + content[ends[index + 1] :]


def changed_words(draw: st.DrawFn, content: bytes) -> bytes:
    """Four bytes that are a large number, not finite, negative or zero in a binary file."""
    at = place(draw, content)
    words = ["ffffffff", "7f800000", "0000807f", "0000c07f", "00000000", "ff7fff7f", "ffff7f7f"]
    return content[:at] + bytes.fromhex(draw(st.sampled_from(words))) + content[at + 4 :]


ACCIDENTS = [
    truncated,
    replaced_byte,
    swapped_bytes,
    deleted_bytes,
    repeated_bytes,
    inserted_bytes,
    changed_lines,
    changed_number,
    changed_number,
    changed_words,
]


def outcome(folder: Path, name: str, content: bytes) -> go.Motion | Markers | None:
    """The recording, if it is read; otherwise the message begins with the file's name."""
    (folder / name).write_bytes(content)
    file = folder / re.sub(r"sub-01_.*", "sub-01_motion.tsv", name.replace(".asf", ".amc"))
    try:
        with warnings.catch_warnings():  # of counts that programs leave as they were
            warnings.filterwarnings("ignore", ".*: its header says", RuntimeWarning)
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
