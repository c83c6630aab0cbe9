"""The command line: geodesic-ocp analyse | demo | solve | models."""

from __future__ import annotations

import argparse
import inspect
import os
import signal
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import closing, suppress
from importlib.metadata import version
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, get_args

import numpy as np
from tqdm import tqdm

from geodesic_ocp.analysis import Analysis, analyse
from geodesic_ocp.errors import GeodesicOcpError, RecordingError
from geodesic_ocp.gallery import figures, problem_classes, with_fields
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.catalogue import catalogue
from geodesic_ocp.model.human import DEFAULT_HEIGHT, DEFAULT_MASS, human_arm
from geodesic_ocp.motion.readers import read_motion
from geodesic_ocp.motion.segmentation import as_threshold
from geodesic_ocp.ocp.solve import solve
from geodesic_ocp.sampled import Motion

_SLOWEST = 1.0  # [s] between samples: no recording of an arm is that slow
_EXIT = """exit codes: 0 done; 1 an error in a problem's own code, shown whole;
2 wrong input, named in one line; 3 a solver or integration failed; 130 interrupted"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit code."""
    options = _parser().parse_args(arguments)
    previous = _on_interrupt(_Interrupts.note) if _in_main_thread() else None
    _Interrupts.seen = False
    try:
        options.run(options)
    except KeyboardInterrupt:
        return _failed("interrupted", 130)
    except Exception as error:
        # CasADi turns a Ctrl-C inside any of its functions into errors of many kinds.
        if _Interrupts.seen:
            return _failed("interrupted", 130)
        if isinstance(error, (ValueError, OSError)):
            return _failed(error, 2)
        if isinstance(error, GeodesicOcpError):
            return _failed(error, 3)
        raise
    finally:
        if previous is not None:
            _on_interrupt(previous)
    return 0


class _Interrupts:
    """Whether Ctrl-C was pressed: libraries may swallow the exception, not the mark."""

    seen = False

    @classmethod
    def note(cls, number: int, frame: object) -> None:
        del number, frame
        cls.seen = True
        raise KeyboardInterrupt


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


def _on_interrupt(handler: Any) -> Any:
    return signal.signal(signal.SIGINT, handler)


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
        help="cut a recording into geodesic synergies and compare with the baselines",
        epilog=_EXIT,
    )
    command.add_argument("file", type=Path, help="MMM motion (.xml) or table (.csv)")
    command.add_argument("--side", choices=("right", "left"), default="right", help="the arm")
    command.add_argument("--height", type=float, help="of the person [m]; default: the recording's")
    command.add_argument("--mass", type=float, help="of the person [kg]; default: the recording's")
    command.add_argument(
        "--resample", type=float, metavar="HZ", help="for samples that are not evenly spaced"
    )
    _add_analysis_options(command)
    command.set_defaults(run=_analyse)

    command = commands.add_parser("demo", help="analyse the bundled recording", epilog=_EXIT)
    _add_analysis_options(command)
    command.set_defaults(run=_demo)

    command = commands.add_parser(
        "solve", help="solve and plot the problems that a file of Python defines", epilog=_EXIT
    )
    command.add_argument("file", type=Path, help="such as problems/great_circle.py; it is run")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="FIELD=VALUE",
        help='of the problem, as Python writes it: --set radius=0.4 --set "goal=(1, 2)"',
    )
    command.add_argument("--problem", metavar="CLASS", help="one of several in the file")
    command.add_argument(
        "--tolerance", type=float, help="divide the grid until conditions hold to this everywhere"
    )
    command.add_argument("--out", type=Path, help="folder for pictures and solutions (JSON)")
    command.set_defaults(run=_solve)

    command = commands.add_parser("models", help="say which models and back ends there are")
    command.set_defaults(run=_models)
    return parser


def _add_analysis_options(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--threshold",
        type=float,
        default=0.6,
        help="angle at which a new synergy begins [rad] (default: %(default)s)",
    )
    command.add_argument("--out", type=Path, help="folder for table, figure and synergies")


def _analyse(options: argparse.Namespace) -> None:
    _check_folder(options.out)
    try:
        motion = read_motion(options.file, human_arm(options.side).joint_names)
    except RecordingError as error:
        other = next(side for side in get_args(Side) if side != options.side)
        with suppress(RecordingError):
            read_motion(options.file, human_arm(other).joint_names)
            raise ValueError(f"{error}; try --side {other}") from None
        raise
    try:
        motion = _in_seconds(motion, options.resample)
    except ValueError as error:
        raise ValueError(f"{options.file}: {error}") from None
    _run(motion, options.side, options.height, options.mass, options)


def _in_seconds(motion: Motion, rate: float | None) -> Motion:
    step = float(np.median(np.diff(motion.time)))
    if step >= _SLOWEST:
        raise ValueError(f"samples are {step:g} s apart: is time in milliseconds? It must be in s")
    return motion if rate is None else motion.resampled(rate)


