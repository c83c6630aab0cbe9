"""Tables of many recordings with numbers that are drawn or chosen."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from geodesic_ocp.studies.study_result import StudyResult
from geodesic_ocp.studies.study_tables import Row, new_rows, write_table

LABELS = {
    "riemannian": "geodesics, kinetic energy with joint inertia",
    "kinetic_energy": "geodesics, kinetic energy",
    "euclidean_same_segments": "straight lines, same segments",
}


def rows_of(
    name: str, subject: str, errors: Mapping[str, float | None], **more: str | float
) -> list[Row]:
    """One row for each method, with these joint errors [rad]; the hand's are proportional."""
    return [
        {
            "recording": name,
            "file": f"{name}.csv",
            "subject": subject,
            "side": "right",
            "duration_s": 2.0,
            "metric": "kinetic energy",
            "method": method,
            "method_label": LABELS.get(method, method),
            "segments": 2,
            "joint_error_rad": error,
            "position_error_m": None if error is None else error / 2.0,
            "orientation_error_rad": None if error is None else error * 3.0,
            **more,
        }
        for method, error in errors.items()
    ]


def synergies_of(name: str, subject: str, durations: tuple[float, float]) -> list[Row]:
    """Two synergies of one recording."""
    return [
        {
            "recording": name,
            "subject": subject,
            "synergy": number,
            "duration_s": duration,
            "length": duration / 2.0,
            "joint_error_rad": 0.01 * number,
            "position_error_m": 0.005 * number,
            "orientation_error_rad": 0.03 * number,
        }
        for number, duration in enumerate(durations, 1)
    ]


def drawn(seed: int, subjects: int, trials: int) -> tuple[list[Row], list[Row]]:
    """Recordings and synergies of subjects whose errors differ, the geodesics' being smaller."""
    rng = np.random.default_rng(seed)
    recordings: list[Row] = []
    synergies: list[Row] = []
    for k in range(1, subjects + 1):
        level = float(np.exp(0.3 * rng.normal()))
        for trial in range(trials):
            name, subject = f"S{k}_{trial}", f"S{k}"
            scale = level * np.exp(0.1 * rng.normal(size=3))
            errors = dict(zip(LABELS, (scale * (0.02, 0.06, 0.03)).tolist(), strict=True))
            recordings += rows_of(name, subject, errors, trial=str(trial))
            low, high = np.sort(rng.uniform(0.2, 1.4, 2)).tolist()
            synergies += synergies_of(name, subject, (low, high))
    return recordings, synergies


def written(folder: Path, recordings: list[Row], synergies: list[Row] | None = None) -> Path:
    """The folder with the tables in it."""
    write_table(folder, "recordings", recordings)
    if synergies is not None:
        write_table(folder, "synergies", synergies)
    return folder


def study_of_rows(
    recordings: Iterable[Row],
    synergies: Iterable[Row] | None = None,
    failures: Iterable[Row] = (),
    by: str | None = None,
) -> StudyResult:
    """The study of rows in memory."""
    return StudyResult(
        new_rows(recordings, "recordings"),
        None if synergies is None else new_rows(synergies, "synergies"),
        new_rows(failures, "failures"),
        by,
    )
