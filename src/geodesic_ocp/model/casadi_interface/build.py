"""Compile the interface for the installed wheels of pin and casadi, or remove what was compiled.

    python -m geodesic_ocp.model.casadi_interface.build [--remove]

It takes about half a minute and 1.5 GB of memory, once for each combination of versions: the result
is kept in the user's cache, for all environments. Exit codes: 0 done, 1 it cannot be done and the
message says why, 2 wrong usage, 130 interrupted.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from hashlib import sha256
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin

from geodesic_ocp.compiled import cache
from geodesic_ocp.model.casadi_interface.library import SOURCE, PinocchioLibrary, folder, prefix
from geodesic_ocp.progress import ProgressBar

EIGEN = "cmeel-eigen>=3.4,<3.5"
_COMPILERS = ("c++", "g++", "clang++")
# Not optimized: the library runs for hundredths of a second for each model.
_FLAGS = ("-std=c++17", "-O0", "-w", "-fPIC", "-shared")
_MEANINGS = {
    "No space left on device": "the disk is full",
    "Killed signal": "the compiler was ended, probably because 1.5 GB of memory were not free",
    "undefined reference": "the compiler's C++ library does not fit CasADi's wheel; GCC fits 3.8's",
}
_TOLERANCE = 1e-12  # relative rounding of a mass matrix
_SHOWN = 8  # lines that are quoted of what a compiler or pip says


class CannotBuild(Exception):
    """The reason why a build is impossible, and what to do."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--remove", action="store_true", help="remove all that were built")
    options = parser.parse_args(arguments)
    try:
        print(remove() if options.remove else provide())
    except (CannotBuild, OSError) as error:
        print(f"pinocchio.casadi: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\ninterrupted, nothing was kept", file=sys.stderr)
        return 130
    return 0


def remove() -> str:
    """Remove all interfaces that were built; returns what was done."""
    files = list(folder().glob("*.so"))
    for file in files:
        file.unlink()
    return f"removed {len(files)} from {folder()}"


def provide() -> str:
    """Build the interface unless it is there; returns what was done.

    Raises:
        CannotBuild: something that the build needs is missing, or it fails.
    """
    if importlib.util.find_spec("pinocchio.casadi") is not None:
        return "pinocchio.casadi is installed, and will be used: nothing to do"
    compiler = _compiler()
    where = folder()
    if reason := cache.why_unused(where):
        raise CannotBuild(f"{where} is not used: {reason}")
    version = _version(compiler)
    file = where / f"{prefix()}{sha256(version.encode()).hexdigest()[:8]}.so"
    if file.exists():
        check(file)
        return f"built already: {file}"
    print(f"building with {version}: about half a minute", flush=True)
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="build-", dir=where) as work:
        built = compile_in(Path(work), compiler)
        check(built)
        built.replace(file)
    return f"built in {time.monotonic() - started:.0f} s and checked: {file}"


def compile_in(work: Path, compiler: list[str]) -> Path:
    """Compile the interface in a folder and return the library.

    Raises:
        CannotBuild: headers are missing and cannot be fetched, or the compiler fails.
    """
    library = work / "interface.so"
    log = work / "output"
    headers = _wheel_headers()
    includes = [f"-I{path}" for path in (*headers, _eigen(headers[0], work))]
    wheel = Path(ca.__file__).parent
    command = [*compiler, *_FLAGS, *includes, str(SOURCE), "-o", str(library)]
    command += [f"-L{wheel}", "-lcasadi"]
    if sys.platform == "linux":
        command.append("-Wl,--no-undefined")
    with (
        log.open("w") as output,
        subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=output, stderr=output
        ) as running,
    ):
        _wait(running)
    if running.returncode:
        raise CannotBuild(_explained(log.read_text(errors="replace"), command))
    return library


def _wait(running: subprocess.Popen[bytes]) -> None:
    bar = ProgressBar()
    started = time.monotonic()
    try:
        while running.poll() is None:
            bar("compiling, seconds", int(time.monotonic() - started), 0)
            time.sleep(0.2)
    except BaseException:
        running.terminate()
        raise
    finally:
        bar.close()


