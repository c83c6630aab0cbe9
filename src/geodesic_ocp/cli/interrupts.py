"""Ctrl-C, which libraries may swallow, and a progress bar that checks for it."""

from __future__ import annotations

import signal
import sys
import threading
from typing import Any


class Interrupts:
    """Whether Ctrl-C was pressed: libraries may swallow the exception, but not this flag."""

    seen = False

    @classmethod
    def note(cls, number: int, frame: object) -> None:
        """Signal handler: set the flag, and raise as usual."""
        del number, frame
        cls.seen = True
        raise KeyboardInterrupt


def in_main_thread() -> bool:
    """Whether this is the main thread, the only one that can handle signals."""
    return threading.current_thread() is threading.main_thread()


def on_interrupt(handler: Any) -> Any:
    """Install a handler of Ctrl-C; returns the previous one."""
    return signal.signal(signal.SIGINT, handler)


class ProgressBar:
    """A progress bar on standard error, if that is a terminal."""

    _WIDTH = 40

    def __call__(self, label: str, done: int, total: int) -> None:
        """Show the current step and the fraction done, or the amount if the total is not known."""
        if Interrupts.seen:
            raise KeyboardInterrupt
        if total <= 0:  # not known
            self._show(f"{label}: {done}")
            return
        filled = "#" * (self._WIDTH * done // total)
        self._show(f"{label}: {100 * done // total:3d}% |{filled:{self._WIDTH}}|")

    def close(self) -> None:
        """Remove the bar."""
        self._show("")

    def _show(self, text: str) -> None:
        """Replace the current line of the terminal."""
        if sys.stderr.isatty():
            print(f"\r{text}\033[K", end="", file=sys.stderr, flush=True)
