"""Scores of several methods on the same segments of several recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.comparison.paired_test import PairedTest, paired_test
from geodesic_ocp.synergies.scores import SCORES, Scores
from geodesic_ocp.table import Table

_SHOWN = ("joint_mean", "position_mean", "rotation_angle", "path_joint", "path_position", "area")


@dataclass(frozen=True, eq=False, repr=False)
class MethodComparison:
    """Scores of several methods on the same segments of several recordings.

    Attributes:
        recordings, subjects: names, one for each recording.
        methods: names; the first cut the recordings, unless segments were given.
        segments: (start, stop) sample indices, a tuple for each recording.
        observed: by method, what it receives of the recording at the ends of a segment, besides
            its duration.
        scores: by method, one for each recording; all NaN where the method failed.
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
        return self.table().markdown()

    def values(self, score: str = "joint_mean") -> Array:
        """One score of every recording and method, (recordings, methods).

        Raises:
            ValueError: there is no such score.
        """
        if score not in SCORES:
            raise ValueError(f"score must be one of {', '.join(SCORES)}, got {score!r}")
        columns = [[getattr(each, score) for each in self.scores[name]] for name in self.methods]
        return np.array(columns, dtype=float).T

    def table(self, *scores: str) -> Table:
        """Means over the recordings on which no method failed.

        Args:
            scores: names of attributes of `Scores`; by default joints, hand, path and area.

        Raises:
            ValueError: there is no such score.
        """
        shown = scores or _SHOWN
        complete = np.flatnonzero(np.all(np.isfinite(self.values()), axis=1))
        means = [_means(self.values(score)[complete]) for score in shown]
        count = f"{len(complete)} of {len(self.recordings)}"
        segments = sum(len(self.segments[index]) for index in complete)
        header = ("method", "observed at the ends", "recordings", "segments")
        rows: list[tuple[str | int | float, ...]] = []
        for k, method in enumerate(self.methods):
            entries = [float(mean[k]) for mean in means]
            rows.append((method, self.observed[method], count, segments, *entries))
        return Table((*header, *(SCORES[score] for score in shown)), tuple(rows))

    def by_recording(self, score: str = "joint_mean") -> Table:
        """One score of every recording (row) and method (column).

        Raises:
            ValueError: there is no such score.
        """
        values = self.values(score)
        rows = tuple(
            (name, self.subjects[k], len(self.segments[k]), *values[k].tolist())
            for k, name in enumerate(self.recordings)
        )
        return Table((SCORES[score], "subject", "segments", *self.methods), rows)

    def tests(
        self,
        score: str = "joint_mean",
        against: str = "straight lines",
        *,
        by: Literal["subject", "recording"] = "subject",
        confidence: float = 0.95,
        seed: int = 0,
    ) -> dict[str, PairedTest]:
        """Paired tests of every method against one of them, over subjects or recordings.

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
        if against not in self.methods:
            raise ValueError(f"against must be one of {', '.join(self.methods)}, got {against!r}")
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
    ) -> Table:
        """`tests` as a table, and what limits them, such as the number of pairs.

        Limits that all tests share are said once, below the table, and others in a column.
        """
        tests = self.tests(score, against, by=by, confidence=confidence, seed=seed)
        unit = SCORES[score].partition("[")[2]
        header = (
            f"against {against}, by {by}",
            "wins",
            f"mean difference{' [' * bool(unit)}{unit}",
            f"{confidence:.0%} interval",
            "sign test p",
            "Wilcoxon p",
        )
        notes = [test.note for test in tests.values()]
        differ = len(set(notes)) > 1
        rows: tuple[tuple[str | int | float, ...], ...] = tuple(
            (
                method,
                f"{test.wins} of {test.pairs}",
                test.mean_difference,
                f"{test.interval[0]:.3g} to {test.interval[1]:.3g}",
                test.sign_p,
                test.wilcoxon_p,
                *((test.note or "-",) if differ else ()),
            )
            for method, test in tests.items()
        )
        if differ:
            return Table((*header, "note"), rows)
        return Table(header, rows, notes[0] if notes else "")


def _means(values: Array) -> Array:
    """Means of the columns; NaN of none."""
    return values.mean(axis=0) if len(values) else np.full(values.shape[1], np.nan)
