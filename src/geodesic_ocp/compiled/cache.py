"""The user's cache of compiled libraries, and the program that adds one.

A library's file name holds the key of its sources and a digest of its content, so that it appears
in one step, complete, and a damaged file is noticed and built again. The size of a file KEY.use
tells for how long the library has been used. Nothing is loaded from a folder that other users can
change: where the cache is not private, a temporary folder is used.

    python cache.py JOB KEY COMPILER [FLAG ...]

compiles the source in JOB, a folder of its own. The library appears beside it, as KEY.DIGEST.so,
and the folder is removed. It runs as a process of its own, which goes on when the program that
started it ends, and waits until others beside it have ended. A lock on JOB tells others that
somebody works there. It imports nothing of this package.
"""

from __future__ import annotations

import atexit
import errno
import os
import re
import shutil
import stat
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path

if sys.platform != "win32":
    import fcntl

ENVIRONMENT_VARIABLE = "GEODESIC_OCP_CACHE"
_LIBRARY = re.compile(r"[0-9a-f]{32}\.[0-9a-f]{32}\.so")
_USE = re.compile(r"[0-9a-f]{32}\.use")
# Use of a library that one byte stands for [s].
_USE_STEP = 1e-3
_JOB = "build-"
# in the folder of a job
_SOURCE = "functions.c"
_OUTPUT = "library"
_NOT_IN_FILE = 8  # type of a section of zeros (SHT_NOBITS)
# A build that has not ended after this time was interrupted [s].
_STALE = 1800.0
# Time after which somebody works at a new job, and keeps it locked [s].
_GRACE = 5.0
# Size beyond which the libraries that have not been used for the longest time are removed [bytes].
_LARGEST = 500_000_000
# Space that suffices for a library and the files of a compiler [bytes].
_ENOUGH = 50_000_000
# Time between looks at the job of another process [s].
_PAUSE = 0.02
# The temporary folder of this process; a forked process makes its own.
_temporary: dict[int, Path] = {}


def cache_folder() -> Path:
    """Return the folder of compiled libraries: $GEODESIC_OCP_CACHE, or in the user's cache."""
    if chosen := os.environ.get(ENVIRONMENT_VARIABLE):
        return Path(chosen).expanduser().absolute() / "compiled"
    from platformdirs import user_cache_path

    return user_cache_path("geodesic_ocp") / "compiled"


def why_unused(folder: Path) -> str:
    """Return why libraries are not kept in this folder; empty if they are, and then it exists."""
    if not folder.is_absolute():
        return f"there is no home folder; set {ENVIRONMENT_VARIABLE}"
    try:
        _make_private(folder)
        return why_not_private(folder)
    except OSError as error:
        return str(error)


def _make_private(folder: Path) -> None:
    """Create the folder and its missing parents for this user alone, whatever the umask is."""
    if not folder.is_dir():
        _make_private(folder.parent)
        folder.mkdir(mode=0o700, exist_ok=True)


def why_not_private(folder: Path) -> str:
    """Return which folder on the path another user could change, and why; empty if none."""
    if not hasattr(os, "getuid"):
        return ""
    resolved = folder.resolve()
    for each in (resolved, *resolved.parents):
        status = each.stat()
        if status.st_uid not in (0, os.getuid()):
            return f"{each} belongs to another user"
        # In a sticky folder, such as /tmp, nobody can replace what belongs to others.
        is_sticky = each != resolved and status.st_mode & stat.S_ISVTX
        if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and not is_sticky:
            return f"{each} can be written to by other users"
    return ""


def _temporary_folder() -> Path:
    process = os.getpid()
    if process not in _temporary:
        _temporary[process] = folder = Path(tempfile.mkdtemp(prefix="geodesic_ocp-")).resolve()

        def remove_own() -> None:
            if os.getpid() == process:
                shutil.rmtree(folder, ignore_errors=True)

        atexit.register(remove_own)
    return _temporary[process]


def writable_folders() -> Iterator[Path]:
    """Yield private folders in the order in which they are tried: the cache, then a temporary one.

    Their paths contain no links, which others might change after the check.
    """
    folder = cache_folder()
    if not why_unused(folder):
        yield folder.resolve()
    with suppress(OSError):  # there is no temporary folder either
        folder = _temporary_folder()
        if not why_unused(folder):
            yield folder


