"""Analyse many recordings in parallel, with one result file for each."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import closing, nullcontext
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.progress import Progress, no_progress, shows_progress
from geodesic_ocp.recordings.read_recording import that_apply
from geodesic_ocp.recordings.read_recordings import parts_of
from geodesic_ocp.studies.analyse_recording import outcome_of
from geodesic_ocp.studies.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.processes import in_executor, in_processes, usable_cores
from geodesic_ocp.studies.result_files import (
    RESULTS,
    Drawing,
    RecordingOutcome,
    RecordingTask,
    collect,
    locked,
    notes_of,
    other_results,
    read_result,
    result_key,
    results_by_key,
    write_tables,
)
from geodesic_ocp.studies.sources import RecordingSource, recording_sources
from geodesic_ocp.studies.study_tables import TABLES, read_table

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, eq=False, repr=False)
class BatchResult:
    """Result of the analysis of many recordings (`analyse_recordings`).

    Attributes:
        folder: folder of the tables and results.
        analysed: number of recordings that were analysed now.
        found: number of recordings with a result from before.
        failures: those without a result, each with its reason, in the order of the files.
        warned: those with a result whose analysis gave warnings.
        seconds: seconds that the run took.
        files: files of the tables and the summary.
        others: number of results in the folder that are of other recordings, settings or versions,
            and in no table.
        notes: what the tables rest on, in sentences: subjects named after files, assumed heights.
    """

    folder: Path
    analysed: int
    found: int
    failures: tuple[RecordingOutcome, ...]
    warned: tuple[RecordingOutcome, ...]
    seconds: float
    files: tuple[Path, ...]
    others: int = 0
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"BatchResult({self.folder}: {self.counts})"

    @property
    def counts(self) -> str:
        """Numbers of recordings, in words."""
        parts = [f"{self.analysed} analysed"]
        if self.found:
            parts.append(f"{self.found} analysed before")
        missing = sum(outcome.kind == "missing" for outcome in self.failures)
        if missing:
            parts.append(f"{missing} not analysed yet")
        if len(self.failures) > missing or not missing:
            parts.append(f"{len(self.failures) - missing} left out")
        return ", ".join(parts)

    def recordings(self) -> DataFrame:
        """Return rows of recordings.csv, one for each recording and method."""
        return read_table(self.folder / "recordings.csv", "recordings")

    def synergies(self) -> DataFrame:
        """Return rows of synergies.csv, one for each synergy."""
        return read_table(self.folder / "synergies.csv", "synergies")


_LABEL = "analysing recordings"
_WINDOW = 64  # recordings submitted to an executor at a time


@shows_progress
def analyse_recordings(
    paths: str | PathLike[str] | Iterable[str | PathLike[str]],
    out: str | PathLike[str],
    side: Side | Literal["both"] = "right",
    settings: AnalysisSettings | None = None,
    *,
    jobs: int | None = None,
    executor: Executor | None = None,
    recursive: bool = False,
    subject_pattern: str | None = None,
    subjects: str | PathLike[str] | None = None,
    time_limit: float | None = None,
    fit: bool = False,
    draw: Drawing | None = None,
    tables_only: bool = False,
    progress: Progress | None = None,
    finished: Callable[[RecordingOutcome], object] | None = None,
) -> BatchResult:
    """Analyse recordings in parallel, and write tables of all synergies, methods and failures.

    Each result is written to `out` as a whole as soon as it is there. A run that was interrupted
    in whatever way goes on where it was: a recording is analysed again only if its file, the
    settings or the version of the package have changed, or if it failed. A process that dies is
    replaced, and its recording analysed once more, alone.

    In a script, the call must stand under ``if __name__ == "__main__":``, as processes read it.

    >>> import tempfile
    >>> from importlib.resources import files
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     result = go.studies.analyse_recordings(
    ...         files("geodesic_ocp") / "data", folder, "left", jobs=1
    ...     )
    >>> result.analysed, len(result.failures)
    (1, 0)

    Args:
        paths: files, folders, or patterns such as "data/**/*.c3d", see `read_recordings`.
        out: folder for results/ (a file a recording, and one of its synergies, see
            `load_synergies`), recordings.csv, synergies.csv, failures.csv, the same as Parquet if
            pyarrow is installed, and summary.md. The tables hold the recordings of this call.
        side: which arm, or "both".
        settings: settings of the analysis.
        jobs: number of processes, by default one for each core; with an executor the number of
            recordings that are submitted to it at a time, by default 64.
        executor: such as that of Dask, ``Client(...).get_executor()``, whose workers see the same
            files under the same names.
        recursive: also take the files in the folders within a folder.
        subject_pattern: subject pattern of the paths, without their suffix, such as
            "{subject}/{trial}" or "{subject}_*_{trial}".
        subjects: CSV file with the columns file and subject, and, if known, trial, height [m] and
            mass [kg], instead of a pattern; file is the
            end of the recording's path, with or without its suffix.
        time_limit: time limit of a recording [s], after which its process is ended and it is left
            out; not with an executor.
        fit: also compute the errors of cubics, splines and minimum jerk, and how that of each
            recording depends on the joint inertia (profiles.csv), for `StudyResult.joint_inertia`.
            It takes several times as long.
        draw: draws a figure of each recording, which is written beside its result: `go.plot`, or
            another function of a module that takes an analysis and `uncertainty`.
        tables_only: write the tables from the results that there are, without any analysis, also
            while another run works in the folder.
        progress: called with the current step, the amount done, and the total.
        finished: called with the outcome of each recording.

    Raises:
        RecordingError: a folder without recordings, or a table of subjects that cannot be read.
        ValueError: a wrong argument, or another run works in the folder.
        GeodesicOcpError: processes cannot be started, or the executor has ended.
        OSError: the folder cannot be written to.
    """
    if jobs is not None and (isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1):
        raise ValueError(f"jobs must be a positive integer or None, got {jobs!r}")
    if side not in (*get_args(Side), "both"):
        raise ValueError(f"side must be 'right', 'left' or 'both', got {side!r}")
    if time_limit is not None:
        as_positive("time_limit", time_limit, "s")
        if executor is not None:
            raise ValueError("give either a time_limit or an executor, which has limits of its own")
    settings = settings or AnalysisSettings()
    files: dict[str, Any] = {name: str(each.absolute()) for name, each in settings.files().items()}
    settings = replace(settings, **files)  # processes may work in other folders
    sides: Sequence[Side] = get_args(Side) if side == "both" else (side,)
    sources = recording_sources(
        paths, sides, recursive=recursive, pattern=subject_pattern, table=subjects
    )
    if settings.effort and not fit:
        raise ValueError("effort: motions of least effort are part of a study: set fit (--study)")
    start = time.perf_counter()
    folder = Path(os.path.abspath(out))
    own = {folder / f"{name}.csv" for name in TABLES}  # of a run in the recordings' folder
    sources = [
        replace(source, part=part)
        for source in sources
        if source.path not in own
        for part in _parts(source, settings)
    ]
    (folder / RESULTS).mkdir(parents=True, exist_ok=True)
    found: dict[str, RecordingOutcome] = {}
    report = progress or no_progress
    report(_LABEL, 0, len(sources))

    def add(outcome: RecordingOutcome) -> None:
        found[outcome.source.name] = outcome
        if finished is not None:
            finished(outcome)
        report(_LABEL, len(found), len(sources))

    wanted = (fit and not tables_only, None if tables_only else draw)
    tasks = _tasks(sources, settings, folder, time_limit, wanted, add)
    with nullcontext() if tables_only else locked(folder):
        with closing(_run(tasks, jobs, executor, tables_only)) as run:
            for outcome in run:
                add(outcome)
        rows, kept = collect(folder, [found[source.name] for source in sources])
        others = other_results(folder, found.values())
        notes = tuple(notes_of(rows["recordings"], others))
        written = write_tables(folder, rows, kept, settings, notes)
    return BatchResult(
        folder=folder,
        analysed=sum(outcome.kind == "analysed" for outcome in kept),
        found=sum(outcome.kind == "found" for outcome in kept),
        failures=tuple(outcome for outcome in kept if not outcome.success),
        warned=tuple(outcome for outcome in kept if outcome.success and outcome.warnings),
        others=others,
        notes=notes,
        seconds=time.perf_counter() - start,
        files=written,
    )


def _parts(source: RecordingSource, settings: AnalysisSettings) -> Sequence[int | None]:
    if settings.fill is None or source.problem:  # without reading the file
        return (None,)
    return parts_of(source.path, source.side, that_apply(source.path, settings.reading()))


def _run(
    tasks: Iterator[RecordingTask],
    jobs: int | None,
    executor: Executor | None,
    tables_only: bool,
) -> Generator[RecordingOutcome, None, None]:
    """Yield outcomes of the tasks; processes have ended when this is closed."""
    if tables_only:
        for task in tasks:
            yield RecordingOutcome(task.source, "missing", "is not analysed yet")
    elif executor is None:
        yield from in_processes(tasks, jobs or usable_cores())
    else:
        yield from in_executor(executor, tasks, jobs or _WINDOW)


def _tasks(
    sources: Sequence[RecordingSource],
    settings: AnalysisSettings,
    folder: Path,
    time_limit: float | None,
    wanted: tuple[bool, Drawing | None],
    add: Callable[[RecordingOutcome], None],
) -> Iterator[RecordingTask]:
    """Yield the recordings that are to be analysed; outcomes of the others are added on the way.

    Args:
        sources, settings, folder, time_limit: of the tasks.
        wanted: whether a result has the profile of the joint inertia, and what draws its figure.
        add: called with each outcome.
    """
    known = results_by_key(folder)
    first: dict[str, str] = {}  # names of recordings by key
    for source in sources:
        outcome = RecordingOutcome(source, "file", source.problem)
        if not source.problem:
            try:
                key = result_key(source, settings)
            except OSError as failure:
                outcome = RecordingOutcome(source, "file", f"cannot be read: {failure.strerror}")
            else:
                same = first.setdefault(key, source.name)
                profile, draw = wanted
                record = None
                if key in known:
                    record = read_result(known[key], profile, draw is not None)
                if same != source.name:
                    outcome = RecordingOutcome(source, "same", f"is the same file as {same}")
                elif record is None:
                    yield RecordingTask(source, settings, folder, key, time_limit, *wanted)
                    continue
                else:
                    outcome = outcome_of(source, key, record)
        add(outcome)
