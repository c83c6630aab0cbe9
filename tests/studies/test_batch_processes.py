"""Processes that die cost at most their own recording."""

from __future__ import annotations

import errno
import os
import signal
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from dataclasses import replace
from itertools import count, islice
from pathlib import Path
from typing import Any

import pytest
from deadly_path import DeadlyPath, EndlessPath

import geodesic_ocp as go
from geodesic_ocp.studies import processes
from geodesic_ocp.studies.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.processes import completed, in_executor, in_processes
from geodesic_ocp.studies.result_files import RecordingOutcome, RecordingTask, locked
from geodesic_ocp.studies.sources import RecordingSource


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path


def task(folder: Path, name: str, path: Any = None) -> RecordingTask:
    """A recording without a file, which ends soon, with a reason."""
    source = RecordingSource(path or folder / name, name, "right")
    return RecordingTask(source, AnalysisSettings(), folder, name)


def tasks(folder: Path, number: int) -> list[RecordingTask]:
    return [task(folder, f"{index}.csv") for index in range(number)]


def by_name(outcomes: Iterator[RecordingOutcome]) -> dict[str, RecordingOutcome]:
    found: dict[str, RecordingOutcome] = {}
    for outcome in outcomes:
        assert outcome.source.file not in found, "a recording has two outcomes"
        found[outcome.source.file] = outcome
    return found


@pytest.mark.slow
def test_processes_that_die_twice_are_named_with_their_recordings(folder: Path) -> None:
    given = tasks(folder, 4)
    given[1] = task(folder, "killed.csv", DeadlyPath(signal.SIGKILL))
    given[2] = task(folder, "ended.csv", DeadlyPath(0))
    found = by_name(in_processes(iter(given), 2))
    assert set(found) == {each.source.file for each in given}
    for name, words in (
        ("killed.csv", "was killed (SIGKILL"),
        ("ended.csv", "ended with exit code 7"),
    ):
        dead = found.pop(name)
        assert dead.kind == "process"
        assert words in dead.text
    assert {each.kind for each in found.values()} == {"file"}  # there is no such file


@pytest.mark.slow
def test_a_process_that_dies_once_costs_nothing(folder: Path) -> None:
    """Also by the signal by which the executor ends processes itself."""
    flag = folder / "flag"
    given = [*tasks(folder, 2), task(folder, "deadly.csv", DeadlyPath(signal.SIGTERM, flag))]
    found = by_name(in_processes(iter(given), 2))
    assert flag.exists()
    assert set(found) == {each.source.file for each in given}
    assert all(each.kind != "process" for each in found.values())


@pytest.mark.slow
def test_a_recording_that_takes_too_long_is_left_out(folder: Path) -> None:
    given = tasks(folder, 3)
    given[1] = replace(task(folder, "endless.csv", EndlessPath()), time_limit=0.5)
    found = by_name(in_processes(iter(given), 2))
    endless = found.pop("endless.csv")
    assert (endless.kind, endless.text) == ("process", "took longer than the time limit")
    assert {each.kind for each in found.values()} == {"file"}
    assert len(found) == 2


@pytest.mark.slow
def test_processes_are_replaced_so_that_memory_stays_bounded(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[int] = []

    class Counted(processes.ProcessPoolExecutor):
        def __init__(self, jobs: int, **settings: Any) -> None:
            started.append(jobs)
            super().__init__(jobs, **settings)

    monkeypatch.setattr(processes, "ProcessPoolExecutor", Counted)
    monkeypatch.setattr(processes, "_RENEWAL", 2)
    before = dict(os.environ)
    assert len(list(in_processes(iter(tasks(folder, 3)), 1))) == 3
    assert started == [1, 1]
    assert dict(os.environ) == before  # which says how many threads a process may have


class Slow(Executor):
    """Ends the oldest call when `most` are open."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.open: list[Future[Any]] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.open = [each for each in self.open if not each.done()]
        assert len(self.open) < self.most
        self.open.append(Future())
        if len(self.open) == self.most:
            self.open[0].set_result(None)
        return self.open[-1]


def test_few_of_endlessly_many_recordings_are_submitted_at_a_time(folder: Path) -> None:
    executor, taken = Slow(5), count()
    endless = (task(folder, f"{next(taken)}.csv") for _ in count())
    finished = completed(executor, endless, 5)
    assert len(list(islice(finished, 50))) == 50
    assert next(taken) <= 55
    finished.close()
    assert all(each.done() for each in executor.open)  # cancelled


class Failing(Executor):
    """Loses the first submissions of every recording, as a cluster whose worker has died."""

    def __init__(self, times: int) -> None:
        self.left: dict[str, int] = {}
        self.times = times

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        left = self.left.setdefault(args[0].key, self.times)
        self.left[args[0].key] = left - 1
        if left > 1:
            future.cancel()
            future.set_running_or_notify_cancel()
        elif left > 0:
            future.set_exception(RuntimeError("the worker was lost"))
        else:
            future.set_result(fn(*args))
        return future


@pytest.mark.slow
def test_a_recording_that_an_executor_loses_is_tried_once_more(folder: Path) -> None:
    once = by_name(in_executor(Failing(1), iter(tasks(folder, 3)), 2))
    assert {each.kind for each in once.values()} == {"file"}
    twice = by_name(in_executor(Failing(2), iter(tasks(folder, 3)), 2))
    assert {each.kind for each in twice.values()} == {"process"}
    words = "failed twice in its executor: CancelledError; then RuntimeError: the worker was lost"
    assert twice["0.csv"].text == words


class Raising(Executor):
    """Raises the same for all recordings, once for each."""

    def __init__(self, failure: Exception) -> None:
        self.failure = failure
        self.seen: set[str] = set()

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if args[0].key in self.seen:
            future.set_result(fn(*args))
        else:
            self.seen.add(args[0].key)
            future.set_exception(self.failure)
        return future


@pytest.mark.slow
@pytest.mark.parametrize(
    "failure",
    [
        OSError("in <TCP>: Stream is closed"),  # as Dask's CommClosedError
        TimeoutError("no answer in 30 s"),
        ConnectionResetError(errno.ECONNRESET, "reset by peer"),
    ],
)
def test_a_lost_connection_is_tried_once_more(failure: Exception, folder: Path) -> None:
    found = by_name(in_executor(Raising(failure), iter(tasks(folder, 3)), 2))
    assert {each.kind for each in found.values()} == {"file"}


def test_a_full_disk_ends_the_run(folder: Path) -> None:
    full = OSError(errno.ENOSPC, "No space left on device")
    with pytest.raises(OSError, match="No space left"):
        list(in_executor(Raising(full), iter(tasks(folder, 3)), 2))


def test_an_executor_that_has_broken_ends_the_run(folder: Path) -> None:
    class Broken(Executor):
        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            from concurrent.futures import BrokenExecutor

            raise BrokenExecutor("all gone")

    with pytest.raises(go.GeodesicOcpError, match=r"Broken has ended early .*all gone"):
        list(in_executor(Broken(), iter(tasks(folder, 3)), 2))


def test_two_runs_in_one_folder_are_refused(tmp_path: Path) -> None:
    words = f"another run works in .*process {os.getpid()}"
    with locked(tmp_path), pytest.raises(ValueError, match=words), locked(tmp_path):
        pass
    with locked(tmp_path):
        pass
