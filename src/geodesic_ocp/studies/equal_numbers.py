"""Errors of first-order and second-order predictions at equal numbers received."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr, real_array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import Euclidean, KineticEnergy, with_joint_inertia
from geodesic_ocp.progress import Progress, shows_progress
from geodesic_ocp.studies.compare_metrics import MetricOrFunction, metric_of
from geodesic_ocp.synergies.optimal_segmentations import (
    OptimalSegmentations,
    optimal_segmentations,
)
from geodesic_ocp.synergies.segment_costs import Curve, Measure
from geodesic_ocp.synergies.spline_knots import SplineKnots, spline_knots
from geodesic_ocp.tables import markdown
from geodesic_ocp.trajectory.recording import Recording, as_recordings

if TYPE_CHECKING:
    from pandas import DataFrame

_METHODS: dict[str, tuple[bool, Curve | None]] = {  # whether the metric is flat; None: a spline
    "geodesics": (False, "geodesic"),
    "straight lines": (True, "geodesic"),
    "Riemannian cubics": (False, "cubic"),
    "cubics of a constant metric": (True, "cubic"),
    "Riemannian splines": (False, None),
    "cubic splines": (True, None),
}


@dataclass(frozen=True, eq=False, repr=False)
class EqualNumbers(ShortRepr):
    """Errors with the best cuts of each method, by the numbers that it receives per second.

    Attributes:
        recordings: names.
        methods: names.
        numbers: numbers received per second (k,).
        errors: mean errors (methods, recordings, k), NaN where a method cannot receive so few.
        unit: of the errors.
    """

    recordings: tuple[str, ...]
    methods: tuple[str, ...]
    numbers: Array
    errors: Array
    unit: str

    _shown = ("recordings", "methods", "numbers")

    @property
    def wins(self) -> Array:
        """Recordings on which each method has the least error (methods, k), of those with all."""
        # NaN is not equal to itself.
        return np.asarray(np.sum(self.errors == self.errors.min(axis=0), axis=1))

    def table(self) -> DataFrame:
        """Return means over the recordings on which all errors are known, and wins there."""
        from pandas import DataFrame

        found = DataFrame(index=self.methods).rename_axis("method")
        for number, errors, wins in zip(self.numbers, self.errors.T, self.wins.T, strict=True):
            known = errors[np.isfinite(errors).all(axis=1)]
            label = f"{number:g} per s"
            found[f"{label} [{self.unit}]"] = DataFrame(known, columns=self.methods).mean()
            found[f"{label}, best of {len(known)}"] = wins
        return found

    def _repr_markdown_(self) -> str:
        return markdown(self.table())


@shows_progress
def compare_at_equal_numbers(
    recordings: Recording | Sequence[Recording],
    metric: MetricOrFunction | None = None,
    *,
    numbers: Sequence[float] = (15.0, 20.0, 30.0, 40.0),
    measure: Measure = "joint",
    spacing: float = 0.1,
    progress: Progress | None = None,
) -> EqualNumbers:
    """Compare geodesics, straight lines, cubics and splines that receive as much of recordings.

    Errors fall with what a method receives. At each cut and at both ends, geodesics and straight
    lines receive a configuration and a speed, n + 1 numbers, cubics a configuration and a velocity,
    2 n. Each method has the cuts with which it has the least error (`optimal_segmentations`); its
    errors are interpolated between numbers of segments. Splines receive n numbers at each knot
    and 2 n more for both end velocities; their knots are good, not the best (`spline_knots`),
    and known for the joints alone. The times of cuts and knots are not counted.

    >>> whole = go.trajectory.bundled_recording()
    >>> recording = go.trajectory.Recording(whole.model, whole.motion.part(270, 349))
    >>> equal = go.studies.compare_at_equal_numbers(recording, go.Euclidean(7), numbers=[10])
    >>> equal.methods[:2]
    ('geodesics', 'straight lines')

    Args:
        recordings: one or more, see `read_recordings`.
        metric: metric of the geodesics and Riemannian cubics, or a function of a recording's model
            that returns one; None: the kinetic energy with joint inertia.
        numbers: numbers received per second.
        measure: "joint" [rad], "position" [m] or "orientation" [rad] of the hand.
        spacing: spacing of the candidates for cuts [s].
        progress: called with the current step, the amount done, and the total.

    Raises:
        ValueError: no recordings, numbers that are not positive, or see `optimal_segmentations`.
        NotConverged: see `optimal_segmentations`.
    """
    given = as_recordings(recordings)
    wanted = real_array(numbers, "numbers").ravel()
    if not wanted.size or not np.all((wanted > 0.0) & np.isfinite(wanted)):
        raise ValueError(f"numbers must be positive numbers per second, got {numbers!r}")
    methods = {
        name: each for name, each in _METHODS.items() if each[1] is not None or measure == "joint"
    }
    errors = np.full((len(methods), len(given), wanted.size), np.nan)
    total = errors[..., 0].size
    for j, recording in enumerate(given):
        model = recording.model
        motion = recording.motion
        curved: Metric = (
            KineticEnergy(with_joint_inertia(model))
            if metric is None
            else metric_of("metric", metric, model)
        )
        for i, (method, (is_flat, curve)) in enumerate(methods.items()):
            if progress is not None:
                progress(f"{recording.name}: {method}", j * len(methods) + i, total)
            its = Euclidean(model.dof) if is_flat else curved
            n = model.dof
            found: SplineKnots | OptimalSegmentations
            if curve is None:
                found = spline_knots(its, motion, spacing=spacing)
                received = n * (found.counts + 1) + 2 * n
            else:
                found = optimal_segmentations(
                    its, motion, measure=measure, model=model, curve=curve, spacing=spacing
                )
                received = (2 * n if curve == "cubic" else n + 1) * (found.counts + 1)
            received = received / motion.duration
            errors[i, j] = np.interp(wanted, received, found.errors, left=np.nan, right=np.nan)
    if progress is not None:
        progress("done", total, total)
    names = tuple(recording.name for recording in given)
    unit = "m" if measure == "position" else "rad"
    return EqualNumbers(names, tuple(methods), wanted, errors, unit)
