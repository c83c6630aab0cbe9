"""Low-pass filter before samples are thinned out."""

from __future__ import annotations

import numpy as np
import scipy

from geodesic_ocp.arrays import Array

_ORDER, _OF_NYQUIST = 8, 0.9


def without_aliases(q: Array, rate: float, new_rate: float) -> Array:
    """Samples q (k, n), taken at `rate`, without what `new_rate` [Hz] could not represent.

    A Butterworth filter of order 8 runs forwards and backwards; it halves the amplitude at 0.9
    times half the new rate. The ends are continued by point reflection.
    """
    sections = scipy.signal.butter(_ORDER, _OF_NYQUIST * new_rate / 2.0, fs=rate, output="sos")
    padding = min(len(q) - 1, int(np.ceil(20.0 * rate / new_rate)))
    result: Array = scipy.signal.sosfiltfilt(sections, q, axis=0, padlen=padding)
    return result
