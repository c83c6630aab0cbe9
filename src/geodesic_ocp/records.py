"""JSON files that name their format and version."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

from geodesic_ocp.errors import RecordingError


def read_record(file: str | PathLike[str], form: str, version: int, what: str) -> dict[str, Any]:
    """The object in a JSON file of this format and version; `what` says in messages what it holds.

    Raises:
        RecordingError: the file is missing, cannot be read, or is of another format or version.
    """
    path = Path(file)
    if not path.is_file():
        raise RecordingError(f"{path}: there is no such file")
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except OSError as failure:
        raise RecordingError(f"{path}: cannot be read: {failure}") from None
    except (ValueError, RecursionError) as failure:
        raise RecordingError(f"{path}: is not JSON: {failure}") from None
    if not isinstance(record, dict) or record.get("format") != form:
        raise RecordingError(f"{path}: is not a file of {what}")
    if record.get("version") != version:
        raise RecordingError(f"{path}: has version {record.get('version')}, expected {version}")
    return record


def write_together(folder: str | Path, write: Callable[[Path], object]) -> list[Path]:
    """Let files be written to a folder elsewhere, and move them in together; their paths.

    Raises:
        OSError: the folder cannot be made or written to.
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target, prefix=".writing-") as temporary:
        made = Path(temporary)
        write(made)
        return sorted(file.replace(target / file.name) for file in made.iterdir())
