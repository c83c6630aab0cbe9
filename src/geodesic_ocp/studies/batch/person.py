"""The person of a recording, as the tables describe it, and where that is from."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.recordings.read_recording import stature_of
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.studies.batch.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.batch.sources.recording_source import RecordingSource
from geodesic_ocp.studies.tables.columns import Row


def identity(source: RecordingSource, own_subject: str) -> dict[str, str]:
    """What identifies a recording in the tables, with the subject that the file names."""
    subject, subject_from = source.subject, str(source.subject_from)
    if not subject:
        subject, subject_from = own_subject, "file"
    if not subject:
        subject, subject_from = source.fallback, source.fallback_from
    return {
        "recording": source.name,
        "file": source.file,
        "subject": subject,
        "subject_from": subject_from,
        "trial": source.trial,
        "side": source.side,
    }


def stature(
    settings: AnalysisSettings, source: RecordingSource
) -> tuple[float | None, float | None]:
    """Height [m] and mass [kg] by the settings or the table of subjects; None if unknown."""
    return (
        source.height if settings.height is None else settings.height,
        source.mass if settings.mass is None else settings.mass,
    )


def person_row(recording: Recording, settings: AnalysisSettings, source: RecordingSource) -> Row:
    """Height and mass of the model, what they rest on, and the errors of markers."""
    subject, fit = recording.motion.subject, recording.fit
    height, mass = stature_of(subject, *stature(settings, source))
    row: Row = {"height_m": height, "mass_kg": mass}
    for name in ("height", "mass"):
        if getattr(settings, name) is not None:
            origin = "given"
        elif getattr(source, name) is not None:
            origin = "table"
        elif name == "height" and fit is not None and fit.height is not None:
            origin = "file" if "subject" in fit.height_from else "markers"
        else:
            origin = "assumed" if getattr(subject, name) is None else "file"
        row[f"{name}_from"] = origin
    row["marker_error_m"] = None if fit is None else float(np.nanmean(fit.errors))
    return row
