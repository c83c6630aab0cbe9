"""The analysis of one of many recordings, wherever it runs."""

from __future__ import annotations

import gc
import json
import os
import tempfile
import threading
import time
import warnings
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.records import write_file
from geodesic_ocp.studies.batch.analyse_recording import analyse_recording, read_by_settings
from geodesic_ocp.studies.batch.outcome import OutcomeKind, RecordingOutcome, RecordingTask
from geodesic_ocp.studies.batch.person import identity, person_row, stature
from geodesic_ocp.studies.batch.processes.time_limit import time_limit
from geodesic_ocp.studies.batch.results.result_file import (
    FORMAT,
    RESULTS,
    SYNERGIES,
    VERSION,
    read_result,
    result_name,
)
from geodesic_ocp.studies.batch.sources.recording_source import RecordingSource
from geodesic_ocp.studies.tables.analysis_rows import recording_rows, synergy_rows
from geodesic_ocp.studies.tables.columns import Row
from geodesic_ocp.synergies.synergy import save_synergies
from geodesic_ocp.trajectory.motion import Motion

RUNNING = "running"  # folder of files that name the recording of each process
_PROBES = 8  # samples by which equal motions are recognised

# Warnings cannot be told apart between threads: an executor of threads analyses one at a time.
_one_at_a_time = threading.Lock()


def run_task(task: RecordingTask) -> RecordingOutcome:
    """Analyse a recording and write its result; never raises for what is in the file.

    Raises:
        OSError: the result cannot be written.
    """
    note = task.folder / RUNNING / str(os.getpid())
    with _one_at_a_time:
        note.write_text(task.key, encoding="utf-8")
        try:
            with time_limit(task.time_limit):
                return _analysed(task)
        finally:
            note.unlink(missing_ok=True)
            gc.collect()  # models and compiled functions refer to each other


def _analysed(task: RecordingTask) -> RecordingOutcome:
    target = task.folder / RESULTS / result_name(task.source, task.key)
    if (record := read_result(target)) is not None:  # of a process that died right after it
        return outcome_of(task.source, task.key, record)
    start = time.perf_counter()
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            record, synergies = _result(task)
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
    write_file(
        target, json.dumps(record, allow_nan=False), lasting=True
    )  # last: it makes the result
    return replace(outcome_of(task.source, task.key, record), kind="analysed", seconds=seconds)


def _failed(task: RecordingTask, kind: OutcomeKind, failure: Exception) -> RecordingOutcome:
    reason = " ".join(str(failure).split()).removeprefix(f"{task.source.path}: ")
    if kind == "error":
        reason = f"{type(failure).__name__}: {reason}"
    return RecordingOutcome(task.source, kind, reason)


def _result(task: RecordingTask) -> tuple[dict[str, Any], str]:
    """The record of the result and the text of the synergies' file."""
    source, settings = task.source, task.settings
    height, mass = stature(settings, source)
    recording = read_by_settings(source.path, source.side, settings, height, mass, one_of_many=True)
    analysis = analyse_recording(recording, settings)
    motion = analysis.motion
    digest = settings.digest()
    same: Row = person_row(recording, settings, source) | {"settings": digest}
    own: Row = {"settings": digest}
    record = {
        "format": FORMAT,
        "version": VERSION,
        "key": task.key,
        "package": version("geodesic_ocp"),
        "settings": settings.record(),
        "own_subject": motion.subject.name,
        "probes": _probes(motion),
        "identity": identity(source, motion.subject.name),
        "recordings": [same | row for row in recording_rows(analysis)],
        "synergies": [own | row for row in synergy_rows(analysis)],
    }
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "synergies.json"
        save_synergies(file, analysis.synergies, motion.joint_names, analysis.model)
        return record, file.read_text(encoding="utf-8")


def _probes(motion: Motion) -> list[Any]:
    """Number of samples, and the recorded angles at some of them: equal for equal motions."""
    q = motion.q if motion.unfiltered is None else motion.unfiltered
    rows = np.linspace(0, len(q) - 1, _PROBES).round().astype(int)
    return [len(q), q[rows].ravel().tolist()]


def outcome_of(source: RecordingSource, key: str, record: dict[str, Any]) -> RecordingOutcome:
    """The outcome of a recording that has a result."""
    own = record["recordings"][0]
    text = (
        f"{own['segments']} synergies, joints to {own['joint_error_rad']:.3f} rad, hand to "
        f"{1e3 * own['position_error_m']:.0f} mm"
    )
    return RecordingOutcome(source, "found", text, key, tuple(record.get("warnings", ())))
