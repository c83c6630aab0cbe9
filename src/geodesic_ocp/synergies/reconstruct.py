"""Reconstruction of a motion: each of its segments planned as a synergy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.logarithm.geodesic import geodesic
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.synergies.segment import speeds
from geodesic_ocp.synergies.synergy import Synergy, as_segments
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.time_law import TimeLaw, time_law

# A segment that returns to its start has a path too short for the observed speeds at its ends:
# these are limited to this multiple of the mean speed along the path.
_MAX_SPEED_RATIO = 100.0


class Reconstruction(NamedTuple):
    """A motion's synergies and the motion that they predict."""

    synergies: tuple[Synergy, ...]
    predicted: Motion

    def __repr__(self) -> str:
        duration = self.predicted.time[-1] - self.predicted.time[0]
        return f"Reconstruction({len(self.synergies)} synergies, {duration:.3f} s)"


def reconstruct(
    metric: Metric,
    motion: Motion,
    segments: Sequence[tuple[int, int]],
    *,
    progress: Callable[[int], object] | None = None,
) -> Reconstruction:
    """Plan every segment as a geodesic of the metric with a minimum-acceleration time law.

    The path connects the observed configurations at the segment's ends (`geodesic`). The time law
    takes the observed duration and end speeds |q'|_G (at most a hundred times the mean speed along
    the path) and never moves backwards. With `Euclidean` the paths are straight lines.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv").filtered()
    >>> result = go.reconstruct(go.Euclidean(7), motion, [(0, 300), (300, len(motion) - 1)])
    >>> [round(synergy.length, 2) for synergy in result.synergies]
    [0.44, 0.36]
    >>> result.predicted.q.shape
    (840, 7)

    Args:
        metric: of the motion's dimension.
        motion: observed, with velocities.
        segments: (start, stop) sample indices, each starting where the one before stopped, from
            the first sample to the last.
        progress: called with the number of synergies planned so far.

    Returns:
        Synergies, and the predicted motion at the recording's own times.

    Raises:
        ValueError: the segments do not cover the motion, or there are no velocities.
        NotConverged: no geodesic was found for a segment.
    """
    segments = as_segments(motion, segments)
    speed = speeds(metric, motion)
    synergies: list[Synergy] = []
    for start, stop in segments:
        path = geodesic(metric, motion.q[start], motion.q[stop])
        law = law_of_segment(motion, speed, path.length, start, stop)
        synergies.append(Synergy(start, stop, float(motion.time[start]), path, law))
        if progress is not None:
            progress(len(synergies))
    q, velocity = np.empty_like(motion.q), np.empty_like(motion.q)
    for synergy in synergies:
        # A shared sample belongs to the synergy that starts there.
        samples = slice(synergy.start, synergy.stop + 1)
        q[samples], velocity[samples] = synergy.states(motion.time[samples], 1)
    predicted = Motion(motion.time, q, motion.joint_names, velocity, motion.subject)
    return Reconstruction(tuple(synergies), predicted)


def law_of_segment(motion: Motion, speed: Array, length: float, start: int, stop: int) -> TimeLaw:
    """The time law over a path of this length between two samples.

    Args:
        motion: observed.
        speed: its speeds |q'|_G at the samples (k,), which the law takes at both ends.
        length: of the path, in the metric.
        start, stop: indices of the samples.
    """
    duration = float(motion.time[stop] - motion.time[start])
    max_speed = _MAX_SPEED_RATIO * length / duration
    end_speeds = (float(min(speed[index], max_speed)) for index in (start, stop))
    return time_law(length, duration, *end_speeds, monotone=True)
