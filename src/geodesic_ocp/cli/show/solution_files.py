"""Problems, which are solved, and solutions that were saved."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from geodesic_ocp.cli.solve.problem_file import problem_classes
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.ocp.load_solution import load_solution
from geodesic_ocp.ocp.solve import solve
from geodesic_ocp.scenes.paths.of_solution import solution_playback
from geodesic_ocp.scenes.playback import Playback


def problem_playbacks(file: Path) -> Iterator[Playback]:
    """The solutions of the problems that a Python file defines.

    Raises:
        ValueError: the file cannot be run, or defines no problem.
        NotConverged: a problem has no solution.
    """
    for each in problem_classes(file):
        yield solution_playback(solve(each()))


def solution_file(file: Path, options: argparse.Namespace) -> Playback:
    """A solution that geodesic-ocp solve wrote.

    Raises:
        RecordingError: the file cannot be read, or its problem is not known.
    """
    if options.problem is not None:
        problem_classes(options.problem)  # load_solution finds the class among those imported
    try:
        return solution_playback(load_solution(file))
    except RecordingError as error:
        if options.problem is not None or "not imported" not in str(error):
            raise
        reason = str(error).partition(";")[0]
        raise RecordingError(
            f"{reason}; give the file that defines it: --problem FILE.py"
        ) from None
