"""Compile a C file and publish the library in one step; a program that needs nothing else.

    python build.py JOB KEY COMPILER [FLAG ...]

JOB is a folder of its own with the source. The library appears beside it, as KEY.DIGEST.so with a
digest of its content, and the folder is removed. It runs as a process of its own, which goes on
when the program that started it ends.
"""

from __future__ import annotations

import errno
import os
import shutil
import struct
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

SOURCE = "functions.c"
_OUTPUT = "library"
_NOT_IN_FILE = 8  # type of a section of zeros (SHT_NOBITS)


def build(job: Path, key: str, command: list[str]) -> Path:
    """Compile the source in the folder, remove the folder, and return the library.

    Raises:
        OSError: there is no space left, or the compiler cannot be started.
        subprocess.CalledProcessError: the compiler failed; stderr says why.
    """
    try:
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
        build(Path(sys.argv[1]), sys.argv[2], sys.argv[3:])
    except (OSError, subprocess.CalledProcessError) as failure:
        sys.exit(f"{failure}\n{getattr(failure, 'stderr', '') or ''}")
