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
    """A progress bar with the time left, on standard error if that is a terminal."""

    _WIDTH = 40

    def __init__(self) -> None:
        self._bar: Any = None

    def __call__(self, label: str, done: int, total: int) -> None:
        """Show the current step and the fraction done, or the amount if the total is not known."""
        if Interrupts.seen:
            raise KeyboardInterrupt
        if not sys.stderr.isatty():
            return
        wanted = total if total > 0 else None
        if self._bar is None or self._bar.total != wanted or done < self._bar.n:
            self.close()
            self._bar = _new_bar(label, done, wanted, self._WIDTH)
        changed = self._bar.desc != label
        self._bar.set_description_str(label, refresh=False)
        self._bar.update(done - self._bar.n)
        if changed or done == total:
            self._bar.refresh()

    def line(self, text: str) -> None:
        """Print a line on standard output, above the bar."""
        if self._bar is None:
            print(text, flush=True)
        else:
            self._bar.write(text, file=sys.stdout)

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def _new_bar(label: str, done: int, total: int | None, width: int) -> Any:
    from tqdm import tqdm  # what is shown on no terminal need not wait for it

    tqdm.set_lock(threading.RLock())  # not that of several processes: one alone writes
    tqdm.monitor_interval = 0  # without a thread
    shape = f"{{desc}}: {{percentage:3.0f}}% |{{bar:{width}}}| {{remaining}} left"
    return tqdm(
        desc=label,
        initial=done,
        total=total,
        ascii=" #",
        bar_format="{desc}: {n_fmt}" if total is None else shape,
        leave=False,
        smoothing=0.1,
        file=sys.stderr,
        dynamic_ncols=True,
    )
