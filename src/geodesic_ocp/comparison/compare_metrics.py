"""Error against number of synergies, for several metrics, each with its own optimal cuts."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.comparison.bayesian_information import (
    bayesian_information,
    noise_left,
)
from geodesic_ocp.comparison.metric_comparison import ErrorCurve, MetricComparison, OnlineErrors
from geodesic_ocp.comparison.named_metrics import MetricOrFunction, as_named_metrics, metric_of
from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import USUAL_METRICS
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.progress import Progress, shows_progress
from geodesic_ocp.synergies.optimal_segmentations import (
    OptimalSegmentations,
    optimal_segmentations,
)
from geodesic_ocp.synergies.scores import evaluate
from geodesic_ocp.synergies.segment import segment
from geodesic_ocp.synergies.segment_costs import Measure
from geodesic_ocp.synergies.synergy import reconstruct
from geodesic_ocp.trajectory.motion import Motion, bandwidth


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
    thresholds: Sequence[float] = (0.3, 0.6, 1.0),
    noise: ArrayLike | None = None,
    cutoff: float | None = None,
    progress: Progress | None = None,
) -> MetricComparison:
    """Reconstruct a motion with several metrics, each with the cuts that are best for it.

    At an equal number of segments, each metric has its least error in one measure
    (`optimal_segmentations`). The errors in the other two measures are those of the same cuts. The
    online rule (`segment`) adds one point for each metric and threshold.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> arm = go.human_arm("left", height=1.78)
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv").filtered()
    >>> part = go.Motion(motion.time[:90], motion.q[:90], motion.joint_names, motion.velocity[:90])
    >>> metrics = {"straight lines": go.Euclidean(7)}
    >>> comparison = go.compare_metrics(arm, part, metrics, thresholds=[0.6], spacing=0.1)
    >>> comparison.curves["straight lines"].counts.tolist()
    [1, 2, 3, 4, 5, 6, 7]

    Args:
        model: the arm; its joints are selected from the motion by name.
        motion: the recording; filtered here (`Motion.filtered`) if it has no velocities.
        metrics: by name, a metric or a function of the model that returns one; None compares the
            kinetic energy with the model's or the default joint inertia (`default_joint_inertia`),
            the kinetic energy of the links alone, and straight lines.
        measure: that the cuts minimize: "joint" [rad], "position" or "orientation" of the hand.
        counts: numbers of segments; None takes all that are possible.
        refined: move the cuts by single samples, which takes about 0.2 s for each number and
            metric; otherwise they stay on the grid of candidates.
        spacing: of the candidates [s].
        max_duration: of a segment [s].
        thresholds: of the online rule [rad].
        noise: standard deviation of the noise in the coordinates, one number or (n,) [rad], for
            `MetricComparison.best_count`; None estimates it from the record of the filter.
        cutoff: of the motion's filter [Hz], for the same; None takes the filter's. Where that is
            not known, every sample counts as independent, so give it if the motion was filtered
            elsewhere.
        progress: called with what is done, the amount done, and the total.

    Raises:
        ValueError: there is no metric or it does not fit the model, counts are empty or not
            possible with one of the metrics, or see `optimal_segmentations` and `segment`.
        NotConverged: see `optimal_segmentations`.

    Warns:
        RuntimeWarning: log maps failed, or a point of the online rule was left out for that.
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
    curves, online = {}, {}
    for name, metric in named.items():
        found = optimal_segmentations(
            metric,
            motion,
            measure=measure,
            model=model,
            spacing=spacing,
            max_duration=max_duration,
            progress=None if progress is None else _labelled(progress, name),
        )
        chosen = found.counts.tolist() if counts is None else sorted({int(k) for k in counts})
        curves[name] = _curve(model, found, chosen, refined, floor, frequency)
        online[name] = _online(model, metric, motion, thresholds, name)
    return MetricComparison(model, motion, measure, curves, online)


def _labelled(progress: Progress, name: str) -> Progress:
    return lambda label, done, total: progress(f"{name}: {label}", done, total)


def _curve(
    model: Model,
    found: OptimalSegmentations,
    counts: Sequence[int],
    refined: bool,
    noise: np.ndarray,
    frequency: float,
) -> ErrorCurve:
    motion = found.motion
    independent = min(len(motion), max(1.0, 2.0 * frequency * motion.duration))
    errors, criteria = [], []
    for count in counts:
        predicted = found.predicted(count, refined=refined)
        errors.append(evaluate(model, motion, predicted))
        criteria.append(bayesian_information(predicted.q - motion.q, count, noise, independent))
    segments = tuple(tuple(found.segments(count, refined=refined)) for count in counts)
    return ErrorCurve(
        np.array(counts),
        np.array([each.joint for each in errors]),
        np.array([each.position for each in errors]),
        np.array([each.orientation for each in errors]),
        np.array(criteria),
        segments,
    )


def _online(
    model: Model, metric: Metric, motion: Motion, thresholds: Sequence[float], name: str
) -> tuple[OnlineErrors, ...]:
    """Errors with the cuts of the online rule, for the thresholds at which it succeeds."""
    points = []
    for threshold in thresholds:
        try:
            segments = segment(metric, motion, threshold)
            predicted = reconstruct(metric, motion, segments).predicted
        except GeodesicOcpError as failure:
            warnings.warn(
                f"{name}: the online rule at {threshold:g} rad is left out: {failure}",
                RuntimeWarning,
                stacklevel=3,
            )
            continue
        errors = evaluate(model, motion, predicted)
        points.append(OnlineErrors(float(threshold), len(segments), errors))
    return tuple(points)
