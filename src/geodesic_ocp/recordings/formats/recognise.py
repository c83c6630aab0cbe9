"""The catalogue of formats of recordings, recognized by the content of a file."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.segment_orientations import JOINTS
from geodesic_ocp.recordings.formats.laboratory import is_qualisys, is_vicon, motion_bids_kind
from geodesic_ocp.trajectory.files.text_lines import LENGTHS, is_time

_HEAD = 1 << 16  # bytes from which a format is told

# What other files begin with.
_OTHERS = (
    (b"\x89PNG", "a PNG image"),
    (b"\xff\xd8\xff", "a JPEG image"),
    (b"%PDF", "a PDF document"),
    (b"\x1f\x8b", "a gzip archive: unpack it first"),
    (b"7z\xbc\xaf", "a 7z archive: unpack it first"),
    (b"\x89HDF", "an HDF5 file"),
    (b"MATLAB", "a MATLAB file"),
    (b"\x93NUMPY", "a single NumPy array"),
    (b"PAR1", "a Parquet table"),
    (b"\x80", "a Python pickle"),
    (b"Kaydara FBX", "an FBX file: export it as BVH"),
    (b"; FBX", "an FBX file: export it as BVH"),
    (b"glTF", "a glTF model"),
    (b"{", "JSON"),
)


def recognise(file: Path) -> str:
    """Return the format of a file, a key of `FORMATS`, from its first bytes; its suffix does not
    count, but for sub-..._motion.tsv of Motion-BIDS, whose columns are named in another file.

    Raises:
        RecordingError: the file is missing or of another format; says what it looks like.
        OSError: the file cannot be read.
    """
    if not file.is_file():
        what = "is a folder, not a file" if file.is_dir() else "there is no such file"
        raise RecordingError(f"{file}: {what}")
    with file.open("rb") as stream:
        head = stream.read(_HEAD)
    if not head.strip():
        raise RecordingError(f"{file}: is empty")
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        return "smpl"
    others = tuple(magic for magic, _ in _OTHERS if len(magic) > 2)  # some have the same "P"
    if head[1:2] == b"\x50" and b"\0" in head[:512] and not head.startswith(others):
        return "c3d"
    if re.fullmatch(r"sub-.+_motion\.tsv", file.name):
        return motion_bids_kind(file)
    lines = [line.strip() for line in _text(head).splitlines() if line.strip()]
    for name, each in FORMATS.items():
        if lines and each.is_format(lines):
            return name
    raise RecordingError(
        f"{file}: is not a recording in a known format: it looks like {_other(head, lines)}. "
        f"These are read: {', '.join(each.label for each in FORMATS.values())}"
    )


def _text(head: bytes) -> str:
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return head.decode("utf-16", errors="replace")
    return head.decode("utf-8-sig", errors="replace")


def _without_comments(lines: list[str]) -> list[str]:
    return [line for line in lines if not line.startswith("#")]


def _is_mvnx(lines: list[str]) -> bool:
    return lines[0].startswith("<") and any(re.search(r"<mvnx\b", line) for line in lines[:20])


def _is_mmm(lines: list[str]) -> bool:
    """Return whether it is XML, which is MMM's unless it says otherwise."""
    return lines[0].startswith("<") and not _is_mvnx(lines)


def _is_trc(lines: list[str]) -> bool:
    return lines[0].lower().startswith("pathfiletype")


def _is_bvh(lines: list[str]) -> bool:
    return lines[0].split()[0].upper() == "HIERARCHY"


def _is_acclaim(lines: list[str]) -> bool:
    """Return whether it is a motion (.amc), or the skeleton (.asf) that belongs to one."""
    words = (":version", ":root", ":bonedata", ":units", ":fully-specified", ":degrees", ":radians")
    if lines[0].lower().startswith("#!oml:"):
        return True
    plain = [line.lower() for line in _without_comments(lines)[:3]]
    if plain[:1] == ["1"]:
        return any(line.startswith("root ") for line in plain)
    return any(line.startswith(words) for line in plain[:1])


def _is_opensim(lines: list[str]) -> bool:
    ends = (re.split(r"[,\t; ]", line, maxsplit=1)[0].lower() for line in lines)
    return "endheader" in ends


def _notes(lines: list[str]) -> list[re.Match[str]]:
    """Return the notes of a table, `# key: value`."""
    found = (re.match(r"#\s*(unit|height|mass|subject)\s*:\s*(\S*)", line, re.I) for line in lines)
    return [note for note in found if note]


def _is_table(lines: list[str]) -> bool:
    columns = _columns(lines)
    return bool(_notes(lines)) or any(map(is_time, columns)) or not columns.isdisjoint(JOINTS)


