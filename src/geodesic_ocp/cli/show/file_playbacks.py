"""Playbacks of what is in files, each read by what it is."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from geodesic_ocp.cli.notes import printed_warnings
from geodesic_ocp.cli.show.file_kind import Kind, file_kind
from geodesic_ocp.cli.show.folder_files import folder_files
from geodesic_ocp.cli.show.recordings import analysed, recording_playbacks, recordings
from geodesic_ocp.cli.show.robot_files import alignment_file, robot_playback, trajectory_file
from geodesic_ocp.cli.show.shown_robot import is_installed
from geodesic_ocp.cli.show.solution_files import problem_playbacks, solution_file
from geodesic_ocp.cli.show.synergy_playback import synergies_file
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.scenes.playback import Playback
from geodesic_ocp.studies.batch.results.result_file import SYNERGIES

_Found = tuple[Path | str, Kind]


def file_playbacks(options: argparse.Namespace) -> list[Playback]:
    """What is in the files, in their order; synergies are shown with the recording if one is given.

    Raises:
        ValueError: a file cannot be read or shown; names it.
        NotConverged: a problem has no solution, or no motion fits markers.
    """
    found = list(_found(options.file))
    recorded = [file for file, kind in found if kind == "recording"]
    synergies = [file for file, kind in found if kind == "synergies"]
    together = len(recorded) == 1 and len(synergies) == 1 and not options.analyse
    playbacks: list[Playback] = []
    for file, kind in found:
        if isinstance(file, str):
            playbacks.append(robot_playback(file, options))
            continue
        if together and kind == "recording":
            continue
        with printed_warnings():
            playbacks += _of(file, kind, options, recorded[0] if together else None)
    return playbacks


def _found(names: list[str]) -> Iterator[_Found]:
    """Files with what is in them, those in folders included, and names of robots."""
    for name in names:
        path = Path(name)
        if is_installed(name):
            if path.is_dir():
                print(f"note: {name} is the robot of that name; the folder is ./{name}")
            yield name, "robot"
        elif path.is_dir():
            yield from ((file, file_kind(file)) for file in folder_files(path))
        elif not path.exists():
            if path.suffix and not path.suffix[1:].isdigit():
                raise RecordingError(f"{name}: there is no such file")
            yield name, "robot"
        else:
            kind = file_kind(path)
            if kind == "result":  # of many recordings; the synergies are beside it
                path, kind = path.with_suffix(SYNERGIES), "synergies"
            yield (name if kind == "robot" else path), kind


def _of(
    file: Path, kind: Kind, options: argparse.Namespace, recorded: Path | str | None
) -> Iterator[Playback]:
    if kind == "recording" and options.analyse:
        yield from (analysed(recording) for recording in recordings(file, options))
    elif kind == "recording":
        yield from recording_playbacks(file, options)
    elif kind == "synergies":
        yield synergies_file(file, options, None if recorded is None else Path(recorded))
    elif kind == "trajectory":
        yield trajectory_file(file, options)
    elif kind == "alignment":
        yield alignment_file(file, options)
    elif kind == "solution":
        yield solution_file(file, options)
    else:
        yield from problem_playbacks(file)
