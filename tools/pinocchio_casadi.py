"""Build `pinocchio.casadi` for an environment in which pin and casadi were installed with pip.

    ENVIRONMENT/bin/python tools/pinocchio_casadi.py [--jobs N | --cached | --remove | --purge]

The `pin` wheels leave Pinocchio's own CasADi bindings out. This builds them from the source
distribution of the installed version, against the installed wheels, and puts them beside the
installed `pinocchio`. That takes half an hour on two cores, once: the result is kept in the user's
cache, for every environment with the same versions. On conda-forge pinocchio.casadi is part of the
package and none of this is needed.

Exit codes: 0 done, 1 it cannot be done and the message says why, 2 wrong usage, 3 nothing in the
cache (--cached), 130 interrupted.
"""

from __future__ import annotations

import argparse
import shutil
import signal
import sys
import time
from pathlib import Path
from types import FrameType

from casadi_bindings import cache, checks, install
from casadi_bindings.build import build
from casadi_bindings.errors import CannotBuild
from casadi_bindings.target import MODULE, Target, installed_target

CPU_MINUTES = 56  # measured: 28 min with two compilers at once
LEAST_MINUTES = 6  # fetching, and the longest file alone takes two


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    options = _parser().parse_args(arguments)
    try:
        if options.remove or options.purge:
            return _remove(purge=options.purge)
        return _provide(options)
    except (CannotBuild, OSError) as error:
        print(f"pinocchio.casadi: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\ninterrupted; the next run continues from here", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description="Build pinocchio.casadi for this Python's environment (pip's pin and casadi)."
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--jobs", type=_count, help="parallel compilers (default: by processors and memory)"
    )
    what.add_argument(
        "--cached",
        action="store_true",
        help="install from the cache only; exit code 3 if it is not there",
    )
    what.add_argument("--remove", action="store_true", help="remove it from this environment")
    what.add_argument("--purge", action="store_true", help="the same, and empty the cache")
    return parser


def _count(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be a whole number above 0, got {text!r}")
    return int(text)


def _provide(options: argparse.Namespace) -> int:
    folder = install.imported_folder()
    if folder and install.installed_key(folder) == install.FOREIGN:
        failure = install.import_error()
        if not failure:
            print(f"{folder} has a pinocchio.casadi of its own: nothing to do")
            return 0
        raise CannotBuild(
            f"{folder}/casadi was not put there by this tool, and does not work: remove it first."
            f" {failure}"
        )
    target = installed_target()
    if _works(target):
        print(f"pinocchio.casadi is in {target.pinocchio} already, built for these versions")
        return 0
    finished = cache.find(target)
    if finished is None and cache.finished_folder(target).exists():
        print(f"the build in {cache.finished_folder(target)} is damaged, and not used")
    if finished is None and options.cached:
        print(f"no finished build for these versions in {cache.cache_folder()}")
        return 3
    if finished is None:
        finished = _build(target, options.jobs)
    with cache.locked(target.pinocchio):
        if not _works(target):
            checks.check_space(target.pinocchio / "casadi", (finished / MODULE).stat().st_size)
            install.install(target, finished)
    print(f"installed into {target.pinocchio}, from {finished}")
    print("checked: it imports, and its mass matrix is that of numeric Pinocchio")
    return 0


def _works(target: Target) -> bool:
    """Whether this target's build is in the environment already."""
    return install.installed_key(target.pinocchio) == target.key and not install.import_error()


def _build(target: Target, asked: int | None) -> Path:
    checks.check_recipe(target)
    checks.check_casadi(target)
    compiler = checks.find_compiler(target)
    jobs = checks.choose_jobs(asked)
    work = cache.work_folder(target)
    checks.check_space(work, checks.DISK)
    _announce(target, compiler, jobs, work)
    started = time.monotonic()
    work.mkdir(parents=True, exist_ok=True)
    with cache.locked(work):
        finished = cache.find(target)  # another run may have made it while this one waited
        if finished is None:
            module, init = build(target, work, compiler, jobs)
            finished = cache.store(target, module, init, time.monotonic() - started)
        shutil.rmtree(work, ignore_errors=True)
    print(f"built in {(time.monotonic() - started) / 60:.0f} min")
    return finished


def _announce(target: Target, compiler: Path, jobs: int, work: Path) -> None:
    minutes = max(CPU_MINUTES / min(jobs, checks.processors()), LEAST_MINUTES)
    memory, disk = jobs * checks.JOB_MEMORY / checks.GB, checks.DISK / checks.GB
    print(
        f"Building pinocchio.casadi for pin {target.versions['pin']} and casadi"
        f" {target.versions['casadi']} with {compiler}, {jobs} at once.\n"
        f"From the beginning this takes about {minutes:.0f} minutes. It takes up to {memory:.0f} GB"
        f" of memory ({checks.free_memory() / checks.GB:.0f} GB are free)\n"
        f"and, until it is done, {disk:.0f} GB of disk in {work}.\n"
        "Interrupt it when you like: the next run goes on from there.",
        flush=True,
    )


def _remove(*, purge: bool) -> int:
    removed = []
    for folder in install.wheel_folders():
        with cache.locked(folder):
            if install.remove(folder):
                removed.append(folder)
                print(f"removed from {folder}")
    if not removed:
        print("this environment has no pinocchio.casadi that was put there by this tool")
    kept = cache.cache_folder()
    if purge:
        print(f"removed {kept}" if cache.purge() else f"there are no builds in {kept}")
    elif kept.exists():
        print(f"builds are kept in {kept}; --purge removes them, too")
    return 0


def _stop(signum: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, _stop)
    sys.exit(main())
