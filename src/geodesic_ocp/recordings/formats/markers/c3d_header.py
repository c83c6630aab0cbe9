"""C3dHeader: the numbers at the beginning of a c3d file, and its parameters.

The layout is that of "The C3D File Format User Guide" (Motion Lab Systems): blocks of 512 bytes; a
header of 16-bit words; then groups and parameters, each with its name and the offset of the next.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError

BLOCK = 512
_DEC, _ORDERS = 85, {84: "<", 85: "<", 86: ">"}  # byte orders of Intel, DEC and MIPS
_TYPES = {1: "B", 2: "H", 4: "f"}
_SATURATED = 65535  # of a frame number in the header, in longer files


@dataclass(frozen=True)
class C3dHeader:
    """What describes the frames of a c3d file.

    Attributes:
        order: of bytes, "<" or ">".
        is_dec: whether floats are those of DEC.
        points: number of points in every frame.
        analog: number of analog samples in every frame.
        first, last: numbers of the first frame and of the last.
        scale: of integer coordinates; negative if coordinates are floats.
        rate: of frames [Hz].
        data: byte at which the frames begin.
        parameters: numbers or strings by group and name, in capitals.
    """

    order: str
    is_dec: bool
    points: int
    analog: int
    first: int
    last: int
    scale: float
    rate: float
    data: int
    parameters: Mapping[tuple[str, str], Array | list[str]]

    def strings(self, group: str, name: str) -> list[str]:
        """Strings of a parameter, without blanks around them; none if it has none."""
        values = self.parameters.get((group, name))
        return [value.strip(" \0") for value in values] if isinstance(values, list) else []

    def numbers(self, group: str, name: str, count: int = 1) -> Array | None:
        """At least `count` numbers of a parameter, or None."""
        values = self.parameters.get((group, name))
        return None if values is None or isinstance(values, list) or len(values) < count else values

    @property
    def frames(self) -> int:
        """Number of frames; in long files it is in parameters, as the header has 16 bits."""
        count = self.last - self.first + 1
        if self.first <= self.last < _SATURATED:
            return count
        start = self.numbers("TRIAL", "ACTUAL_START_FIELD", 2)
        end = self.numbers("TRIAL", "ACTUAL_END_FIELD", 2)
        if start is not None and end is not None:
            words = np.array([1.0, 65536.0])
            return int(words @ end[:2] - words @ start[:2]) + 1
        long = self.numbers("POINT", "LONG_FRAMES")
        return int(long[0]) if long is not None and math.isfinite(long[0]) else count


def read_c3d_header(file: Path, content: bytes) -> C3dHeader:
    """The header and the parameters of a c3d file.

    Raises:
        RecordingError: the file is cut off, or its header or parameters contradict themselves.
    """
    size, block = len(content), content[0] if content else 0
    start = BLOCK * (block - 1)
    if block < 2 or start + 4 > size:
        raise RecordingError(
            f"{file}: is cut off or broken: its {size} bytes have no block {block}, where the "
            "parameters should be"
        )
    processor = content[start + 3]
    if processor not in _ORDERS:
        raise RecordingError(f"{file}: names a processor of unknown type {processor}")
    order, is_dec = _ORDERS[processor], processor == _DEC
    points, analog, first, last = struct.unpack_from(f"{order}4H", content, 2)
    (data,) = struct.unpack_from(f"{order}H", content, 16)
    scale, rate = (floats(content[at : at + 4], order, is_dec)[0] for at in (12, 20))
    if data <= block:
        raise RecordingError(f"{file}: the header is broken: its data begin in block {data}")
    for name, value in {"scale": scale, "rate": rate}.items():
        if not math.isfinite(value) or value == 0.0 or (name == "rate" and value < 0.0):
            raise RecordingError(f"{file}: the header is broken: its {name} is {value:g}")
    parameters = _parameters(file, content, start + 4, order, is_dec)
    return C3dHeader(
        order, is_dec, points, analog, first, last, scale, rate, BLOCK * (data - 1), parameters
    )


def floats(content: bytes, order: str, is_dec: bool) -> Array:
    """Numbers of four bytes; DEC's have their words swapped and another offset of the exponent."""
    if is_dec:
        content = np.frombuffer(content, "<u2").reshape(-1, 2)[:, ::-1].tobytes()
    with np.errstate(invalid="ignore"):  # signalling NaN
        numbers = np.frombuffer(content, f"{order}f4").astype(float)
    return numbers / 4.0 if is_dec else numbers


def _parameters(
    file: Path, content: bytes, at: int, order: str, is_dec: bool
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
                f"{file}: the parameters are broken: {name!r} at byte {at} does not end where the "
                "next one begins"
            )
        at = offset_at + offset if offset > 0 else end
    raise RecordingError(f"{file}: is cut off or broken: the parameters at byte {at} do not end")


def _values(
    content: bytes, at: int, order: str, is_dec: bool
) -> tuple[Array | list[str], int | None]:
    """Values of a parameter, and where they end; None if their type is unknown or they do not."""
    kind, rank = struct.unpack_from("bB", content[at : at + 2].ljust(2, b"\0"))
    dimensions = content[at + 2 : at + 2 + rank]
    count, start = math.prod(dimensions), at + 2 + rank
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
