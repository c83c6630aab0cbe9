"""Settings of matplotlib for a while: in place of the user's, or in addition to them."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# Settings are global: two threads that set and restore them by turns would leave one's for good.
_LOCK = threading.RLock()


@contextmanager
def own_style(settings: dict[Any, Any]) -> Iterator[None]:
    """Draw with matplotlib's defaults and these settings, whatever style the user has chosen.

    The user's settings are restored at the end; other threads wait until then.
    """
    import matplotlib.style

    with _LOCK, matplotlib.style.context(["default", settings]):
        yield


@contextmanager
def added_style(settings: dict[Any, Any]) -> Iterator[None]:
    """Draw with the user's style and these settings on top, which are taken back at the end."""
    import matplotlib

    with _LOCK, matplotlib.rc_context(settings):
        yield
