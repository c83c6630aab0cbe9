"""Quintic smoothing spline: a zero-phase low-pass filter that also gives derivatives."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array

_ORDER = 3  # of the derivative that is penalized
_DEGREE = 2 * _ORDER - 1
# A finer spacing of knots would only add digits to lose: this one follows a sine of 12 Hz to 1e-6.
_SPACING = 0.005  # [s]
_AT_3_DB = np.sqrt(2.0) - 1.0


def half_amplitude(cutoff: float) -> float:
    """Frequency [Hz] that passes with half its amplitude, of the spline with this -3 dB point."""
    return float(cutoff * _AT_3_DB ** (-1.0 / (2 * _ORDER)))


def frequency_response(frequency: ArrayLike, cutoff: float) -> Array:
    """Factor by which the spline multiplies a sine of this frequency [Hz]."""
    relative = np.asarray(frequency, dtype=float) / half_amplitude(cutoff)
    response: Array = 1.0 / (1.0 + relative ** (2 * _ORDER))
    return response


def smoothing_spline(time: Array, values: Array, cutoff: float) -> scipy.interpolate.BSpline:
    """The quintic spline x that minimizes sum_i w_i |y_i - x(t_i)|^2 + lambda int |x'''|^2 dt.

    The weights w are those of the trapezoidal rule, so that the sum approximates an integral and
    x hardly depends on the sampling rate. Away from the ends a sine of frequency f is multiplied by
    1 / (1 + lambda (2 pi f)^6): the response of a Butterworth filter of order 3 that runs forwards
    and backwards (Craven, Wahba, Numerische Mathematik 31, 1979; Woltring, Advances in Engineering
    Software 8, 1986). lambda follows from the cut-off, where the factor is 1 / sqrt(2). At the ends
    x''' and x'''' vanish; parabolas stay as they are.

    Args:
        time: of the samples (k,) [s], three or more.
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
    """Matrix from the coefficients of a quintic spline to its third derivative at the points."""
    degree, size = _DEGREE, knots.size - _DEGREE - 1
    matrix = scipy.sparse.eye_array(size, format="csr")
    for _ in range(_ORDER):
        slope = degree / (knots[degree + 1 : degree + size] - knots[1:size])
        difference = scipy.sparse.diags_array(
            [-slope, slope], offsets=[0, 1], shape=(size - 1, size)
        )
        matrix, knots, degree, size = difference @ matrix, knots[1:-1], degree - 1, size - 1
    return scipy.interpolate.BSpline.design_matrix(points, knots, degree) @ matrix
