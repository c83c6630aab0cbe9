"""JSON files with a format name and a version, and writing of several files at once."""

from __future__ import annotations

import json
import lzma
import math
import os
import secrets
import struct
import tempfile
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

from geodesic_ocp.errors import RecordingError

# What zipfile, its decompressors and NumPy raise of a damaged archive of arrays.
UNREADABLE_ARCHIVE = (
    *(OSError, ValueError, EOFError, KeyError, TypeError, SyntaxError, MemoryError, OverflowError),
    *(AttributeError, NotImplementedError, RuntimeError, struct.error, tokenize.TokenError),
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError),
)
TEMPORARY = ".writing-"  # start of the names of files that are being written


def read_record(file: str | PathLike[str], name: str, version: int, what: str) -> dict[str, Any]:
    """Read the object in a JSON file of format `name`; messages call its content `what`.

    Raises:
        RecordingError: the file is missing, cannot be read, or is of another format or version.
    """
    path = Path(file)
    if not path.is_file():
        raise RecordingError(f"{path}: there is no such file")
    try:
        record = parse_json(path.read_text(encoding="utf-8"))
    except OSError as failure:
        raise RecordingError(f"{path}: cannot be read: {failure}") from None
    except (ValueError, RecursionError) as failure:
        raise RecordingError(f"{path}: is not JSON: {failure}") from None
    if not isinstance(record, dict) or record.get("format") != name:
        raise RecordingError(f"{path}: is not a file of {what}")
    if record.get("version") != version:
        raise RecordingError(f"{path}: has version {record.get('version')}, expected {version}")
    return record


def parse_json(text: str) -> Any:
    """The value of a JSON text, whose integers have a floating-point value.

    Raises:
        ValueError: it is no JSON, or has an integer beyond the range of floating-point numbers.
        RecursionError: it is nested too deeply.
    """
    return json.loads(text, parse_int=_integer)


def _integer(digits: str) -> int:
    if not math.isfinite(float(digits)):
        raise ValueError(f"the integer {digits:.20}... is too large")
    return int(digits)


def write_together(folder: str | Path, write: Callable[[Path], object]) -> list[Path]:
    """Write files to a temporary folder, move them to `folder` together, and return their paths.

    Raises:
        OSError: the folder cannot be created or written to.
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target, prefix=TEMPORARY) as temporary:
        write(Path(temporary))
        return sorted(file.replace(target / file.name) for file in Path(temporary).iterdir())


def write_file(file: str | PathLike[str], text: str, *, lasting: bool = False) -> Path:
    """Write a text file all at once, see `replacing`.

    Raises:
        OSError: the file cannot be written.
    """
    target = Path(file)
    with replacing(target, lasting=lasting) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return target


@contextmanager
def replacing(target: Path, *, lasting: bool = False) -> Iterator[Path]:
    """A path in the same folder, whose file becomes the target; a failure leaves that as it was.

    The file has the permissions of any new one. If lasting, it is on the disk when this ends.

    Raises:
        OSError: the file cannot be written.
    """
    if not target.parent.is_dir():
        raise FileNotFoundError(f"{target}: there is no folder {target.parent}")
    temporary = target.with_name(f"{TEMPORARY}{secrets.token_hex(8)}")
    try:
        yield temporary
        if lasting:
            _to_disk(temporary)
        temporary.replace(target)
    except BaseException as failure:
        temporary.unlink(missing_ok=True)
        if isinstance(failure, OSError) and str(failure.filename) == str(temporary):
            failure.filename = str(target)  # the one that the user knows
            del failure.filename2
        raise
    if lasting:
        _to_disk(target.parent)


def _to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
