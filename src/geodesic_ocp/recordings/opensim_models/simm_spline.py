"""The cubic spline of OpenSim's SimmSpline."""

from __future__ import annotations

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.opensim_models.osim_model import OsimFunction

_BEYOND = 0.01  # of the spline's width


def simm_spline(x: Array, y: Array) -> OsimFunction:
    """The interpolating cubic spline through (x, y).

    It is not the natural spline: at either end its third derivative is that of the cubic through
    the four points there (Forsythe, Malcolm and Moler, Computer Methods for Mathematical
    Computations, 1977, section 4.4). With three points the third derivatives at the ends are zero.

    Args:
        x: increasing (n,), n at least 2.
        y: (n,).

    Returns:
        A function that raises RecordingError beyond the ends by more than a hundredth of the
        spline's width, as programs differ there. Up to that it is linear.
    """
    count, step, slope = len(x), np.diff(x), np.diff(y) / np.diff(x)
    matrix, right = np.zeros((count, count)), np.zeros(count)  # of the second derivatives
    for i in range(1, count - 1):
        matrix[i, i - 1 : i + 2] = step[i - 1], 2.0 * (step[i - 1] + step[i]), step[i]
        right[i] = 6.0 * (slope[i] - slope[i - 1])
    for end, inner, width, four in (
        (0, 1, step[0], slice(0, 4)),
        (-1, -2, -step[-1], slice(-4, None)),
    ):
        matrix[end, [end, inner]] = -1.0, 1.0
        right[end] = width * _third_derivative(x[four], y[four]) if count > 3 else 0.0
    second = np.zeros(2) if count == 2 else np.linalg.solve(matrix, right)
    slopes = np.append(
        slope - step * (2.0 * second[:-1] + second[1:]) / 6.0,
        slope[-1] + step[-1] * (second[-2] + 2.0 * second[-1]) / 6.0,
    )
    spline = scipy.interpolate.CubicHermiteSpline(x, y, slopes)

    def evaluate(values: Array) -> Array:
        at = values[0]
        inside = np.clip(at, x[0], x[-1])
        worst = int(np.argmax(np.abs(at - inside)))
        if abs(at[worst] - inside[worst]) > _BEYOND * (x[-1] - x[0]):
            raise RecordingError(
                f"a SimmSpline of the model has points from {x[0]:.4g} to {x[-1]:.4g}, but its "
                f"coordinate is {at[worst]:.4g}"
            )
        beyond = np.where(at < x[0], slopes[0], slopes[-1])
        result: Array = spline(inside) + beyond * (at - inside)
        return result

    return evaluate


def _third_derivative(x: Array, y: Array) -> float:
    """Of the cubic through four points."""
    return float(
        6.0 * sum(y[i] / np.prod([x[i] - x[j] for j in range(4) if j != i]) for i in range(4))
    )
