"""The command line, geodesic-ocp: a parser, and commands that import what they need."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from geodesic_ocp.cli.align.align_options import add_align_options
from geodesic_ocp.cli.analyse.analysis_options import add_analysis_options, check_options
from geodesic_ocp.cli.analyse.many_options import add_many_options, are_many
from geodesic_ocp.cli.analyse.recording import (
    analyse_bundled,
    analyse_file,
    check_folder,
    save_analysis,
)
from geodesic_ocp.cli.fit.fit_options import add_fit_options
from geodesic_ocp.cli.interrupts import Interrupts, in_main_thread, on_interrupt
from geodesic_ocp.cli.retarget.retarget_options import add_retarget_options
from geodesic_ocp.cli.study.study_options import add_study_options
from geodesic_ocp.cli.trajectory.check_trajectory_options import add_check_trajectory_options
from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.model.dynamics.rigid_body import BACKENDS

_FILE = "recording: MMM, AMC, BVH, OpenSim, c3d, SMPL .npz, or a table (.csv)"
_EXIT = """exit codes: 0 done; 1 a check failed, some of many recordings were left out, or an
error in a problem's own code, shown whole; 2 wrong input, named in one line; 3 a solver or
integration failed; 130 interrupted"""


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

    command = commands.add_parser(
        "analyse",
        help="cut recordings into geodesic synergies and compare with the baselines",
        description="Cut a recording into geodesic synergies and compare with the baselines; or "
        "many recordings in parallel, with tables of all. A run that was interrupted goes on when "
        "the same command is given again.",
        epilog=_EXIT,
    )
    command.add_argument(
        "file", nargs="+", help=f"{_FILE}; several, a folder, or a pattern in quotes for many"
    )
    _add_person(command, ("right", "left", "both"))
    command.add_argument(
        "--curve",
        action="store_true",
        help="also compare metrics at equal numbers of synergies, each with its best cuts",
    )
    add_analysis_options(command)
    add_many_options(command)
    command.set_defaults(run=_analyse)

    command = commands.add_parser(
        "retarget", help="transfer the synergies of a recording to a robot", epilog=_EXIT
    )
    _add_recording(command, ("right", "left", "both"))
    command.add_argument(
        "--robot",
        action="append",
        required=True,
        metavar="NAME",
        help="such as panda (see geodesic-ocp models), or a file (URDF, MJCF); twice with "
        "--side both, right and left",
    )
    add_retarget_options(command)
    command.add_argument(
        "--report",
        action="store_true",
        help="write a page with animated models (default folder: geodesic_ocp_retarget)",
    )
    add_analysis_options(command)
    command.set_defaults(run=_retarget)

    command = commands.add_parser(
        "fit", help="estimate parameters of the metric from recordings", epilog=_EXIT
    )
    add_fit_options(command)
    command.set_defaults(run=_fit)

    command = commands.add_parser(
        "study", help="statistics over subjects of an analysis of many recordings", epilog=_EXIT
    )
    add_study_options(command)
    command.set_defaults(run=_study)

    command = commands.add_parser("demo", help="analyse the bundled recording", epilog=_EXIT)
    command.add_argument("--robot", metavar="NAME", help="also transfer it to this robot")
    add_retarget_options(command)
    add_analysis_options(command)
    command.set_defaults(run=_demo)

    command = commands.add_parser(
        "solve", help="solve and plot the problems that a Python file defines", epilog=_EXIT
    )
    command.add_argument("file", type=Path, help="such as problems/great_circle.py; it is run")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="FIELD=VALUE",
        help='a Python literal, as in --set radius=0.4 --set "goal=(1, 2)"',
    )
    command.add_argument("--problem", metavar="CLASS", help="one of several in the file")
    command.add_argument(
        "--tolerance",
        type=float,
        help="refine the grid until the conditions hold to this everywhere",
    )
    command.add_argument("--out", type=Path, help="folder for figures and solutions (JSON)")
    command.set_defaults(run=_solve)

    command = commands.add_parser(
        "check", help="check the installation against known geodesics", epilog=_EXIT
    )
    command.add_argument(
        "file", type=Path, nargs="?", help="more known geodesics (.json), in the documented form"
    )
    command.add_argument("--backend", choices=BACKENDS, help="check this one only")
    command.set_defaults(run=_check)

    command = commands.add_parser(
        "align", help="show and save how a robot's arm is aligned with a person's", epilog=_EXIT
    )
    add_align_options(command)
    command.set_defaults(run=_align)

    command = commands.add_parser(
        "check-trajectory", help="tell whether a robot can execute a trajectory", epilog=_EXIT
    )
    add_check_trajectory_options(command)
    command.set_defaults(run=_check_trajectory)

    command = commands.add_parser("models", help="list the available models and back ends")
    command.set_defaults(run=_models)

    command = commands.add_parser(
        "info", help="show versions, compilers and settings; clear the cache", epilog=_EXIT
    )
    command.add_argument(
        "--clear-cache", action="store_true", help="remove all compiled libraries from the cache"
    )
    command.set_defaults(run=_info)
    return parser


def _add_recording(command: argparse.ArgumentParser, sides: Sequence[str]) -> None:
    command.add_argument("file", type=Path, help=_FILE)
    _add_person(command, sides)


def _add_person(command: argparse.ArgumentParser, sides: Sequence[str]) -> None:
    command.add_argument("--side", choices=sides, default="right", help="which arm")
    command.add_argument(
        "--height", type=float, help="height of the person [m]; default: the recording's"
    )
    command.add_argument(
        "--mass", type=float, help="body mass of the person [kg]; default: the recording's"
    )
    command.add_argument(
        "--resample",
        type=float,
        metavar="HZ",
        help="interpolate at this rate first, for samples that are not evenly spaced",
    )
    command.add_argument(
        "--convention",
        metavar="NAME",
        help="of joint angles (.mot, .sto) or of skeletons (.amc, .bvh, .npz): a name or a file; "
        "default: the known one that fits",
    )
    command.add_argument(
        "--unit",
        type=_unit,
        metavar="UNIT",
        help="of lengths in .bvh and .amc files: m, cm, mm, in, or a number of metres",
    )
    command.add_argument(
        "--amc-rate", type=float, metavar="HZ", help="sampling rate of .amc files (default: 120)"
    )


def _unit(text: str) -> str | float:
    try:
        return float(text)
    except ValueError:
        return text


# Each command imports what it alone needs, so that none waits for another's.


def _analyse(options: argparse.Namespace) -> int:
    check_options(options)
    check_folder(options.out)
    if are_many(options):
        from geodesic_ocp.cli.analyse.many_recordings import analyse_many

        return analyse_many(options)
    options.file = Path(options.file[0])
    save_analysis(analyse_file(options, options.side), options.out, with_curve=options.curve)
    return 0


def _retarget(options: argparse.Namespace) -> None:
    from geodesic_ocp.cli.retarget.retarget_command import retarget_file

    check_options(options)
    retarget_file(options)


def _demo(options: argparse.Namespace) -> None:
    options.out = options.out or Path("geodesic_ocp_demo")
    check_options(options)
    check_folder(options.out)
    if options.robot is not None:
        from geodesic_ocp.cli.retarget.retarget_command import demo_on_robot

        demo_on_robot(options)
        return
    save_analysis(analyse_bundled(options), options.out, with_curve=True)


def _fit(options: argparse.Namespace) -> None:
    from geodesic_ocp.cli.fit.fit_command import fit_files

    fit_files(options)


def _study(options: argparse.Namespace) -> None:
    from geodesic_ocp.cli.study.study_command import study_tables

    study_tables(options)


def _solve(options: argparse.Namespace) -> None:
    from geodesic_ocp.cli.solve.solve_command import solve_file

    solve_file(options)


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
    from geodesic_ocp.model.formats.catalogue import catalogue

    del options
    for line in catalogue():
        print(line)


def _info(options: argparse.Namespace) -> None:
    from geodesic_ocp.cli.info_command import print_info

    print_info(options)
