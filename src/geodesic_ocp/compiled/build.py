"""Compile one C file and publish the library in one step; a program that needs nothing else.

    python build.py SOURCE KEY COMPILER [FLAG ...]

The library appears beside the source as KEY.DIGEST.so (`cache.file_name`), and the source is
removed. It runs as a process of its own, which goes on when the program that started it ends.
"""

from __future__ import annotations

import os
import subprocess
import sys
from hashlib import sha256
from pathlib import Path


def build(source: Path, key: str, command: list[str]) -> Path:
    """Compile `source`, remove it, and return the library.

    Raises:
        OSError: the folder cannot be written to, or the compiler cannot be started.
        subprocess.CalledProcessError: the compiler failed; stderr says why.
    """
    output = source.with_suffix(".part")
    try:
        subprocess.run(
            [*command, str(source), "-o", str(output)],
            check=True,
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
        )
        digest = sha256(output.read_bytes()).hexdigest()[:32]
        library = source.with_name(f"{key}.{digest}.so")
        os.replace(output, library)
    finally:
        source.unlink(missing_ok=True)
        output.unlink(missing_ok=True)
    return library


if __name__ == "__main__":
    try:
        build(Path(sys.argv[1]), sys.argv[2], sys.argv[3:])
    except (OSError, subprocess.CalledProcessError) as failure:
        sys.exit(f"{failure}\n{getattr(failure, 'stderr', '') or ''}")