def _demo(options: argparse.Namespace) -> None:
    options.file = "the bundled recording"
    options.out = options.out or Path("geodesic_ocp_demo")
    _check_folder(options.out)
    print("A person steps up and reaches with the left hand (motion capture, 4.4 s).")
    with as_file(files("geodesic_ocp") / "data" / "reach.csv") as file:
        motion = read_motion(file, human_arm("left").joint_names)
    _run(motion, "left", None, None, options)


def _check_folder(folder: Path | None) -> None:
    """Find what stands in the way of the output before any work is done."""
    if folder is None:
        return
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"--out {folder} is a file, not a folder")
    nearest = next(parent for parent in (folder, *folder.absolute().parents) if parent.exists())
    if not nearest.is_dir() or not os.access(nearest, os.W_OK):
        raise ValueError(f"--out {folder}: cannot write to {nearest}")


def _run(
    motion: Motion,
    side: Side,
    height: float | None,
    mass: float | None,
    options: argparse.Namespace,
) -> None:
    assumed = []
    if height is None and (height := motion.subject.height) is None:
        height = DEFAULT_HEIGHT
        assumed.append(f"height {height} m")
    if mass is None and (mass := motion.subject.mass) is None:
        mass = DEFAULT_MASS
        assumed.append(f"mass {mass} kg")
    arm = human_arm(side, height, mass)
    as_threshold(options.threshold)
    start = time.perf_counter()
    try:
        with closing(_Bar()) as bar:
            analysis = analyse(arm, motion, options.threshold, progress=bar)
    except ValueError as error:
        raise ValueError(f"{options.file}: {error}") from None
    _summarise(analysis, height, mass, assumed, time.perf_counter() - start)
    if options.out is not None:
        print()
        for file in analysis.save(options.out):
            print(f"wrote {file}")


class _Bar:
    """A progress bar on standard error, made when the amount of work is known."""

    def __init__(self) -> None:
        self._bar: tqdm | None = None

    def __call__(self, label: str, done: int, total: int) -> None:
        if _Interrupts.seen:
            raise KeyboardInterrupt
        if self._bar is None:
            self._bar = tqdm(
                total=total,
                leave=False,
                disable=None,
                bar_format="{desc}: {percentage:3.0f}% |{bar}|",
            )
        self._bar.total = total
        self._bar.set_description_str(label, refresh=False)
        self._bar.update(done - self._bar.n)
        self._bar.refresh()

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


def _summarise(
    analysis: Analysis, height: float, mass: float, assumed: Sequence[str], seconds: float
) -> None:
    motion = analysis.motion
    who = f" of {motion.subject.name}" if motion.subject.name else ""
    print(
        f"{analysis.model.name}{who}, height {height:g} m, mass {mass:g} kg: "
        f"{len(motion)} samples, {motion.duration:.2f} s at {motion.rate:.0f} Hz"
    )
    if assumed:
        print(f"assumed, as the recording does not say: {', '.join(assumed)}")
    errors = analysis.errors["riemannian"]
    print(
        f"{len(analysis.synergies)} geodesic synergies at a threshold of "
        f"{analysis.threshold:g} rad explain the joints to {errors.joint:.3f} rad and the hand to "
        f"{1000 * errors.position:.0f} mm on average (found in {seconds:.1f} s)"
    )
    print(f"\nmean errors against the filtered recording\n\n{analysis.table()}")


def _solve(options: argparse.Namespace) -> None:
    _check_folder(options.out)
    kinds = problem_classes(options.file)
    if options.problem is not None:
        names = [kind.__name__ for kind in kinds]
        if options.problem not in names:
            raise ValueError(f"{options.file} has no {options.problem}; it has {', '.join(names)}")
        kinds = [kinds[names.index(options.problem)]]
    settings = {}
    for each in options.set:
        name, equals, value = each.partition("=")
        if not equals:
            raise ValueError(f"--set {each}: it must be FIELD=VALUE")
        settings[name.strip()] = value.strip()
    for problem in [with_fields(kind, settings) for kind in kinds]:
        kind = type(problem)
        solution = solve(problem, tolerance=options.tolerance)
        about = (inspect.getdoc(kind) or "").partition("\n")[0]
        print(f"{kind.__name__}: {about}\n\n{figures(solution)}\n\n{solution.certificate}")
        if options.out is not None:
            options.out.mkdir(parents=True, exist_ok=True)
            stem = options.out / kind.__name__
            solution.plot().savefig(stem.with_suffix(".png"), dpi=110)
            solution.save(stem.with_suffix(".json"))
            print(f"\nwrote {stem}.png\nwrote {stem}.json")


def _models(options: argparse.Namespace) -> None:
    del options
    for line in catalogue():
        print(line)
