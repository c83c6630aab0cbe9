"""How many synergies there are, how long they take and how long they are, by subject."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.studies.study.statistics.subjects import by_subject
from geodesic_ocp.studies.tables.columns import Row

LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass(frozen=True)
class SynergyStatistics:
    """The synergies of a subject, those at rest included.

    Attributes:
        subject, condition: names; the condition is empty without conditions.
        recordings, synergies: their numbers.
        per_recording: number of synergies in a recording, mean over the recordings.
        per_second: number of synergies in the time [s] of all recordings [1/s].
        durations: quantiles at `LEVELS` [s].
        lengths: quantiles at `LEVELS`, in the metric's unit.
    """

    subject: str
    condition: str
    recordings: int
    synergies: int
    per_recording: float
    per_second: float
    durations: tuple[float, ...]
    lengths: tuple[float, ...]

    def __repr__(self) -> str:
        where = f" in {self.condition}" if self.condition else ""
        return (
            f"SynergyStatistics({self.subject}{where}, {self.synergies} synergies in "
            f"{self.recordings} recordings, median {self.durations[2]:.3g} s)"
        )


def synergy_statistics(
    recordings: Sequence[Row], synergies: Sequence[Row], condition: str
) -> tuple[SynergyStatistics, ...]:
    """Statistics of each subject, in natural order of their names.

    Args:
        recordings: rows of recordings and methods under the condition.
        synergies: rows of the synergies in them.
        condition: its name.
    """
    own = by_subject(synergies)
    found = []
    for subject, rows in by_subject(recordings).items():
        times = {str(row["recording"]): _number(row["duration_s"]) for row in rows}
        mine = own.get(subject, [])
        total = math.fsum(times.values())
        found.append(
            SynergyStatistics(
                subject,
                condition,
                len(times),
                len(mine),
                len(mine) / len(times),
                len(mine) / total if total > 0.0 else math.nan,
                _quantiles([_number(row["duration_s"]) for row in mine]),
                _quantiles([_number(row["length"]) for row in mine]),
            )
        )
    return tuple(found)


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan


def _quantiles(values: Sequence[float]) -> tuple[float, ...]:
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return (math.nan,) * len(LEVELS)
    return tuple(np.quantile(known, LEVELS).tolist())
