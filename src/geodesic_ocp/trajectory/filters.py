"""Zero-phase filters of sampled coordinates, and what they say about the noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from geodesic_ocp.arrays import Array, ShortRepr, as_positive

# Time stamps may deviate from even spacing by this fraction of a step, as recordings round them.
_UNEVEN = 0.1
# Noise bandwidth of a Savitzky-Golay filter of order 2, times its duration: its middle weight is
# 9/4 over the number of samples of its window.
_BANDWIDTH_OF_WINDOW = 9.0 / 8.0
# The smoothing spline: order of the derivative that is penalized, and degree.
_ORDER = 3
_DEGREE = 2 * _ORDER - 1
# A finer spacing of knots would only add digits to lose: this one follows a sine of 12 Hz to 1e-6.
_SPACING = 0.005  # [s]
_AT_3_DB = np.sqrt(2.0) - 1.0
# Voluntary motions of the arm have next to no power above 12 Hz; samples at 50 Hz still resolve
# 18 Hz, and so the floor is read between the two whatever the sampling rate.
_NOISE_BAND = (12.0, 18.0)  # [Hz]
_OF_NYQUIST = 0.72
_CUTOFFS = np.arange(3.0, 12.0 + 1e-9, 0.1)  # [Hz]
_MIN_RATE = 12.0  # [Hz], [s], to choose one of them
_MIN_DURATION = 0.3  # [Hz], [s], to choose one of them
_RESOLUTION = 0.1  # [Hz]
_LEAST_SIZE = 256  # of the Fourier transform
_LEAST_DENSITY = 1e-12  # [rad^2/Hz]: below the rounding of any recording
_STILL = 1e-5  # [rad]


@dataclass(frozen=True, eq=False, repr=False)
class MotionFilter(ShortRepr):
    """The filter of a motion, and the noise that was found in the recording.

    Attributes:
        kind: "smoothing spline" or "Savitzky-Golay filter of order 2".
        cutoff: -3 dB point of the smoothing spline [Hz]; None for Savitzky-Golay.
        duration: duration of the window of the Savitzky-Golay filter [s]; None for the smoothing
            spline.
        chosen: whether the cut-off was chosen from the noise floor.
        noise: standard deviation of the noise of every joint before filtering (n,) [rad or m].
        velocity_noise: noise of the velocities after filtering (n,) [rad/s or m/s].
    """

    kind: str
    cutoff: float | None
    duration: float | None
    chosen: bool
    noise: Array
    velocity_noise: Array

    @property
    def bandwidth(self) -> float:
        """Cut-off frequency, or noise bandwidth of a Savitzky-Golay filter of order 2 [Hz]."""
        if self.cutoff is not None:
            return self.cutoff
        return _BANDWIDTH_OF_WINDOW / float(self.duration or np.inf)

    @property
    def order(self) -> int:
        """Order of the polynomials of a Savitzky-Golay filter."""
        return int(self.kind.rpartition(" ")[2])

    def select(self, columns: list[int]) -> MotionFilter:
        """Return the filter of these joints."""
        noise = self.noise[columns]
        velocity_noise = self.velocity_noise[columns]
        return replace(self, noise=noise, velocity_noise=velocity_noise)

    _shown = ("kind", "cutoff", "duration", "noise")

    def __str__(self) -> str:
        """Return the description as a sentence."""
        low, high = (f"{1e3 * float(end):.2g}" for end in (self.noise.min(), self.noise.max()))
        noise = low if low == high else f"{low} to {high}"
        if self.cutoff is None:
            size = f"with a window of {self.duration:.3g} s"
        else:
            how = ", chosen from the noise floor" if self.chosen else ""
            size = f"with a cut-off frequency of {self.cutoff:.3g} Hz{how}"
        return f"Filtered by a {self.kind} {size}; noise of the joints: {noise} mrad."


Filtered = tuple[Array, Array, MotionFilter]  # coordinates, velocities, filter


def check_even(time: Array) -> None:
    """Raise ValueError unless the samples are evenly spaced."""
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
    """Filter by a smoothing spline; a cut-off of None is chosen from the noise floor.

    Raises:
        ValueError: fewer than three samples, or too few or too slow for this cut-off or for any.
    """
    duration = float(time[-1] - time[0])
    rate = (time.size - 1) / duration
    chosen = cutoff is None
    if cutoff is None:
        if rate < _MIN_RATE:
            raise ValueError(
                f"at a sampling rate of {rate:.4g} Hz motion and noise cannot be told apart, which "
                f"takes {_MIN_RATE:g} Hz; give the cut-off, filtered(cutoff=...)"
            )
        if duration < _MIN_DURATION:
            raise ValueError(
                "the motion is too short to filter: to choose a cut-off takes "
                f"{_MIN_DURATION:g} s, it lasts {duration:.4g} s; give the cut-off, "
                "filtered(cutoff=...)"
            )
        cutoff = _choose_cutoff(rate, q)
    cutoff = as_positive("cutoff", cutoff, "Hz")
    if cutoff >= rate / 2.0:
        raise ValueError(
            f"cutoff must be below half the sampling rate, {rate / 2.0:.4g} Hz, got {cutoff:g}"
        )
    if time.size < 3:
        raise ValueError(f"the motion is too short to filter: {time.size} samples, not three")
    spline = _smoothing_spline(np.linspace(time[0], time[-1], time.size), q, cutoff)
    smooth = spline(time)
    velocity = spline(time, 1)
    density = noise_density(rate, q)
    removed = np.mean((q - smooth) ** 2, axis=0)
    # What the residuals lack has the bandwidth of 1 - (1 - H)^2, integrated over f > 0.
    passed = 7.0 * np.pi / 18.0 * _half_amplitude(cutoff)
    noise = np.sqrt(removed + density * min(passed, rate / 2.0))
    left = np.sqrt(density) * _velocity_gain(cutoff)
    return smooth, velocity, MotionFilter("smoothing spline", cutoff, None, chosen, noise, left)


def locally_fitted(time: Array, q: Array, window: int, order: int) -> Filtered:
    """Filter by Savitzky and Golay: polynomials fitted to windows of samples.

    Each sample is in the middle of its polynomial's samples, except near the ends (Savitzky, Golay,
    Analytical Chemistry 36, 1964).

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
    smooth, velocity = (
        scipy.signal.savgol_filter(q, window, order, deriv, step, axis=0) for deriv in (0, 1)
    )
    # Standard deviations of the residual and of the slope in a window of unit white noise.
    fit, slope = (
        scipy.signal.savgol_coeffs(window, order, deriv, step, use="dot") for deriv in (0, 1)
    )
    left_out = float(np.linalg.norm(np.eye(window)[window // 2] - fit))
    removed = np.sqrt(np.mean((q - smooth) ** 2, axis=0))
    noise = removed / left_out if left_out > 0.0 else np.zeros_like(removed)
    left = noise * float(np.linalg.norm(slope))
    kind = f"Savitzky-Golay filter of order {order}"
    return smooth, velocity, MotionFilter(kind, None, window * step, False, noise, left)


def window_of(duration: float, rate: float, order: int) -> int:
    """Return the odd number of samples nearest to a duration [s] at this rate [Hz].

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


def without_aliases(q: Array, rate: float, new_rate: float) -> Array:
    """Return samples q (k, n), taken at `rate`, without what `new_rate` [Hz] could not represent.

    A Butterworth filter of order 8 runs forwards and backwards; it halves the amplitude at 0.9
    times half the new rate. The ends are continued by point reflection.
    """
    sections = scipy.signal.butter(8, 0.9 * new_rate / 2.0, fs=rate, output="sos")
    padding = min(len(q) - 1, int(np.ceil(20.0 * rate / new_rate)))
    result: Array = scipy.signal.sosfiltfilt(sections, q, axis=0, padlen=padding)
    return result


def _smoothing_spline(time: Array, values: Array, cutoff: float) -> scipy.interpolate.BSpline:
    """Return the quintic spline x that minimizes sum_i w_i |y_i - x(t_i)|^2 + lambda int |x'''|^2
    dt.

    The weights w are those of the trapezoidal rule, so that the sum approximates an integral and
    x hardly depends on the sampling rate. Away from the ends a sine of frequency f is multiplied by
    1 / (1 + lambda (2 pi f)^6): the response of a Butterworth filter of order 3 that runs forwards
    and backwards (Craven, Wahba, Numerische Mathematik 31, 1979; Woltring, Advances in Engineering
    Software 8, 1986). lambda follows from the cut-off, where the factor is 1 / sqrt(2). At the ends
    x''' and x'''' vanish; parabolas stay as they are.

    Args:
        time: time of the samples (k,) [s], three or more.
        values: y (k, n).
        cutoff: -3 dB point [Hz].
    """
    pieces = min(time.size - 1, int(np.ceil((time[-1] - time[0]) / _SPACING - 1e-9)))
    breaks = np.linspace(time[0], time[-1], pieces + 1)
    knots = np.concatenate([[breaks[0]] * _DEGREE, breaks, [breaks[-1]] * _DEGREE])
    steps = np.diff(time)
    weights = 0.5 * (np.append(steps, 0.0) + np.insert(steps, 0, 0.0))
    basis = scipy.interpolate.BSpline.design_matrix(time, knots, _DEGREE).tocsr()
    nodes, node_weights = np.polynomial.legendre.leggauss(_ORDER)
    width = np.diff(breaks)[:, None]
    points = (breaks[:-1, None] + width * (nodes + 1.0) / 2.0).ravel()
    third = _third_derivative(knots, points)
    penalty = _AT_3_DB / (2.0 * np.pi * cutoff) ** (2 * _ORDER)
    diagonal = scipy.sparse.diags(penalty * (width * node_weights / 2.0).ravel())
    matrix = basis.T @ scipy.sparse.diags(weights) @ basis + third.T @ diagonal @ third
    size = knots.size - _DEGREE - 1
    banded = np.zeros((_DEGREE + 1, size))
    for offset in range(min(_DEGREE + 1, size)):
        banded[offset, : size - offset] = matrix.diagonal(-offset)
    right = basis.T @ (weights[:, None] * values)
    coefficients = scipy.linalg.solveh_banded(banded, right, lower=True)
    return scipy.interpolate.BSpline(knots, coefficients, _DEGREE)


def _third_derivative(knots: Array, points: Array) -> scipy.sparse.csr_array:
    """Return matrix from the coefficients of a quintic spline to its third derivative at the
    points.
    """
    degree = _DEGREE
    size = knots.size - _DEGREE - 1
    matrix = scipy.sparse.eye_array(size, format="csr")
    for _ in range(_ORDER):
        slope = degree / (knots[degree + 1 : degree + size] - knots[1:size])
        difference = scipy.sparse.diags_array(
            [-slope, slope], offsets=[0, 1], shape=(size - 1, size)
        )
        matrix = difference @ matrix
        knots = knots[1:-1]
        degree = degree - 1
        size = size - 1
    return scipy.interpolate.BSpline.design_matrix(points, knots, degree) @ matrix


def _half_amplitude(cutoff: float) -> float:
    """Return frequency [Hz] that passes with half its amplitude, of the spline with this -3 dB
    point.
    """
    return float(cutoff * _AT_3_DB ** (-1.0 / (2 * _ORDER)))


def _velocity_gain(cutoff: float) -> float:
    """Return standard deviation of the smoothing spline's velocity for noise of unit density, [1/s
    Hz^.5].

    The root of the integral of (2 pi f)^2 H(f)^2 over all f > 0.
    """
    return float(2.0 * np.pi * np.sqrt(np.pi / 12.0 * _half_amplitude(cutoff) ** 3))


def noise_band(rate: float) -> tuple[float, float]:
    """Return frequencies [Hz] between which the noise is read, at this sampling rate [Hz]."""
    high = min(_NOISE_BAND[1], _OF_NYQUIST * rate / 2.0)
    return high * _NOISE_BAND[0] / _NOISE_BAND[1], high


def noise_density(rate: float, q: Array) -> Array:
    """Return spectral density of the noise (n,) [rad^2/Hz], one-sided, of samples q (k, n) at a
    rate [Hz].

    The median of the density between 12 and 18 Hz (less where the sampling rate is below 50 Hz),
    where people's motions have next to no power. Of white noise, the density is
    2 sigma^2 / rate with its standard deviation sigma.
    """
    frequency, density = _spectrum(rate, q)
    low, high = noise_band(rate)
    band = density[(frequency >= low) & (frequency <= high)]
    # A periodogram is exponentially distributed: its median is log 2 times its mean.
    floor: Array = np.maximum(np.median(band, axis=0) / np.log(2.0), _LEAST_DENSITY)
    return floor


def _choose_cutoff(rate: float, q: Array) -> float:
    """Return the cut-off [Hz] of the least expected mean squared error of the velocities.

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
    used = frequency <= noise_band(rate)[1]
    excess = ((density[used] - floor) / floor).sum(axis=1)
    frequency = frequency[used]
    step = frequency[1]
    cutoffs = _CUTOFFS[max(_CUTOFFS[0], rate / 4.0) >= _CUTOFFS]
    errors = []
    for cutoff in cutoffs:
        response = 1.0 / (1.0 + (frequency / _half_amplitude(cutoff)) ** (2 * _ORDER))
        distortion = step * (2.0 * np.pi * frequency * (1.0 - response)) ** 2 @ excess
        errors.append(distortion + moving.sum() * _velocity_gain(cutoff) ** 2)
    return float(np.round(cutoffs[int(np.argmin(errors))], 1))


def _spectrum(rate: float, q: Array) -> tuple[Array, Array]:
    """Return frequencies (m,) [Hz] and one-sided densities (m, n), of a Hann window without its
    trend.
    """
    window = 1.0 + np.cos(np.pi * np.linspace(-1.0, 1.0, len(q) + 2)[1:-1, None])
    trend = np.vander(np.linspace(-1.0, 1.0, len(q)), 2)
    detrended = q - trend @ np.linalg.lstsq(trend, q, rcond=None)[0]
    size = max(len(q), round(rate / _RESOLUTION), _LEAST_SIZE)
    transform = np.fft.rfft(window * detrended, size, axis=0)
    scale = 2.0 / (rate * float((window**2).sum()))
    density: Array = np.asarray(scale * np.abs(transform) ** 2, dtype=float)
    return np.linspace(0.0, (len(density) - 1) * rate / size, len(density)), density
