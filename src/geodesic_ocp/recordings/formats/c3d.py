"""c3d: positions of markers in binary files.

The layout is that of "The C3D File Format User Guide" (Motion Lab Systems): blocks of 512 bytes; a
header of 16-bit words; then groups and parameters, each with its name and the offset of the next.

Points without a label, or with one that begins with an asterisk, belong to no marker that could be
named and are left out; so are the angles, forces, moments and powers of a model, which some
programs store as points. A marker is missing where its residual is negative, and where it is
exactly at the origin with a residual of zero. Time starts at zero.

The library ezc3d is not used: version 1.7.2 ends the process with a segmentation fault on files
whose parameters are incomplete. The tests compare with it.
"""

from __future__ import annotations

import math
import struct
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.recordings.markers.people import distinct_labels
from geodesic_ocp.trajectory.files.text_lines import LENGTHS, named_failures
from geodesic_ocp.trajectory.motion import Subject

BLOCK = 512
# byte orders of Intel, DEC and MIPS
_DEC = 85
_ORDERS = {84: "<", 85: "<", 86: ">"}
_TYPES = {1: "B", 2: "H", 4: "f"}
_SATURATED = 65535  # of a frame number in the header, in longer files


@dataclass(frozen=True)
class C3dHeader:
    """Description of the frames of a c3d file."""

    order: str  # order of bytes, "<" or ">"
    is_dec: bool  # whether floats are those of DEC
    points: int  # number of points in every frame
    analog: int  # number of analog samples in every frame
    # first, last: numbers of the first frame and of the last
    first: int
    last: int
    scale: float  # scale of integer coordinates; negative if coordinates are floats
    rate: float  # rate of frames [Hz]
    data: int  # byte at which the frames begin
    # numbers or strings by group and name, in capitals
    parameters: Mapping[tuple[str, str], Array | list[str]]

    def strings(self, group: str, name: str) -> list[str]:
        """Return strings of a parameter, without blanks around them; none if it has none."""
        values = self.parameters.get((group, name))
        return [value.strip(" \0") for value in values] if isinstance(values, list) else []

    def number(self, group: str, name: str, words: int = 1) -> float | None:
        """Return the number in the first words of 16 bits of a parameter, None without them."""
        values = self.parameters.get((group, name))
        if values is None or isinstance(values, list) or len(values) < words:
            return None
        return float(np.array([1.0, 65536.0])[:words] @ values[:words])

    def held_frames(self, content: bytes) -> int:
        """Return the number of frames up to the last byte that is not zero.

        Zeros fill up the last block of a file.
        """
        written = len(content.rstrip(b"\0")) - self.data
        return max(0, min(-(-written // self.frame_size), self.room(content)))

    def room(self, content: bytes) -> int:
        """Return the number of whole frames for which the content of the file is long enough."""
        return max(len(content) - self.data, 0) // self.frame_size

    @property
    def frame_size(self) -> int:
        """Bytes of a frame."""
        return (4 * self.points + self.analog) * (4 if self.scale < 0.0 else 2)

    def frames(self, content: bytes) -> int:
        """Return the number of frames.

        The header has 16 bits for it, which programs let saturate or overflow in long files. Then
        the number is in parameters, or follows from the size of the file.
        """
        count = self.last - self.first + 1
        held = self.held_frames(content)
        if held > 0 and (held - count) % (_SATURATED + 1) == 0:
            return held
        if self.first <= self.last < _SATURATED:
            return count
        start = self.number("TRIAL", "ACTUAL_START_FIELD", 2)
        end = self.number("TRIAL", "ACTUAL_END_FIELD", 2)
        if start is not None and end is not None:
            return int(end - start) + 1
        stated = (self.number("POINT", name) for name in ("LONG_FRAMES", "FRAMES"))
        long = [each for each in stated if each is not None and _SATURATED < each < math.inf]
        if long:
            return int(long[0])
        return held if self.last == _SATURATED else count


def read_c3d_header(content: bytes) -> C3dHeader:
    """Return the header and the parameters of a c3d file.

    Raises:
        RecordingError: the file is cut off, or its header or parameters contradict themselves.
    """
    size = len(content)
    block = content[0] if content else 0
    start = BLOCK * (block - 1)
    if block < 2 or start + 4 > size:
        raise RecordingError(
            f"is cut off or broken: its {size} bytes have no block {block}, where the "
            "parameters should be"
        )
    processor = content[start + 3]
    if processor not in _ORDERS:
        raise RecordingError(f"names a processor of unknown type {processor}")
    order = _ORDERS[processor]
    is_dec = processor == _DEC
    points, analog, first, last = struct.unpack_from(f"{order}4H", content, 2)
    (data,) = struct.unpack_from(f"{order}H", content, 16)
    scale, rate = (floats(content[at : at + 4], order, is_dec)[0] for at in (12, 20))
    if data <= block:
        raise RecordingError(f"the header is broken: its data begin in block {data}")
    for name, value in {"scale": scale, "rate": rate}.items():
        if not math.isfinite(value) or value == 0.0 or (name == "rate" and value < 0.0):
            raise RecordingError(f"the header is broken: its {name} is {value:g}")
    parameters = _parameters(content, start + 4, order, is_dec)
    return C3dHeader(
        order, is_dec, points, analog, first, last, scale, rate, BLOCK * (data - 1), parameters
    )


def floats(content: bytes, order: str, is_dec: bool) -> Array:
    """Return numbers of four bytes; DEC's have their words swapped and another offset of the
    exponent.
    """
    if is_dec:
        content = np.frombuffer(content, "<u2").reshape(-1, 2)[:, ::-1].tobytes()
    with np.errstate(invalid="ignore"):  # signalling NaN
        numbers = np.frombuffer(content, f"{order}f4").astype(float)
    return numbers / 4.0 if is_dec else numbers


def _parameters(
    content: bytes, at: int, order: str, is_dec: bool
) -> dict[tuple[str, str], Array | list[str]]:
    """Follow the chain of groups and parameters to its end, within the file."""
    groups: dict[int, str] = {}
    values: dict[tuple[int, str], Array | list[str]] = {}
    offset = 1
    while at + 2 <= len(content):
        length, group = struct.unpack_from("2b", content, at)
        if offset == 0 or length == 0 or group == 0:
            return {(groups.get(key, ""), name): value for (key, name), value in values.items()}
        offset_at = at + 2 + abs(length)
        if offset_at + 2 > len(content):
            break
        name = content[at + 2 : offset_at].decode("latin-1").upper()
        (offset,) = struct.unpack_from(f"{order}H", content, offset_at)
        end: int | None = offset_at + 2
        if group < 0:
            groups.setdefault(-group, name)
        else:
            values[group, name], end = _values(content, offset_at + 2, order, is_dec)
        if end is None or end > len(content) or (offset > 0 and offset_at + offset < end):
            raise RecordingError(
                f"the parameters are broken: {name!r} at byte {at} does not end where the "
                "next one begins"
            )
        at = offset_at + offset if offset > 0 else end
    raise RecordingError(f"is cut off or broken: the parameters at byte {at} do not end")


def _values(
    content: bytes, at: int, order: str, is_dec: bool
) -> tuple[Array | list[str], int | None]:
    """Return values of a parameter, and where they end; None if their type is unknown or they do
    not.
    """
    kind, rank = struct.unpack_from("bB", content[at : at + 2].ljust(2, b"\0"))
    dimensions = content[at + 2 : at + 2 + rank]
    count = math.prod(dimensions)
    start = at + 2 + rank
    end = start + abs(kind) * count
    raw = content[start:end]
    if kind not in (-1, *_TYPES) or len(dimensions) < rank or end > len(content):
        return [], None
    if kind == -1:
        length = dimensions[0] if rank else 1
        text = raw.decode("latin-1")
        return [text[i : i + length] for i in range(0, len(text), max(length, 1))], end
    if kind == 4:
        return floats(raw, order, is_dec), end
    return np.frombuffer(raw, f"{order}{_TYPES[kind]}").astype(float), end


_NO_POSITIONS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")
_SAME_RATE = 0.01
_SHOWN = 20  # segments in a message


def read_c3d(file: Path) -> Markers:
    """Read all markers that have a label.

    Raises:
        RecordingError: the file is broken or cut off, has no markers, or gives no known unit.
    """
    with named_failures(file):
        content = file.read_bytes()
        header = read_c3d_header(content)
        if header.points == 0:
            only = ", only analog data" if header.analog else ""
            if segments := header.strings("ROTATION", "LABELS"):
                only = f", only rotations of {', '.join(segments[:_SHOWN])}, which are not read"
            raise RecordingError(f"has no markers{only}")
        _check_counts(file, header, content)
        unit = next(iter(header.strings("POINT", "UNITS")), "")
        if unit.lower() not in LENGTHS:
            raise RecordingError(f"POINT:UNITS must be m, cm or mm, is {unit!r}")
        others = {name for kind in _NO_POSITIONS for name in header.strings("POINT", kind)}
        labels = {
            index: label
            for index, label in enumerate(_labels(header)[: header.points])
            if label and not label.startswith("*") and label not in others
        }
        if not labels:
            raise RecordingError(f"none of its {header.points} points has a marker's label")
        names = distinct_labels(file, list(labels.values()))
        subjects = header.strings("SUBJECTS", "NAMES")
        points = _points(header, content)[:, list(labels)]
        positions = points[:, :, :3]
        residuals = points[:, :, 3]
        missing = (residuals < 0.0) | ((residuals == 0.0) & np.all(positions == 0.0, axis=2))
        positions = np.where(missing[:, :, None], np.nan, LENGTHS[unit.lower()] * positions)
        time = np.arange(len(points)) / header.rate
        person = Subject(name=subjects[0] if len(subjects) == 1 else "")
        return Markers(time, tuple(names), positions, person)


def _check_counts(file: Path, header: C3dHeader, content: bytes) -> None:
    """Check that header, parameters and size of the file agree.

    Raises:
        RecordingError: header and parameters differ, or count too many frames.

    Warns:
        RuntimeWarning: they count fewer frames than the file holds.
    """
    frames = header.frames(content)
    for what, count, name in (("points", header.points, "USED"), ("frames", frames, "FRAMES")):
        stated = header.number("POINT", name)
        if stated is not None and count < _SATURATED and stated != count:
            raise RecordingError(
                f"is broken: the header counts {count} {what}, POINT:{name} {stated:g}"
            )
    rate = header.number("POINT", "RATE")
    if rate is not None and not abs(rate - header.rate) <= _SAME_RATE * header.rate:
        raise RecordingError(
            f"is broken: the rate is {header.rate:g} Hz in the header, {rate:g} Hz in POINT:RATE"
        )
    room = header.room(content)
    held = header.held_frames(content)
    if frames < 1:
        raise RecordingError(
            f"the header is broken: it counts frames {header.first} to {header.last}"
        )
    if frames > room:
        raise RecordingError(f"is cut off: the header counts {frames} frames, there are {room}")
    if frames < held:
        warnings.warn(
            f"{file}: its header counts {frames} frames, which are read, but the file has room for "
            f"{held}: is it that of another file?",
            RuntimeWarning,
            stacklevel=4,
        )


def _points(header: C3dHeader, content: bytes) -> Array:
    """Return coordinates in the unit of the file, and residual, of every point (frames, points, 4).

    The residual, with the mask of cameras in its other byte, is only compared with zero.
    """
    frames = header.frames(content)
    raw = content[header.data : header.data + frames * header.frame_size]
    words = (
        floats(raw, header.order, header.is_dec)
        if header.scale < 0.0
        else np.frombuffer(raw, f"{header.order}i2").astype(float)
    )
    own = words.reshape(frames, -1)[:, : 4 * header.points]
    points = own.reshape(frames, header.points, 4).copy()
    if header.scale > 0.0:
        points[:, :, :3] *= header.scale
    return points


def _labels(header: C3dHeader) -> list[str]:
    """Return labels of the points; beyond 255 they continue in LABELS2, LABELS3, ..."""
    numbers = [
        int(name[6:])
        for group, name in header.parameters
        if group == "POINT" and name.startswith("LABELS") and name[6:].isdecimal()
    ]
    names = ["LABELS", *(f"LABELS{number}" for number in sorted(numbers))]
    return [label for name in names for label in header.strings("POINT", name)]
