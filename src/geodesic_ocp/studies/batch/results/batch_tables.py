"""The tidy tables and the summary of many recordings, from their results."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

from geodesic_ocp.records import write_file
from geodesic_ocp.studies.batch.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.batch.outcome import RecordingOutcome
from geodesic_ocp.studies.batch.results.batch_notes import notes_of
from geodesic_ocp.studies.batch.results.equal_motions import MotionsByProbes
from geodesic_ocp.studies.batch.results.result_file import read_result, results_by_key
from geodesic_ocp.studies.tables.columns import Row
from geodesic_ocp.studies.tables.parquet import PARQUET_HINT, has_parquet
from geodesic_ocp.studies.tables.write_rows import write_rows
from geodesic_ocp.table import Table


class CollectedResults:
    """Rows of the tables, from results that are read one after the other."""

    def __init__(self) -> None:
        self.recordings: list[Row] = []
        self.synergies: list[Row] = []
        self._motions = MotionsByProbes()

    def add(self, record: dict[str, Any]) -> str:
        """Add a result; returns the name of an earlier recording with the same motion, or ""."""
        identity = record["identity"]
        same = self._motions.add(identity["recording"], identity["side"], *record["probes"])
        if same:
            return same
        self.recordings += [identity | row for row in record["recordings"]]
        self.synergies += [identity | row for row in record["synergies"]]
        return ""


def collect(
    folder: Path, outcomes: Sequence[RecordingOutcome]
) -> tuple[CollectedResults, list[RecordingOutcome]]:
    """Rows of all results, and outcomes in which one of several equal motions is kept."""
    collected, kept, paths = CollectedResults(), [], results_by_key(folder)
    for outcome in outcomes:
        record = read_result(paths[outcome.key]) if outcome.key in paths else None
        if outcome.success and record is None:
            text = "its result has disappeared from the folder"
            outcome = RecordingOutcome(outcome.source, "error", text)
        elif record is not None and (same := collected.add(record)):
            text = f"holds the same motion as {same}"
            outcome = RecordingOutcome(outcome.source, "same", text)
        kept.append(outcome)
    return collected, kept


def other_results(folder: Path, outcomes: Iterable[RecordingOutcome]) -> int:
    """Number of results in the folder that belong to none of these recordings."""
    return len(set(results_by_key(folder)) - {outcome.key for outcome in outcomes})


def write_tables(
    folder: Path,
    collected: CollectedResults,
    outcomes: Sequence[RecordingOutcome],
    settings: AnalysisSettings,
    others: int = 0,
) -> tuple[Path, ...]:
    """Write recordings, synergies and failures as tables, and summary.md; returns the paths."""
    failures = [outcome for outcome in outcomes if not outcome.success]
    files = [
        *write_rows(folder, "recordings", collected.recordings),
        *write_rows(folder, "synergies", collected.synergies),
        *write_rows(folder, "failures", [_failure_row(outcome) for outcome in failures]),
        write_file(folder / "summary.md", _summary(collected, outcomes, settings, others)),
    ]
    return tuple(files)


def mean_table(rows: Sequence[Row]) -> Table:
    """Means over recordings of the errors of each method."""
    columns = ("joint_error_rad", "position_error_m", "orientation_error_rad")
    entries: list[tuple[str | int | float, ...]] = []
    for label in dict.fromkeys(str(row["method_label"]) for row in rows):
        own = [row for row in rows if row["method_label"] == label]
        found = [row for row in own if row["joint_error_rad"] is not None]
        means = [
            fmean(float(row[name] or 0.0) for row in found) if found else "-" for name in columns
        ]
        entries.append((label, len(found), *means))
    header = ("method", "recordings", "joints [rad]", "hand [m]", "hand [rad]")
    return Table(header, tuple(entries))


def _summary(
    collected: CollectedResults,
    outcomes: Sequence[RecordingOutcome],
    settings: AnalysisSettings,
    others: int,
) -> str:
    subjects = {row["subject"] for row in collected.recordings}
    failures = [outcome for outcome in outcomes if not outcome.success]
    warned = [outcome for outcome in outcomes if outcome.success and outcome.warnings]
    count = len(outcomes) - len(failures)
    missing = sum(outcome.kind == "missing" for outcome in failures)
    waiting = f", {missing} of them as nobody has analysed them yet" if missing else ""
    lines = [
        "# Analysis of many recordings",
        "",
        f"{count} recordings of {len(subjects)} subjects, {len(collected.synergies)} geodesic "
        f"synergies; {len(failures)} recordings are left out{waiting}.",
        "",
        f"Settings: `{settings!r}` (those not named are the defaults).",
    ]
    for note in notes_of(collected.recordings, others):
        lines += ["", note]
    if not has_parquet():
        lines += ["", f"The tables are CSV alone. {PARQUET_HINT}."]
    if collected.recordings:
        lines += ["", "## Mean errors over the recordings", ""]
        lines.append(mean_table(collected.recordings).markdown().rstrip())
    if failures:
        lines += ["", "## Left out", "", "| recording | kind | reason |", "| --- | --- | --- |"]
        lines += [f"| {_cell(o.source.name)} | {o.kind} | {_cell(o.text)} |" for o in failures]
    if warned:
        lines += ["", "## Warnings", "", "| recording | warning |", "| --- | --- |"]
        lines += [f"| {_cell(o.source.name)} | {_cell('; '.join(o.warnings))} |" for o in warned]
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _failure_row(outcome: RecordingOutcome) -> Row:
    source = outcome.source
    return {
        "recording": source.name,
        "file": source.file,
        "subject": source.subject,
        "subject_from": source.subject_from if source.subject else "",
        "trial": source.trial,
        "side": source.side,
        "kind": outcome.kind,
        "reason": outcome.text,
    }
