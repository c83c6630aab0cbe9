"""Many recordings through an executor, or through processes that may die."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
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
from itertools import chain, islice
from multiprocessing import connection
from pathlib import Path
from typing import Any

from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.studies.analyse_recording import run_task
from geodesic_ocp.studies.result_files import RecordingOutcome, RecordingTask

Finished = tuple[RecordingTask, "Future[RecordingOutcome]"]


def completed(
    executor: Executor, tasks: Iterator[RecordingTask], window: int
) -> Iterator[Finished]:
    """Yield tasks with their futures as they are done; at most `window` are submitted and not done.

    Without order. After an executor has broken, no more tasks are taken.
    """
    pending: dict[Future[RecordingOutcome], RecordingTask] = {}
    broken = False
    try:
        while True:
            for task in () if broken else islice(tasks, window - len(pending)):
                try:
                    with one_thread():  # processes start when something is submitted
                        future = executor.submit(run_task, task)
                except BrokenExecutor as failure:
                    broken = True
                    future = Future()
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
    """Return the exception of a future that is done; also if a cluster has cancelled it."""
    try:
        return future.exception()
    except CancelledError as failure:
        return failure


def in_executor(
    executor: Executor, tasks: Iterator[RecordingTask], window: int
) -> Iterator[RecordingOutcome]:
    """Yield outcomes through an executor of the user's, such as Dask's.

    A recording whose process dies is analysed once more, after all others and alone.

    Raises:
        GeodesicOcpError: the executor itself is broken; what is finished stays.
        OSError: a result cannot be written.
    """
    again = {}
    for task, future in completed(executor, tasks, window):
        if (failure := _loss(executor, future)) is None:
            yield future.result()
        else:
            again[task] = _named(failure)
    for task, first in again.items():
        for _, future in completed(executor, iter([task]), 1):
            if (failure := _loss(executor, future)) is None:
                yield future.result()
            else:
                text = f"failed twice in its executor: {first}; then {_named(failure)}"
                yield RecordingOutcome(task.source, "process", text)


def _loss(executor: Executor, future: Future[RecordingOutcome]) -> BaseException | None:
    """Return why a recording was lost; raises what ends the run."""
    failure = failure_of(future)
    if isinstance(failure, BrokenExecutor):
        raise GeodesicOcpError(
            f"the {type(executor).__name__} has ended early ({_named(failure)}); finished "
            "recordings are kept: run again with another one"
        )
    if failure is not None and _is_of_the_folder(failure):
        raise failure
    return failure


def _is_of_the_folder(failure: BaseException) -> bool:
    """Return whether a result could not be written, as opposed to a lost connection.

    Dask's own ones, such as CommClosedError, have no number of the system.
    """
    lost = isinstance(failure, (ConnectionError, TimeoutError))
    return isinstance(failure, OSError) and failure.errno is not None and not lost


def _named(failure: BaseException) -> str:
    return f"{type(failure).__name__}: {' '.join(str(failure).split())}".rstrip(": ")


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
    """Return cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


_UNLIKELY_PARENT = "500"  # the system's choice when memory is short falls on these processes
_AHEAD = 2  # tasks submitted for each process
# Recordings for each process, after which all are renewed, so that their memory stays bounded.
# Executors' own `max_tasks_per_child` can stop for ever while tasks wait (CPython issue 115634).
_RENEWAL = 100
_CONTEXT = multiprocessing.get_context("spawn")


def describe_end(code: int) -> str:
    """Return an exit code in words, after "its process"."""
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


@contextmanager
def _pool(jobs: int) -> Iterator[Executor]:
    """Yield an executor of processes, which are killed if the body raises."""
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(jobs, mp_context=_CONTEXT, initializer=_start)
    try:
        yield pool
    except BaseException:
        for process in set(multiprocessing.active_children()) - others:
            with suppress(ValueError):  # it is closed
                process.kill()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def in_processes(tasks: Iterator[RecordingTask], jobs: int) -> Iterator[RecordingOutcome]:
    """Yield outcomes from `jobs` processes, each with one thread.

    If a process dies, the recordings that were being analysed are analysed once more, one after the
    other, each in a process of its own, and fail if that dies as well.

    Args:
        tasks: are taken as processes become free.
        jobs: number of processes.

    Raises:
        GeodesicOcpError: processes cannot be started.
        OSError: a result cannot be written.
    """
    for first in tasks:
        lost: list[RecordingTask] = []
        some = chain([first], islice(tasks, _RENEWAL * jobs - 1))
        with _pool(jobs) as pool:
            for task, future in completed(pool, some, _AHEAD * jobs):
                if isinstance(failure_of(future), BrokenExecutor):
                    lost.append(task)
                else:
                    yield future.result()
        for task in lost:
            yield _alone(task)


def _alone(task: RecordingTask) -> RecordingOutcome:
    """Analyse a recording in a process of its own."""
    receiver, sender = _CONTEXT.Pipe(duplex=False)
    process = _CONTEXT.Process(target=_send_outcome, args=(sender, task))
    with one_thread():
        process.start()
    sender.close()
    found: list[Any] = []
    try:
        with suppress(EOFError):
            while True:
                found.append(receiver.recv())
    except BaseException:
        process.kill()
        raise
    finally:
        process.join()
    end = describe_end(process.exitcode or 0)
    if not found:
        raise GeodesicOcpError(
            f"processes cannot be started: each {end}. In a script, the call must stand "
            'under if __name__ == "__main__":'
        )
    if len(found) == 1:
        text = end if process.exitcode == -signal.SIGALRM else f"its process {end}, twice"
        return RecordingOutcome(task.source, "process", text)
    if isinstance(found[1], BaseException):
        raise found[1]
    outcome: RecordingOutcome = found[1]
    return outcome


def _send_outcome(sender: Any, task: RecordingTask) -> None:
    _start()
    sender.send("started")
    try:
        sender.send(run_task(task))
    except OSError as failure:  # the result cannot be written
        sender.send(failure)
