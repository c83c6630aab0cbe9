"""The noise floor of a recording, and the cut-off frequency that follows from it."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.trajectory.filters.smoothing_spline import frequency_response, half_amplitude

# Voluntary motions of the arm have next to no power above 12 Hz; samples at 50 Hz still resolve
# 18 Hz, and so the floor is read between the two whatever the sampling rate.
_NOISE_BAND = (12.0, 18.0)  # [Hz]
_OF_NYQUIST = 0.72
_CUTOFFS = np.arange(3.0, 12.0 + 1e-9, 0.1)  # [Hz]
_RESOLUTION = 0.1  # [Hz]
_LEAST_SIZE = 256  # of the Fourier transform
_LEAST_DENSITY = 1e-12  # [rad^2/Hz]: below the rounding of any recording
_STILL = 1e-5  # [rad]
MIN_RATE, MIN_DURATION = 12.0, 0.3  # [Hz], [s]


def noise_density(rate: float, q: Array) -> Array:
    """Spectral density of the noise (n,) [rad^2/Hz], one-sided, of samples q (k, n) at a rate [Hz].

    The median of the density between 12 and 18 Hz (less where the sampling rate is below 50 Hz),
    where people's motions have next to no power. Of white noise, the density is
    2 sigma^2 / rate with its standard deviation sigma.
    """
    frequency, density = _spectrum(rate, q)
    high = min(_NOISE_BAND[1], _OF_NYQUIST * rate / 2.0)
    low = high * _NOISE_BAND[0] / _NOISE_BAND[1]
    band = density[(frequency >= low) & (frequency <= high)]
    # A periodogram is exponentially distributed: its median is log 2 times its mean.
    floor: Array = np.maximum(np.median(band, axis=0) / np.log(2.0), _LEAST_DENSITY)
    return floor


def choose_cutoff(rate: float, q: Array) -> float:
    """Cut-off frequency [Hz] that minimizes the expected mean squared error of the velocities.

    With the observed spectral density P and that of the noise, N, a filter of response H distorts
    by the integral of (2 pi f)^2 (1 - H)^2 (P - N) and leaves noise of the integral of
    (2 pi f)^2 H^2 N. Their sum is an unbiased estimate of the error where N is known (Mallows' C_L;
    Craven, Wahba, Numerische Mathematik 31, 1979, section 2; for derivatives of recorded motions:
    Woltring, Human Movement Science 4, 1985). The errors of the joints, each divided by its N, are
    added, and all joints get the same cut-off, between 3 and 12 Hz.
    """
    moving = np.ptp(q, axis=0) > _STILL
    if not moving.any():
        return float(_CUTOFFS[-1])
    floor = noise_density(rate, q)[moving]
    frequency, density = _spectrum(rate, q[:, moving])
    used = frequency <= min(_NOISE_BAND[1], _OF_NYQUIST * rate / 2.0)
    excess = ((density[used] - floor) / floor).sum(axis=1)
    frequency = frequency[used]
    step = frequency[1]
    cutoffs = _CUTOFFS[max(_CUTOFFS[0], rate / 4.0) >= _CUTOFFS]
    errors = [
        step
        * ((2.0 * np.pi * frequency * (1.0 - frequency_response(frequency, cutoff))) ** 2)
        @ excess
        + moving.sum() * velocity_gain(cutoff) ** 2
        for cutoff in cutoffs
    ]
    return float(np.round(cutoffs[int(np.argmin(errors))], 1))


def velocity_gain(cutoff: float) -> float:
    """Standard deviation of the smoothing spline's velocity for noise of unit density, [1/s Hz^.5].

    The root of the integral of (2 pi f)^2 H(f)^2 over all f > 0.
    """
    return float(2.0 * np.pi * np.sqrt(np.pi / 12.0 * half_amplitude(cutoff) ** 3))


def passed_bandwidth(cutoff: float) -> float:
    """Bandwidth [Hz] of the noise that the spline's residuals lack: integral of 1 - (1 - H)^2."""
    return float(7.0 * np.pi / 18.0 * half_amplitude(cutoff))


def _spectrum(rate: float, q: Array) -> tuple[Array, Array]:
    """Frequencies (m,) [Hz] and one-sided densities (m, n), of a Hann window without its trend."""
    window = 1.0 + np.cos(np.pi * np.linspace(-1.0, 1.0, len(q) + 2)[1:-1, None])
    trend = np.vander(np.linspace(-1.0, 1.0, len(q)), 2)
    detrended = q - trend @ np.linalg.lstsq(trend, q, rcond=None)[0]
    size = max(len(q), round(rate / _RESOLUTION), _LEAST_SIZE)
    transform = np.fft.rfft(window * detrended, size, axis=0)
    scale = 2.0 / (rate * float((window**2).sum()))
    density: Array = np.asarray(scale * np.abs(transform) ** 2, dtype=float)
    return np.linspace(0.0, (len(density) - 1) * rate / size, len(density)), density
