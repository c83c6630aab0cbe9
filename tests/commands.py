"""What `printed` and `refused` of the tests of the command line are."""

from __future__ import annotations

from collections.abc import Callable

Output = Callable[..., str]
