"""Where one synergy ends and the next begins."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from geodesic_ocp.arrays import Array, as_positive, evaluate
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.parallel_transport import transport_between
from geodesic_ocp.trajectory.motion import Motion

# Joints that all stay within this never move: it is below the noise of motion capture [rad or m].
_STILL = 1e-3
# Angles to the transported velocity are compared to a threshold of tenths of a radian.
_TRANSPORT_TOLERANCE = 1e-6


def segment(
    metric: Metric,
    motion: Motion,
    threshold: float = 0.6,
    *,
    rest: float = 0.02,
    rest_duration: float = 0.1,
) -> list[tuple[int, int]]:
    """Cut a motion where it leaves the geodesic that it set out on.

    The velocity at a segment's start is transported in parallel along the observed motion; where
    its angle to the observed velocity exceeds the threshold, a new segment begins (Klein, Jaquier,
    Meixner, Asfour 2022, section III). A geodesic carries its own velocity in parallel: the angle
    stays zero along it.

    At rest the velocity's direction is noise. The arm rests where its speed |q'|_G is below `rest`
    times the motion's largest. A rest of `rest_duration` or longer is a segment of its own, from
    its first sample to the first that moves; during a shorter one no cut is made, and a segment
    that begins in one takes its direction from the first sample that moves.

    Args:
        metric: whose transport and angles are used, of the motion's dimension.
        motion: with velocities, see `Motion.filtered`.
        threshold: largest angle [rad], in (0, pi).
        rest: share of the largest speed below which the arm rests, in [0, 1).
        rest_duration: of the shortest rest that is a segment [s].

    Returns:
        (start, stop) sample indices of every segment; each begins at the sample where the one
        before ended, the last one ends at the last sample.

    Raises:
        ValueError: the motion has no velocities, never moves or is not of the metric's dimension;
            or a number is out of range.
    """
    threshold = as_threshold(threshold)
    if not 0.0 <= rest < 1.0:
        raise ValueError(f"rest must be in [0, 1), got {rest}")
    rest_duration = as_positive("rest_duration", rest_duration, "s")
    velocity = moving_velocity(motion)
    speed = speeds(metric, motion)
    at_rest = speed <= rest * speed.max()
    in_long_rest = np.zeros(len(motion), dtype=bool)
    for first, after in _runs(at_rest):
        if motion.time[min(after, len(motion) - 1)] - motion.time[first] >= rest_duration:
            in_long_rest[first:after] = True

    cuts: list[int] = []
    carried: Array | None = None
    for k in range(len(motion)):
        if in_long_rest[k]:
            if k == 0 or not in_long_rest[k - 1]:
                cuts.append(k)
            carried = None
            continue
        if k > 0 and in_long_rest[k - 1]:
            cuts.append(k)
        elif carried is not None:
            span = motion.time[k - 1 : k + 1]
            carried = transport_between(
                metric, motion, carried, span, tolerance=_TRANSPORT_TOLERANCE
            )[-1]
        if at_rest[k]:
            continue
        if carried is None:
            carried = velocity[k]
        elif metric.angle(motion.q[k], carried, velocity[k]) > threshold:
            cuts.append(k)
            carried = velocity[k]
    return _between(cuts, len(motion))


def as_threshold(threshold: float) -> float:
    """The argument as an angle in (0, pi) [rad]; ValueError if it is not."""
    threshold = as_positive("threshold", threshold, "rad")
    if threshold >= np.pi:
        raise ValueError(f"threshold must be below pi rad, got {threshold:g} (in degrees?)")
    return threshold


def segment_zero_velocity(
    motion: Motion, joints: int = 3, window: float = 0.05
) -> list[tuple[int, int]]:
    """Cut a motion where many joints turn back at once.

    A segment begins where more than `joints` joint velocities cross zero within `window` [s], at
    the sample nearest to the mean of their crossings (after Fod, Mataric, Jenkins, "Automated
    derivation of primitives for movement classification", Autonomous Robots 12, 2002).

    Returns:
        (start, stop) sample indices as of `segment`.

    Raises:
        ValueError: the motion has no velocities or never moves, or a number is out of range.
    """
    if joints < 0 or joints >= len(motion.joint_names):
        raise ValueError(f"joints must be 0 to {len(motion.joint_names) - 1}, got {joints}")
    window = as_positive("window", window, "s")
    velocity = moving_velocity(motion)
    found = [(t, j) for j in range(velocity.shape[1]) for t in _crossings(motion, velocity[:, j])]
    found.sort()
    cuts, after = [], -np.inf
    for start, _ in found:
        if start <= after:
            continue
        group = [(t, joint) for t, joint in found if start <= t <= start + window]
        if len({joint for _, joint in group}) > joints:
            middle = float(np.mean([t for t, _ in group]))
            cuts.append(int(np.argmin(np.abs(motion.time - middle))))
            after = start + window
    return _between(cuts, len(motion))


def speeds(metric: Metric, motion: Motion) -> Array:
    """Observed speed |q'|_G at every sample, (k,)."""
    if metric.dim != len(motion.joint_names):
        raise ValueError(
            f"the metric has dimension {metric.dim}, the motion {len(motion.joint_names)} joints"
        )
    if metric.joint_names is not None and metric.joint_names != motion.joint_names:
        raise ValueError(
            f"the motion's joints {', '.join(motion.joint_names)} are not the metric's in its "
            f"order, {', '.join(metric.joint_names)}; use motion.select(model.joint_names)"
        )
    velocity = observed_velocity(motion)
    result: Array = evaluate(metric.speed.map(len(motion)), motion.q.T, velocity.T).ravel()
    return result


def observed_velocity(motion: Motion) -> Array:
    """The motion's velocities (k, n); ValueError where there are none."""
    if motion.velocity is None:
        raise ValueError("the motion has no velocities; use motion.filtered()")
    return motion.velocity


def moving_velocity(motion: Motion) -> Array:
    """The motion's velocities (k, n); ValueError where there are none, or no joint moves."""
    if np.ptp(motion.q, axis=0).max() < _STILL:
        raise ValueError(
            f"the motion never moves: every joint stays within {_STILL:g} rad from first to last"
        )
    return observed_velocity(motion)


def _runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """(first, first after) of every run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(first), int(after)) for first, after in edges.reshape(-1, 2)]


def _crossings(motion: Motion, velocity: Array) -> list[float]:
    """Times at which one joint's velocity changes its sign, by linear interpolation."""
    signed = np.flatnonzero(velocity)
    changes = np.flatnonzero(np.diff(np.sign(velocity[signed])))
    times = []
    for before, after in zip(signed[changes], signed[changes + 1], strict=True):
        share = velocity[before] / (velocity[before] - velocity[after])
        times.append(
            float(motion.time[before] + share * (motion.time[after] - motion.time[before]))
        )
    return times


def _between(cuts: list[int], count: int) -> list[tuple[int, int]]:
    """Segments between cuts, the first and the last sample."""
    edges = sorted({0, count - 1, *cuts})
    return list(pairwise(edges))
