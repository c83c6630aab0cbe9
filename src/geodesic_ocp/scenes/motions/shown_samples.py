"""Which samples of a recording are shown."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array

RATE = 200.0  # [Hz], above which a screen and an eye gain nothing
MOST = 12000  # samples: a minute at that rate
_ROUNDED = 1.01  # time stamps are rounded, and a rate of 200.1 Hz is one of 200 Hz


def shown_samples(time: Array) -> tuple[NDArray[np.int64], str]:
    """Indices of the samples that are shown, and a note if these are not all.

    Every n-th sample and the last one, as they are, not interpolated: at most about 200 per second
    and 12000 altogether.

    >>> import numpy as np
    >>> shown, note = shown_samples(np.arange(1001) / 1000.0)
    >>> len(shown), note
    (201, 'every 5th of 1001 samples is shown')

    Args:
        time: of the samples (k,) [s], increasing.
    """
    count = len(time)
    if count < 3:
        return np.arange(count), ""
    rate = (count - 1) / float(time[-1] - time[0])
    step = int(np.ceil(max(rate / RATE, (count - 1) / (MOST - 1)) / _ROUNDED))
    if step <= 1:
        return np.arange(count), ""
    shown = np.unique(np.append(np.arange(0, count, step), count - 1))
    return shown, f"every {_ordinal(step)} of {count} samples is shown"


def _ordinal(number: int) -> str:
    endings = {1: "st", 2: "nd", 3: "rd"}
    teen = number % 100 in (11, 12, 13)
    return f"{number}{'th' if teen else endings.get(number % 10, 'th')}"
