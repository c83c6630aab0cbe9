"""How functions that take long report their progress."""

from __future__ import annotations

from collections.abc import Callable

# Called with the current step, the amount done, and the total.
Progress = Callable[[str, int, int], object]


def no_progress(label: str, done: int, total: int) -> None:
    """Report no progress."""
    del label, done, total
