"""Many recordings, analysed in parallel with the options of the command line."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import closing, contextmanager, nullcontext
from typing import Any

from geodesic_ocp.cli.analyse.analysis_options import settings_of
from geodesic_ocp.cli.interrupts import ProgressBar
from geodesic_ocp.studies.batch.analyse_recordings import analyse_recordings
from geodesic_ocp.studies.batch.batch_result import BatchResult
from geodesic_ocp.studies.batch.outcome import RecordingOutcome
from geodesic_ocp.studies.batch.results.batch_tables import mean_table
from geodesic_ocp.studies.tables.parquet import PARQUET_HINT, has_parquet


def analyse_many(options: argparse.Namespace) -> int:
    """Analyse recordings, print each as it is finished, and the tables; returns the exit code.

    Raises:
        RecordingError, ValueError, GeodesicOcpError, OSError: as `analyse_recordings`.
    """
    settings = settings_of(options)
    cluster = nullcontext((None, None)) if options.scheduler is None else _dask(options.scheduler)
    with cluster as (executor, window), closing(ProgressBar()) as bar:
        shown: set[str] = set()  # names of those left out

        def show(outcome: RecordingOutcome) -> None:
            if not outcome.success:
                shown.add(outcome.source.name)
            if outcome.kind not in ("found", "missing"):
                text = f"left out: {outcome}" if not outcome.success else str(outcome)
                took = f" ({outcome.seconds:.1f} s)" if outcome.seconds else ""
                bar.line(text + took)
                for warning in outcome.warnings:
                    bar.line(f"  note: {warning}")

        try:
            result = analyse_recordings(
                options.file,
                options.out,
                options.side,
                settings,
                jobs=options.jobs if executor is None else window,
                executor=executor,
                recursive=options.recursive,
                subject_pattern=options.subject_from,
                subjects=options.subjects,
                time_limit=options.time_limit,
                tables_only=options.tables_only,
                progress=bar,
                finished=show,
            )
        except KeyboardInterrupt:
            bar.line("Finished recordings are kept: the same command goes on from here.")
            raise
    for outcome in result.failures:
        if outcome.source.name not in shown:  # as the same motion as another
            print(f"left out: {outcome}")
    _summarize(result)
    return 1 if result.failures else 0


@contextmanager
def _dask(address: str) -> Iterator[tuple[Executor, int]]:
    """The executor of a Dask cluster, and how many recordings to submit to it at a time.

    Raises:
        ValueError: Dask is not installed, no scheduler answers, or it has no workers.
    """
    try:
        import distributed
    except ImportError:
        raise ValueError(
            "--scheduler needs Dask: pip install 'geodesic_ocp[cluster]', here and on the workers"
        ) from None
    new_client: Any = distributed.Client
    try:
        client = new_client(address, set_as_default=False)
    except (OSError, ValueError) as failure:
        raise ValueError(f"--scheduler {address}: no scheduler answers: {failure}") from None
    with client:
        workers = client.nthreads()
        if not workers:
            raise ValueError(f"--scheduler {address}: it has no workers")
        yield client.get_executor(pure=False), 3 * len(workers)


def _summarize(result: BatchResult) -> None:
    rows = result.recordings()
    print(f"\n{result.counts}, in {result.seconds:.1f} s")
    if rows:
        print(f"\nmean errors over the recordings\n\n{mean_table(rows)}")
    for note in result.notes:
        print(f"\nnote: {note}")
    print()
    for file in result.files:
        print(f"wrote {file}")
    if not has_parquet():
        print(f"{PARQUET_HINT}.")
