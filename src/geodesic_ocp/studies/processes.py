"""Tasks through any executor, a bounded number of them at a time."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import contextmanager, suppress
from itertools import islice
from multiprocessing import connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.studies.analyse_recording import RUNNING, run_task
from geodesic_ocp.studies.result_files import RecordingOutcome, RecordingTask

Finished = tuple[RecordingTask, "Future[RecordingOutcome]"]


def completed(
    executor: Executor, tasks: Iterator[RecordingTask], window: int
) -> Iterator[Finished]:
    """Tasks with their futures as they are done; at most `window` are submitted and not done.

    Without order. After an executor has broken, no more tasks are taken.
    """
    pending: dict[Future[RecordingOutcome], RecordingTask] = {}
    broken = False
    try:
        while True:
            for task in () if broken else islice(tasks, window - len(pending)):
                try:
                    future = executor.submit(run_task, task)
                except BrokenExecutor as failure:
                    broken, future = True, Future()
                    future.set_exception(failure)
                pending[future] = task
                if broken:
                    break
            if not pending:
                return
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                broken = broken or isinstance(failure_of(future), BrokenExecutor)
                yield pending.pop(future), future
    finally:
        for future in pending:
            future.cancel()


def failure_of(future: Future[RecordingOutcome]) -> BaseException | None:
    """The exception of a future that is done; also if a cluster has cancelled it."""
    try:
        return future.exception()
    except CancelledError as failure:
        return failure


def in_executor(
    executor: Executor, tasks: Iterator[RecordingTask], window: int
) -> Iterator[RecordingOutcome]:
    """Outcomes through an executor of the user's, such as Dask's.

    A recording whose process dies is analysed once more, after all others and alone.

    Raises:
        GeodesicOcpError: the executor itself is broken; what is finished stays.
        OSError: a result cannot be written.
    """
    again: list[tuple[RecordingTask, str]] = []
    for task, future in completed(executor, tasks, window):
        failure = failure_of(future)
        if failure is None:
            yield future.result()
        elif isinstance(failure, BrokenExecutor):
            raise _broken(executor, failure)
        elif _is_of_the_folder(failure):
            raise failure
        else:
            again.append((task, _named(failure)))
    for task, first in again:
        for _, future in completed(executor, iter([task]), 1):
            second = failure_of(future)
            if second is None:
                yield future.result()
            elif isinstance(second, BrokenExecutor):
                raise _broken(executor, second)
            elif _is_of_the_folder(second):
                raise second
            else:
                text = f"failed twice in its executor: {first}; then {_named(second)}"
                yield RecordingOutcome(task.source, "process", text)


def _is_of_the_folder(failure: BaseException) -> bool:
    """Return whether a result could not be written, as opposed to a lost connection.

    Dask's own ones, such as CommClosedError, have no number of the system.
    """
    lost = isinstance(failure, (ConnectionError, TimeoutError))
    return isinstance(failure, OSError) and failure.errno is not None and not lost


def _named(failure: BaseException) -> str:
    return f"{type(failure).__name__}: {' '.join(str(failure).split())}".rstrip(": ")


def _broken(executor: Executor, failure: BaseException) -> GeodesicOcpError:
    return GeodesicOcpError(
        f"the {type(executor).__name__} has ended early ({_named(failure)}); finished recordings "
        "are kept: run again with another one"
    )


_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let processes that are started here use one thread; this process stays as it is."""
    before = {name: os.environ.get(name) for name in _VARIABLES}
    os.environ.update(dict.fromkeys(_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def usable_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


_UNLIKELY_PARENT = "500"  # the system's choice when memory is short falls on these processes


class WorkerProcesses(Executor):
    """Processes with one thread each, which end with the process that started them."""

    def __init__(self, jobs: int) -> None:
        self._others = {each.pid for each in multiprocessing.active_children()}
        self._found: dict[int, BaseProcess] = {}
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_start)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Submit a call; a process is started for it if none is free."""
        with one_thread():
            future = self._pool.submit(fn, *args, **kwargs)
        for process in multiprocessing.active_children():
            if process.pid is not None and process.pid not in self._others:
                self._found[process.pid] = process
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Wait for the processes to end."""
        self._pool.shutdown(wait, cancel_futures=cancel_futures)

    def kill(self) -> None:
        """End all processes at once."""
        for process in self._found.values():
            with suppress(ValueError):  # it is closed
                process.kill()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def ended(self) -> dict[int, int]:
        """Exit codes by process, of those that have ended; negative numbers are signals."""
        codes = {pid: process.exitcode for pid, process in self._found.items()}
        return {pid: code for pid, code in codes.items() if code is not None}


def describe_end(code: int) -> str:
    """An exit code in words, after "its process"."""
    if code >= 0:
        return f"ended with exit code {code}"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    if -code == signal.SIGALRM:
        return "took longer than the time limit"
    if -code == signal.SIGKILL:
        return f"was killed ({name}; the system does so when memory is short)"
    return f"crashed ({name})"


def _start() -> None:
    """Prepare a process: its parent alone handles Ctrl-C, and it ends when the parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(_UNLIKELY_PARENT, encoding="ascii")
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    connection.wait([parent.sentinel])
    os._exit(1)


# Recordings after which the processes are replaced, so that their memory stays bounded.
_RENEWAL = 100
_AHEAD = 2  # tasks submitted for each process
# Times in a row that processes may die without any outcome, and without a recording to name.
_ATTEMPTS = 3
_TOO_LONG = describe_end(-signal.SIGALRM)


def in_processes(
    tasks: Iterator[RecordingTask], jobs: int, folder: Path
) -> Iterator[RecordingOutcome]:
    """Outcomes from `jobs` processes, each with one thread.

    If a process dies, its recording is analysed once more, alone, and fails if that dies as well.
    If it cannot be told whose process died, this is done with all that were being analysed. What
    took longer than its time limit is not analysed again.

    Args:
        tasks: are taken as processes become free.
        jobs: number of processes.
        folder: folder of the output, in which processes note what they are analysing.

    Raises:
        GeodesicOcpError: processes cannot be started.
        OSError: a result cannot be written.
    """
    upcoming, idle = _Upcoming(tasks), 0
    while (first := next(upcoming, None)) is not None:
        upcoming.put_back([first])
        run = _Run(jobs, folder)
        lost = yield from run.outcomes(islice(upcoming, _RENEWAL * jobs))
        suspects = run.suspects()
        upcoming.put_back([task for task in lost if task.key not in suspects])
        for task in lost:
            if suspects.get(task.key) == _TOO_LONG:
                yield RecordingOutcome(task.source, "process", _TOO_LONG)
            elif task.key in suspects:
                yield from _alone(task, folder, suspects[task.key])
        idle = idle + 1 if lost and not suspects and not run.count else 0
        if idle == _ATTEMPTS:
            raise GeodesicOcpError(
                f"processes cannot be started: each {run.end()}. In a script, the call must stand "
                'under if __name__ == "__main__":'
            )


def _alone(task: RecordingTask, folder: Path, first: str) -> Iterator[RecordingOutcome]:
    """A recording once more, in a process of its own."""
    run = _Run(1, folder)
    if (yield from run.outcomes(iter([task]))):
        run.suspects()  # removes the note
        text = f"its process {first}; analysed again, alone, it {run.end()}"
        yield RecordingOutcome(task.source, "process", text)


class _Upcoming:
    """Tasks, with those first that were put back."""

    def __init__(self, tasks: Iterator[RecordingTask]) -> None:
        self._tasks = tasks
        self._first: deque[RecordingTask] = deque()

    def __iter__(self) -> Iterator[RecordingTask]:
        return self

    def __next__(self) -> RecordingTask:
        return self._first.popleft() if self._first else next(self._tasks)

    def put_back(self, tasks: list[RecordingTask]) -> None:
        self._first.extend(tasks)


class _Run:
    """One set of processes, from their start to their end."""

    def __init__(self, jobs: int, folder: Path) -> None:
        self.count = 0  # of outcomes
        self._jobs, self._notes = jobs, folder / RUNNING
        self._executor = WorkerProcesses(jobs)

    def outcomes(
        self, tasks: Iterator[RecordingTask]
    ) -> Generator[RecordingOutcome, None, list[RecordingTask]]:
        """Outcomes of the tasks; returns the tasks that were lost as a process died."""
        lost = []
        try:
            for task, future in completed(self._executor, tasks, _AHEAD * self._jobs):
                failure = failure_of(future)
                if isinstance(failure, BrokenExecutor):
                    lost.append(task)
                    continue
                self.count += 1
                yield future.result()
            self._executor.shutdown()
        except BaseException:
            self._executor.kill()
            raise
        return lost

    def suspects(self) -> dict[str, str]:
        """Keys of the recordings whose processes died, with how; removes the notes.

        When one process dies, the executor ends the others by SIGTERM. If none died otherwise, it
        cannot be told which was the first.
        """
        codes, found = self._executor.ended(), {}
        for pid, code in codes.items():
            note = self._notes / str(pid)
            if note.is_file():
                found[pid] = note.read_text(encoding="utf-8"), code
                note.unlink()
        others = {key: code for key, code in found.values() if code != -signal.SIGTERM}
        chosen = others or dict(found.values())
        return {key: describe_end(code) for key, code in chosen.items()}

    def end(self) -> str:
        """Return how the processes ended, in words."""
        codes = set(self._executor.ended().values()) - {0}
        odd = codes - {-signal.SIGTERM} or codes
        return " or ".join(describe_end(code) for code in sorted(odd)) or "ended early"
