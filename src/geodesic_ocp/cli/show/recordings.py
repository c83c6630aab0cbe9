"""Recordings as they are, or analysed first."""

from __future__ import annotations

import argparse
import warnings
from contextlib import closing
from pathlib import Path
from typing import get_args

from geodesic_ocp.cli.analyse.recording_options import stated
from geodesic_ocp.cli.interrupts import ProgressBar
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.human.anthropometry import Side
from geodesic_ocp.recordings.read_recording import read_recording
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.scenes.of_analysis import analysis_playback
from geodesic_ocp.scenes.playback import Playback
from geodesic_ocp.scenes.playback_of import playback_of
from geodesic_ocp.studies.batch.analyse_recording import analyse_recording
from geodesic_ocp.studies.batch.analysis_settings import AnalysisSettings


def recordings(file: Path, options: argparse.Namespace) -> list[Recording]:
    """The recording of the arm that is asked for, or of both.

    Without --side, of the right arm, or of the left one if the file has no other.

    Raises:
        RecordingError: the file cannot be read, or has no such arm.
    """
    if options.side is not None:
        sides = get_args(Side) if options.side == "both" else (options.side,)
        return [_read(file, side, options) for side in sides]
    try:
        return [_read(file, "right", options)]
    except RecordingError as error:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                found = _read(file, "left", options)
            except RecordingError:
                raise error from None
        print(f"note: {file}: the left arm; there is no right one")
        return [found]


def _read(file: Path, side: Side, options: argparse.Namespace) -> Recording:
    return read_recording(file, side, height=options.height, mass=options.mass, **stated(options))


def recording_playback(recording: Recording) -> Playback:
    """The motion of a recording, or the person that was fitted to its markers."""
    return playback_of(recording, title=recording.name)


def analysed(recording: Recording) -> Playback:
    """The observed arm and the one that the synergies of a recording predict.

    Raises:
        ValueError: the recording is too short to be analysed; names it.
    """
    settings = AnalysisSettings()
    metric = settings.metric_of(recording.model)
    try:
        with closing(ProgressBar()) as bar:
            found = analyse_recording(recording, settings, metric=metric, progress=bar)
    except ValueError as error:
        raise ValueError(f"{recording.name}: {error}") from None
    count = len(found.synergies)
    return analysis_playback(found, title=f"{recording.name}: {count} geodesic synergies")
