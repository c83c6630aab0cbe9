"""WorkerProcesses: an executor of processes that knows how each of them ended."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import suppress
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from geodesic_ocp.studies.batch.processes.one_thread import one_thread

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
    wait([parent.sentinel])
    os._exit(1)
