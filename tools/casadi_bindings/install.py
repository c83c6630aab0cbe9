"""Install a finished build beside the installed pinocchio, check it, and remove it."""

from __future__ import annotations

import importlib.util
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
from pathlib import Path

from casadi_bindings.cache import INIT
from casadi_bindings.errors import CannotBuild
from casadi_bindings.target import MODULE, Target

CHECK = Path(__file__).with_name("check_import.py")
FOREIGN = "somebody else's"
MARK = "# Put here by tools/pinocchio_casadi.py of geodesic_ocp: "
# Upgrading a wheel leaves these files behind; loaded beside other versions they would crash.
GUARD = """\
{mark}{key}
# Pinocchio's own file follows this check.
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
    init = pinocchio / "casadi" / INIT
    if not init.is_file():
        return None
    found = re.match(re.escape(MARK) + r"(\S+)$", init.read_text(), flags=re.MULTILINE)
    return found[1] if found else FOREIGN


def install(target: Target, build: Path) -> None:
    """Copy a finished build into the environment and check that it works there.

    Raises:
        CannotBuild: the environment cannot be written to, or the import fails; then it is as if
            nothing had been installed.
    """
    folder, module = target.pinocchio / "casadi", target.pinocchio / MODULE
    guard = GUARD.format(mark=MARK, key=target.key, versions=target.linked)
    try:
        folder.mkdir(exist_ok=True)
        (folder / INIT).write_text(guard + (build / INIT).read_text())
        module.unlink(missing_ok=True)  # a process that has it loaded keeps it
        shutil.copyfile(build / MODULE, module)
        failure = import_error()
        if failure:
            raise CannotBuild(
                f"the finished build in {build} does not work here, and was taken out of the"
                f" environment again; delete that folder to have it built anew. {failure}"
            )
    except OSError as error:
        remove(target.pinocchio)
        raise CannotBuild(f"cannot be installed into {target.pinocchio}: {error}") from error
    except BaseException:
        remove(target.pinocchio)
        raise


def remove(pinocchio: Path) -> bool:
    """Remove what `install` copied; False if there was nothing."""
    if installed_key(pinocchio) in (None, FOREIGN):
        return False
    (pinocchio / MODULE).unlink(missing_ok=True)
    shutil.rmtree(pinocchio / "casadi")
    if not any(pinocchio.iterdir()):  # pin itself was uninstalled before
        pinocchio.rmdir()
    return True


def imported_folder() -> Path | None:
    """Folder of the pinocchio that an import would take."""
    found = importlib.util.find_spec("pinocchio")
    return Path(found.origin).resolve().parent if found and found.origin else None


def wheel_folders() -> list[Path]:
    """Folders of pip's pinocchio in this environment, including remains after pin was removed."""
    packages = Path(sysconfig.get_path("platlib"))
    return sorted(packages.glob("cmeel.prefix/lib*/python*/site-packages/pinocchio"))


def import_error() -> str:
    """Why pinocchio.casadi does not work in this environment; empty if it does."""
    done = subprocess.run([sys.executable, str(CHECK)], capture_output=True, text=True)
    if done.returncode == 0:
        return ""
    if done.returncode < 0:
        return f"Python was ended by {signal.Signals(-done.returncode).name}"
    return "Python said:\n  " + "\n  ".join(done.stderr.strip().splitlines()[-3:])