def new_job(folder: Path, text: str, name: str) -> Path:
    """Return a new folder in which a source is compiled.

    Raises:
        FileExistsError: there is a job of this name.
        OSError: the folder cannot be written to, or has no space left.
    """
    for job in folder.glob(f"{_JOB}*"):
        if is_stale(job):
            shutil.rmtree(job, ignore_errors=True)
    job = folder / f"{_JOB}{name}"
    job.mkdir(mode=0o700)
    try:
        (job / _SOURCE).write_text(text, encoding="utf-8")
    except OSError:
        shutil.rmtree(job, ignore_errors=True)
        raise
    return job


def is_stale(job: Path) -> bool:
    """Return whether the process that worked at this job was interrupted, or has ended."""
    try:
        age = time.time() - job.stat().st_mtime
        return age > _STALE or (age > _GRACE and not is_locked(job))
    except OSError:
        return True


def wait_for_job(folder: Path, name: str) -> None:
    """Wait until another process has ended this job."""
    while not is_stale(folder / f"{_JOB}{name}"):
        time.sleep(_PAUSE)


def has_space(folder: Path) -> bool:
    """Return whether a compiler that failed there had enough space."""
    try:
        return shutil.disk_usage(folder).free > _ENOUGH
    except OSError:
        return False


def find(key: str) -> Path | None:
    """Return the undamaged library with this key; damaged ones are removed."""
    folders = [folder.resolve() for folder in [cache_folder()] if not why_unused(folder)]
    if (temporary := _temporary.get(os.getpid())) is not None and not why_unused(temporary):
        folders.append(temporary)
    for file in [file for folder in folders for file in sorted(folder.glob(f"{key}.*.so"))]:
        with suppress(OSError):
            if _is_own(file) and file.name == file_name(key, file.read_bytes()):
                with suppress(OSError):  # it may belong to the administrator
                    os.utime(file)
                return file
            file.unlink()
    return None


def use(file: Path) -> float:
    """Return for how long all processes have used this library [s], since `forget_use`."""
    try:
        return _use_file(file).lstat().st_size * _USE_STEP
    except OSError:
        return 0.0


def add_use(file: Path, seconds: float) -> None:
    """Remember use of this library; other processes may do the same at the same time."""
    with suppress(OSError):
        descriptor = os.open(_use_file(file), os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        with open(descriptor, "ab", buffering=0) as stream:
            stream.write(b"." * round(seconds / _USE_STEP))


def forget_use(file: Path) -> None:
    """Begin again to add up the use of this library."""
    with suppress(OSError):
        _use_file(file).unlink()


def _use_file(file: Path) -> Path:
    return file.with_name(f"{file.name.partition('.')[0]}.use")


def _is_own(file: Path) -> bool:
    """Return whether nobody else can have written the file, now or earlier."""
    status = file.lstat()
    is_shared = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    owners = (0, os.getuid()) if hasattr(os, "getuid") else (status.st_uid,)
    return stat.S_ISREG(status.st_mode) and not is_shared and status.st_uid in owners


def stored() -> list[Path]:
    """Return all libraries in the cache."""
    return _named(_LIBRARY)


def _named(pattern: re.Pattern[str]) -> list[Path]:
    try:
        return sorted(file for file in cache_folder().iterdir() if pattern.fullmatch(file.name))
    except OSError:
        return []


def limit_size() -> None:
    """Remove the libraries that have not been used for the longest time from a large cache."""
    try:
        status = [(file.stat().st_mtime, file.stat().st_size, file) for file in stored()]
        total = 0
        for _, size, file in sorted(status, reverse=True):
            total += size
            if total > _LARGEST:
                file.unlink()
                forget_use(file)
    except OSError:  # another process does the same
        return


def clear() -> int:
    """Remove libraries, notes of use and unfinished builds; returns the number of libraries.

    Raises:
        OSError: a library cannot be removed.
    """
    files = stored()
    for file in [*files, *_named(_USE)]:
        file.unlink(missing_ok=True)
    for job in cache_folder().glob(f"{_JOB}*"):
        shutil.rmtree(job, ignore_errors=True)
    return len(files)


@contextmanager
def lock(folder: Path, alone: bool = False) -> Iterator[None]:
    """Hold a lock on a folder, which ends with the process at the latest.

    Args:
        folder: folder to lock; nothing is done where its file system has no locks.
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
    """Return whether a process has a lock on the folder, or that cannot be told."""
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
                [*command, _SOURCE, "-o", _OUTPUT],
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
    """Return name of the library with this key and content."""
    return f"{key}.{sha256(content).hexdigest()[:32]}.so"


def is_complete(content: bytes) -> bool:
    """Return whether a 64-bit ELF file holds all of its sections; True for other formats."""
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
