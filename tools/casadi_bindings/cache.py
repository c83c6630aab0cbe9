"""Finished builds in the user's cache, one folder for each combination of versions."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
from pathlib import Path

from casadi_bindings.target import MODULE, Target

RECORD = "build.json"  # written last: a folder without it is not finished


def cache_folder() -> Path:
    """Where builds are kept: $XDG_CACHE_HOME or ~/.cache, with a name of its own below."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base).expanduser().resolve() / "geodesic_ocp" / "pinocchio_casadi"


def work_folder(target: Target) -> Path:
    """Where that build is made; it stays when a build is interrupted, so that the next goes on."""
    return cache_folder() / (target.key + ".work")


def find(target: Target) -> Path | None:
    """The folder of the finished, undamaged build for this target, or None."""
    folder = cache_folder() / target.key
    try:
        files = json.loads((folder / RECORD).read_text())["sha256"]
        intact = all(_digest(folder / name) == digest for name, digest in files.items())
    except (OSError, ValueError, KeyError):
        return None
    return folder if intact else None


def store(target: Target, module: Path, init: Path, seconds: float) -> Path:
    """Keep a built module and its `casadi/__init__.py`, both or nothing."""
    final = cache_folder() / target.key
    folder = Path(tempfile.mkdtemp(dir=cache_folder(), prefix="new-"))
    shutil.copyfile(module, folder / MODULE)
    shutil.copyfile(init, folder / "__init__.py")
    record = {
        "versions": target.linked,
        "seconds": round(seconds),
        "sha256": {name: _digest(folder / name) for name in (MODULE, "__init__.py")},
    }
    (folder / RECORD).write_text(json.dumps(record, indent=2) + "\n")
    shutil.rmtree(final, ignore_errors=True)
    folder.replace(final)
    return final


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()
