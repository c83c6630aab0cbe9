"""Lines of text files, the numbers in them and their units, and the file's name in messages."""

from __future__ import annotations

import csv
import math
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.errors import RecordingError

#: Radians in a unit of angle, by its name in lower case.
ANGLES = {
    **dict.fromkeys(("rad", "rads", "radian", "radians"), 1.0),
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "°"), np.pi / 180.0),
}
#: Metres in a unit of length, by its name in lower case.
LENGTHS = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), 1e-2),
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), 1e-3),
}


# No angle, length or coordinate of a person is larger in any unit, so that nothing overflows.
_LARGEST = 1e9


@contextmanager
def named_failures(file: Path) -> Iterator[None]:
    """Raise failures of the operating system, of decoding and of values as RecordingError.

    Readers of files work within it, so that their own messages need not name the file.
    """
    try:
        yield
    except OSError as failure:
        raise RecordingError(f"{file}: cannot be read: {failure.strerror or failure}") from None
    except csv.Error as failure:
        raise RecordingError(f"{file}: is not a table: {failure}") from None
    except UnicodeDecodeError as failure:
        raise RecordingError(
            f"{file}: is not text in UTF-8 (byte {failure.start}); save it as UTF-8"
        ) from None
    except ValueError as failure:
        if isinstance(failure, RecordingError) and str(failure).startswith(str(file)):
            raise
        raise RecordingError(f"{file}: {failure}") from None


def read_lines(file: Path) -> list[str]:
    """Return the lines of a text file, without their ends: UTF-8, UTF-16 or Latin 1."""
    content = file.read_bytes()
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = content.decode("utf-16", errors="replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:  # older programs write names in Latin 1
            text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def numbers(line: int | None, what: str, words: Sequence[str], count: int) -> list[float]:
    """Return `count` finite numbers from the words of a line, if the place is one.

    Raises:
        RecordingError: another count, or a word that is not a finite number; the message names the
            line and `what` they are.
    """
    what = what if line is None else f"line {line}: {what}"
    if len(words) != count:
        raise RecordingError(f"{what} has {len(words)} numbers, not {count}")
    try:
        values = [float(word) for word in words]
    except ValueError:
        shown = " ".join(words)[:40]
        raise RecordingError(f"{what} is not numeric: {shown!r}") from None
    for value in values:
        if not math.isfinite(value) or abs(value) > _LARGEST:
            raise RecordingError(f"{what} has the value {value:g}")
    return values


SAME_RATE = 0.01  # part by which two statements of one rate may differ


def stated(file: Path, what: str, *, own: float | None, given: float | None) -> float | None:
    """Return what a file states of itself or, where it says nothing, what was given.

    Where it states something else, a RuntimeWarning says so.

    Args:
        file: of the recording.
        what: it is about, with the name of the argument, such as "the rate [Hz] (rate)".
        own: the file's.
        given: the argument; None: not given.
    """
    if own is None:
        return given
    if given is not None and not abs(own - given) <= SAME_RATE * abs(own):
        shown, other = (
            str(each) if isinstance(each, bool) else f"{each:g}" for each in (own, given)
        )
        warnings.warn(
            f"{file}: {what} is {shown}, as the file states, not {other}",
            RuntimeWarning,
            stacklevel=4,
        )
    return own


def stated_rate(file: Path, own: float | None, given: float | None) -> float | None:
    """Return the rate [Hz] that a file states or, where it says nothing, the one that was given."""
    return stated(file, "the rate [Hz] (rate)", own=own, given=given)


def rate_of(time: Array) -> float | None:
    """Return the mean rate [Hz] of times (k,), or None if they are not increasing."""
    lasting = time.size > 1 and time[-1] > time[0]
    return (time.size - 1) / float(time[-1] - time[0]) if lasting else None


@contextmanager
def unless_stated() -> Iterator[None]:
    """Yield without the warnings of `stated`: of many files, each takes what it does not state."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*, as the file states, not ", RuntimeWarning)
        yield


def times_at(count: int, rate: float) -> Array:
    """Return the times (k,) [s] of so many samples at a rate [Hz], from zero on."""
    return np.arange(count) / as_positive("rate", rate, "Hz")


_LONGEST_STEP = 1.0  # [s] between samples of a recording


def check_seconds(time: Array) -> None:
    """Raise ValueError, which asks for the unit, if samples at times (k,) are a second apart."""
    step = float(np.median(np.diff(time)))
    if step >= _LONGEST_STEP:
        raise ValueError(
            f"samples are {step:g} s apart: is time in milliseconds? It must be in s; the header "
            "of a table may say 'time [ms]'"
        )


_TIMES = ("time", "t", "zeit", "timestamp")


def name_and_unit(cell: str) -> tuple[str, str]:
    """Return a column's name and unit: "Time (s)" is Time in s; the unit may be empty."""
    found = re.fullmatch(r"(.*?)\s*[(\[]\s*([^)\]]*?)\s*[)\]]", cell)
    return (found[1], found[2].lower()) if found and found[1] else (cell, "")


def is_time(cell: str) -> bool:
    """Return whether a column of this name is the time."""
    return name_and_unit(cell)[0].lower() in _TIMES
