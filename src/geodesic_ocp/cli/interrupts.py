"""Ctrl-C, which libraries may swallow, and the progress bar that looks out for it."""

from __future__ import annotations

import signal
import threading
from typing import Any

from tqdm import tqdm


class Interrupts:
    """Whether Ctrl-C was pressed: libraries may swallow the exception, not the mark."""

    seen = False

    @classmethod
    def note(cls, number: int, frame: object) -> None:
        """A handler of signals: leave the mark, and raise as usual."""
        del number, frame
        cls.seen = True
        raise KeyboardInterrupt


def in_main_thread() -> bool:
    """Only there can signals be handled."""
    return threading.current_thread() is threading.main_thread()


def on_interrupt(handler: Any) -> Any:
    """Install a handler of Ctrl-C; returns the one before."""
    return signal.signal(signal.SIGINT, handler)


class Bar:
    """A progress bar on standard error, made when the amount of work is known."""

    def __init__(self) -> None:
        self._bar: tqdm | None = None

    def __call__(self, label: str, done: int, total: int) -> None:
        """Show what is being done, and how much of all there is."""
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
        """Take the bar away."""
        if self._bar is not None:
            self._bar.close()
