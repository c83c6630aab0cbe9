"""Errors of metrics against the number of segments, each metric with its own best cuts."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, get_args

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_choice
from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.figures import save_figure
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.manifold.metrics import USUAL_METRICS, as_analysis_metric
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.progress import Progress, shows_progress
from geodesic_ocp.records import write_together
from geodesic_ocp.synergies.optimal_segmentations import (
    OptimalSegmentations,
    optimal_segmentations,
)
from geodesic_ocp.synergies.scores import motion_errors
from geodesic_ocp.synergies.segment import segment
from geodesic_ocp.synergies.segment_costs import Measure
from geodesic_ocp.synergies.segment_developed import segment_developed
from geodesic_ocp.synergies.synergy import reconstruct
from geodesic_ocp.synergies.uncertainty import Cutting
from geodesic_ocp.tables import markdown, new_table
from geodesic_ocp.trajectory.motion import Motion, bandwidth

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame


# A metric, or a function of a model that returns one.
MetricOrFunction = Metric | Callable[[Model], Metric]


def as_named_metrics(metrics: Mapping[str, MetricOrFunction]) -> dict[str, MetricOrFunction]:
    """Return the metrics by name, checked.

    Raises:
        ValueError: there is none, they have no names, or one is neither a metric nor a function.
    """
    if not isinstance(metrics, Mapping):
        raise ValueError(
            "metrics must have names, as in {'kinetic energy': go.KineticEnergy(model)}, got "
            f"{metrics!r}"
        )
    if not metrics:
        raise ValueError("metrics must be at least one, got none")
    for name, given in metrics.items():
        if not isinstance(given, Metric) and not callable(given):
            raise ValueError(
                f"metrics: {name!r} must be a metric, or a function of a model that returns one, "
                f"got {given!r}"
            )
    return dict(metrics)


def metric_of(name: str, given: MetricOrFunction, model: Model) -> Metric:
    """Return the metric of a model.

    Raises:
        ValueError: a function has not returned a metric, or it is of other joints.
    """
    try:
        metric = as_metric(given if isinstance(given, Metric) else given(model))
        return as_analysis_metric(metric, model)
    except ValueError as error:
        raise ValueError(f"metrics: {name!r}: {error}") from None


MEASURES: tuple[Measure, ...] = get_args(Measure)
_SHOWN = (4, 8, 12, 16, 20, 24)  # of many numbers of segments
_HEADER = ("metric", "cuts", "segments", "joints [rad]", "hand [m]", "hand [rad]")


@dataclass(frozen=True, eq=False, repr=False)
class MetricComparison:
    """Errors of several metrics, each with its own optimal cuts, from `compare_metrics`.

    Attributes:
        model: the arm.
        motion: observed, filtered.
        measure: measure that the cuts minimize.
        curves: tables by metric, indexed by the number of segments: mean errors with optimal cuts
            in the columns joint, position and orientation [rad, m, rad], the Bayesian information
            criterion, and the cuts as (start, stop) sample indices.
        by_rule: tables by metric, indexed by the rules that were compared: the number of segments,
            and errors likewise.
    """

    model: Model
    motion: Motion
    measure: Measure
    curves: Mapping[str, DataFrame]
    by_rule: Mapping[str, DataFrame]

    def __repr__(self) -> str:
        names = list(self.curves)[:3]
        best = ", ".join(f"{self.best_count(name)} ({name})" for name in names)
        best += ", ..." if len(self.curves) > len(names) else ""
        return (
            f"MetricComparison({self.model.name}, {self.motion.duration:.3g} s, cuts of least "
            f"{self.measure} error,\n  synergies worth having: {best})"
        )

    def _repr_markdown_(self) -> str:
        return markdown(self.table())

    def best_count(self, name: str) -> int:
        """Return the number of synergies worth having: that of the least Bayesian information
        criterion.

        With M independent samples of each of n joints, residuals of mean square R_j and noise of
        variance sigma_j^2, the number k minimizes

            M sum_j (log s_j^2 + R_j / s_j^2) + k (n + 2) log(M n),  s_j^2 = max(R_j, sigma_j^2).

        A segment has n + 2 parameters: the configuration, the time and the speed at its end. After
        a low-pass filter with cut-off frequency f, M is 2 f times the duration (Schwarz,
        "Estimating the dimension of a model", The Annals of Statistics 6, 1978).

        Raises:
            ValueError: there is no such metric.
        """
        return int(self.curves[as_choice("name", name, self.curves)]["criterion"].idxmin())

    def table(self, counts: Sequence[int] | None = None) -> DataFrame:
        """Return mean errors of every metric: optimal cuts, then those of the rules.

        Args:
            counts: numbers of segments; None shows 4, 8, ..., 24 and the number worth having.

        Raises:
            ValueError: a number of segments that was not compared.
        """
        known = self._counts
        if missing := sorted(set(counts or ()).difference(known)):
            raise ValueError(f"counts {missing} are not among those compared, {known}")
        rows = []
        for name, curve in self.curves.items():
            best = self.best_count(name)
            few = known if len(known) <= len(_SHOWN) else {*_SHOWN, best}
            chosen = curve[curve.index.isin(few if counts is None else counts)]
            for count, *errors in chosen[[*MEASURES]].itertuples():
                cuts = "optimal, least BIC" if count == best else "optimal"
                rows.append((name, cuts, count, *errors))
            rows += [(name, *found) for found in self.by_rule[name].itertuples()]
        return new_table(_HEADER, rows)

    def save(self, folder: str | FilePath, *, figure: Figure | None = None) -> list[FilePath]:
        """Write table.csv (all numbers of segments), table.md, and a figure (.png, .pdf).

        Args:
            folder: is made if there is none.
            figure: of the comparison, as `go.plot` draws it; None: none is written.

        Returns:
            The files' paths.

        Raises:
            OSError: the folder cannot be created or written to.
        """

        def write(place: FilePath) -> None:
            self.table(self._counts).to_csv(place / "table.csv")
            (place / "table.md").write_text(markdown(self.table()), encoding="utf-8")
            if figure is not None:
                save_figure(figure, place)

        return write_together(folder, write)

    @property
    def _counts(self) -> list[int]:
        """All numbers of segments that any metric has."""
        return sorted({int(count) for curve in self.curves.values() for count in curve.index})


_LEAST_NOISE = 1e-6  # [rad or m]: the rounding of recordings
_NORMAL_MEDIAN = 0.6745  # median of the absolute value of a standard normal variable


def bayesian_information(
    residuals: Array, segments: int, noise: Array, independent_samples: float
) -> float:
    """Return BIC of a motion from segments, see `MetricComparison.best_count`.

    Residuals are taken as Gaussian, and nothing below the noise counts as explained.

    Args:
        residuals: predicted minus observed coordinates (samples, n).
        segments: their number k.
        noise: standard deviations sigma (n,) of the noise in the observed coordinates.
        independent_samples: M, of every joint, which is less than the number of samples after a
            low-pass filter.
    """
    joints = residuals.shape[1]
    squares = np.mean(residuals**2, axis=0)
    variances = np.maximum(squares, noise**2)
    misfit = independent_samples * float(np.sum(np.log(variances) + squares / variances))
    parameters = segments * (joints + 2)
    return float(misfit + parameters * np.log(independent_samples * joints))


def noise_left(motion: Motion, noise: ArrayLike | None, frequency: float) -> Array:
    """Return standard deviations (n,) of the noise in the coordinates: as given, or estimated.

    White noise of standard deviation sigma before a filter of bandwidth f leaves
    sigma sqrt(2 f / rate). Without a record of the filter, sigma comes from second differences of
    the coordinates, as they are.

    Raises:
        ValueError: noise is neither one nor n numbers, or not positive.
    """
    joints = len(motion.joint_names)
    if noise is not None:
        given = np.asarray(noise, dtype=float)
        if given.shape not in ((), (joints,)) or not np.all(np.isfinite(given) & (given > 0.0)):
            raise ValueError(f"noise must be one or {joints} positive numbers, got {noise!r}")
        return np.asarray(np.broadcast_to(given, joints), dtype=float)
    if motion.filter is not None:
        left = motion.filter.noise * np.sqrt(min(1.0, 2.0 * frequency / motion.rate))
    else:
        second = np.abs(np.diff(motion.q, 2, axis=0))
        left = np.median(second, axis=0) / (_NORMAL_MEDIAN * np.sqrt(6.0))
    return np.asarray(np.maximum(left, _LEAST_NOISE))


@shows_progress
def compare_metrics(
    model: Model,
    motion: Motion,
    metrics: Mapping[str, MetricOrFunction] | None = None,
    *,
    measure: Measure = "joint",
    counts: Sequence[int] | None = None,
    refined: bool = False,
    spacing: float = 0.05,
    max_duration: float = 2.0,
    rules: Mapping[str, Cutting] | None = None,
    noise: ArrayLike | None = None,
    cutoff: float | None = None,
    progress: Progress | None = None,
) -> MetricComparison:
    """Reconstruct a motion with several metrics, each with the cuts that are best for it.

    At an equal number of segments, each metric has its least error in one measure
    (`optimal_segmentations`). The errors in the other two measures are those of the same cuts.
    Rules that find a number of segments by themselves add one point for each metric.

    >>> recording = go.trajectory.bundled_recording()
    >>> part = recording.motion.part(0, 89)
    >>> metrics = {"straight lines": go.Euclidean(7)}
    >>> comparison = go.studies.compare_metrics(
    ...     recording.model, part, metrics, rules={}, spacing=0.1
    ... )
    >>> comparison.curves["straight lines"].index.tolist()
    [1, 2, 3, 4, 5, 6, 7]

    Args:
        model: the arm; its joints are selected from the motion by name.
        motion: the recording; filtered here (`Motion.filtered`) if it has no velocities.
        metrics: metrics by name, a metric or a function of the model that returns one; None
            compares the kinetic energy with the model's or the default joint inertia
            (`default_joint_inertia`), the kinetic energy of the links alone, and straight lines.
        measure: measure that the cuts minimize: "joint" [rad], "position" or "orientation" of the
            hand.
        counts: numbers of segments; None takes all that are possible.
        refined: move the cuts by single samples, which takes about 0.2 s for each number and
            metric; otherwise they stay on the grid of candidates.
        spacing: spacing of the candidates [s].
        max_duration: max duration of a segment [s].
        rules: functions of metric and motion that find segments, by name; None:
            `segment_developed` and the online rule, `segment`.
        noise: standard deviation of the noise in the coordinates, one number or (n,) [rad], for
            `MetricComparison.best_count`; None estimates it from the record of the filter.
        cutoff: cutoff of the motion's filter [Hz], for the same; None takes the filter's. Where
            that is not known, every sample counts as independent, so give it if the motion was
            filtered elsewhere.
        progress: called with what is done, the amount done, and the total.

    Raises:
        ValueError: there is no metric or it does not fit the model, counts are empty or not
            possible with one of the metrics, or see `optimal_segmentations` and the rules.
        NotConverged: see `optimal_segmentations`.

    Warns:
        RuntimeWarning: log maps failed, or a point of a rule was left out for that.
    """
    motion = motion.select(as_model(model).joint_names)
    if motion.velocity is None:
        motion = motion.filtered()
    given = as_named_metrics(USUAL_METRICS if metrics is None else metrics)
    named = {name: metric_of(name, each, model) for name, each in given.items()}
    if counts is not None and (np.ndim(counts) != 1 or not len(counts)):
        raise ValueError(f"counts must be one or more numbers of segments, got {counts!r}")
    frequency = bandwidth(motion, cutoff)
    floor = noise_left(motion, noise, frequency)
    rules = {"developed": segment_developed, "online": segment} if rules is None else rules
    curves = {}
    by_rule = {}
    for name, metric in named.items():
        found = optimal_segmentations(
            metric,
            motion,
            measure=measure,
            model=model,
            spacing=spacing,
            max_duration=max_duration,
            progress=progress and (lambda label, *of, name=name: progress(f"{name}: {label}", *of)),
        )
        chosen = found.counts.tolist() if counts is None else sorted({int(k) for k in counts})
        curves[name] = _curve(model, found, chosen, refined, floor, frequency)
        by_rule[name] = _by_rule(model, metric, motion, rules, name)
    return MetricComparison(model, motion, measure, curves, by_rule)


def _curve(
    model: Model,
    found: OptimalSegmentations,
    counts: Sequence[int],
    refined: bool,
    noise: np.ndarray,
    frequency: float,
) -> DataFrame:
    from pandas import DataFrame

    motion = found.motion
    independent = min(len(motion), max(1.0, 2.0 * frequency * motion.duration))
    rows = []
    for count in counts:
        predicted = found.predicted(count, refined=refined)
        errors = motion_errors(model, motion, predicted)
        criterion = bayesian_information(predicted.q - motion.q, count, noise, independent)
        cuts = tuple(found.segments(count, refined=refined))
        rows.append((count, *errors.means, criterion, cuts))
    columns = ["segments", *MEASURES, "criterion", "cuts"]
    return DataFrame(rows, columns=columns).set_index("segments")


def _by_rule(
    model: Model, metric: Metric, motion: Motion, rules: Mapping[str, Cutting], name: str
) -> DataFrame:
    """Return errors with the cuts of the rules that succeed."""
    from pandas import DataFrame

    points = []
    for rule, cutting in rules.items():
        try:
            segments = cutting(metric, motion)
            predicted = reconstruct(metric, motion, segments).predicted
        except GeodesicOcpError as failure:
            warnings.warn(
                f"{name}: {rule} cuts are left out: {failure}",
                RuntimeWarning,
                stacklevel=3,
            )
            continue
        errors = motion_errors(model, motion, predicted)
        points.append((rule, len(segments), *errors.means))
    return DataFrame(points, columns=["cuts", "segments", *MEASURES]).set_index("cuts")
