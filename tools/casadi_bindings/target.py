"""Target: the Python environment that the bindings are built for."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import sys
import sysconfig
from dataclasses import dataclass
from functools import cached_property
from importlib import metadata
from pathlib import Path

from casadi_bindings.errors import CannotBuild

RECIPE = 1  # raised whenever the build changes what it makes: older results are then not reused
WANTED = "'pin>=4.1,<5' 'casadi>=3.8'"  # what a build can be made for
MODULE = "pinocchio_pywrap_casadi" + str(sysconfig.get_config_var("EXT_SUFFIX"))
NOT_LINKED = {"numpy", "cmeel"}  # their versions may change under the finished bindings


@dataclass(frozen=True)
class Target:
    """The wheels of one environment.

    Attributes:
        versions: of pin, casadi and all that they require, by normalized name of distribution.
        pinocchio: folder of the imported package.
        casadi: folder of the imported package.
    """

    versions: dict[str, str]
    pinocchio: Path
    casadi: Path

    @cached_property
    def linked(self) -> dict[str, str]:
        """Versions of everything that the bindings are linked with."""
        return {name: self.versions[name] for name in sorted(self.versions.keys() - NOT_LINKED)}

    @cached_property
    def runpath(self) -> str:
        """Paths from the module to the libraries of the wheels of pin and casadi."""
        folders = (self.pinocchio.parents[2], self.casadi)
        return ":".join("$ORIGIN/" + os.path.relpath(path, self.pinocchio) for path in folders)

    @cached_property
    def key(self) -> str:
        """Name of what is built for exactly these versions, this Python and this platform."""
        soabi = str(sysconfig.get_config_var("SOABI"))
        text = repr((RECIPE, soabi, self.runpath, self.linked))
        digest = hashlib.sha256(text.encode()).hexdigest()[:10]
        return f"pin-{self.versions['pin']}_casadi-{self.versions['casadi']}_{soabi}_{digest}"


def installed_target() -> Target:
    """The environment of the running interpreter.

    Raises:
        CannotBuild: pin or casadi is missing, or is imported from elsewhere.
    """
    folders = {}
    for distribution, package in (("pin", "pinocchio"), ("casadi", "casadi")):
        try:
            files = metadata.distribution(distribution)
        except metadata.PackageNotFoundError:
            raise CannotBuild(
                f"{distribution} is not installed for {sys.executable}:"
                f" {sys.executable} -m pip install {WANTED}"
            ) from None
        folders[package] = _imported_from(files, package)
    versions = _with_requirements("pin") | _with_requirements("casadi")
    return Target(versions, folders["pinocchio"], folders["casadi"])


def _imported_from(distribution: metadata.Distribution, package: str) -> Path:
    found = importlib.util.find_spec(package)
    own = [file for file in distribution.files or () if file.match(f"{package}/__init__.py")]
    if found is None or found.origin is None or not own:
        raise CannotBuild(f"{package} of the wheel cannot be found: reinstall it with pip")
    origin = Path(found.origin).resolve()
    if origin not in [Path(str(distribution.locate_file(file))).resolve() for file in own]:
        raise CannotBuild(
            f"`import {package}` takes {origin}, which is not pip's: is PYTHONPATH set?"
        )
    return origin.parent


def _with_requirements(name: str) -> dict[str, str]:
    """Versions of an installed distribution and of all that it requires, by normalized name."""
    found: dict[str, str] = {}
    waiting = [name]
    while waiting:
        name = re.sub(r"[-_.]+", "-", waiting.pop()).lower()
        if name in found:
            continue
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:  # required on other platforms only
            continue
        found[name] = distribution.version
        requirements = [line for line in distribution.requires or () if "extra ==" not in line]
        waiting += [re.split(r"[^A-Za-z0-9._-]", line, maxsplit=1)[0] for line in requirements]
    return found
