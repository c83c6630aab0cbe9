"""Segmentation of a motion into geodesic synergies."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np

from geodesic_ocp.arrays import Array, as_number, as_positive
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.manifold.metric import Metric, has_compiled_code
from geodesic_ocp.synergies.observed_velocity import moving_velocity, speeds
from geodesic_ocp.synergies.segmentation.between_samples import (
    nearest_samples,
    parts_of_steps,
    times_between,
    velocity_between,
)
from geodesic_ocp.synergies.segmentation.cuts_by_transport import cuts_by_transport
from geodesic_ocp.synergies.segmentation.rests import rest_level, states
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import speeds_at

# Angles to the transported velocity are compared to a threshold of tenths of a radian.
_TRANSPORT_TOLERANCE = 1e-6
_MOST_PARTS = 256  # of a step between two samples


def segment(
    metric: Metric,
    motion: Motion,
    threshold: float = 0.6,
    *,
    rest: float = 0.02,
    rest_duration: float = 0.1,
    min_duration: float = 0.1,
    hysteresis: float = 0.1,
) -> list[tuple[int, int]]:
    """Cut a motion where it deviates from the geodesic on which the segment started.

    The velocity at a segment's start is parallel-transported along the observed motion; where its
    angle to the observed velocity exceeds the threshold, a new segment starts (Klein, Jaquier,
    Meixner, Asfour 2022, section III). Along a geodesic this angle stays zero: a geodesic
    parallel-transports its own velocity.

    The motion is followed between its samples, in steps of at most 5 ms, and noise is kept from
    cutting, so that the cuts do not depend on the sampling rate:

    - A segment's reference is the velocity at the steadiest instant of its first `min_duration`:
      where it turns most slowly. The first instant itself is often in the middle of a turn.
    - The motion deviates from the moment at which the angle rises above the threshold, if it then
      exceeds threshold + hysteresis before falling below the threshold again.
    - That moment is a cut if segments on both of its sides last at least `min_duration`. Otherwise
      the turn belongs to the beginning or end of a segment, and only the reference is taken anew.

    At rest the direction of the velocity is noise. The arm rests where its speed |q'|_G is below
    `rest` times the largest speed of the motion, or below twice the speed of the noise, where the
    filter has measured it. A rest of `rest_duration` or longer is a segment of its own. In a
    shorter one there is no cut and no reference.

    With `min_duration=0` and `hysteresis=0` this is the rule of Klein et al.: every crossing of the
    threshold is a cut, and the velocity there the reference. A cut is certain `min_duration` after
    the angle has exceeded threshold + hysteresis, a rest after `rest_duration`.

    >>> import numpy as np, geodesic_ocp as go
    >>> time = np.arange(200) / 100.0
    >>> corner = go.Motion(time, np.column_stack([time, np.maximum(time - 1.0, 0.0)]), ("x", "y"))
    >>> go.segment(go.Euclidean(2), corner.filtered(cutoff=6.0))
    [(0, 101), (101, 199)]

    Args:
        metric: whose transport and angles are used, of the motion's dimension.
        motion: with velocities, see `Motion.filtered`.
        threshold: largest angle [rad], in (0, pi).
        rest: fraction of the largest speed below which the arm rests, in [0, 1); 0 for no rests.
        rest_duration: of the shortest rest that is a segment [s].
        min_duration: of the shortest segment [s], 0 for any; a rest, and a movement between two
            rests, may be shorter.
        hysteresis: by which the angle must exceed the threshold [rad], not negative.

    Returns:
        (start, stop) sample indices of every segment; each starts at the sample where the one
        before stopped, the nearest to the cut, and the last one stops at the last sample.

    Raises:
        ValueError: the motion has no velocities, never moves, is not of the metric's dimension or
            seems to be in degrees; the metric is not defined at a sample; or a number is out of
            range.
        IntegrationFailed: the metric is singular somewhere along the motion.
    """
    threshold = as_threshold(threshold)
    if not 0.0 <= rest < 1.0:
        raise ValueError(f"rest must be in [0, 1), got {rest}")
    rest_duration = as_positive("rest_duration", rest_duration, "s")
    min_duration = _not_negative("min_duration", min_duration, "s")
    hysteresis = _not_negative("hysteresis", hysteresis, "rad")
    velocity = moving_velocity(motion)
    level = rest_level(metric, motion, speeds(metric, motion), rest)
    metric.check_units("motion", motion.q[int(np.argmax(np.abs(motion.q).max(axis=1)))])
    rule = (threshold, hysteresis, min_duration)
    cuts = _cuts(metric, motion, velocity, level, rest_duration, rule)
    return list(pairwise(nearest_samples(motion, cuts)))


def _cuts(
    metric: Metric,
    motion: Motion,
    velocity: Array,
    level: float,
    rest_duration: float,
    rule: tuple[float, float, float],
) -> Array:
    """Times of the cuts, with as many steps between two samples as the transport needs."""
    cut = (
        metric.kernels.segment if has_compiled_code(metric) else partial(cuts_by_transport, metric)
    )
    parts = parts_of_steps(motion)
    while True:
        times = times_between(motion, 2 * parts)
        curve = np.hstack([motion(times), motion(times, 1)])
        observed = velocity_between(motion, velocity, times[::2])
        speed = speeds_at(metric, curve[::2, : metric.dim], observed)
        state = states(times[::2], speed, level, rest_duration)
        cuts, error, worst = cut(times[::2], curve, observed, state, *rule)
        if error <= _TRANSPORT_TOLERANCE:
            return cuts
        if not np.isfinite(error) or parts >= _MOST_PARTS:
            metric.check_domain_along("the motion", motion.time, motion.q)
            start, stop = times[2 * worst - 2], times[2 * worst]
            raise IntegrationFailed(
                f"parallel transport: from t = {start:.6g} to {stop:.6g} s its error is "
                f"{error:.1e}, not {_TRANSPORT_TOLERANCE:.0e}: the metric is "
                "singular there",
                float(start),
            )
        parts *= 2


def as_threshold(threshold: float) -> float:
    """The argument as an angle in (0, pi) [rad]; ValueError if it is not."""
    threshold = as_positive("threshold", threshold, "rad")
    if threshold >= np.pi:
        raise ValueError(f"threshold must be below pi rad, got {threshold:g} (in degrees?)")
    return threshold


def _not_negative(name: str, value: float, unit: str) -> float:
    number = as_number(name, value)
    if number < 0.0:
        raise ValueError(f"{name} must not be negative [{unit}], got {value}")
    return number
