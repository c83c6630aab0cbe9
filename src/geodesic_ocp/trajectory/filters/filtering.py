"""Filters of recorded coordinates, with what they say about the noise."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.trajectory.filters.motion_filter import MotionFilter
from geodesic_ocp.trajectory.filters.noise_floor import (
    MIN_DURATION,
    MIN_RATE,
    choose_cutoff,
    noise_density,
    passed_bandwidth,
    velocity_gain,
)
from geodesic_ocp.trajectory.filters.savitzky_golay import residual_gain, savitzky_golay, slope_gain
from geodesic_ocp.trajectory.filters.smoothing_spline import smoothing_spline

# Time stamps may deviate from even spacing by this fraction of a step, as recordings round them.
_UNEVEN = 0.1

Filtered = tuple[Array, Array, MotionFilter]  # coordinates, velocities, filter


def check_even(time: Array) -> None:
    """ValueError unless the samples are evenly spaced."""
    step = (time[-1] - time[0]) / (time.size - 1)
    off = time - np.linspace(time[0], time[-1], time.size)
    row = int(np.argmax(np.abs(off)))
    if abs(off[row]) > _UNEVEN * step:
        raise ValueError(
            f"filtering needs evenly spaced samples: sample {row} is {abs(off[row]):.6g} s off "
            f"the even grid of steps of {step:.6g} s; resample first (Motion.resampled, or "
            "--resample on the command line)"
        )


def low_passed(time: Array, q: Array, cutoff: float | None) -> Filtered:
    """By a smoothing spline; a cut-off of None is chosen from the noise floor.

    Raises:
        ValueError: fewer than three samples, or too few or too slow for this cut-off or for any.
    """
    duration = float(time[-1] - time[0])
    rate = (time.size - 1) / duration
    chosen = cutoff is None
    if cutoff is None:
        if rate < MIN_RATE:
            raise ValueError(
                f"at a sampling rate of {rate:.4g} Hz motion and noise cannot be told apart, which "
                f"takes {MIN_RATE:g} Hz; give the cut-off, filtered(cutoff=...)"
            )
        if duration < MIN_DURATION:
            raise ValueError(
                f"the motion is too short to filter: to choose a cut-off takes {MIN_DURATION:g} s, "
                f"it lasts {duration:.4g} s; give the cut-off, filtered(cutoff=...)"
            )
        cutoff = choose_cutoff(rate, q)
    cutoff = as_positive("cutoff", cutoff, "Hz")
    if cutoff >= rate / 2.0:
        raise ValueError(
            f"cutoff must be below half the sampling rate, {rate / 2.0:.4g} Hz, got {cutoff:g}"
        )
    if time.size < 3:
        raise ValueError(f"the motion is too short to filter: {time.size} samples, not three")
    spline = smoothing_spline(np.linspace(time[0], time[-1], time.size), q, cutoff)
    smooth, velocity = spline(time), spline(time, 1)
    density = noise_density(rate, q)
    removed = np.mean((q - smooth) ** 2, axis=0)
    noise = np.sqrt(removed + density * min(passed_bandwidth(cutoff), rate / 2.0))
    left = np.sqrt(density) * velocity_gain(cutoff)
    return smooth, velocity, MotionFilter("smoothing spline", cutoff, None, chosen, noise, left)


def locally_fitted(time: Array, q: Array, window: int, order: int) -> Filtered:
    """By a Savitzky-Golay filter of `window` samples.

    Raises:
        ValueError: there are fewer samples than `window`, or window and order do not fit (window
            odd and above order, order at least 1).
    """
    if window % 2 == 0 or order < 1 or window <= order:
        raise ValueError(
            f"window must be odd and above order, order at least 1, got {window} and {order}"
        )
    if time.size < window:
        raise ValueError(
            f"the motion is too short to filter: a window of {window} needs as many samples, not "
            f"{time.size}"
        )
    step = (time[-1] - time[0]) / (time.size - 1)
    smooth, slope = savitzky_golay(q, window, order)
    gain = residual_gain(window, order)
    removed = np.sqrt(np.mean((q - smooth) ** 2, axis=0))
    noise = removed / gain if gain > 0.0 else np.zeros_like(removed)
    left = noise * slope_gain(window, order) / step
    kind = f"Savitzky-Golay filter of order {order}"
    return smooth, slope / step, MotionFilter(kind, None, window * step, False, noise, left)


def window_of(duration: float, rate: float, order: int) -> int:
    """The odd number of samples nearest to a duration [s] at this rate [Hz].

    Raises:
        ValueError: the duration is not positive, or has too few samples for this order.
    """
    samples = as_positive("duration", duration, "s") * rate
    window = 2 * max(0, round((samples - 1.0) / 2.0)) + 1
    if order >= 1 and window <= order:
        least = order + 1 + order % 2
        raise ValueError(
            f"duration {duration:g} s is {window} sample{'s' * (window > 1)} at {rate:.4g} Hz; at "
            f"least {least} ({least / rate:.2g} s) are needed for a polynomial of order {order}"
        )
    return window
