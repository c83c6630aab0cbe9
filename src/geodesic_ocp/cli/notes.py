"""Warnings as lines of text."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def printed_warnings() -> Iterator[None]:
    """Print warnings, such as those of a robot's file, as lines that begin with "note:"."""
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = _print_warning
        yield


def _print_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"note: {message}")
