"""Segmentation of a motion into geodesic synergies."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np

from geodesic_ocp.arrays import Array, as_positive, evaluate
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.manifold.metric import Metric, has_compiled_code
from geodesic_ocp.synergies.observed_velocity import moving_velocity, speeds
from geodesic_ocp.trajectory.motion import Motion

# Angles to the transported velocity are compared to a threshold of tenths of a radian.
_TRANSPORT_TOLERANCE = 1e-6
_MAX_STEPS = 64  # between two samples
_MOVING, _AT_REST, _IN_LONG_REST = range(3)  # states of a sample


def segment(
    metric: Metric,
    motion: Motion,
    threshold: float = 0.6,
    *,
    rest: float = 0.02,
    rest_duration: float = 0.1,
) -> list[tuple[int, int]]:
    """Cut a motion where it deviates from the geodesic on which the segment started.

    The velocity at a segment's start is parallel-transported along the observed motion; where its
    angle to the observed velocity exceeds the threshold, a new segment starts (Klein, Jaquier,
    Meixner, Asfour 2022, section III). Along a geodesic this angle stays zero: a geodesic
    parallel-transports its own velocity.

    At rest the direction of the velocity is noise. The arm rests where its speed |q'|_G is below
    `rest` times the largest speed of the motion. A rest of `rest_duration` or longer is a segment
    of its own, from its first sample to the first that moves. A shorter one is not cut, and a
    segment that starts in one takes its direction from the first sample that moves.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> arm = go.human_arm("left", height=1.78)
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv", arm.joint_names)
    >>> go.segment(go.KineticEnergy(arm), motion.filtered(), threshold=0.6)[:4]
    [(0, 48), (48, 57), (57, 66), (66, 69)]

    Args:
        metric: whose transport and angles are used, of the motion's dimension.
        motion: with velocities, see `Motion.filtered`.
        threshold: largest angle [rad], in (0, pi).
        rest: fraction of the largest speed below which the arm rests, in [0, 1).
        rest_duration: of the shortest rest that is a segment [s].

    Returns:
        (start, stop) sample indices of every segment; each starts at the sample where the one
        before stopped, and the last one stops at the last sample.

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
    in_long_rest = _in_long_rest(at_rest, motion.time, rest_duration)

    state = np.where(in_long_rest, 2, at_rest).astype(np.uint8)
    return list(pairwise(_cuts(metric, motion, velocity, state, threshold)))


def _cuts(
    metric: Metric, motion: Motion, velocity: Array, state: np.ndarray, threshold: float
) -> list[int]:
    """Samples at which the motion is cut, with as many steps between two as the transport needs.

    `state` (k,) of a sample is one of _MOVING, _AT_REST and _IN_LONG_REST.
    """
    cuts = metric.kernels.segment if has_compiled_code(metric) else partial(_flags, metric)
    steps = 1
    while True:
        fractions = np.arange(2 * steps) / (2 * steps)
        between = motion.time[:-1, None] + fractions * np.diff(motion.time)[:, None]
        times = np.append(between.ravel(), motion.time[-1])
        curve = np.hstack([motion(times), motion(times, 1)])
        flags, error, worst = cuts(motion.time, curve, velocity, state, threshold)
        if error <= _TRANSPORT_TOLERANCE:
            return np.flatnonzero(flags).tolist()
        if not np.isfinite(error) or steps >= _MAX_STEPS:
            raise IntegrationFailed(
                f"parallel transport: from t = {motion.time[worst - 1]:.6g} to "
                f"{motion.time[worst]:.6g} s its error is {error:.1e} with {steps} steps, not "
                f"{_TRANSPORT_TOLERANCE:.0e}: the metric is singular or not defined there",
                float(motion.time[worst - 1]),
            )
        steps *= 2


def _flags(
    metric: Metric,
    time: Array,
    curve: Array,
    velocity: Array,
    state: np.ndarray,
    threshold: float,
) -> tuple[np.ndarray, float, int]:
    """Interpreted, what `Kernels.segment` does."""
    count, n = velocity.shape
    steps = (len(curve) - 1) // (2 * (count - 1))
    tensors = evaluate(metric._matrix_function.map(count), curve[:: 2 * steps, :n].T)
    tensors = tensors.reshape(n, count, n).swapaxes(0, 1)
    flags, change, worst = np.zeros(count, dtype=np.uint8), 0.0, 0
    flags[[0, -1]] = 1
    transported: Array | None = None
    norm = 0.0
    for k in range(count):
        if state[k] == _IN_LONG_REST:
            flags[k] |= k == 0 or state[k - 1] != _IN_LONG_REST
            transported = None
            continue
        if k > 0 and state[k - 1] == _IN_LONG_REST:
            flags[k] = 1
        elif transported is not None:
            size = (time[k] - time[k - 1]) / steps
            for part in range(2 * steps * (k - 1), 2 * steps * k, 2):
                points = curve[part : part + 3].T
                transported = metric.transport_step(transported, points, size).full()[:, 0]
            now = _norm(tensors[k], transported)
            relative = abs(now - norm) / norm
            if not (relative <= change or np.isnan(change)):
                change, worst = relative, k
            norm = now
        if state[k] == _AT_REST:
            continue
        if transported is not None and _angle(tensors[k], transported, velocity[k]) > threshold:
            flags[k], transported = 1, None
        if transported is None:
            transported = velocity[k]
            norm = _norm(tensors[k], transported)
    return flags, change, worst


def _norm(tensor: Array, v: Array) -> float:
    return float(np.sqrt(v @ tensor @ v))


def _angle(tensor: Array, u: Array, v: Array) -> float:
    """As in `Metric.angle`, with NaN where the metric is not defined."""
    unit_u, unit_v = u / _norm(tensor, u), v / _norm(tensor, v)
    return float(2.0 * np.arctan2(_norm(tensor, unit_u - unit_v), _norm(tensor, unit_u + unit_v)))


def as_threshold(threshold: float) -> float:
    """The argument as an angle in (0, pi) [rad]; ValueError if it is not."""
    threshold = as_positive("threshold", threshold, "rad")
    if threshold >= np.pi:
        raise ValueError(f"threshold must be below pi rad, got {threshold:g} (in degrees?)")
    return threshold


def _in_long_rest(at_rest: np.ndarray, time: Array, rest_duration: float) -> np.ndarray:
    """Flags (k,) of the samples in rests of at least this duration [s]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at_rest.astype(int), [0]])))
    result = np.zeros(at_rest.size, dtype=bool)
    for first, after in edges.reshape(-1, 2):
        if time[min(after, time.size - 1)] - time[first] >= rest_duration:
            result[first:after] = True
    return result
