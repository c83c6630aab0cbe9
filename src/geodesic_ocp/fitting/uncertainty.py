"""How well the data determine the parameters of a fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.fitting.program.curvature import LeastErrors
from geodesic_ocp.fitting.program.metric_program import MetricProgram
from geodesic_ocp.trajectory.motion import bandwidth

# Directions in which the logarithms of the parameters are more uncertain than this are reported.
_UNDETERMINED = 0.5
_SINGULAR = 1e-7  # smallest eigenvalue relative to the largest
_INVOLVED = 0.25  # smallest component of a direction that is named


def covariance(program: MetricProgram, errors: LeastErrors) -> Array:
    """Covariance of parameters that are at no bound, in units of their initial values.

    H^-1 (sum_r s_r^2 / k_r H_r) H^-1 with the Hessians H_r of the recordings' least errors, their
    sum H, the variance s_r^2 of an error and the number k_r of independent samples: the errors of
    filtered data are correlated over 1 / (2 bandwidth) (Davidson and MacKinnon, "Estimation and
    Inference in Econometrics", 1993, chapter 5, for the form). Infinite where H is singular.
    """
    total = np.asarray(errors.hessians.sum(axis=0))
    if not total.size:
        return total
    components = 3 if program.parts[0].functions.measure == "position" else None
    weights = []
    for part, value in zip(program.parts, errors.values, strict=True):
        motion = part.observed.recording.motion
        duration = sum(float(motion.time[b] - motion.time[a]) for a, b in part.observed.segments)
        frequency = bandwidth(motion)
        samples = min(2.0 * frequency * duration, part.observed.owners.size)
        variance = 2.0 * value / (components or part.functions.dim)
        weights.append(variance / max(samples, 1.0))
    middle = np.einsum("r,rij->ij", np.array(weights), errors.hessians)
    if np.linalg.eigvalsh(middle)[0] < 0.0:  # single recordings need not have a minimum here
        middle = _positive(float(np.mean(weights)) * total)
    # Negative curvature means that the error has no minimum along a direction.
    values, vectors = np.linalg.eigh(total)
    regular = values > _SINGULAR * max(values[-1], 1e-300)
    inverse = (vectors[:, regular] / values[regular]) @ vectors[:, regular].T
    result = inverse @ middle @ inverse
    flat = vectors[:, ~regular]
    return np.asarray(result + np.diag(np.where(np.sum(flat**2, axis=1) > 1e-6, np.inf, 0.0)))


def _positive(matrix: Array) -> Array:
    """The positive semidefinite part of a symmetric matrix."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def undetermined_directions(
    errors: LeastErrors, matrix: Array, relative: Array, names: Sequence[str]
) -> tuple[str, ...]:
    """Sentences on combinations of parameters that the data do not determine.

    The eigenvectors of the Hessian by the parameters' logarithms along which one standard deviation
    is more than half, so that a factor of 1.6 and more is within it.

    Args:
        errors, matrix: of the parameters at no bound, and their covariance.
        relative: their values in units of their initial values.
        names: of these parameters.
    """
    if not relative.size:
        return ()
    hessian = errors.hessians.sum(axis=0) * np.outer(relative, relative)
    finite = np.where(np.isfinite(matrix), matrix, 0.0) / np.outer(relative, relative)
    sentences = []
    for value, direction in zip(*np.linalg.eigh(hessian), strict=True):
        flat = value <= _SINGULAR * np.abs(hessian).max()
        variance = max(float(direction @ finite @ direction), 0.0)
        if not flat and variance <= _UNDETERMINED**2:
            continue
        direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
        involved = [k for k in range(relative.size) if abs(direction[k]) >= _INVOLVED]
        listed = [names[k] for k in involved]
        if len(listed) == 1:
            sentences.append(f"the data do not determine {listed[0]}")
            continue
        powers = [f"{names[k]} by a factor of {2.0 ** direction[k]:.3g}" for k in involved]
        sentences.append(
            f"the data determine {', '.join(listed[:-1])} and {listed[-1]} in combination only: "
            f"changing {' and '.join(powers)} leaves the error almost the same"
        )
    return tuple(sentences)
