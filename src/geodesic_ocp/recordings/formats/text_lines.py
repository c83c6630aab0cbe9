"""Lines of text files, and the numbers in them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from geodesic_ocp.errors import RecordingError

# No angle, length or coordinate of a person is larger in any unit, so that nothing overflows.
_LARGEST = 1e9


def read_lines(file: Path) -> list[str]:
    """Return the lines of a text file, without their ends: UTF-8, UTF-16 or Latin 1.

    Raises:
        RecordingError: the file cannot be read.
    """
    try:
        content = file.read_bytes()
    except OSError as failure:
        raise RecordingError(f"{file}: cannot be read: {failure.strerror}") from None
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = content.decode("utf-16", errors="replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:  # older programs write names in Latin 1
            text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def numbers(file: Path, line: int, what: str, words: Sequence[str], count: int) -> list[float]:
    """`count` finite numbers from the words of a line.

    Raises:
        RecordingError: another count, or a word that is not a finite number; the message names the
            file, the line and `what` they are.
    """
    if len(words) != count:
        raise RecordingError(f"{file}: line {line}: {what} has {len(words)} numbers, not {count}")
    try:
        values = [float(word) for word in words]
    except ValueError:
        shown = " ".join(words)[:40]
        raise RecordingError(f"{file}: line {line}: {what} is not numeric: {shown!r}") from None
    for value in values:
        if not math.isfinite(value) or abs(value) > _LARGEST:
            raise RecordingError(f"{file}: line {line}: {what} has the value {value:g}")
    return values
