"""Recordings as they are, or analysed first."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import get_args

import numpy as np

from geodesic_ocp.cli.analyse.recording_options import stated
from geodesic_ocp.cli.interrupts import ProgressBar
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.anthropometry import Side, trunk
from geodesic_ocp.model.combine import combine
from geodesic_ocp.model.human import DEFAULT_HEIGHT, stature
from geodesic_ocp.model.model import Model
from geodesic_ocp.recordings.read_markers import read_markers
from geodesic_ocp.recordings.read_recording import read_recording
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.scenes.motions.of_motion import motion_playback
from geodesic_ocp.scenes.playback import Playback
from geodesic_ocp.scenes.playback_of import playback_of
from geodesic_ocp.scenes.recorded.of_analysis import analysis_playback
from geodesic_ocp.scenes.recorded.of_markers import marker_fit_playback
from geodesic_ocp.studies.batch.analyse_recording import analyse_recording
from geodesic_ocp.studies.batch.analysis_settings import AnalysisSettings
from geodesic_ocp.trajectory.motion import Motion


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


def recording_playbacks(file: Path, options: argparse.Namespace) -> Iterator[Playback]:
    """The motion of a recording, of both arms in one pane, or the person fitted to its markers.

    Raises:
        RecordingError: the file cannot be read, or has no such arm.
    """
    found = recordings(file, options)
    if len(found) == 2 and not any(each.fit for each in found):
        yield motion_playback(*_together(*found), title=f"{file.stem}, both arms")
        return
    for recording in found:
        if recording.fit is None:
            yield playback_of(recording, title=recording.name)
        else:
            markers = read_markers(file, up=options.up)
            yield marker_fit_playback(recording.fit, markers, title=recording.name)


def _together(right: Recording, left: Recording) -> tuple[Motion, Model]:
    """Both arms of a person as one motion of one model, with the origin between the shoulders."""
    height = stature(right.model) or DEFAULT_HEIGHT
    across = trunk().half_width * height
    model = combine(right.model, left.model, placements=[(across, 0.0, 0.0), (-across, 0.0, 0.0)])
    motions = right.motion, left.motion
    q = np.hstack([each.q for each in motions])
    velocity = np.hstack([np.asarray(each.velocity) for each in motions])
    one = motions[0]
    return Motion(one.time, q, model.joint_names, velocity, one.subject, trunk=one.trunk), model


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
