"""Leave-one-out errors of a fitted metric, and fits of single recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from geodesic_ocp.fitting.metric_fit import MetricFit
from geodesic_ocp.fitting.separate_fits import refit, units_of
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import Euclidean
from geodesic_ocp.progress import Progress
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.synergies.reconstruct import reconstruct
from geodesic_ocp.synergies.scores.evaluate import MotionErrors, evaluate
from geodesic_ocp.table import Table


@dataclass(frozen=True)
class LeftOut:
    """Errors of one recording with parameters estimated from others.

    Attributes:
        name: of the recording.
        subject: its subject.
        values: estimates from the recordings that were not left out.
        errors: of the geodesics with these parameters (`reconstruct`).
        straight_lines: errors of straight lines on the same segments.
    """

    name: str
    subject: str
    values: tuple[float, ...]
    errors: MotionErrors
    straight_lines: MotionErrors


@dataclass(frozen=True, repr=False)
class CrossValidation:
    """Errors of recordings that took no part in the estimation.

    Attributes:
        unit: that was left out at a time, "recording" or "subject".
        parameters: names.
        left_out: one for each recording.
    """

    unit: str
    parameters: tuple[str, ...]
    left_out: tuple[LeftOut, ...]

    def __repr__(self) -> str:
        wins = sum(each.errors.joint < each.straight_lines.joint for each in self.left_out)
        return (
            f"CrossValidation({len(self.left_out)} recordings, one {self.unit} left out at a time, "
            f"joint error below that of straight lines in {wins})"
        )

    def _repr_markdown_(self) -> str:
        return self.table().markdown()

    def table(self) -> Table:
        """Estimates without the recording, its errors, and those of straight lines."""
        header = (
            "left out",
            *self.parameters,
            "joints [rad]",
            "hand [m]",
            "hand [rad]",
            "lines: joints [rad]",
            "lines: hand [m]",
            "lines: hand [rad]",
        )
        rows: list[tuple[str | int | float, ...]] = []
        for each in self.left_out:
            errors = (
                error
                for own in (each.errors, each.straight_lines)
                for error in (own.joint, own.position, own.orientation)
            )
            rows.append((each.name, *each.values, *errors))
        return Table(header, tuple(rows))


def leave_one_out(
    fit: MetricFit, by: str = "recording", *, progress: Progress | None = None
) -> CrossValidation:
    """Estimate anew without each recording, or subject, and predict it.

    Errors are those of `reconstruct` and `evaluate` on all segments of the recording, the same for
    the geodesics and the straight lines.

    Raises:
        ValueError: fewer than two recordings or subjects.
        NotConverged: an estimation or a geodesic of a recording that was left out failed.
    """
    recordings, labels = fit.recordings, units_of(fit, by)
    units = list(dict.fromkeys(labels))
    if len(units) < 2:
        raise ValueError(f"leaving one {by} out needs at least two, got {len(units)}")
    results: dict[int, LeftOut] = {}
    for number, unit in enumerate(units):
        if progress is not None:
            progress(f"leaving one {by} out", number, len(units))
        others = refit(fit, [k for k, label in enumerate(labels) if label != unit])
        for index in [k for k, label in enumerate(labels) if label == unit]:
            recording = recordings[index]
            segments = fit.program.parts[index].observed.every
            results[index] = LeftOut(
                recording.name,
                recording.subject,
                tuple(others.values.values()),
                _errors(recording, segments, others.metric(recording.model)),
                _errors(recording, segments, Euclidean(recording.model.dof)),
            )
    return CrossValidation(
        by,
        tuple(each.name for each in fit.estimates),
        tuple(results[index] for index in range(len(recordings))),
    )


def _errors(
    recording: Recording, segments: Sequence[tuple[int, int]], metric: Metric
) -> MotionErrors:
    predicted = reconstruct(metric, recording.motion, segments).predicted
    return evaluate(recording.model, recording.motion, predicted)
