"""One recording, read and analysed by settings."""

from __future__ import annotations

from pathlib import Path

from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.progress import Progress
from geodesic_ocp.recordings.read_recording import read_recording, that_apply
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.studies.batch.analysis_settings import AnalysisSettings
from geodesic_ocp.synergies.analyse import Analysis, analyse


def read_by_settings(
    path: Path,
    side: Side,
    settings: AnalysisSettings,
    height: float | None,
    mass: float | None,
    *,
    one_of_many: bool = False,
) -> Recording:
    """Read a recording as the settings say, with a height [m] and mass [kg] of the person.

    One of many may have another format than those to which convention, skeleton, unit, rate and up
    apply, which are then left out.

    Raises:
        RecordingError, ValueError, ImportError: as `read_recording`.
    """
    stated = settings.reading()
    if one_of_many:
        stated = that_apply(path, stated)
    return read_recording(
        path,
        side,
        height=height,
        mass=mass,
        armature=settings.armature or 0.0,
        resample=settings.resample,
        cutoff=settings.cutoff,
        duration=settings.savitzky_golay,
        unfiltered=not settings.filter,
        **stated,
    )


def analyse_recording(
    recording: Recording,
    settings: AnalysisSettings,
    *,
    metric: Metric | None = None,
    progress: Progress | None = None,
) -> Analysis:
    """Analyse a recording, whose motion is filtered already, as the settings say.

    Args:
        recording: with the armature of the settings.
        settings: of the metric and the segments.
        metric: in place of that of the settings.
        progress: called with the current step, the amount done, and the total.

    Raises:
        ValueError, NotConverged: as `analyse`.
    """
    model, motion = recording.model, recording.motion
    metric = settings.metric_of(model) if metric is None else metric
    return analyse(
        model,
        motion,
        settings.threshold,
        metric=metric,
        segments=settings.segments_of(metric, motion, model, progress),
        rest=settings.rest_speed,
        rest_duration=settings.rest_duration,
        min_duration=settings.min_duration,
        hysteresis=settings.hysteresis,
        progress=progress,
    )
