"""Synergies: a motion's segments, each planned as a geodesic with its own timing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.geodesics.geodesic import geodesic
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.synergies.segment import observed_velocity, speeds
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.time_law import TimeLaw, time_law
from geodesic_ocp.trajectory.timed_path import states_at

# A segment that comes back to where it began has a path too short for its end speeds: none is
# more than this many times the mean speed along the path.
_FASTEST = 100.0


@dataclass(frozen=True, eq=False)
class Synergy:
    """One planned segment: at time t it has come as far along its path as the law says.

    Attributes:
        start, stop: indices of its first and last sample in the recording.
        start_time: of its first sample [s].
        path: the geodesic between the observed configurations at its ends; of a robot's, the path that
            brings the hand to its pose.
        law: distance along the path over time from the start.
    """

    start: int
    stop: int
    start_time: float
    path: Path
    law: TimeLaw

    @property
    def duration(self) -> float:
        """[s]"""
        return self.law.duration

    @property
    def length(self) -> float:
        """Length of the path in its metric."""
        return self.law.length

    def __call__(self, t: ArrayLike, order: int = 0) -> Array:
        """Configuration (k, n), or velocity for order 1, acceleration for 2, at times t (k,) [s].

        Raises:
            ValueError: t lies outside the synergy, or the order is above 2.
        """
        if order not in (0, 1, 2):
            raise ValueError(f"order must be 0, 1 or 2, got {order}")
        found = self.states(np.atleast_1d(np.asarray(t, dtype=float)))[order]
        return found[0] if np.ndim(t) == 0 else found

    def states(self, t: Array) -> tuple[Array, Array, Array]:
        """Configurations, velocities and accelerations, (k, n) each, at times t (k,) [s]."""
        return states_at(self.path, self.law, t - self.start_time)


class Reconstruction(NamedTuple):
    """A motion's synergies and the motion that they predict."""

    synergies: tuple[Synergy, ...]
    predicted: Motion


def reconstruct(
    metric: Metric,
    motion: Motion,
    segments: Sequence[tuple[int, int]],
    *,
    progress: Callable[[int], object] | None = None,
) -> Reconstruction:
    """Plan every segment as a geodesic of the metric with a minimum-acceleration time law.

    The path joins the observed configurations at the segment's ends (`geodesic`), the time law takes the
    observed duration and end speeds |q'|_G (at most a hundred times the path's mean speed) and
    never runs backwards. With `Euclidean` the paths
    are straight lines.

    Args:
        metric: of the motion's dimension.
        motion: with velocities.
        segments: as from `segment`, without gaps from the first sample to the last.
        progress: called with the number of synergies planned so far.

    Returns:
        Synergies, and the predicted motion at the recording's own instants.

    Raises:
        ValueError: the segments do not cover the motion, or there are no velocities.
        NotConverged: there is no geodesic for a segment; the message names it.
    """
    segments = [(int(start), int(stop)) for start, stop in segments]
    edges = [segments[0][0], *(stop for _, stop in segments)] if segments else []
    starts = [start for start, _ in segments]
    if not edges or edges[0] != 0 or edges[-1] != len(motion) - 1 or starts != edges[:-1]:
        raise ValueError(
            f"segments must cover samples 0 to {len(motion) - 1} without gaps, got {segments}"
        )
    if any(start >= stop for start, stop in segments):
        raise ValueError(f"every segment must end after it starts, got {segments}")
    observed_velocity(motion)
    speed = speeds(metric, motion)
    synergies: list[Synergy] = []
    for start, stop in segments:
        synergies.append(_planned(metric, motion, speed, start, stop))
        if progress is not None:
            progress(len(synergies))
    return Reconstruction(tuple(synergies), _predicted(motion, synergies))


def _planned(metric: Metric, motion: Motion, speed: Array, start: int, stop: int) -> Synergy:
    path = geodesic(metric, motion.q[start], motion.q[stop])
    duration = float(motion.time[stop] - motion.time[start])
    fastest = _FASTEST * path.length / duration
    ends = (float(min(speed[index], fastest)) for index in (start, stop))
    law = time_law(path.length, duration, *ends, monotone=True)
    return Synergy(start, stop, float(motion.time[start]), path, law)


def _predicted(motion: Motion, synergies: Sequence[Synergy]) -> Motion:
    q, velocity = np.empty_like(motion.q), np.empty_like(motion.q)
    for synergy in synergies:
        # A shared sample belongs to the synergy that begins there.
        here = slice(synergy.start, synergy.stop + 1)
        q[here], velocity[here], _ = synergy.states(motion.time[here])
    return Motion(motion.time, q, motion.joint_names, velocity, motion.subject)
