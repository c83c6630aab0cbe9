"""The analysis of one recording of many, in a process of its own or in this one."""

from __future__ import annotations

import gc
import multiprocessing
import signal
import tempfile
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.anthropometry import Sides
from geodesic_ocp.progress import Progress
from geodesic_ocp.recordings.read_recording import read_recording, that_apply
from geodesic_ocp.records import replacing, write_file
from geodesic_ocp.studies.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.joint_inertias import profile_rows
from geodesic_ocp.studies.result_files import (
    RESULTS,
    SYNERGIES,
    OutcomeKind,
    RecordingOutcome,
    RecordingTask,
    figure_file,
    read_result,
    result_name,
    write_result,
)
from geodesic_ocp.studies.sources import RecordingSource, person_row, stature
from geodesic_ocp.studies.study_tables import Row, recording_rows, synergy_rows
from geodesic_ocp.synergies.analyse import Analysis, analyse
from geodesic_ocp.synergies.synergy import save_synergies
from geodesic_ocp.trajectory.files.text_lines import unless_stated
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.recording import Recording


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """End this process by SIGALRM if the body takes longer; None sets no limit.

    The system does so also while a solver runs, which no exception could leave. Nothing is done
    outside the main thread of a process that was started for the work.
    """
    started = multiprocessing.parent_process() is not None
    if seconds is None or not started or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def read_by_settings(
    path: Path,
    side: Sides,
    settings: AnalysisSettings,
    height: float | None,
    mass: float | None,
    *,
    one_of_many: bool = False,
    part: int | None = None,
) -> Recording:
    """Read a recording as the settings say, with a height [m] and mass [kg] of the person.

    One of many may have another format than those to which convention, skeleton, unit, rate and up
    apply, which are then left out, or may state what others do not. A part of it takes the place of
    that of the settings.

    Raises:
        RecordingError, ValueError, ImportError: as `read_recording`.
    """
    stated = settings.reading()
    stated["part"] = part or stated["part"]
    if one_of_many:
        stated = that_apply(path, stated)
    with unless_stated() if one_of_many else nullcontext():
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
        recording: recording with the armature of the settings.
        settings: settings of the metric and the segments.
        metric: in place of that of the settings.
        progress: called with the current step, the amount done, and the total.

    Raises:
        ValueError, NotConverged: as `analyse`.
    """
    model = recording.model
    motion = recording.motion
    metric = settings.metric_of(model) if metric is None else metric
    return analyse(
        model,
        motion,
        metric=metric,
        segments=settings.cutting(model, progress),
        noise=None if recording.fit is None else recording.fit.noise,
        progress=progress,
    )


_PROBES = 8  # samples by which equal motions are recognised

# Warnings cannot be told apart between threads: an executor of threads analyses one at a time.
_one_at_a_time = threading.Lock()


def run_task(task: RecordingTask) -> RecordingOutcome:
    """Analyse a recording and write its result; never raises for what is in the file.

    Raises:
        OSError: the result cannot be written.
    """
    with _one_at_a_time:
        try:
            with time_limit(task.time_limit):
                return _analysed(task)
        finally:
            gc.collect()  # models and compiled functions refer to each other


def _analysed(task: RecordingTask) -> RecordingOutcome:
    target = task.folder / RESULTS / result_name(task.source, task.key)
    if (
        record := read_result(target, task.fit, task.draw is not None)
    ) is not None:  # of a process that died right after it
        return outcome_of(task.source, task.key, record)
    start = time.perf_counter()
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            record, synergies = _result(task, target)
    except (ValueError, OSError, ImportError) as failure:
        return _failed(task, "file", failure)
    except GeodesicOcpError as failure:
        return _failed(task, "solver", failure)
    except Exception as failure:  # an error in a reader or in the analysis: the others go on
        return _failed(task, "error", failure)
    record["warnings"] = list(dict.fromkeys(" ".join(str(each.message).split()) for each in caught))
    seconds = time.perf_counter() - start
    for row in record["recordings"]:
        row["computation_s"] = seconds
    write_file(target.with_suffix(SYNERGIES), synergies, lasting=True)
    write_result(target, record)  # last: it makes the result
    return replace(outcome_of(task.source, task.key, record), kind="analysed", seconds=seconds)


def _failed(task: RecordingTask, kind: OutcomeKind, failure: Exception) -> RecordingOutcome:
    reason = " ".join(str(failure).split()).removeprefix(f"{task.source.path}: ")
    if kind == "error":
        reason = f"{type(failure).__name__}: {reason}"
    return RecordingOutcome(task.source, kind, reason)


def _result(task: RecordingTask, target: Path) -> tuple[dict[str, Any], str]:
    """Return the record of the result and the text of the synergies' file; write the figure."""
    source = task.source
    settings = task.settings
    height, mass = stature(settings, source)
    recording = read_by_settings(
        source.path, source.side, settings, height, mass, one_of_many=True, part=source.part
    )
    analysis = analyse_recording(recording, settings)
    spread = analysis.uncertainty() if settings.uncertainty else None
    motion = analysis.motion
    if task.draw is not None:
        with replacing(figure_file(target)) as temporary:
            task.draw(analysis, uncertainty=spread).savefig(temporary, format="png", dpi=110)
    digest = settings.digest()
    same: Row = person_row(recording, settings, source) | {"settings": digest}
    own: Row = {"settings": digest}
    record = {
        "key": task.key,
        "package": version("geodesic_ocp"),
        "settings": settings.record(),
        "own_subject": motion.subject.name,
        "probes": _probes(motion),
        "recordings": [
            same | row for row in recording_rows(analysis, task.fit, settings.effort, spread)
        ],
        "synergies": [own | row for row in synergy_rows(analysis, spread)],
    }
    if task.fit:
        record["profiles"] = profile_rows(analysis)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "synergies.json"
        save_synergies(
            file,
            synergies=analysis.synergies,
            joint_names=motion.joint_names,
            model=analysis.model,
            doubts=motion.doubts,
        )
        return record, file.read_text(encoding="utf-8")


def _probes(motion: Motion) -> list[Any]:
    """Get number of samples, and the recorded angles at some of them: equal for equal motions."""
    q = motion.q if motion.unfiltered is None else motion.unfiltered
    rows = np.linspace(0, len(q) - 1, _PROBES).round().astype(int)
    return [len(q), q[rows].ravel().tolist()]


def outcome_of(source: RecordingSource, key: str, record: dict[str, Any]) -> RecordingOutcome:
    """Return the outcome of a recording that has a result."""
    own = record["recordings"][0]
    text = (
        f"{own['segments']} synergies, joints to {own['joint_error_rad']:.3f} rad, hand to "
        f"{1e3 * own['position_error_m']:.0f} mm"
    )
    if doubts := own.get("doubts"):
        text += f"; doubtful: {doubts}"
    return RecordingOutcome(source, "found", text, key, tuple(record.get("warnings", ())))
