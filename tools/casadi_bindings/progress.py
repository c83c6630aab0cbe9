"""Progress of one step, on the terminal or in a log."""

from __future__ import annotations

import re
import sys
import time
from types import TracebackType

EVERY = 30.0  # s between lines where there is no terminal to write over the last one


class Progress:
    """Print a step while it runs, and how long it took."""

    def __init__(self, what: str) -> None:
        self._what = what

    def __enter__(self) -> Progress:
        self._started = self._said = time.monotonic()
        self._say(self._what + " ...")
        return self

    def ninja(self, line: str) -> None:
        """Take a line of Ninja's output, "[12/84] Building ...", and print the progress."""
        counted = re.match(r"\[(\d+)/(\d+)\]", line)
        if counted is None:
            return
        done, total = map(int, counted.groups())
        elapsed = time.monotonic() - self._started
        if sys.stdout.isatty() or time.monotonic() - self._said > EVERY:
            to_go = elapsed / max(done, 1) * (total - done)
            self._say(
                f"{self._what}: {done} of {total} after {elapsed / 60:.0f} min,"
                f" about {to_go / 60:.0f} min to go"
            )

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        elapsed = time.monotonic() - self._started
        ending = "done" if kind is None else "stopped"
        self._say(f"{self._what}: {ending} after {elapsed:.0f} s")
        if sys.stdout.isatty():
            print()

    def _say(self, text: str) -> None:
        self._said = time.monotonic()
        if sys.stdout.isatty():
            print(f"\r  {text:<70}", end="", flush=True)
        else:
            print(f"  {text}", flush=True)
