"""The analysis of one recording by settings."""

from __future__ import annotations

from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.progress import Progress
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.studies.batch.analysis_settings import AnalysisSettings
from geodesic_ocp.synergies.analyse import analyse
from geodesic_ocp.synergies.analysis import Analysis


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
        rest=settings.rest,
        rest_duration=settings.rest_duration,
        min_duration=settings.min_duration,
        hysteresis=settings.hysteresis,
        progress=progress,
    )
