"""CSV files as columns and lines of text."""

from __future__ import annotations

import csv
from pathlib import Path

from geodesic_ocp.errors import RecordingError


def read_text_table(file: Path) -> tuple[list[str], list[tuple[str, list[str]]]]:
    """Names of the columns of a CSV file, and its lines, each with its place in the file.

    Raises:
        RecordingError: the file cannot be read, or a line does not fit the columns.
    """
    lines: list[tuple[str, list[str]]] = []
    number = 0
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.reader(stream, strict=True)
            names = next(reader, [])
            number = reader.line_num
            for values in reader:
                where = f"line {number + 1}"
                number = reader.line_num
                if values and len(values) != len(names):
                    raise RecordingError(
                        f"{file}: {where}: {len(values)} values under {len(names)} columns"
                    )
                if values:
                    lines.append((where, values))
    except UnicodeDecodeError as error:
        raise RecordingError(f"{file}: is not text in UTF-8: {error}") from None
    except csv.Error as error:
        raise RecordingError(f"{file}: line {number + 1}: is not CSV: {error}") from None
    except OSError as error:
        raise RecordingError(f"{file}: cannot be read: {error}") from None
    if len(names) == 1 and {";", "\t"} & set(names[0]):
        raise RecordingError(f"{file}: line 1: separate columns by commas, got {names[0][:60]!r}")
    if not names:
        raise RecordingError(f"{file}: line 1: is empty, expected the names of columns")
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise RecordingError(f"{file}: line 1: column {', '.join(twice)} is there twice")
    return names, lines
