"""The terminal: Ctrl-C, progress, warnings as notes, and what is asked for before long work."""

from __future__ import annotations

import os
import signal
import threading
import warnings
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from geodesic_ocp.progress import ProgressBar


class Interrupts:
    """A record of Ctrl-C: libraries may swallow the exception, but not this flag."""

    seen = False

    @classmethod
    def note(cls, number: int, frame: object) -> None:
        """Set the flag, and raise KeyboardInterrupt as usual (a signal handler)."""
        del number, frame
        cls.seen = True
        raise KeyboardInterrupt

    @classmethod
    @contextmanager
    def noted(cls) -> Iterator[None]:
        """Record Ctrl-C meanwhile; only the main thread can."""
        cls.seen = False
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        previous = signal.signal(signal.SIGINT, cls.note)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, previous)


class _Bar(ProgressBar):
    def __call__(self, label: str, done: int, total: int) -> None:
        if Interrupts.seen:
            raise KeyboardInterrupt
        super().__call__(label, done, total)


@contextmanager
def progress() -> Iterator[ProgressBar]:
    """Yield a progress bar; meanwhile warnings are printed as notes."""
    with printed_warnings(), closing(_Bar()) as bar:
        yield bar


@contextmanager
def printed_warnings() -> Iterator[None]:
    """Print warnings, such as those of a robot's file, as lines that begin with "note:"."""
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = _print_warning
        yield


def _print_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    print(f"note: {message}")


def print_written(files: Iterable[Path | str]) -> None:
    """Print the names of files that were written."""
    for file in files:
        print(f"wrote {file}")


def check_folder(folder: Path | None) -> None:
    """Check that the output folder can be written to, before any work is done.

    Raises:
        ValueError: the folder is a file, or cannot be written to.
    """
    if folder is None:
        return
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"--out {folder} is a file, not a folder")
    nearest = next(parent for parent in (folder, *folder.absolute().parents) if parent.exists())
    if not nearest.is_dir() or not os.access(nearest, os.W_OK):
        raise ValueError(f"--out {folder}: cannot write to {nearest}")
