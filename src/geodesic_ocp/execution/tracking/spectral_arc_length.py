"""Smoothness of a movement: the spectral arc length of its speed."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array

_HIGHEST = 10.0  # [Hz]
_LEAST = 0.05  # of the largest amplitude: higher frequencies are cut off from there on
_PADDING = 4  # powers of two


def spectral_arc_length(speed: Array, rate: float) -> float:
    """Minus the length of the normalized amplitude spectrum of a speed (k,) sampled at a rate [Hz].

    Nearer to zero for smoother movements, independent of amplitude and duration. By Balasubramanian
    et al., "On the analysis of movement smoothness", J. NeuroEngineering and Rehabilitation 12
    (2015), with its parameters: up to 10 Hz, as long as the amplitude is at least 0.05. NaN without
    any movement.
    """
    size = 2 ** (int(np.ceil(np.log2(speed.size))) + _PADDING)
    amplitude = np.abs(np.fft.rfft(speed, size))
    if not amplitude.max() > 0.0:
        return float("nan")
    amplitude = (amplitude / amplitude.max())[np.fft.rfftfreq(size, 1.0 / rate) <= _HIGHEST]
    last = int(np.flatnonzero(amplitude >= _LEAST)[-1])
    rises = np.diff(amplitude[: last + 1])
    return -float(np.sum(np.hypot(1.0 / max(last, 1), rises)))
