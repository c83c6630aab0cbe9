"""Paths that end or hold the process which asks for their name."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class DeadlyPath:
    """Sends itself a signal, or exits; only once if a flag is given, which is then set."""

    signal: int
    flag: Path | None = None

    @property
    def stem(self) -> str:
        if self.flag is None or not self.flag.exists():
            if self.flag is not None:
                self.flag.touch()
            if not self.signal:
                os._exit(7)
            os.kill(os.getpid(), self.signal)
        return "deadly"


class EndlessPath:
    """Takes a minute to tell its name."""

    @property
    def stem(self) -> str:
        time.sleep(60.0)
        return "endless"
