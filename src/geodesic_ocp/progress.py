"""Progress of long computations: a bar on a terminal or in a notebook, lines in a log."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from contextlib import closing
from functools import wraps
from typing import Any, TypeVar, cast

_Function = TypeVar("_Function", bound=Callable[..., Any])

# Called with the current step, the amount done, and the total; zero: the total is not known.
Progress = Callable[[str, int, int], object]
_WIDTH = 40  # characters of a bar
_PATIENCE = 2.0  # [s] before a function that nobody asked to report shows a bar
_SPACING = 10.0  # [s] between lines in a log


def no_progress(label: str, done: int, total: int) -> None:
    """Report no progress."""
    del label, done, total


def shows_progress(function: _Function) -> _Function:
    """Let a function with an argument `progress` show a bar where none is given.

    The bar appears on a terminal or in a notebook, and only where somebody has to wait.
    """

    @wraps(function)
    def shown(*args: Any, **given: Any) -> Any:
        if given.get("progress") is not None or not _has_reader():
            return function(*args, **given)
        with closing(ProgressBar(_PATIENCE)) as bar:
            return function(*args, **{**given, "progress": bar})

    return cast("_Function", shown)


class ProgressBar:
    """A progress bar with the time left on standard error; in a log, a line now and then.

    Args:
        patience: time before the bar appears [s].
    """

    def __init__(self, patience: float = 0.0) -> None:
        self._bar: Any = None
        self._patience = patience
        self._next_line = time.monotonic() + _SPACING

    def __call__(self, label: str, done: int, total: int) -> None:
        """Show the current step and the fraction done, or the amount if the total is not known."""
        if not _has_reader():
            self._in_log(label, done, total)
            return
        wanted = total if total > 0 else None
        if self._bar is None or self._bar.total != wanted or done < self._bar.n:
            self.close()
            self._bar = _new_bar(label, done, wanted, self._patience)
        changed = self._bar.desc != label
        self._bar.set_description_str(label, refresh=False)
        self._bar.update(done - self._bar.n)
        if changed or done == total:
            self._bar.refresh()

    def _in_log(self, label: str, done: int, total: int) -> None:
        if time.monotonic() >= self._next_line:
            self._next_line = time.monotonic() + _SPACING
            amount = f"{100 * done // total} %" if total > 0 else str(done)
            print(f"{label}: {amount}", file=sys.stderr, flush=True)

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


def _has_reader() -> bool:
    """Return True on a terminal or in a notebook."""
    return sys.stderr.isatty() or "ipykernel" in sys.modules


def _new_bar(label: str, done: int, total: int | None, patience: float) -> Any:
    from tqdm import tqdm  # what is shown on no terminal need not wait for it

    tqdm.set_lock(threading.RLock())  # not that of several processes: one alone writes
    tqdm.monitor_interval = 0  # without a thread
    shape = f"{{desc}}: {{percentage:3.0f}}% |{{bar:{_WIDTH}}}| {{remaining}} left"
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
        delay=patience,
    )
