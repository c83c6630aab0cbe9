"""Finished builds in the user's cache, one folder for each combination of versions."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from casadi_bindings.errors import CannotBuild
from casadi_bindings.target import MODULE, Target

INIT = "__init__.py"
RECORD = "build.json"
WORK = ".work"


def cache_folder() -> Path:
    """Where builds are kept: $XDG_CACHE_HOME or ~/.cache, with a name of its own below."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base).expanduser().resolve() / "geodesic_ocp" / "pinocchio_casadi"


def finished_folder(target: Target) -> Path:
    """Where the finished build for this target is, once there is one."""
    return cache_folder() / target.key


def work_folder(target: Target) -> Path:
    """Where that build is made; it stays when a build is interrupted, so that the next goes on."""
    return cache_folder() / (target.key + WORK)


def find(target: Target) -> Path | None:
    """The folder of the finished, undamaged build for this target, or None."""
    folder = finished_folder(target)
    try:
        record = json.loads((folder / RECORD).read_text())
        intact = record["versions"] == target.linked and all(
            record["sha256"][name] == _digest(folder / name) for name in (MODULE, INIT)
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return folder if intact else None


def store(target: Target, module: Path, init: Path, seconds: float) -> Path:
    """Keep a built module and its `casadi/__init__.py`, both or nothing."""
    folder = Path(tempfile.mkdtemp(dir=cache_folder(), prefix="new-"))
    try:
        shutil.copyfile(module, folder / MODULE)
        shutil.copyfile(init, folder / INIT)
        record = {
            "versions": target.linked,
            "seconds": round(seconds),
            "sha256": {name: _digest(folder / name) for name in (MODULE, INIT)},
        }
        (folder / RECORD).write_text(json.dumps(record, indent=2) + "\n")
        shutil.rmtree(finished_folder(target), ignore_errors=True)
        return folder.replace(finished_folder(target))
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def purge() -> bool:
    """Delete all builds; False if there are none.

    Raises:
        CannotBuild: one of them is being made.
    """
    folder = cache_folder()
    if not folder.exists():
        return False
    with contextlib.ExitStack() as locks:
        for work in folder.glob("*" + WORK):
            if not locks.enter_context(locked(work, wait=False)):
                raise CannotBuild(f"another run is building in {work}: nothing was purged")
        shutil.rmtree(folder)
    return True


@contextlib.contextmanager
def locked(folder: Path, *, wait: bool = True) -> Iterator[bool]:
    """Keep other runs out of a folder; without `wait` yield False if one of them is in it."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            free = True
        except BlockingIOError:
            free = False
        if wait and not free:
            print(f"waiting for another run in {folder}", flush=True)
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            free = True
        yield free
    finally:
        os.close(descriptor)


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()
