"""Fits to other choices of the recordings: each alone, all but one, and with repetition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy
from scipy.interpolate import CubicSpline

from geodesic_ocp.arrays import Array, ShortRepr, as_integer
from geodesic_ocp.fitting.error_profile import ErrorProfile, error_profile
from geodesic_ocp.fitting.fit_metric import solve_program
from geodesic_ocp.fitting.metric_fit import ConfidenceInterval, MetricFit
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import Euclidean
from geodesic_ocp.progress import Progress, no_progress, shows_progress
from geodesic_ocp.synergies.scores import MotionErrors, motion_errors
from geodesic_ocp.synergies.second_order import riemannian_cubics
from geodesic_ocp.synergies.synergy import reconstruct
from geodesic_ocp.tables import markdown, new_table
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.recording import Recording

if TYPE_CHECKING:
    from pandas import DataFrame

_FINE = 2000  # points at which an interpolated profile is compared
_LARGEST_STEP = np.log(10.0)  # of a parameter's logarithm
FEWEST = 3  # units of a bootstrap: of two, there are three different resamples


@shows_progress
def separate_fits(
    fit: MetricFit, by: str = "recording", *, progress: Progress | None = None
) -> dict[str, MetricFit]:
    """Return a fit of every recording, or of every subject with all recordings, on the same
    segments.

    By the name of the recording or the subject.

    >>> whole = go.trajectory.bundled_recording()
    >>> parts = [whole.motion.part(k, k + 79) for k in (270, 350, 430)]
    >>> recordings = [go.trajectory.Recording(whole.model, part) for part in parts]
    >>> fit = go.fitting.fit_metric(recordings[:2], segments=[[(0, 79)]] * 2)
    >>> separate = go.fitting.separate_fits(fit)
    >>> [round(each.values["joint_inertia"], 2) for each in separate.values()]
    [0.03, 0.07]

    Args:
        fit: fit whose recordings, segments and parameters are used.
        by: "recording" or "subject".
        progress: called with the current step, the amount done, and the total.

    Raises:
        ValueError: by is neither "recording" nor "subject".
        NotConverged: Ipopt did not find a solution.
    """
    report = progress or no_progress
    units = units_of(fit.recordings, by)
    found = {}
    for number, (unit, members) in enumerate(units.items()):
        report(f"fitting each {by}", number, len(units))
        found[unit] = refit(fit, members)
    return found


@dataclass(frozen=True)
class Heterogeneity:
    """Whether estimates of one parameter from separate recordings or subjects differ by more than
    their standard errors (Cochran, Biometrics 10, 1954; Higgins et al., BMJ 327, 2003).

    Attributes:
        parameter: name of the parameter.
        count: number of estimates that the data determine, k.
        q: sum of the squared deviations of their logarithms from the weighted mean, in units of
            their standard errors.
        p: probability of a larger q if all were equal, by chi squared with k - 1 degrees of
            freedom; NaN for fewer than two.
        i_squared: fraction of their variance that is not of their standard errors.
        lowest, highest: unit and estimate.
    """

    parameter: str
    count: int
    q: float
    p: float
    i_squared: float
    lowest: tuple[str, float]
    highest: tuple[str, float]


def heterogeneity(fits: Mapping[str, MetricFit]) -> tuple[Heterogeneity, ...]:
    """Return for every parameter whether separate fits (`separate_fits`) disagree.

    >>> whole = go.trajectory.bundled_recording()
    >>> parts = [whole.motion.part(k, k + 79) for k in (270, 350, 430)]
    >>> recordings = [go.trajectory.Recording(whole.model, part) for part in parts]
    >>> fit = go.fitting.fit_metric(recordings[:2], segments=[[(0, 79)]] * 2)
    >>> (found,) = go.fitting.heterogeneity(go.fitting.separate_fits(fit))
    >>> found.count, round(found.q, 1), round(found.p, 2)
    (2, 2.1, 0.14)

    Args:
        fits: by recording or subject. Estimates at a bound and those that the data do not determine
            are left out.
    """
    found = []
    names = [each.name for each in next(iter(fits.values())).estimates] if fits else []
    for column, name in enumerate(names):
        own = {unit: fit.estimates[column] for unit, fit in fits.items()}
        known = {
            unit: (each.value, each.standard_error / each.value)
            for unit, each in own.items()
            if not each.at_bound and 0.0 < each.standard_error < np.inf
        }
        if not known:
            continue
        values, errors = np.array(list(known.values())).T
        weights = errors**-2.0
        logs = np.log(values)
        q = float(weights @ (logs - weights @ logs / weights.sum()) ** 2)
        free = len(known) - 1
        p = float(scipy.stats.chi2.sf(q, free)) if free else np.nan
        ends = [(list(known)[int(k)], float(values[k])) for k in np.argsort(values)[[0, -1]]]
        share = max(0.0, 1.0 - free / q) if q > 0.0 else 0.0
        found.append(Heterogeneity(name, len(known), q, p, share, *ends))
    return tuple(found)


def units_of(recordings: Sequence[Recording], by: str) -> dict[str, list[int]]:
    """Return indices of the recordings of each recording or subject, by its label.

    Raises:
        ValueError: by is neither "recording" nor "subject".
    """
    labels = [each.subject for each in recordings]
    if by == "recording":
        names = [each.name or "recording" for each in recordings]
        labels = [
            f"{name} ({number + 1})" if names.count(name) > 1 else name
            for number, name in enumerate(names)
        ]
    elif by != "subject":
        raise ValueError(f"by must be 'recording' or 'subject', got {by!r}")
    return {
        unit: [index for index, label in enumerate(labels) if label == unit]
        for unit in dict.fromkeys(labels)
    }


def refit(fit: MetricFit, chosen: Sequence[int]) -> MetricFit:
    """Return the fit of some of its recordings, by index, on the same segments.

    Raises:
        NotConverged: Ipopt did not find a solution.
    """
    program = replace(fit.program, parts=tuple(fit.program.parts[index] for index in chosen))
    near = fit.program.start_of(chosen, fit.outcome)
    return solve_program(program, fit.parameters, fit.family, near)


@dataclass(frozen=True)
class LeftOut:
    """Errors of one recording with parameters estimated from others.

    Attributes:
        name: name of the recording.
        values: estimates from the recordings that were not left out.
        errors: errors of the geodesics (`reconstruct`) or cubics with these parameters.
        straight_lines: errors of straight lines on the same segments; with cubics, of those of a
            constant metric, minimum acceleration.
    """

    name: str
    subject: str
    values: tuple[float, ...]
    errors: MotionErrors
    straight_lines: MotionErrors


@dataclass(frozen=True, repr=False)
class CrossValidation(ShortRepr):
    """Errors of recordings that took no part in the estimation.

    Attributes:
        unit: unit that was left out at a time, "recording" or "subject".
        parameters: names.
        left_out: one for each recording.
    """

    unit: str
    parameters: tuple[str, ...]
    left_out: tuple[LeftOut, ...]

    def _repr_markdown_(self) -> str:
        return markdown(self.table())

    def table(self) -> DataFrame:
        """Return estimates without the recording, its errors, and those of a constant metric."""
        kinds = ("joints [rad]", "hand [m]", "hand [rad]")
        header = (
            "left out",
            *self.parameters,
            *kinds,
            *(f"constant metric: {kind}" for kind in kinds),
        )
        rows = [
            (each.name, *each.values, *each.errors.means, *each.straight_lines.means)
            for each in self.left_out
        ]
        return new_table(header, rows)


@shows_progress
def leave_one_out(
    fit: MetricFit, by: str = "recording", *, progress: Progress | None = None
) -> CrossValidation:
    """Estimate anew without each recording, or subject, and predict it.

    Errors are those of `evaluate` on all segments of the recording, of the predictions of the fit
    and of those in a constant metric: straight lines, or minimum acceleration.

    >>> whole = go.trajectory.bundled_recording()
    >>> parts = [whole.motion.part(k, k + 79) for k in (270, 350, 430)]
    >>> recordings = [go.trajectory.Recording(whole.model, part) for part in parts]
    >>> fit = go.fitting.fit_metric(recordings, segments=[[(0, 79)]] * 3)
    >>> validation = go.fitting.leave_one_out(fit)
    >>> [round(each.errors.joint, 3) for each in validation.left_out]
    [0.013, 0.046, 0.063]

    Args:
        fit: from at least two recordings.
        by: what is left out, "recording" or "subject".
        progress: called with the current step, the amount done, and the total.

    Raises:
        ValueError: fewer than two recordings or subjects.
        NotConverged: an estimation or a geodesic of a recording that was left out failed.
    """
    report = progress or no_progress
    units = units_of(fit.recordings, by)
    if len(units) < 2:
        raise ValueError(f"leaving one {by} out needs at least two, got {len(units)}")
    results: list[tuple[int, LeftOut]] = []
    for number, members in enumerate(units.values()):
        report(f"leaving one {by} out", number, len(units))
        others = refit(fit, [k for k in range(len(fit.recordings)) if k not in members])
        for index in members:
            part = fit.program.parts[index]
            recording = part.recording
            model = part.recording.model
            motion = recording.motion
            values = tuple(others.values.values())
            errors = [
                motion_errors(model, motion, _predicted(fit, each, motion, part.every))
                for each in (others.metric(model), Euclidean(model.dof))
            ]
            results.append((index, LeftOut(recording.name, recording.subject, values, *errors)))
    left_out = tuple(each for _, each in sorted(results, key=lambda pair: pair[0]))
    return CrossValidation(by, tuple(each.name for each in fit.estimates), left_out)


def _predicted(
    fit: MetricFit, metric: Metric, motion: Motion, segments: Sequence[tuple[int, int]]
) -> Motion:
    if fit.curve == "geodesic":
        return reconstruct(metric, motion, segments).predicted
    return riemannian_cubics(metric, motion, segments)


@shows_progress
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
    """Return percentile intervals of estimates from resampled recordings or subjects.

    Recordings, or subjects with all their recordings, are drawn with replacement (Efron and
    Tibshirani, "An Introduction to the Bootstrap", 1993, chapters 13 and 6.4). With one parameter
    every resample is fitted exactly, on the interpolated profiles of the recordings' least errors.
    With several, the estimate moves by one Newton step in the parameters' logarithms, from the
    exact derivatives of the recordings' least errors at the solution.

    >>> whole = go.trajectory.bundled_recording()
    >>> parts = [whole.motion.part(k, k + 79) for k in (270, 350, 430)]
    >>> recordings = [go.trajectory.Recording(whole.model, part) for part in parts]
    >>> fit = go.fitting.fit_metric(recordings, segments=[[(0, 79)]] * 3)
    >>> (interval,) = go.fitting.bootstrap_fit(fit, 20)
    >>> interval.name, interval.count, round(interval.high, 3)
    ('joint_inertia', 3, 0.064)

    Args:
        fit: from several recordings.
        count: number of resamples.
        by: "recording" or "subject".
        confidence: confidence of the intervals.
        seed: seed of the random numbers.
        curve: the profile of the only parameter (`error_profile`), if it is known already.
        progress: called with the current step, the amount done, and the total.

    Raises:
        ValueError: fewer than three units, or a number out of range.
    """
    units = units_of(fit.recordings, by)
    weights, tails = resampled([*units.values()], by, count, confidence, seed)
    if len(fit.estimates) == 1:
        estimates = minimizers(curve or error_profile(fit, progress=progress), weights)
    else:
        estimates = _newton_steps(fit, weights)
    # Nothing is known of parameters that the data do not determine.
    unknown = np.isinf([each.standard_error for each in fit.estimates])
    low, high = np.percentile(estimates, tails, axis=0, method="nearest")
    low = np.where(unknown, 0.0, low)
    high = np.where(unknown, np.inf, high)
    return tuple(
        ConfidenceInterval(each.name, float(a), float(b), confidence, by, len(units))
        for each, a, b in zip(fit.estimates, low, high, strict=True)
    )


def resampled(
    units: Sequence[Sequence[int]], by: str, count: int, confidence: float, seed: int
) -> tuple[Array, tuple[float, float]]:
    """Return how often each index is there where its units are drawn with replacement, (count, k),
    and the percentiles of the interval.

    Raises:
        ValueError: fewer than three units, or a number out of range.
    """
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must be between 0 and 1, got {confidence}")
    count = as_integer("count", count, 1)
    if len(units) < FEWEST:
        raise ValueError(f"a bootstrap needs at least three {by}s, got {len(units)}")
    rng = np.random.default_rng(as_integer("seed", seed, 0))
    drawn = rng.multinomial(len(units), np.full(len(units), 1.0 / len(units)), size=count)
    weights = np.zeros((count, sum(map(len, units))))
    for column, members in enumerate(units):
        weights[:, members] = drawn[:, [column]]
    tail = 50.0 * (1.0 - confidence)
    return weights, (tail, 100.0 - tail)


def minimizers(curve: ErrorProfile, weights: Array) -> Array:
    """Return minimizers (count, 1) of weighted sums of the recordings' interpolated profiles.

    0 or inf where the sum is least at the first or the last value.
    """
    logs = np.log(curve.values)
    fine = np.linspace(logs[0], logs[-1], _FINE)
    errors = CubicSpline(logs, curve.errors**2)(fine)  # (fine, recordings)
    best = np.argmin(errors @ weights.T, axis=0)
    estimates = np.exp(fine[best])
    estimates[best == 0] = 0.0
    estimates[best == _FINE - 1] = np.inf
    return np.asarray(estimates[:, None])


def _newton_steps(fit: MetricFit, weights: Array) -> Array:
    """Return estimates (count, p) after one Newton step from the solution."""
    derivatives = fit.derivatives
    values = np.array(list(fit.values.values()))
    relative = values / fit.program.start
    free = np.flatnonzero([not each.at_bound for each in fit.estimates])
    own = derivatives.of_parameters(free)
    gradients = own.gradients * relative[free]
    hessians = own.hessians * np.outer(relative[free], relative[free])
    hessians += gradients[:, :, None] * np.eye(free.size)
    sizes, axes = np.linalg.eigh(np.einsum("kr,rij->kij", weights, hessians))
    if free.size:  # where no minimum is near: the curvature of all recordings
        flat = sizes[:, 0] <= 1e-9 * sizes[:, -1]
        sizes[flat], axes[flat] = np.linalg.eigh(hessians.sum(axis=0))
    along = np.einsum("kij,ki->kj", axes, weights @ gradients) / np.maximum(sizes, 1e-12)
    steps = np.clip(-np.einsum("kij,kj->ki", axes, along), -_LARGEST_STEP, _LARGEST_STEP)
    lower = fit.program.lower[free]
    upper = fit.program.upper[free]
    result = np.full((len(weights), values.size), np.nan)
    result[:, free] = np.clip(values[free] * np.exp(steps), lower, upper)
    return result
