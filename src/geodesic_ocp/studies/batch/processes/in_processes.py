"""Tasks in processes of this computer; a process that dies costs at most its own recording."""

from __future__ import annotations

import signal
from collections import deque
from collections.abc import Generator, Iterator
from concurrent.futures import BrokenExecutor
from itertools import islice
from pathlib import Path

from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.studies.batch.outcome import RecordingOutcome, RecordingTask
from geodesic_ocp.studies.batch.processes.in_executor import completed, failure_of
from geodesic_ocp.studies.batch.processes.worker_processes import WorkerProcesses, describe_end
from geodesic_ocp.studies.batch.run_task import RUNNING

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
        folder: of the output, in which processes note what they are analysing.

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
        """How the processes ended, in words."""
        codes = set(self._executor.ended().values()) - {0}
        odd = codes - {-signal.SIGTERM} or codes
        return " or ".join(describe_end(code) for code in sorted(odd)) or "ended early"
