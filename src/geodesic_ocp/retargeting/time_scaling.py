"""Time scaling of a robot's paths: minimum-acceleration time laws within the joints' speed limits.

Every synergy takes the person's time, with the person's speeds at its ends in proportion to the
path lengths. Where a joint would exceed its speed limit, the time interval is scaled, for all arms
alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.time_law import TimeLaw, time_law
from geodesic_ocp.trajectory.timed_path import states_at

_SAMPLES = 201
_MAX_ROUNDS = 60
_MARGIN = 1.001  # of a scale factor
# A cubic with end speeds of at most three times its mean is monotone (Fritsch and Carlson 1980).
_MONOTONE = 3.0


@dataclass(frozen=True, eq=False)
class ArmPaths:
    """The paths of one arm, to be travelled one after the other.

    Attributes:
        edges: times (k + 1,) [s] in the recording at which its k paths begin and end.
        paths: k of them; of zero length where the arm rests.
        speeds: (k + 1,) at the edges, in the metric's unit per second.
        limits: largest speeds of the joints (n,) [rad/s or m/s].
    """

    edges: Array
    paths: Sequence[Path]
    speeds: Array
    limits: Array


@dataclass(frozen=True, eq=False, repr=False)
class TimeScaling:
    """Time laws of the arms' paths, and robot time as a function of recording time.

    Attributes:
        laws: for each arm, a time law for each path.
        edges: times (m + 1,) [s] of the recording between which time is scaled uniformly.
        factors: scale factors (m,), at least one.
    """

    laws: tuple[tuple[TimeLaw, ...], ...]
    edges: Array
    factors: Array

    def __repr__(self) -> str:
        largest = float(np.max(self.factors))
        return f"TimeScaling({len(self.factors)} intervals, scaled by at most {largest:.3g})"

    def __call__(self, time: Array) -> Array:
        """Robot time [s], from 0, for times of the recording [s]."""
        steps = np.diff(self.edges) * self.factors
        later = np.concatenate([[0.0], np.cumsum(steps)])
        return np.asarray(np.interp(time, self.edges, later))


def handover_speeds(speeds: Array, lengths: Array, durations: Array, paths: Array) -> Array:
    """Speeds (k + 1,) at the ends of a robot's k paths.

    Args:
        speeds: of the person there (k + 1,), in the person's metric.
        lengths: of the person's k movements.
        durations: of them [s].
        paths: lengths of the robot's k paths.

    The person's speed times the mean of the two length ratios; zero at a rest, and at most three
    times the mean speed on either side.
    """
    moving = (lengths > 0.0) & (paths > 0.0)
    ratio = np.divide(paths, lengths, out=np.zeros_like(paths), where=moving)
    mean = paths / durations
    inner = (ratio[:-1] + ratio[1:]) / 2.0
    found = speeds * np.concatenate([ratio[:1], inner, ratio[-1:]])
    still = np.concatenate([~moving[:1], ~(moving[:-1] & moving[1:]), ~moving[-1:]])
    return np.where(still, 0.0, np.minimum(found, _cap(mean)))


def _cap(mean: Array) -> Array:
    """Largest speeds (k + 1,) at the ends of k monotone paths with these mean speeds."""
    least = np.concatenate([mean[:1], np.minimum(mean[:-1], mean[1:]), mean[-1:]])
    return np.asarray(_MONOTONE * least)


def scale_time(arms: Sequence[ArmPaths]) -> TimeScaling:
    """Time laws for all arms' paths, with continuous speed and joints within their speed limits.

    Raises:
        NotConverged: joints exceed their speed limits after many rounds of scaling.
    """
    edges = np.unique(np.concatenate([arm.edges for arm in arms]))
    factors = np.ones(edges.size - 1)
    speeds = [[_unit_speeds(path, arm.limits) for path in arm.paths] for arm in arms]
    for _ in range(_MAX_ROUNDS):
        scaling = TimeScaling(tuple(_laws(arm, edges, factors) for arm in arms), edges, factors)
        needed = np.ones_like(factors)
        for arm, laws, of_arm in zip(arms, scaling.laws, speeds, strict=True):
            for start, stop, law, of_path in zip(
                arm.edges[:-1], arm.edges[1:], laws, of_arm, strict=True
            ):
                here = (edges[:-1] >= start) & (edges[1:] <= stop)
                needed[here] = np.maximum(needed[here], _speed_ratio(law, of_path))
        if np.all(needed <= 1.0):
            return scaling
        factors = factors * np.where(needed > 1.0, needed * _MARGIN, 1.0)
    raise NotConverged("joints exceed their speed limits however much time is scaled")


def _laws(arm: ArmPaths, edges: Array, factors: Array) -> tuple[TimeLaw, ...]:
    steps = np.diff(edges) * factors
    later = np.concatenate([[0.0], np.cumsum(steps)])
    index = np.searchsorted(edges, arm.edges)
    durations = np.diff(later[index])
    before = np.concatenate([[1.0], factors])[index]
    after = np.concatenate([factors, [1.0]])[index]
    # A neighbour or another arm may be slowed down more: end speeds follow the smaller mean.
    mean = np.array([path.length for path in arm.paths]) / durations
    speeds = np.minimum(arm.speeds / np.maximum(before, after), _cap(mean))
    laws = []
    for path, duration, start, end in zip(
        arm.paths, durations, speeds[:-1], speeds[1:], strict=True
    ):
        laws.append(time_law(path.length, float(duration), start, end, monotone=True))
    return tuple(laws)


def _unit_speeds(path: Path, limits: Array) -> Array:
    """Largest joint speed relative to its limit (k,) at evenly spaced lengths, at unit speed."""
    if not path.length > 0.0:
        return np.zeros(1)
    ends = np.array([0.0, path.length])
    law = TimeLaw(ends, ends, np.ones(2))
    _, velocity = states_at(path, law, np.linspace(0.0, law.duration, _SAMPLES), order=1)
    return np.asarray((np.abs(velocity) / limits).max(axis=1))


def _speed_ratio(law: TimeLaw, unit_speeds: Array) -> float:
    """Ratio of the fastest joint speed to its limit."""
    times = np.linspace(0.0, law.duration, _SAMPLES)
    lengths = np.linspace(0.0, law.length, unit_speeds.size)
    return float((law(times, 1) * np.interp(law(times), lengths, unit_speeds)).max())