def _is_marker_table(lines: list[str]) -> bool:
    """Return three columns NAME_x, NAME_y and NAME_z are a marker, unless the unit is that of
    angles.
    """
    units = [note[2].lower() for note in _notes(lines) if note[1].lower() == "unit"]
    if units:
        return units[0] in LENGTHS
    names = _columns(lines)
    return any(
        {f"{name[:-1]}{axis}" for axis in "yz"} <= names for name in names if name.endswith("_x")
    )


def _columns(lines: list[str]) -> set[str]:
    """Return names in the first line without #, if it is divided into columns."""
    first = (_without_comments(lines) or [""])[0]
    return {name.strip(" \t\"'") for name in re.split(r"[,;\t]", first)}


_GAPS = ("fill", "part")


@dataclass(frozen=True)
class Format:
    """A format of recordings.

    Attributes:
        label: name in messages.
        content: "angles" (a Motion), "segments" (SegmentOrientations) or "markers" (Markers).
        module, function: the reader, imported when a file of the format is read.
        arguments: arguments of `read_recording` that its reader takes.
        is_format: whether the lines of a text file, stripped and not empty, are of the format;
            formats without it are told by their first bytes.
    """

    label: str
    content: Literal["angles", "segments", "markers"]
    module: str
    function: str
    arguments: tuple[str, ...] = ()
    is_format: Callable[[list[str]], bool] = lambda lines: False

    @property
    def applicable(self) -> set[str]:
        """Arguments of `read_recording` that apply to it: also those of gaps, if it has angles."""
        return {*self.arguments, *(() if self.content == "markers" else _GAPS)}

    def read(self, file: Path, *args: Any, **kwargs: Any) -> Any:
        """Read a file of this format."""
        module = import_module(f"geodesic_ocp.{self.module}")
        return getattr(module, self.function)(file, *args, **kwargs)


_SKELETON = ("convention", "skeleton", "rate", "unit", "up")
_MARKERS = ("up", "marker_set", "person")
_TABLE = ("columns", *_GAPS)
_WING = "recordings.formats"
#: Every format that is read; a text file is of the first that recognises it.
FORMATS: dict[str, Format] = {
    "mmm": Format("MMM XML", "angles", "trajectory.files.mmm", "read_mmm", (), _is_mmm),
    "trc": Format("TRC", "markers", f"{_WING}.marker_tables", "read_trc", _MARKERS, _is_trc),
    "amc": Format("ASF/AMC", "segments", f"{_WING}.amc", "read_amc", _SKELETON, _is_acclaim),
    "bvh": Format(
        "BVH", "segments", f"{_WING}.bvh", "read_bvh", ("convention", "unit", "up"), _is_bvh
    ),
    "opensim": Format(
        "OpenSim .mot and .sto",
        "angles",
        f"{_WING}.opensim",
        "read_opensim",
        ("convention", *_TABLE, "degrees_in", "rate"),
        _is_opensim,
    ),
    "mvnx": Format(
        "Xsens MVNX", "segments", f"{_WING}.mvnx", "read_mvnx", ("convention", "rate"), _is_mvnx
    ),
    "vicon": Format(
        "CSV of Vicon Nexus", "markers", f"{_WING}.laboratory", "read_vicon", _MARKERS, is_vicon
    ),
    "qualisys": Format(
        "Qualisys TSV", "markers", f"{_WING}.laboratory", "read_qualisys", _MARKERS, is_qualisys
    ),
    "bids angles": Format(
        "Motion-BIDS (JNTANG)",
        "angles",
        f"{_WING}.laboratory",
        "read_motion_bids_angles",
        ("convention", *_TABLE, "rate"),
    ),
    "bids markers": Format(
        "Motion-BIDS (POS)", "markers", f"{_WING}.laboratory", "read_motion_bids_markers", _MARKERS
    ),
    "marker table": Format(
        "a table of markers (CSV)",
        "markers",
        f"{_WING}.marker_tables",
        "read_marker_table",
        _MARKERS,
        _is_marker_table,
    ),
    "table": Format(
        "a table (CSV)",
        "angles",
        "trajectory.files.angle_tables",
        "read_table",
        (*_TABLE, "degrees_in", "rate"),
        _is_table,
    ),
    "c3d": Format("c3d", "markers", f"{_WING}.c3d", "read_c3d", _MARKERS),
    "smpl": Format(
        "AMASS-style .npz", "segments", f"{_WING}.smpl", "read_smpl", ("convention", "up", "rate")
    ),
}


def _other(head: bytes, lines: list[str]) -> str:
    for magic, what in _OTHERS:
        if head.startswith(magic):
            return what
    if b"\0" in head:
        return "binary data"
    if all(_is_number(word) for line in lines[:5] for word in re.split(r"[,;\s]+", line) if word):
        return "a table of numbers without the names of joints"
    return f"text that begins with {lines[0][:40]!r}" if lines else "an empty file"


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
