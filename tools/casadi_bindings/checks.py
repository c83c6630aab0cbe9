"""Checks before a build whether it can succeed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

from casadi_bindings.environment import clean_environment
from casadi_bindings.errors import CannotBuild
from casadi_bindings.target import WANTED, Target

GB = 1e9
DISK = 2.0 * GB  # measured: 1.7 GB
JOB_MEMORY = 3.5 * GB  # measured: 7 GB for two compilers at once
PROBE = """
#include <Python.h>
#include <casadi/casadi.hpp>
#include <optional>
int main() {
  std::optional<std::string> name("no such solver");
  return casadi::has_nlpsol(*name) ? 1 : 0;
}
"""


def check_recipe(target: Target) -> None:
    """Raise CannotBuild for platforms and versions without a recipe."""
    if sys.platform != "linux":
        raise CannotBuild(
            f"built on Linux only, this is {sys.platform}: conda-forge's pinocchio brings"
            " pinocchio.casadi on every platform (environment.yml)"
        )
    pin, library = target.versions["pin"], target.versions.get("libpinocchio", "missing")
    if not pin.startswith("4.") or pin.startswith("4.0."):
        raise CannotBuild(
            f"the recipe is for pin 4.1 and later 4.x, pin {pin} is installed (4.0 does not compile"
            f" with GCC 12): {sys.executable} -m pip install --upgrade {WANTED}"
        )
    if library != pin:
        raise CannotBuild(
            f"pin is {pin}, but libpinocchio {library}:"
            f" {sys.executable} -m pip install --force-reinstall pin=={pin}"
        )


def check_casadi(target: Target) -> None:
    """Raise CannotBuild if the casadi wheel cannot be linked with the pin wheel.

    CasADi's manylinux2014 wheels use libstdc++'s old std::string, Pinocchio's the new one.
    """
    libraries = sorted(target.casadi.glob("libcasadi.so*"))
    headers = target.casadi / "include" / "casadi" / "casadi.hpp"
    if not libraries or not headers.is_file() or not (target.casadi / "cmake").is_dir():
        raise CannotBuild(f"no library, headers or CMake files of CasADi in {target.casadi}")
    if b"_ZN6casadi8FunctionC1ERKNSt7__cxx1112basic_string" not in libraries[0].read_bytes():
        raise CannotBuild(
            f"the wheel of casadi {target.versions['casadi']} was compiled with the old C++ ABI"
            " (_GLIBCXX_USE_CXX11_ABI=0), pin's with the new one, and they cannot be linked; a"
            " wheel tagged manylinux_2_28 has the new one, as of casadi 3.8:"
            f" {sys.executable} -m pip install --upgrade pip"
            f" && {sys.executable} -m pip install --force-reinstall {WANTED}"
        )


def find_compiler(target: Target) -> Path:
    """The C++ compiler, $CXX or the usual one, after it has compiled and linked a small program.

    Raises:
        CannotBuild: there is none, it fails, or Python's headers are missing.
    """
    include = Path(sysconfig.get_path("include"))
    if not (include / "Python.h").is_file():
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        raise CannotBuild(
            f"Python's headers are missing ({include / 'Python.h'}): install them, on Debian and"
            f" Ubuntu with apt install python{version}-dev"
        )
    asked = os.environ.get("CXX")
    candidates = [asked] if asked else ["c++", "g++", "clang++"]
    found = next(filter(None, map(shutil.which, candidates)), None)
    if found is None:
        raise CannotBuild(
            f"CXX={asked} is not a program: give a C++ compiler's name or path, without options"
            if asked
            else "there is no C++ compiler: install one (on Debian and Ubuntu apt install g++), or"
            " set CXX to its path"
        )
    with tempfile.TemporaryDirectory() as folder:
        source, program = Path(folder) / "probe.cpp", Path(folder) / "probe"
        source.write_text(PROBE)
        command = [found, "-std=c++17", f"-I{include}", f"-I{target.casadi / 'include'}"]
        command += [str(source), "-o", str(program), f"-L{target.casadi}", "-lcasadi"]
        command += [f"-Wl,-rpath,{target.casadi}", "-Wl,--allow-shlib-undefined"]
        for what, step in (("compile and link", command), ("run", [str(program)])):
            failure = _failure(step)
            if failure:
                raise CannotBuild(
                    f"{found} cannot {what} a C++17 program with CasADi. GCC 12 is known to be new"
                    " enough; set CXX to the path of another compiler, g++ rather than gcc."
                    f" {failure}"
                )
    return Path(found).absolute()


def _failure(command: list[str]) -> str:
    """The output of a program that failed; empty if it did not."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", env=clean_environment()
        )
    except OSError as error:
        return str(error)
    if done.returncode == 0:
        return ""
    said = "\n  ".join((done.stderr + done.stdout).strip().splitlines()[:8])
    return f"Its exit code is {done.returncode}; it said:\n  {said}"


def choose_jobs(asked: int | None) -> int:
    """Number of parallel compilers: as requested, or what processors and memory allow.

    Raises:
        CannotBuild: not even one fits into the memory that is free.
    """
    if asked is not None:
        return asked
    fitting = int(free_memory() // JOB_MEMORY)
    if fitting < 1:
        raise CannotBuild(
            f"{free_memory() / GB:.1f} GB of memory are free, one compiler takes up to"
            f" {JOB_MEMORY / GB:.1f} GB: close something, or try --jobs 1 all the same"
        )
    return min(fitting, processors())


def processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0))


def free_memory(root: Path = Path("/")) -> float:
    """Memory [bytes] that new programs can have, also inside a container."""
    free = 1024.0 * _fields(root / "proc" / "meminfo")["MemAvailable"]
    group = root / "sys" / "fs" / "cgroup"
    limit = group / "memory.max"
    if limit.is_file() and limit.read_text().strip().isdigit():
        # Cached files can be dropped.
        cached = _fields(group / "memory.stat")["inactive_file"]
        used = int((group / "memory.current").read_text()) - cached
        free = min(free, int(limit.read_text()) - used)
    return free


def _fields(file: Path) -> dict[str, int]:
    """Numbers by name, from lines such as "MemAvailable:  24000000 kB"."""
    rows = [line.split() for line in file.read_text().splitlines()]
    return {row[0].rstrip(":"): int(row[1]) for row in rows}


def check_space(folder: Path, needed: float) -> None:
    """Raise CannotBuild unless the content of the folder can grow to this many bytes."""
    needed -= sum(file.lstat().st_size for file in folder.rglob("*"))
    existing = next(path for path in (folder, *folder.parents) if path.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise CannotBuild(f"{existing} cannot be written to")
    free = shutil.disk_usage(existing).free
    if free < needed:
        raise CannotBuild(
            f"{free / GB:.2f} GB are free in {existing}, {needed / GB:.2f} GB more are needed"
        )
