"""Put a finished build beside the installed pinocchio, check it, and take it away again."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
import sys
from pathlib import Path

from casadi_bindings.cache import RECORD
from casadi_bindings.errors import CannotBuild
from casadi_bindings.target import MODULE, Target

FOREIGN = "somebody else's"
CHECK = Path(__file__).with_name("check_import.py")
# Upgrading a wheel leaves these files behind; loaded beside other versions they would crash.
GUARD = """\
# Put here by tools/pinocchio_casadi.py of geodesic_ocp; Pinocchio's own file follows this check.
from importlib import metadata as _metadata

for _name, _built_for in {versions!r}.items():
    try:
        _found = _metadata.version(_name)
    except _metadata.PackageNotFoundError:
        _found = "missing"
    if _found != _built_for:
        raise ImportError(
            f"pinocchio.casadi was built for {{_name}} {{_built_for}}, here it is {{_found}}:"
            " build it again, or remove it (tools/pinocchio_casadi.py --remove)"
        )

"""


def installed_key(pinocchio: Path) -> str | None:
    """Key of the build that `install` put there, or FOREIGN, or None if there is nothing."""
    folder = pinocchio / "casadi"
    try:
        return str(json.loads((folder / RECORD).read_text())["key"])
    except (OSError, ValueError, KeyError):
        return FOREIGN if (folder / "__init__.py").exists() else None


def install(target: Target, build: Path) -> None:
    """Copy a finished build into the environment and make sure that it works there.

    Raises:
        CannotBuild: the environment cannot be written to, or the import fails; then it is as if
            nothing had been installed.
    """
    folder = target.pinocchio / "casadi"
    record = json.loads((build / RECORD).read_text())
    guard = GUARD.format(versions=record["versions"])
    try:
        folder.mkdir(exist_ok=True)
        (folder / RECORD).write_text(json.dumps({"key": target.key, **record}, indent=2) + "\n")
        (folder / "__init__.py").write_text(guard + (build / "__init__.py").read_text())
        new = target.pinocchio / (MODULE + ".new")
        shutil.copyfile(build / MODULE, new)
        new.replace(target.pinocchio / MODULE)  # a process that has it loaded keeps the old one
    except OSError as error:
        remove(target.pinocchio)
        raise CannotBuild(f"cannot be installed into {target.pinocchio}: {error}") from error
    failure = import_error()
    if failure:
        remove(target.pinocchio)
        raise CannotBuild(
            f"the build does not work here and was taken out again; it is kept in {build}. Python"
            f" said:\n  {failure}"
        )


def remove(pinocchio: Path) -> bool:
    """Take out what `install` put there; False if there was nothing of the kind."""
    folder = pinocchio / "casadi"
    ours = (folder / RECORD).exists()
    if ours:
        (pinocchio / MODULE).unlink(missing_ok=True)
        (pinocchio / (MODULE + ".new")).unlink(missing_ok=True)
        shutil.rmtree(folder)
        if not any(pinocchio.iterdir()):  # pin itself was uninstalled before
            pinocchio.rmdir()
    return ours


def pinocchio_folder() -> Path | None:
    """Folder of the importable pinocchio, also of what is left of it without pin."""
    found = importlib.util.find_spec("pinocchio")
    locations = list(found.submodule_search_locations or ()) if found else []
    return Path(locations[0]).resolve() if locations else None


def import_error() -> str:
    """Why pinocchio.casadi does not work in this environment; empty if it does."""
    done = subprocess.run([sys.executable, str(CHECK)], capture_output=True, text=True)
    if done.returncode == 0:
        return ""
    return "\n  ".join(done.stderr.strip().splitlines()[-3:]) or f"exit code {done.returncode}"
