"""Compile a C file and publish the library in one step; a program that needs nothing else.

    python build.py JOB KEY COMPILER [FLAG ...]

JOB is a folder of its own with the source. The library appears beside it, as KEY.DIGEST.so with a
digest of its content, and the folder is removed. It runs as a process of its own, which goes on
when the program that started it ends, and waits until others beside it have ended. A lock on JOB
tells others that somebody works there.
"""

from __future__ import annotations

import errno
import os
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path

if sys.platform != "win32":
    import fcntl

SOURCE = "functions.c"
_OUTPUT = "library"
_NOT_IN_FILE = 8  # type of a section of zeros (SHT_NOBITS)


@contextmanager
def lock(folder: Path, alone: bool = False) -> Iterator[None]:
    """Hold a lock on a folder, which ends with the process at the latest.

    Args:
        folder: with nothing done where its file system has no locks.
        alone: wait until nobody else has a lock on it.
    """
    if sys.platform == "win32":
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        yield
    finally:
        os.close(descriptor)


def is_locked(folder: Path) -> bool:
    """Whether a process has a lock on the folder, or that cannot be told."""
    if sys.platform == "win32":
        return True
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False


def build(job: Path, key: str, command: list[str]) -> Path:
    """Compile the source in the folder, remove the folder, and return the library.

    Raises:
        OSError: there is no space left, or the compiler cannot be started.
        subprocess.CalledProcessError: the compiler failed; stderr says why.
    """
    try:
        with lock(job):
            # Relative names, so that equal sources become equal libraries.
            subprocess.run(
                [*command, SOURCE, "-o", _OUTPUT],
                check=True,
                capture_output=True,
                text=True,
                errors="replace",
                stdin=subprocess.DEVNULL,
                cwd=job,
                env={**os.environ, "TMPDIR": str(job)},
            )
        output = job / _OUTPUT
        content = output.read_bytes()
        if not is_complete(content):  # TinyCC does not notice a full disk
            raise OSError(errno.ENOSPC, "the compiled library is incomplete", str(output))
        output.chmod(0o700)
        library = job.with_name(file_name(key, content))
        os.replace(output, library)
    finally:
        shutil.rmtree(job, ignore_errors=True)
    return library


def file_name(key: str, content: bytes) -> str:
    """Name of the library with this key and content."""
    return f"{key}.{sha256(content).hexdigest()[:32]}.so"


def is_complete(content: bytes) -> bool:
    """Whether a 64-bit ELF file holds all of its sections; True for libraries of other formats."""
    if len(content) < 64 or content[:5] != b"\x7fELF\x02":
        return len(content) >= 64
    (start,) = struct.unpack_from("=Q", content, 40)
    size, count = struct.unpack_from("=HH", content, 58)
    if start + size * count > len(content):
        return False
    for at in range(start, start + size * count, size):
        (section,) = struct.unpack_from("=I", content, at + 4)
        offset, length = struct.unpack_from("=QQ", content, at + 24)
        if section != _NOT_IN_FILE and offset + length > len(content):
            return False
    return True


if __name__ == "__main__":
    os.nice(10)
    try:
        folder = Path(sys.argv[1])
        with lock(folder), lock(folder.parent, alone=True):
            build(folder, sys.argv[2], sys.argv[3:])
    except (OSError, subprocess.CalledProcessError) as failure:
        sys.exit(f"{failure}\n{getattr(failure, 'stderr', '') or ''}")
