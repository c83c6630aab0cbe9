"""A lock on a folder, which the system releases however the process ends."""

from __future__ import annotations

import errno
import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_FILE = ".lock"


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the folder for this run alone.

    Raises:
        ValueError: another run works in this folder; names its process.
        OSError: the folder cannot be written to.
    """
    with open(folder / _FILE, "a+", encoding="utf-8") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as failure:
            if failure.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                raise
            stream.seek(0)
            who = stream.read().strip() or "unknown"
            raise ValueError(
                f"{folder}: another run works in this folder (process {who}); wait for it to end, "
                "or choose another folder"
            ) from None
        stream.truncate(0)
        stream.write(f"{os.getpid()}\n")
        stream.flush()
        yield
