"""A limit of the time that a recording may take in a process."""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """End this process by SIGALRM if the body takes longer; None sets no limit.

    The system does so also while a solver runs, which no exception could leave. Nothing is done
    outside the main thread of a process that was started for the work.
    """
    started = multiprocessing.parent_process() is not None
    if seconds is None or not started or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
