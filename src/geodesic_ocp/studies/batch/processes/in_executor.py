"""Tasks through any executor, a bounded number of them at a time."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from itertools import islice

from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.studies.batch.outcome import RecordingOutcome, RecordingTask
from geodesic_ocp.studies.batch.run_task import run_task

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
    """Whether a result could not be written; lost connections of a cluster are OSErrors, too.

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
