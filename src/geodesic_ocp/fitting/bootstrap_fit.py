"""Confidence intervals of a fit by resampling recordings or subjects."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from geodesic_ocp.arrays import Array, as_integer
from geodesic_ocp.fitting.error_profile import ErrorProfile, error_profile
from geodesic_ocp.fitting.metric_fit import ConfidenceInterval, MetricFit
from geodesic_ocp.fitting.separate_fits import units_of
from geodesic_ocp.progress import Progress

_FINE = 2000  # points at which an interpolated profile is compared
_LARGEST_STEP = np.log(10.0)  # of a parameter's logarithm


def bootstrap_fit(
    fit: MetricFit,
    count: int = 1000,
    *,
    by: str = "recording",
    confidence: float = 0.95,
    seed: int = 0,
    curve: ErrorProfile | None = None,
    progress: Progress | None = None,
) -> tuple[ConfidenceInterval, ...]:
    """Percentile intervals of estimates from resampled recordings or subjects.

    Recordings, or subjects with all their recordings, are drawn with replacement (Efron and
    Tibshirani, "An Introduction to the Bootstrap", 1993, chapters 13 and 6.4). With one parameter
    every resample is fitted exactly, on the interpolated profiles of the recordings' least errors.
    With several, the estimate moves by one Newton step in the parameters' logarithms, from the
    exact derivatives of the recordings' least errors at the solution.

    Args:
        fit: from several recordings.
        count: of resamples.
        by: "recording" or "subject".
        confidence: of the intervals.
        seed: of the random numbers.
        curve: the profile of the only parameter (`error_profile`), if it is known already.
        progress: called with the current step, the amount done, and the total.

    Raises:
        ValueError: fewer than two units, or a number out of range.
    """
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must be between 0 and 1, got {confidence}")
    count = as_integer("count", count, 1)
    labels = units_of(fit, by)
    units = list(dict.fromkeys(labels))
    if len(units) < 2:
        raise ValueError(f"a bootstrap needs at least two {by}s, got {len(units)}")
    members = np.array([[label == unit for label in labels] for unit in units], dtype=float)
    rng = np.random.default_rng(as_integer("seed", seed, 0))
    drawn = rng.multinomial(len(units), np.full(len(units), 1.0 / len(units)), size=count)
    weights = drawn @ members
    estimates = (
        _on_profile(curve or error_profile(fit, progress=progress), weights)
        if len(fit.estimates) == 1
        else _newton_steps(fit, weights)
    )
    # Nothing is known of parameters that the data do not determine.
    unknown = np.isinf([each.standard_error for each in fit.estimates])
    tail = 50.0 * (1.0 - confidence)
    low, high = np.percentile(estimates, [tail, 100.0 - tail], axis=0, method="nearest")
    low, high = np.where(unknown, 0.0, low), np.where(unknown, np.inf, high)
    return tuple(
        ConfidenceInterval(each.name, float(a), float(b), confidence, by, len(units))
        for each, a, b in zip(fit.estimates, low, high, strict=True)
    )


def _on_profile(curve: ErrorProfile, weights: Array) -> Array:
    """Minimizers (count, 1) of the weighted sums of the recordings' interpolated profiles."""
    logs = np.log(curve.values)
    fine = np.linspace(logs[0], logs[-1], _FINE)
    errors = CubicSpline(logs, curve.errors**2)(fine)  # (fine, recordings)
    best = np.argmin(errors @ weights.T, axis=0)
    estimates = np.exp(fine[best])
    estimates[best == 0] = 0.0
    estimates[best == _FINE - 1] = np.inf
    return np.asarray(estimates[:, None])


def _newton_steps(fit: MetricFit, weights: Array) -> Array:
    """Estimates (count, p) after one Newton step from the solution."""
    derivatives, values = fit.derivatives, np.array(list(fit.values.values()))
    relative = values / fit.program.start
    gradients = derivatives.gradients * relative
    hessians = derivatives.hessians * np.outer(relative, relative)
    index = np.arange(values.size)
    hessians[:, index, index] += gradients
    bounded = np.array([each.at_bound for each in fit.estimates])
    free = np.flatnonzero(~bounded)
    total = np.linalg.eigh(hessians.sum(axis=0)[np.ix_(free, free)])
    result = np.tile(values, (len(weights), 1))
    for row, weight in enumerate(weights):
        hessian = np.einsum("r,rij->ij", weight, hessians)[np.ix_(free, free)]
        gradient = (weight @ gradients)[free]
        sizes, axes = np.linalg.eigh(hessian)
        if sizes[0] <= 1e-9 * sizes[-1]:  # no minimum nearby: the curvature of all recordings
            sizes, axes = total
        step = -(axes / np.maximum(sizes, 1e-12)) @ (axes.T @ gradient)
        result[row, free] *= np.exp(np.clip(step, -_LARGEST_STEP, _LARGEST_STEP))
    lower, upper = fit.program.lower, fit.program.upper
    result = np.asarray(np.clip(result, lower, upper))
    result[:, bounded] = np.nan
    return result
