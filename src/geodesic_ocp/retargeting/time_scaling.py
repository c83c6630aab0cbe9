"""When a robot's paths are travelled: minimum-acceleration laws, slower where joints are too slow.

Every synergy takes the person's time, and the hand-over speeds are the person's, in proportion to
the lengths. Where a joint would be faster than it can, the span of time is stretched, for all arms
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
from geodesic_ocp.trajectory.timed_path import at_times

_PLACES = 201
_ROUNDS = 60
_MORE = 1.001
# Fritsch and Carlson: a cubic whose end speeds are at most three times its mean never turns back.
_FASTEST = 3.0


@dataclass(frozen=True, eq=False)
class Arm:
    """What one arm is to do.

    Attributes:
        edges: instants (k + 1,) [s] at which its k paths begin and end in the recording.
        paths: k of them; of no length where the arm rests.
        speeds: (k + 1,) at the edges, in the metric's unit per second.
        limits: largest speeds of the joints (n,) [rad/s or m/s].
    """

    edges: Array
    paths: Sequence[Path]
    speeds: Array
    limits: Array


@dataclass(frozen=True, eq=False)
class Timing:
    """Laws of the arms' paths, and the robot's time.

    Attributes:
        laws: for each arm, one for each path.
        edges: instants (m + 1,) [s] of the recording between which time is stretched evenly.
        stretches: factors (m,), one at least.
    """

    laws: tuple[tuple[TimeLaw, ...], ...]
    edges: Array
    stretches: Array

    def __call__(self, time: Array) -> Array:
        """The robot's time [s], from 0, for times of the recording [s]."""
        steps = np.diff(self.edges) * self.stretches
        later = np.concatenate([[0.0], np.cumsum(steps)])
        return np.asarray(np.interp(time, self.edges, later))


def hand_over_speeds(speeds: Array, lengths: Array, durations: Array, paths: Array) -> Array:
    """Speeds (k + 1,) at which a robot's k paths hand over.

    Args:
        speeds: of the person there (k + 1,), in the person's metric.
        lengths: of the person's k movements.
        durations: of them [s].
        paths: lengths of the robot's k paths.

    The person's speed times the mean of the two ratios of lengths; zero at a rest; and at most
    three times the mean speed on either side.
    """
    moving = (lengths > 0.0) & (paths > 0.0)
    ratio = np.divide(paths, lengths, out=np.zeros_like(paths), where=moving)
    mean = paths / durations
    inner = (ratio[:-1] + ratio[1:]) / 2.0
    found = speeds * np.concatenate([ratio[:1], inner, ratio[-1:]])
    still = np.concatenate([~moving[:1], ~(moving[:-1] & moving[1:]), ~moving[-1:]])
    return np.where(still, 0.0, np.minimum(found, _cap(mean)))


def _cap(mean: Array) -> Array:
    """Largest speeds (k + 1,) at the ends of k paths with these mean speeds."""
    least = np.concatenate([mean[:1], np.minimum(mean[:-1], mean[1:]), mean[-1:]])
    return np.asarray(_FASTEST * least)


def timed(arms: Sequence[Arm]) -> Timing:
    """Laws for all arms' paths, with speeds that are continuous and joints within their limits.

    Raises:
        NotConverged: time was stretched again and again, and joints are still too fast.
    """
    edges = np.unique(np.concatenate([arm.edges for arm in arms]))
    stretches = np.ones(edges.size - 1)
    for _ in range(_ROUNDS):
        timing = Timing(tuple(_laws(arm, edges, stretches) for arm in arms), edges, stretches)
        needed = np.ones_like(stretches)
        for arm, laws in zip(arms, timing.laws, strict=True):
            for start, stop, path, law in zip(
                arm.edges[:-1], arm.edges[1:], arm.paths, laws, strict=True
            ):
                here = (edges[:-1] >= start) & (edges[1:] <= stop)
                needed[here] = np.maximum(needed[here], _excess(path, law, arm.limits))
        if np.all(needed <= 1.0):
            return timing
        stretches = stretches * np.where(needed > 1.0, needed * _MORE, 1.0)
    raise NotConverged("joints are too fast however much time is stretched")


def _laws(arm: Arm, edges: Array, stretches: Array) -> tuple[TimeLaw, ...]:
    steps = np.diff(edges) * stretches
    later = np.concatenate([[0.0], np.cumsum(steps)])
    places = np.searchsorted(edges, arm.edges)
    durations = np.diff(later[places])
    before = np.concatenate([[1.0], stretches])[places]
    after = np.concatenate([stretches, [1.0]])[places]
    # A neighbour may be stretched more, or another arm: then this one must not creep and dash.
    mean = np.array([path.length for path in arm.paths]) / durations
    speeds = np.minimum(arm.speeds / np.maximum(before, after), _cap(mean))
    laws = []
    for path, duration, start, end in zip(
        arm.paths, durations, speeds[:-1], speeds[1:], strict=True
    ):
        laws.append(time_law(path.length, float(duration), start, end, monotone=True))
    return tuple(laws)


def _excess(path: Path, law: TimeLaw, limits: Array) -> float:
    """How many times faster than its limit the fastest joint is."""
    _, velocity, _ = at_times(path, law, np.linspace(0.0, law.duration, _PLACES))
    return float((np.abs(velocity) / limits).max(initial=0.0))
