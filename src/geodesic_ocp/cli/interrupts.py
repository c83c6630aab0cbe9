"""Ctrl-C, which libraries may swallow, and a progress bar that checks for it."""

from __future__ import annotations

import signal
import threading
from typing import Any

from tqdm import tqdm


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
    """A progress bar on standard error, created once the amount of work is known."""

    def __init__(self) -> None:
        self._bar: tqdm | None = None

    def __call__(self, label: str, done: int, total: int) -> None:
        """Show the current step and the fraction done."""
        if Interrupts.seen:
            raise KeyboardInterrupt
        if self._bar is None:
            self._bar = tqdm(
                total=total,
                leave=False,
                disable=None,
                bar_format="{desc}: {percentage:3.0f}% |{bar}|",
            )
        self._bar.total = total
        self._bar.set_description_str(label, refresh=False)
        self._bar.update(done - self._bar.n)
        self._bar.refresh()

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.close()
