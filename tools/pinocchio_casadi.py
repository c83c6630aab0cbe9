"""Build `pinocchio.casadi` for an environment in which pin and casadi were installed with pip.

    ENVIRONMENT/bin/python tools/pinocchio_casadi.py [--jobs N | --cached | --remove | --purge]

The `pin` wheels leave Pinocchio's own CasADi bindings out. This builds them from the source
distribution of the installed version, against the installed wheels, and puts them beside the
installed `pinocchio`. That takes half an hour on two cores, once: the result is kept in the user's
cache, for every environment with the same versions. On conda-forge pinocchio.casadi is part of the
package and none of this is needed.

Exit codes: 0 done, 1 in the way is what the message says, 2 wrong usage, 3 nothing in the cache
(--cached), 130 interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import fcntl
import shutil
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from casadi_bindings import cache, checks, install
from casadi_bindings.build import build
from casadi_bindings.errors import CannotBuild
from casadi_bindings.target import MODULE, Target, installed_target

CPU_MINUTES = 56  # measured: 28 min with two compilers at once


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    options = _parser().parse_args(arguments)
    try:
        if options.remove or options.purge:
            _remove(purge=options.purge)
            return 0
        return _provide(options)
    except CannotBuild as error:
        print(f"pinocchio.casadi: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\ninterrupted; the next run goes on from here", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description="Build pinocchio.casadi for this Python's environment (pip's pin and casadi)."
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--jobs", type=_count, help="compilers at once (default: what fits)")
    what.add_argument("--cached", action="store_true", help="only if the cache has it: exit code 3")
    what.add_argument("--remove", action="store_true", help="take it out of this environment")
    what.add_argument("--purge", action="store_true", help="the same, and empty the cache")
    return parser


def _count(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be a whole number above 0, got {text!r}")
    return int(text)


def _provide(options: argparse.Namespace) -> int:
    folder = install.pinocchio_folder()
    there = install.installed_key(folder) if folder else None
    if there == install.FOREIGN:
        failure = install.import_error()
        if not failure:
            print(f"{folder} has a pinocchio.casadi of its own: nothing to do")
            return 0
        raise CannotBuild(
            f"{folder}/casadi was not put there by this tool, and does not work: remove it first."
            f" Python said:\n  {failure}"
        )
    target = installed_target()
    if there == target.key and not install.import_error():
        print(f"pinocchio.casadi is in {folder} already, built for these versions")
        return 0
    finished = cache.find(target)
    if finished is None and options.cached:
        print(f"no finished build for these versions in {cache.cache_folder()}")
        return 3
    if finished is None:
        finished = _build(target, options.jobs)
    checks.check_space(target.pinocchio, 2.0 * (finished / MODULE).stat().st_size)
    install.install(target, finished)
    print(f"installed into {target.pinocchio}, from {finished}")
    print("checked: it imports, and its mass matrix is that of numeric Pinocchio")
    return 0


def _build(target: Target, asked: int | None) -> Path:
    checks.check_recipe(target)
    checks.check_casadi(target)
    compiler = checks.find_compiler(target)
    jobs = checks.choose_jobs(asked)
    work = cache.work_folder(target)
    checks.check_space(work, checks.DISK)
    versions = f"pin {target.versions['pin']} and casadi {target.versions['casadi']}"
    print(f"Building pinocchio.casadi for {versions}, with {compiler}, {jobs} at once.")
    print(f"This takes about {CPU_MINUTES / jobs:.0f} minutes, up to", end=" ")
    print(f"{jobs * checks.JOB_MEMORY / checks.GB:.0f} GB of memory, and until it is done", end=" ")
    print(f"{checks.DISK / checks.GB:.0f} GB of disk in\n{work}.")
    print("Interrupt it when you like: the next run goes on from there.", flush=True)
    started = time.monotonic()
    with _alone(work):
        finished = cache.find(target)  # another run may have made it while this one waited
        if finished is None:
            module, init = build(target, work, compiler, jobs)
            finished = cache.store(target, module, init, time.monotonic() - started)
    shutil.rmtree(work, ignore_errors=True)
    print(f"built in {(time.monotonic() - started) / 60:.0f} min")
    return finished


@contextlib.contextmanager
def _alone(work: Path) -> Iterator[None]:
    """Wait until no other run builds the same."""
    work.mkdir(parents=True, exist_ok=True)
    with (work / ".lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("another run builds the same: waiting for it", flush=True)
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _remove(*, purge: bool) -> None:
    folder = install.pinocchio_folder()
    if folder is None or not install.remove(folder):
        print("this environment has no pinocchio.casadi that was put there by this tool")
    else:
        print(f"removed from {folder}")
    kept = cache.cache_folder()
    if purge:
        shutil.rmtree(kept, ignore_errors=True)
        print(f"removed {kept}")
    elif kept.exists():
        print(f"finished builds are kept in {kept}; --purge removes them, too")


if __name__ == "__main__":
    sys.exit(main())
