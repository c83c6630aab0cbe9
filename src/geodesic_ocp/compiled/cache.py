"""The user's cache of compiled libraries.

A library's file name holds the key of what it was made from and a digest of its content, so that it
appears in one step, complete, and a damaged file is noticed and made anew. Nothing is loaded from
a folder that other users can write to: where the cache is not private, a temporary folder is used.
"""

from __future__ import annotations

import os
import stat
import tempfile
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

from platformdirs import user_cache_path

ENVIRONMENT_VARIABLE = "GEODESIC_OCP_CACHE"
_SUFFIX = ".so"


def cache_folder() -> Path:
    """Where compiled libraries are kept: $GEODESIC_OCP_CACHE, or a folder of the user's cache."""
    chosen = os.environ.get(ENVIRONMENT_VARIABLE)
    return (Path(chosen) if chosen else user_cache_path("geodesic_ocp")) / "compiled"


def usable_folder() -> Path:
    """The cache's folder if it is private and can be written to, else one of this process."""
    folder = cache_folder()
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if why_not_private(folder) == "" and os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return temporary_folder()


@lru_cache(maxsize=1)
def _temporary() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="geodesic_ocp-")


def temporary_folder() -> Path:
    """A folder that is removed when this process ends."""
    return Path(_temporary().name)


def why_not_private(folder: Path) -> str:
    """Which folder on the path another user could change, and why; empty if there is none."""
    if not hasattr(os, "getuid"):
        return ""
    owners = (0, os.getuid())
    resolved = folder.resolve()
    for each in (resolved, *resolved.parents):
        status = each.stat()
        if status.st_uid not in owners:
            return f"{each} belongs to another user"
        shared = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        # In a sticky folder, such as /tmp, nobody can replace what belongs to others.
        if shared and not (each != resolved and status.st_mode & stat.S_ISVTX):
            return f"{each} can be written to by other users"
    return ""


def find(folder: Path, key: str) -> Path | None:
    """The undamaged library with this key; damaged ones are removed."""
    for file in sorted(folder.glob(f"{key}.*{_SUFFIX}")):
        try:
            if file.name == file_name(key, file.read_bytes()):
                return file
            file.unlink()
        except OSError:
            continue
    return None


def file_name(key: str, content: bytes) -> str:
    """Name of the library with this key and content."""
    return f"{key}.{sha256(content).hexdigest()[:32]}{_SUFFIX}"


def stored() -> list[Path]:
    """All files in the cache."""
    folder = cache_folder()
    return sorted(file for file in folder.iterdir() if file.is_file()) if folder.is_dir() else []


def clear() -> int:
    """Remove all files from the cache, and return their number."""
    files = stored()
    for file in files:
        file.unlink(missing_ok=True)
    return len(files)