def check(file: Path) -> None:
    """Compare the mass matrix of a library with that of numeric Pinocchio.

    Raises:
        CannotBuild: it cannot be loaded, or they differ.
    """
    model = pin.buildSampleModelManipulator()
    q = ca.SX.sym("q", model.nq)
    try:
        matrix = ca.Function("G", [q], [PinocchioLibrary(file).mass_matrix(model, q)])
    except (OSError, RuntimeError) as error:
        raise CannotBuild(f"the library does not work: {error}") from error
    at = np.linspace(-1.0, 1.0, model.nq)
    expected = np.triu(pin.crba(model, model.createData(), at))
    off = np.abs(np.triu(matrix(at).full()) - expected).max()
    if not off <= _TOLERANCE * np.abs(expected).max():
        raise CannotBuild(f"{file} is wrong: its mass matrix differs from Pinocchio's by {off:g}")


def _compiler() -> list[str]:
    """Return $CXX, or the first C++ compiler, with the options that the variable has.

    Raises:
        CannotBuild: there is none.
    """
    given = os.environ.get("CXX")
    for name, *options in map(shlex.split, [given] if given else _COMPILERS):
        if found := shutil.which(name):
            return [found, *options]
    wanted = f"CXX={given!r} is not a program" if given else "there is no C++ compiler"
    hint = "xcode-select --install" if sys.platform == "darwin" else "apt-get install g++"
    raise CannotBuild(f"{wanted}; install one ({hint}) or name it in CXX")


def _version(compiler: list[str]) -> str:
    """Return the first line of what a compiler says about itself, and its options."""
    said = subprocess.run([compiler[0], "--version"], capture_output=True, text=True)
    if said.returncode:
        raise CannotBuild(f"{compiler[0]} does not work: {said.stderr.strip()}")
    return " ".join([said.stdout.splitlines()[0], *compiler[1:], platform.machine()])


def _wheel_headers() -> tuple[Path, Path]:
    """Return the folders of headers of pin, with Boost's, and of casadi.

    Raises:
        CannotBuild: they are not there, as in installations that are not pip's.
    """
    # The wheel puts the package in cmeel.prefix/lib/pythonX/site-packages.
    prefixes = [path for path in Path(pin.__file__).parents if path.name == "cmeel.prefix"]
    of_pin = prefixes[0] / "include" if prefixes else Path()
    of_casadi = Path(ca.__file__).parent / "include"
    for package, path, header in (
        ("pin", of_pin, "pinocchio/autodiff/casadi.hpp"),
        ("casadi", of_casadi, "casadi/casadi.hpp"),
    ):
        if not (path / header).is_file():
            raise CannotBuild(
                f"{package} has no header {header}: install its wheel (pip install"
                f" --force-reinstall {package}), or pinocchio of conda-forge, which has"
                " pinocchio.casadi"
            )
    return of_pin, of_casadi


def _eigen(headers: Path, work: Path) -> Path:
    """Return the folder of Eigen's headers, which are fetched unless they are among pin's.

    Raises:
        CannotBuild: they cannot be fetched.
    """
    installed = headers / "eigen3"
    if (installed / "Eigen").is_dir():
        return installed
    print(f"fetching Eigen's headers ({EIGEN})", flush=True)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    pip += ["--no-deps", "--only-binary", ":all:", "--target", str(work / "eigen"), EIGEN]
    done = subprocess.run(pip, capture_output=True, text=True)
    if done.returncode:
        said = "\n  ".join(done.stderr.strip().splitlines()[-_SHOWN:])
        raise CannotBuild(
            f"Eigen's headers cannot be fetched: install {EIGEN!r} into this environment, and run"
            f" this again. pip said:\n  {said}"
        )
    return work / "eigen" / "cmeel.prefix" / "include" / "eigen3"


def _explained(output: str, command: list[str]) -> str:
    """Return why a compiler failed: the meaning if it is known, and its first errors."""
    lines = output.strip().splitlines()
    errors = [line for line in lines if "error: " in line or "undefined" in line] or lines
    known = [meaning for sign, meaning in _MEANINGS.items() if sign in output]
    shown = "\n  ".join(line for line in errors[:_SHOWN])
    why = f": {known[0]}" if known else ""
    return f"{command[0]} failed{why}. It said:\n  {shown}\nThe command was {shlex.join(command)}"


if __name__ == "__main__":
    sys.exit(main())
