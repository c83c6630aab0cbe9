"""Numbers in the cells of tables."""

from __future__ import annotations

import math

from geodesic_ocp.errors import RecordingError


def finite_number(where: str, name: str, text: str) -> float:
    """The number in a cell.

    Args:
        where: the file and the line.
        name: of the column.
        text: in the cell.

    Raises:
        RecordingError: the text is not a finite number.
    """
    try:
        number = float(text)
    except ValueError:
        raise RecordingError(f"{where}: {name} is not a number: {text[:40]!r}") from None
    if not math.isfinite(number):
        raise RecordingError(f"{where}: {name} is {number}")
    return number
