"""The command line, geodesic-ocp: a parser, and commands that import what they need."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from geodesic_ocp.cli.align.align_options import add_align_options
from geodesic_ocp.cli.analyse.analyse_options import add_analyse_options
from geodesic_ocp.cli.fit.fit_options import add_fit_options
from geodesic_ocp.cli.interrupts import Interrupts, in_main_thread, on_interrupt
from geodesic_ocp.cli.retarget.retarget_options import add_demo_options, add_retarget_options
from geodesic_ocp.cli.show.show_options import add_show_options
from geodesic_ocp.cli.solve.solve_options import add_solve_options
from geodesic_ocp.cli.study.study_options import add_study_options
from geodesic_ocp.cli.trajectory.check_trajectory_options import add_check_trajectory_options
from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.model.dynamics import BACKENDS

_EXIT = """exit codes: 0 done; 1 a check failed, some of many recordings were left out, or an
error in a problem's own code, shown whole; 2 wrong input, named in one line; 3 a solver or
integration failed; 130 interrupted"""

_EXTRA = "pip install 'geodesic_ocp["  # in messages about packages that are not installed


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit code."""
    options = _parser().parse_args(arguments)
    previous = on_interrupt(Interrupts.note) if in_main_thread() else None
    Interrupts.seen = False
    try:
        return int(options.run(options) or 0)
    except KeyboardInterrupt:
        return _failed("interrupted", 130)
    except BrokenPipeError:  # the reader of the output, such as `head`, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        # CasADi turns a Ctrl-C inside any of its functions into errors of many kinds.
        if Interrupts.seen:
            return _failed("interrupted", 130)
        if isinstance(error, (ValueError, OSError)):
            return _failed(error, 2)
        if isinstance(error, GeodesicOcpError):
            return _failed(error, 3)
        if isinstance(error, ImportError) and _EXTRA in str(error):
            return _failed(error, 2)
        raise
    finally:
        if previous is not None:
            on_interrupt(previous)


def _failed(reason: object, code: int) -> int:
    print("geodesic-ocp: error:", " ".join(str(reason).split()), file=sys.stderr)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="geodesic-ocp",
        description="Geodesics of mechanical systems, and human arm motion as sequences of them.",
        epilog=_EXIT,
    )
    release = version("geodesic_ocp")
    parser.add_argument("--version", action="version", version=f"%(prog)s {release}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(
        name: str, run: Callable[[argparse.Namespace], int | None], text: str, **more: Any
    ) -> argparse.ArgumentParser:
        each = commands.add_parser(name, help=text, **({"epilog": _EXIT} | more))
        each.set_defaults(run=run)
        return each

    analysed = command(
        "analyse",
        _analyse,
        "cut recordings into geodesic synergies and compare with the baselines",
        description="Cut a recording into geodesic synergies and compare with the baselines; or "
        "many recordings in parallel, with tables of all. A run that was interrupted goes on when "
        "the same command is given again.",
    )
    add_analyse_options(analysed)
    add_retarget_options(
        command("retarget", _retarget, "transfer the synergies of a recording to a robot")
    )
    add_fit_options(command("fit", _fit, "estimate parameters of the metric from recordings"))
    add_study_options(
        command("study", _study, "statistics over subjects of an analysis of many recordings")
    )
    add_demo_options(command("demo", _demo, "analyse the bundled recording"))
    add_solve_options(
        command("solve", _solve, "solve and plot the problems that a Python file defines")
    )
    add_show_options(
        command(
            "show",
            _show,
            "show recordings, results and robots in three dimensions and in motion",
            description="Show what is in files in three dimensions and in motion, in a browser, or "
            "in a page or video: recordings, results of the other commands, problems and robots. "
            "Where there is no screen, a page is written to the current folder.",
        )
    )
    checked = command("check", _check, "check the installation against known geodesics")
    checked.add_argument(
        "file", type=Path, nargs="?", help="more known geodesics (.json), in the documented form"
    )
    checked.add_argument("--backend", choices=BACKENDS, help="check this one only")
    add_align_options(
        command("align", _align, "show and save how a robot's arm is aligned with a person's")
    )
    add_check_trajectory_options(
        command(
            "check-trajectory", _check_trajectory, "tell whether a robot can execute a trajectory"
        )
    )
    command("models", _models, "list the available models and back ends", epilog=None)
    shown = command("info", _info, "show versions, compilers and settings; clear the cache")
    shown.add_argument(
        "--clear-cache", action="store_true", help="remove all compiled libraries from the cache"
    )
    return parser


# Each command imports what it alone needs, so that none waits for another's.


def _analyse(options: argparse.Namespace) -> int:
    from geodesic_ocp.cli.analyse.analyse_command import analyse_files

    return analyse_files(options)


def _retarget(options: argparse.Namespace) -> None:
    from geodesic_ocp.cli.retarget.retarget_command import retarget_file

    retarget_file(options)


def _demo(options: argparse.Namespace) -> None:
    from geodesic_ocp.cli.demo_command import run_demo

    run_demo(options)


def _fit(options: argparse.Namespace) -> None:
    from geodesic_ocp.cli.fit.fit_command import fit_files

    fit_files(options)


def _study(options: argparse.Namespace) -> None:
    from geodesic_ocp.cli.study.study_command import study_tables

    study_tables(options)


def _solve(options: argparse.Namespace) -> None:
    from geodesic_ocp.cli.solve.solve_command import solve_file

    solve_file(options)


def _show(options: argparse.Namespace) -> None:
    from geodesic_ocp.cli.show.show_command import show_files

    show_files(options)


def _check(options: argparse.Namespace) -> int:
    from geodesic_ocp.validation.check import run_check

    return 0 if run_check(options.file, options.backend) else 1


def _check_trajectory(options: argparse.Namespace) -> int:
    from geodesic_ocp.cli.trajectory.check_trajectory_command import check_trajectory_file

    return check_trajectory_file(options)


def _align(options: argparse.Namespace) -> None:
    from geodesic_ocp.cli.align.align_command import align_robot

    align_robot(options)


def _models(options: argparse.Namespace) -> None:
    from geodesic_ocp.model.formats.load_model import catalogue

    del options
    for line in catalogue():
        print(line)


def _info(options: argparse.Namespace) -> None:
    from geodesic_ocp.cli.info_command import print_info

    print_info(options)
