"""Scores of several methods on the same segments of several recordings."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np

from geodesic_ocp.arrays import Array, as_choice
from geodesic_ocp.errors import GeodesicOcpError, IntegrationFailed
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import STRAIGHT_LINES, USUAL_METRICS
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress, shows_progress
from geodesic_ocp.studies.compare_metrics import MetricOrFunction, as_named_metrics, metric_of
from geodesic_ocp.studies.paired_test import PairedTest, paired_test
from geodesic_ocp.synergies.baselines import distal_inertia, distal_joints
from geodesic_ocp.synergies.scores import SCORES, Scores, score
from geodesic_ocp.synergies.second_order import OF_A_GEODESIC, SECOND_ORDER, second_order_names
from geodesic_ocp.synergies.segment_developed import segment_developed
from geodesic_ocp.synergies.synergy import as_segments, reconstruct
from geodesic_ocp.synergies.uncertainty import Cutting
from geodesic_ocp.tables import markdown, new_table
from geodesic_ocp.trajectory.recording import Recording, as_recordings

if TYPE_CHECKING:
    from pandas import DataFrame

_SHOWN = ("joint_mean", "position_mean", "rotation_angle", "path_joint", "path_position", "area")


@dataclass(frozen=True, eq=False, repr=False)
class MethodComparison:
    """Scores of several methods on the same segments of several recordings.

    Attributes:
        recordings, subjects: names, one for each recording.
        methods: names; the first cut the recordings, unless segments were given.
        segments: (start, stop) sample indices, a tuple for each recording.
        observed: data at the ends of a segment that each method receives, besides its duration.
        scores: scores by method, one for each recording; all NaN where the method failed.
        failures: (recording, method, reason) for each of these.
    """

    recordings: tuple[str, ...]
    subjects: tuple[str, ...]
    methods: tuple[str, ...]
    segments: tuple[tuple[tuple[int, int], ...], ...]
    observed: Mapping[str, str]
    scores: Mapping[str, tuple[Scores, ...]]
    failures: tuple[tuple[str, str, str], ...] = ()

    def __repr__(self) -> str:
        failed = f", {len(self.failures)} failures" if self.failures else ""
        return (
            f"MethodComparison({len(self.methods)} methods, {len(self.recordings)} recordings of "
            f"{len(set(self.subjects))} subjects,\n  {sum(map(len, self.segments))} segments"
            f"{failed})"
        )

    def _repr_markdown_(self) -> str:
        return markdown(self.table())

    def values(self, score: str = "joint_mean") -> Array:
        """Return one score of every recording and method, (recordings, methods).

        Raises:
            ValueError: there is no such score.
        """
        as_choice("score", score, SCORES)
        columns = [[getattr(each, score) for each in self.scores[name]] for name in self.methods]
        return np.array(columns, dtype=float).T

    def table(self, *scores: str) -> DataFrame:
        """Return means over the recordings on which no method failed.

        Args:
            scores: names of attributes of `Scores`; by default joints, hand, path and area.

        Raises:
            ValueError: there is no such score.
        """
        from pandas import DataFrame

        shown = scores or _SHOWN
        complete = np.flatnonzero(np.all(np.isfinite(self.values()), axis=1))
        found = DataFrame({"observed at the ends": self.observed}, self.methods)
        found["recordings"] = f"{len(complete)} of {len(self.recordings)}"
        found["segments"] = sum(len(self.segments[index]) for index in complete)
        for each in shown:
            means = DataFrame(self.values(each)[complete], columns=self.methods).mean()
            found[SCORES[each]] = means
        return found.rename_axis("method")

    def by_recording(self, score: str = "joint_mean") -> DataFrame:
        """Return one score of every recording (row) and method (column).

        Raises:
            ValueError: there is no such score.
        """
        from pandas import DataFrame

        found = DataFrame(self.values(score), self.recordings, self.methods)
        found.insert(0, "subject", self.subjects)
        found.insert(1, "segments", [len(each) for each in self.segments])
        return found.rename_axis(SCORES[score])

    def tests(
        self,
        score: str = "joint_mean",
        against: str = "straight lines",
        *,
        by: Literal["subject", "recording"] = "subject",
        confidence: float = 0.95,
        seed: int = 0,
    ) -> dict[str, PairedTest]:
        """Return paired tests of every method against one of them, over subjects or recordings.

        A method wins a pair if its score is better: lower, but higher for the correlation of the
        speed profiles. P-values are of single tests, not corrected for their number.

        Args:
            score: an attribute of `Scores`.
            against: the method to which the others are compared.
            by: "subject": recordings of a subject are averaged first; "recording": each is a pair,
                which assumes that recordings of a subject are independent.
            confidence, seed: see `paired_test`.

        Returns:
            By method, without those that failed on every recording.

        Raises:
            ValueError: there is no such score or method, or by is neither of the two.
        """
        values = self.values(score)
        as_choice("against", against, self.methods)
        if by not in ("subject", "recording"):
            raise ValueError(f"by must be 'subject' or 'recording', got {by!r}")
        reference = values[:, self.methods.index(against)]
        return {
            method: paired_test(
                column,
                reference,
                by=self.subjects if by == "subject" else None,
                confidence=confidence,
                larger_is_better=score == "speed_correlation",
                seed=seed,
            )
            for method, column in zip(self.methods, values.T, strict=True)
            if method != against and np.isfinite(column - reference).any()
        }

    def test_table(
        self,
        score: str = "joint_mean",
        against: str = "straight lines",
        *,
        by: Literal["subject", "recording"] = "subject",
        confidence: float = 0.95,
        seed: int = 0,
    ) -> DataFrame:
        """Return `tests` as a table, and what limits them, such as the number of pairs.

        Limits that all tests share are said once, below the table, and others in a column.
        """
        tests = self.tests(score, against, by=by, confidence=confidence, seed=seed)
        unit = SCORES[score].partition("[")[2]
        notes = [test.note for test in tests.values()]
        columns = [f"against {against}, by {by}", "wins"]
        columns.append(f"mean difference{' [' * bool(unit)}{unit}")
        columns += [f"{confidence:.0%} interval", "sign test p", "Wilcoxon p"]
        rows = [
            (
                *(method, f"{test.wins} of {test.pairs}", test.mean_difference),
                "{:.3g} to {:.3g}".format(*test.interval),
                *(test.sign_p, test.wilcoxon_p),
            )
            for method, test in tests.items()
        ]
        found = new_table(columns, rows)
        if len(set(notes)) > 1:
            found["note"] = [note or "-" for note in notes]
        elif notes:
            found.attrs["note"] = notes[0]
        return found


_Segments = Sequence[tuple[int, int]]


@shows_progress
def compare_methods(
    recordings: Recording | Sequence[Recording],
    metrics: Mapping[str, MetricOrFunction] | None = None,
    *,
    methods: Sequence[str] | None = None,
    segments: Sequence[_Segments] | Cutting = segment_developed,
    progress: Progress | None = None,
) -> MethodComparison:
    """Predict the same segments of recordings by geodesics and by baselines, and score them all.

    Geodesics of each metric (`reconstruct`) are compared with second-order motions of the first
    metric, Riemannian cubics and splines, with their counterparts of a constant metric, minimum
    acceleration and cubic splines, and with minimum jerk of the joints and of the hand. Motions of
    least effort, which take seconds for a recording, are computed if `methods` names them: "least
    torque", "least torque change", "least work" and "least work and acceleration". The methods do
    not receive the same data; the table has a column that says what each receives for a segment.

    >>> from importlib.resources import files
    >>> recordings = go.recordings.read_recordings(files("geodesic_ocp") / "data", "left")
    >>> comparison = go.studies.compare_methods(
    ...     recordings, {"straight lines": lambda arm: go.Euclidean(arm.dof)}
    ... )
    >>> comparison.methods[:3]
    ('straight lines', 'Riemannian cubics', 'minimum acceleration')

    Args:
        recordings: one or more, see `read_recordings`.
        metrics: metrics by name, a metric or a function of a recording's model that returns one. By
            default the kinetic energy with joint inertia (that of the model, if it has any, or
            else `default_joint_inertia`), the kinetic energy without it, the kinetic energy with
            joint inertia on the distal joints alone (`distal_inertia`; of `human_arm` only), and
            the Euclidean metric, whose geodesics are straight lines.
        methods: names of the other predictions, in the order of the table; None: all but those of
            least effort.
        segments: a function that finds the segments of a motion by the first metric, as of
            `analyse`; or the segments of each recording. All methods predict these segments.
        progress: called with the current step, the amount done, and the total.

    Returns:
        All scores. Where a method fails on a recording, as a geodesic is not found, they are NaN.

    Raises:
        ValueError: no recordings or metrics, an unknown method, segments that do not cover their
            recording, a metric of another dimension, or a recording that never moves.
        IntegrationFailed: the first metric is singular along a recording, see `segment`.
    """
    recordings = as_recordings(recordings)
    metrics = as_named_metrics(_default_metrics(recordings) if metrics is None else metrics)
    if same := metrics.keys() & SECOND_ORDER.keys():
        raise ValueError(f"metrics: {', '.join(same)} is the name of a baseline")
    others = tuple(second_order_names(effort=False) if methods is None else methods)
    if isinstance(methods, str) or not SECOND_ORDER.keys() >= set(others):
        raise ValueError(f"methods must be some of {', '.join(SECOND_ORDER)}, got {methods!r}")
    methods = (*metrics, *dict.fromkeys(others))
    total = len(recordings) * (len(methods) + 1)
    done = 0

    def report(label: str) -> None:
        nonlocal done
        if progress is not None:
            progress(label, done, total)
        done += 1

    @cache  # compiled once for recordings of one model
    def metric(name: str, model: Model) -> Metric:
        return metric_of(name, metrics[name], model)

    cuts: list[_Segments] = [] if callable(segments) else _given_segments(recordings, segments)
    for recording in recordings:
        report(f"{recording.name}: cutting into segments")
        if callable(segments):
            cuts.append(_cut(metric(methods[0], recording.model), recording, segments))
    scores: dict[str, list[Scores]] = {method: [] for method in methods}
    failures: list[tuple[str, str, str]] = []
    for recording, pieces in zip(recordings, cuts, strict=True):
        for method in methods:
            report(f"{recording.name}: {method}")
            try:
                if method in metrics:
                    its_metric = metric(method, recording.model)
                    predicted = reconstruct(its_metric, recording.motion, pieces).predicted
                else:
                    first = metric(methods[0], recording.model)
                    predict = SECOND_ORDER[method].predict
                    predicted = predict(first, recording.model, recording.motion, pieces)
                scores[method].append(score(recording.model, recording.motion, predicted, pieces))
            except GeodesicOcpError as failure:
                reason = str(failure).partition("\n")[0]
                failures.append((recording.name, method, reason))
                warnings.warn(f"{recording.name}: {method} failed: {reason}", stacklevel=2)
                scores[method].append(_UNKNOWN)
    report("done")
    return MethodComparison(
        recordings=tuple(recording.name for recording in recordings),
        subjects=tuple(recording.subject for recording in recordings),
        methods=methods,
        segments=tuple(tuple(pieces) for pieces in cuts),
        observed={m: OF_A_GEODESIC if m in metrics else SECOND_ORDER[m].receives for m in methods},
        scores={method: tuple(scores[method]) for method in methods},
        failures=tuple(failures),
    )


_UNKNOWN = Scores(**{each.name: float("nan") for each in fields(Scores)})


def _cut(metric: Metric, recording: Recording, cutting: Cutting) -> _Segments:
    """Return the segments of a recording; errors name it."""
    try:
        return as_segments(recording.motion, cutting(metric, recording.motion))
    except ValueError as failure:
        raise ValueError(f"{recording.name}: {failure}") from None
    except IntegrationFailed as failure:
        message = f"{recording.name}: {failure}"
        raise IntegrationFailed(message, failure.time, failure.state) from None


def _given_segments(
    recordings: Sequence[Recording], segments: Sequence[_Segments]
) -> list[_Segments]:
    """Return the segments that are given, for each recording."""
    if len(segments) != len(recordings):
        raise ValueError(
            f"segments must be given for each of {len(recordings)} recordings, got {len(segments)}"
        )
    return [as_segments(each.motion, its) for each, its in zip(recordings, segments, strict=True)]


def _default_metrics(recordings: Sequence[Recording]) -> dict[str, MetricOrFunction]:
    metrics: dict[str, MetricOrFunction] = dict(USUAL_METRICS)
    if all(distal_joints(recording.model) for recording in recordings):
        metrics["joint inertia of distal joints alone"] = distal_inertia
    metrics[STRAIGHT_LINES] = metrics.pop(STRAIGHT_LINES)  # the last
    return metrics
