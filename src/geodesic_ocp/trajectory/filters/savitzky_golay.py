"""Savitzky-Golay filter: polynomials fitted to windows of samples."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from geodesic_ocp.arrays import Array


def savitzky_golay(values: Array, window: int, order: int) -> tuple[Array, Array]:
    """Values and slopes per sample, (k, n) each, of polynomials fitted to `window` samples.

    Each sample is in the middle of its polynomial's samples, except near the ends (Savitzky, Golay,
    Analytical Chemistry 36, 1964).
    """
    half = window // 2
    first, last = values[:window], values[-window:]
    windows = sliding_window_view(values, window, axis=0)
    fitted, slope = (
        np.vstack([at[:half] @ first, windows @ at[half], at[half + 1 :] @ last])
        for at in _weights(window, order)
    )
    return fitted, slope


def slope_gain(window: int, order: int) -> float:
    """Standard deviation of the slope in the middle of a window of unit white noise."""
    return float(np.linalg.norm(_weights(window, order)[1][window // 2]))


def residual_gain(window: int, order: int) -> float:
    """Standard deviation of the residual in the middle of a window of unit white noise."""
    weights = -_weights(window, order)[0][window // 2]
    weights[window // 2] += 1.0
    return float(np.linalg.norm(weights))


def _weights(window: int, order: int) -> tuple[Array, Array]:
    """From the samples of a window to values and slopes at each of them, (window, window)."""
    half, powers = window // 2, np.arange(order + 1)
    x = np.linspace(-1.0, 1.0, window)[:, None]
    fit = np.linalg.pinv(x**powers)  # from samples to coefficients
    return x**powers @ fit, (powers / half * x ** np.maximum(powers - 1, 0)) @ fit
