"""Segmentation of a recorded motion: where it leaves its geodesic, and where it rests.

The rule compares velocities with a velocity that is parallel-transported along the observed motion.
In a frame E(t) that is transported itself, E' = A E with A w = -G^-1 sum_jk Gamma_ijk q'_j w_k, a
parallel vector has constant components, and if E is orthonormal at the start it remains so. The
components c = E^-1 v of the observed velocity therefore hold all that the rule needs: the angle
between v(t) and the transported v(r) is that between c(t) and c(r).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, as_not_negative, as_positive
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.manifold.metric import Metric, speeds_at
from geodesic_ocp.trajectory.motion import Motion

# Joints within this range do not move: it is below the noise of motion capture [rad or m].
_STILL = 1e-3
# Angles to the transported velocity are compared to a threshold of tenths of a radian.
_TRANSPORT_TOLERANCE = 1e-6
_MOST_PARTS = 256  # of a step between two samples
_LONGEST = 0.005  # step between two instants at which a motion is followed [s]
MOVING, AT_REST, IN_LONG_REST = range(3)  # states of an instant
# Below twice the speed of the noise, the direction of a velocity says next to nothing.
_OF_NOISE = 2.0
_SAMPLES = 32  # at which the speed of the noise is averaged


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

    >>> time = np.arange(200) / 100.0
    >>> corner = go.Motion(time, np.column_stack([time, np.maximum(time - 1.0, 0.0)]), ("x", "y"))
    >>> go.segment(go.Euclidean(2), corner.filtered(cutoff=6.0))
    [(0, 101), (101, 199)]

    Args:
        metric: metric whose transport and angles are used, of the motion's dimension.
        motion: motion with velocities, see `Motion.filtered`.
        threshold: largest angle [rad], in (0, pi).
        rest: fraction of the largest speed below which the arm rests, in [0, 1); 0 for no rests.
        rest_duration: rest duration of the shortest rest that is a segment [s].
        min_duration: min duration of the shortest segment [s], 0 for any; a rest, and a movement
            between two rests, may be shorter.
        hysteresis: angle beyond the threshold that a change of direction must reach [rad].

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
    min_duration = as_not_negative("min_duration", min_duration, "s")
    hysteresis = as_not_negative("hysteresis", hysteresis, "rad")
    cuts = _observe(metric, motion, rest, rest_duration).cuts(threshold, hysteresis, min_duration)
    return list(pairwise(nearest_samples(motion, cuts)))


def observed_velocity(motion: Motion) -> Array:
    """Return the motion's velocities (k, n); ValueError if it has none."""
    if motion.velocity is None:
        raise ValueError("the motion has no velocities; use motion.filtered()")
    return motion.velocity


def check_moving(motion: Motion) -> None:
    """Raise ValueError if no joint moves."""
    if np.ptp(motion.q, axis=0).max() < _STILL:
        raise ValueError(
            f"the motion never moves: every joint stays within {_STILL:g} rad from first to last"
        )


def speeds(metric: Metric, motion: Motion) -> Array:
    """Return observed speeds |q'|_G at every sample, (k,); ValueError if motion and metric do not
    fit.
    """
    if metric.dim != len(motion.joint_names):
        raise ValueError(
            f"the metric has dimension {metric.dim}, the motion {len(motion.joint_names)} joints"
        )
    if metric.joint_names is not None and metric.joint_names != motion.joint_names:
        raise ValueError(
            f"the motion's joints {', '.join(motion.joint_names)} are not the metric's in its "
            f"order, {', '.join(metric.joint_names)}; use motion.select(model.joint_names)"
        )
    return speeds_at(metric, motion.q, observed_velocity(motion))


def _observe(metric: Metric, motion: Motion, rest: float, rest_duration: float) -> _Observed:
    """Return the motion's directions, with a motion and numbers that are checked here."""
    if not 0.0 <= rest < 1.0:
        raise ValueError(f"rest must be in [0, 1), got {rest}")
    rest_duration = as_positive("rest_duration", rest_duration, "s")
    check_moving(motion)
    level = _rest_level(metric, motion, speeds(metric, motion), rest)
    metric.check_units("motion", motion.q[int(np.argmax(np.abs(motion.q).max(axis=1)))])

    def states_at(times: Array) -> tuple[Array, Array]:
        return np.hstack([motion(times), motion(times, 1)]), _velocity_between(motion, times[::2])

    times, directions, speed, _ = _follow(metric, motion.time, states_at)
    return _Observed(times, directions, speed, _states(times, speed, level, rest_duration))


@dataclass(frozen=True)
class Development:
    """The development of a motion: a curve in a flat space that turns as the motion does.

    In a frame E(t) that is parallel along the motion, the velocity has components c = E^-1 q', and
    the development is their integral (Kobayashi, Nomizu, "Foundations of Differential Geometry",
    1963, section III.4). It has the motion's speeds, and it is straight where the motion follows a
    geodesic.
    """

    times: Array  # instants (m,), at most 5 ms apart [s]
    points: Array  # of the curve (m, n), in units of length of the metric
    speeds: Array  # |q'|_G (m,)
    resting: NDArray[np.bool_]  # which instants are in a long rest (m,), see `segment`


def development(
    metric: Metric, motion: Motion, rest: float = 0.02, rest_duration: float = 0.1
) -> Development:
    """Return the development of a motion with velocities; arguments and errors as of `segment`."""
    seen = _observe(metric, motion, rest, rest_duration)
    # At an instant without velocity there is no direction.
    velocities = np.nan_to_num(seen.directions) * seen.speeds[:, None]
    steps = 0.5 * (velocities[1:] + velocities[:-1]) * np.diff(seen.times)[:, None]
    points = np.cumsum(np.vstack([np.zeros_like(steps[:1]), steps]), axis=0)
    return Development(seen.times, points, seen.speeds, seen.state == IN_LONG_REST)


def _follow(
    metric: Metric,
    time: Array,
    states_at: Callable[[Array], tuple[Array, Array]],
    frame: Array | None = None,
) -> tuple[Array, Array, Array, Array]:
    """Follow a motion in a parallel frame, in as many steps between samples as transport needs.

    Args:
        metric: metric of the motion.
        time: of the samples (k,) [s].
        states_at: from times (2 m - 1,), positions and velocities (2 m - 1, 2 n) of the curve, and
            the observed velocities (m, n) at every second time.
        frame: orthonormal frame (n, n) at the first sample, as columns; None: any.

    Returns:
        Times (m,), directions (m, n) and speeds (m,) at the instants, and the frame at the last.
    """
    parts = _parts(time)
    while True:
        times = _times_between(time, 2 * parts)
        curve, observed = states_at(times)
        times = times[::2]
        speed = speeds_at(metric, curve[::2, : metric.dim], observed)
        components, last = _parallel_components(metric, times, curve, observed, frame)
        # Transport keeps norms, so that their change is its error.
        error = np.abs(np.linalg.norm(components, axis=1) - speed) / np.where(speed > 0, speed, 1.0)
        if np.all(error <= _TRANSPORT_TOLERANCE):
            with np.errstate(invalid="ignore", divide="ignore"):  # next to a velocity of zero
                directions = components / np.linalg.norm(components, axis=1, keepdims=True)
            return times, directions, speed, last
        worst = int(np.argmax(~(error <= _TRANSPORT_TOLERANCE)))
        if not np.all(np.isfinite(error)) or parts >= _MOST_PARTS:
            metric.check_domain_along("the motion", times, curve[::2, : metric.dim])
            raise IntegrationFailed(
                f"parallel transport: at t = {times[worst]:.6g} s its error is {error[worst]:.1e}, "
                f"not {_TRANSPORT_TOLERANCE:.0e}: the metric is singular there",
                float(times[worst]),
            )
        parts *= 2


def _parallel_components(
    metric: Metric, times: Array, curve: Array, velocity: Array, frame: Array | None = None
) -> tuple[Array, Array]:
    """Return components (m, n) of velocities (m, n) in an orthonormal frame that is parallel along
    a curve, and the frame at its end (n, n).

    Args:
        metric: metric of the curve.
        times: (m,) [s].
        curve: positions and velocities (2 m - 1, 2 n) at the times and halfway between them.
        velocity: at the times.
        frame: the frame at the start; None: any.
    """
    n = metric.dim
    rates = metric.transport_matrices(curve)
    h = np.diff(times)[:, None, None]
    start = rates[:-1:2]
    middle = rates[1::2]
    end = rates[2::2]
    one = np.eye(n)
    # The classical method of order 4, for all steps at once.
    second = middle @ (one + h / 2.0 * start)
    third = middle @ (one + h / 2.0 * second)
    fourth = end @ (one + h * third)
    steps = one + h / 6.0 * (start + 2.0 * second + 2.0 * third + fourth)
    frames = np.empty((times.size, n, n))
    try:
        if frame is None:
            frame = np.linalg.inv(np.linalg.cholesky(metric.matrix(curve[0, :n]))).T
        frames[0] = frame
        for index, step in enumerate(steps, 1):
            frames[index] = frame = step.dot(frame)
        return np.asarray(np.linalg.solve(frames, velocity[:, :, None])[:, :, 0]), frames[-1]
    except np.linalg.LinAlgError:
        return np.full_like(velocity, np.nan), frames[-1]


class OnlineSegmentation:
    """Segmentation of a motion while it goes on, by the rule of `segment`.

    A cut is known as soon as it is certain: `min_duration` after the angle has exceeded threshold +
    hysteresis, and `rest_duration` after the arm has come to rest. The largest speed, of which
    `rest` is a fraction, is that until now; the noise of the velocities is not known.

    Attributes:
        cuts: times at which segments start or stop [s], so far.

    Args:
        metric, threshold, rest, rest_duration, min_duration, hysteresis: see `segment`.
        fastest: largest speed |q'|_G to begin with, so that noise before the first movement rests.
    """

    def __init__(
        self,
        metric: Metric,
        threshold: float = 0.6,
        *,
        rest: float = 0.02,
        rest_duration: float = 0.1,
        min_duration: float = 0.1,
        hysteresis: float = 0.1,
        fastest: float = 0.0,
    ) -> None:
        self.metric = metric
        self.rest = rest
        self.rest_duration = rest_duration
        self.rule = as_threshold(threshold), hysteresis, min_duration
        self.fastest = fastest
        self.cuts = list[float]()
        self.sample: tuple[float, Array, Array] | None = None
        self._frame: Array | None = None

    def add(self, time: float, q: Array, velocity: Array) -> None:
        """Add a sample at a later time [s] than the one before, with q and velocity (n,).

        Raises:
            IntegrationFailed: the metric is singular there.
        """
        before = self.sample
        self.sample = (time, q, velocity)
        if before is None:
            self._frame = None
            self._seen: list[Array] = [np.empty(0), np.empty((0, self.metric.dim)), np.empty(0)]
            self._first = 0
            self._last = time
            self.cuts.append(time)
            return
        (start, q0, v0) = before
        h = time - before[0]

        def states_at(times: Array) -> tuple[Array, Array]:
            # The cubic with these ends.
            s = ((times - start) / h)[:, None]
            straight = (q - q0) / h
            bend = (1.0 - s) * (v0 - straight) - s * (velocity - straight)
            slope = (1.0 - 2.0 * s) * bend - s * (1.0 - s) * (v0 + velocity - 2.0 * straight)
            curve = np.hstack([q0 + h * s * (straight + (1.0 - s) * bend), straight + slope])
            return curve, (1.0 - s[::2]) * v0 + s[::2] * velocity

        *found, frame = _follow(self.metric, np.array([start, time]), states_at, self._frame)
        # Orthonormal again, so that errors do not add up.
        gram = frame.T @ self.metric.matrix(q) @ frame
        self._frame = np.asarray(np.linalg.solve(np.linalg.cholesky(gram), frame.T).T)
        new = slice(1 if self._seen[0].size else 0, None)
        pairs = zip(self._seen, found, strict=True)
        self._seen = [np.concatenate([old, each[new]]) for old, each in pairs]
        self.fastest = max(self.fastest, float(found[2].max()))
        while self._closes():
            pass

    def restart(self) -> None:
        """End the current segment at the last sample; the next sample is the first of another."""
        if self.sample is not None and self.sample[0] > self.cuts[-1]:
            self.cuts.append(self.sample[0])
        self.sample = None

    def _closes(self) -> bool:
        """Find the next cut; return whether there is one."""
        times, directions, speed = self._seen
        state = _states(times, speed, self.rest * self.fastest, self.rest_duration)
        resting = state == IN_LONG_REST
        changes = np.flatnonzero(resting != resting[0])
        if resting[0]:
            if not changes.size:
                self._forget(int(np.searchsorted(times, times[-1] - 2.0 * self.rest_duration)))
                return False
            return self._cut(float(times[changes[0]]), int(changes[0]), 0)
        stop = int(changes[0]) if changes.size else times.size - 1
        if state[stop] == AT_REST:  # for how long is not known yet
            stop = int(np.append(-1, np.flatnonzero(state == MOVING))[-1]) + 1
        observed = _Observed(times, directions, speed, state)
        cuts = observed._cuts_within(0, stop, *self.rule, self._first, self._last)
        if cuts:
            crossing, first = cuts[0]
            return self._cut(crossing, first - 1, 1)
        return bool(changes.size) and self._cut(float(times[stop]), stop, 0)

    def _cut(self, time: float, kept: int, first: int) -> bool:
        self.cuts.append(time)
        self._first = first
        self._last = time
        self._forget(kept)
        return True

    def _forget(self, count: int) -> None:
        self._seen = [each[count:] for each in self._seen]


@dataclass(frozen=True)
class _Observed:
    """Unit vectors (m, n) along a motion's velocities, in a parallel frame, and speeds |q'|_G (m,),
    at times (m,).
    """

    times: Array
    directions: Array
    speeds: Array
    state: NDArray[np.uint8]

    def cuts(self, threshold: float, hysteresis: float, duration: float) -> list[float]:
        """Return times of the cuts, the ends of the motion and of long rests included."""
        resting = self.state == IN_LONG_REST
        inner = np.flatnonzero(np.diff(resting[:-1])) + 1
        cuts: list[float] = []
        for start, stop in pairwise([0, *inner.tolist(), self.times.size - 1]):
            cuts.append(float(self.times[start]))
            if not resting[start]:
                within = self._cuts_within(start, stop, threshold, hysteresis, duration)
                cuts += [cut for cut, _ in within]
        return [*cuts, float(self.times[-1])]

    @cached_property
    def _turns(self) -> Array:
        """Angles by which the velocity turns from the instant before (m,); 0 for the first."""
        return np.append(0.0, _angle(np.sum(self.directions[:-1] * self.directions[1:], axis=1)))

    def _cuts_within(
        self,
        start: int,
        stop: int,
        threshold: float,
        hysteresis: float,
        duration: float,
        first: int | None = None,
        last: float | None = None,
    ) -> list[tuple[float, int]]:
        """Return cuts in a stretch between long rests, each with the instant at or after it.

        They are sought from the instant `first` on, after a cut at the time `last`; None: from the
        start of the stretch.
        """
        cuts: list[tuple[float, int]] = []
        first = start if first is None else first
        last = begin = float(self.times[start]) if last is None else last
        while (reference := self._steadiest(start, first, stop, begin + duration)) is not None:
            crossing = self._crossing(reference, stop, threshold, hysteresis)
            if crossing is None:
                break
            first = max(reference + 1, int(np.searchsorted(self.times, crossing)))
            if crossing - last >= duration and self.times[stop] - crossing >= duration:
                cuts.append((crossing, first))
                last = crossing
            begin = crossing
        return cuts

    def _steadiest(self, start: int, first: int, stop: int, until: float) -> int | None:
        """Return the moving instant in [first, stop) until this time whose velocity turns most
        slowly.

        If none moves until then, it is the first that does.
        """
        moving = first + np.flatnonzero(self.state[first:stop] == MOVING)
        if not moving.size:
            return None
        soon = moving[: max(1, int(np.searchsorted(self.times[moving], until, side="right")))]
        before = np.maximum(soon - 1, start)
        turns = self._turns[soon + 1] + np.where(soon > start, self._turns[soon], 0.0)
        rates = turns / (self.times[soon + 1] - self.times[before])
        return int(soon[np.argmin(np.where(np.isfinite(rates), rates, np.inf))])

    def _crossing(
        self, reference: int, stop: int, threshold: float, hysteresis: float
    ) -> float | None:
        """Return when the angle to the velocity at `reference` rises above the threshold for good.

        That is, without falling back below it before it exceeds threshold + hysteresis.
        """
        angles = _angle(self.directions[reference:stop] @ self.directions[reference])
        angles[0] = 0.0
        moving = self.state[reference:stop] == MOVING
        beyond = moving & (angles > threshold + hysteresis)
        if not np.any(beyond):
            return None
        until = int(np.argmax(beyond))
        below = int(np.flatnonzero(moving[:until] & ~(angles[:until] > threshold))[-1])
        above = below + 1 + int(np.argmax(moving[below + 1 :]))
        time = float(self.times[reference + above])
        if moving[above - 1]:  # interpolated between the two
            part = (angles[above] - threshold) / (angles[above] - angles[above - 1])
            time -= float(part * (time - self.times[reference + above - 1]))
        return time


def _angle(cosine: Array) -> Array:
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _states(times: Array, speed: Array, level: float, rest_duration: float) -> np.ndarray:
    """Get state (m,) of every instant: moving, at rest at most at this speed, or in a long rest."""
    at_rest = speed <= level
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at_rest.astype(int), [0]])))
    result = at_rest.astype(np.uint8)
    for first, after in edges.reshape(-1, 2):
        if times[min(after, times.size - 1)] - times[first] >= rest_duration:
            result[first:after] = IN_LONG_REST
    return result


def _rest_level(metric: Metric, motion: Motion, speed: Array, rest: float) -> float:
    """Return speed up to which the motion rests, which depends on the noise that the filter left.

    With noise of standard deviations sigma_i of the joints' velocities, independent of each other,
    the mean square of its speed |q'|_G is sum_i G_ii sigma_i^2.
    """
    level = rest * float(speed.max())
    if rest == 0.0 or motion.filter is None:
        return level
    at = np.unique(np.linspace(0, len(motion) - 1, _SAMPLES).round().astype(int))
    each = [
        speeds_at(metric, motion.q[at], np.tile(vector, (at.size, 1)))
        for vector in np.diag(motion.filter.velocity_noise)
    ]
    return max(level, _OF_NOISE * float(np.sqrt(np.mean(np.sum(np.square(each), axis=0)))))


def _parts(time: Array) -> int:
    """Return parts of every step between two samples, so that none is longer than 5 ms."""
    return max(1, int(np.ceil(np.diff(time).max() / _LONGEST - 0.01)))


def nearest_samples(motion: Motion, times: Sequence[float] | Array) -> list[int]:
    """Return the samples nearest to these times, in order and without repetition."""
    middles = 0.5 * (motion.time[:-1] + motion.time[1:])
    samples: list[int] = np.unique(np.searchsorted(middles, times)).tolist()
    return samples


def _times_between(time: Array, parts: int) -> Array:
    """Return times (m,) of samples and, with every step between two in equal parts, between
    them.
    """
    steps = np.diff(time)[:, None]
    between = time[:-1, None] + steps * (np.arange(parts) / parts)
    return np.append(between.ravel(), time[-1])


def _velocity_between(motion: Motion, times: Array) -> Array:
    """Return velocities (m, n) at these times from those of the samples.

    A filtered motion has no high frequencies, and a cubic spline through its velocities follows it
    closely. Other velocities may jump from one sample to the next: they are interpolated linearly.
    """
    velocity = observed_velocity(motion)
    if motion.filter is not None:
        result: Array = scipy.interpolate.CubicSpline(motion.time, velocity)(times)
        return result
    return np.column_stack([np.interp(times, motion.time, column) for column in velocity.T])


def as_threshold(threshold: float) -> float:
    """Return the argument as an angle in (0, pi) [rad]; ValueError if it is not."""
    threshold = as_positive("threshold", threshold, "rad")
    if threshold >= np.pi:
        raise ValueError(f"threshold must be below pi rad, got {threshold:g} (in degrees?)")
    return threshold


def segment_zero_velocity(
    motion: Motion, joints: int = 3, window: float = 0.05
) -> list[tuple[int, int]]:
    """Cut a motion where many joints reverse their direction at once.

    A segment starts where more than `joints` joint velocities cross zero within `window` [s], at
    the sample nearest to the mean time of these crossings (after Fod, Mataric, Jenkins, "Automated
    derivation of primitives for movement classification", Autonomous Robots 12, 2002). Crossings
    are located between the samples, so that the cuts hardly depend on the sampling rate.

    >>> arm, time = go.human_arm(), np.linspace(0.0, 1.0, 101)
    >>> turns = np.outer(np.sin(2.0 * np.pi * time), np.ones(7))  # all reverse at 0.25 and 0.75 s
    >>> go.synergies.segment_zero_velocity(go.Motion(time, turns, arm.joint_names).filtered())
    [(0, 25), (25, 75), (75, 100)]

    Args:
        motion: with velocities.
        joints: number of joints that must be exceeded.
        window: time [s] within which they reverse.

    Returns:
        (start, stop) sample indices as from `segment`.

    Raises:
        ValueError: the motion has no velocities or never moves, or a number is out of range.
    """
    if joints < 0 or joints >= len(motion.joint_names):
        raise ValueError(f"joints must be 0 to {len(motion.joint_names) - 1}, got {joints}")
    window = as_positive("window", window, "s")
    times = _times_between(motion.time, _parts(motion.time))
    check_moving(motion)
    observed = _velocity_between(motion, times)
    crossings = sorted(
        (time, joint)
        for joint, velocity in enumerate(observed.T)
        for time in _zero_crossings(times, velocity)
    )
    cuts = [motion.time[0], motion.time[-1]]
    after = -np.inf
    for start, _ in crossings:
        if start <= after:
            continue
        group = [(time, joint) for time, joint in crossings if start <= time <= start + window]
        if len({joint for _, joint in group}) > joints:
            cuts.append(float(np.mean([time for time, _ in group])))
            after = start + window
    return list(pairwise(nearest_samples(motion, cuts)))


def _zero_crossings(time: Array, velocity: Array) -> list[float]:
    """Return times at which one joint's velocity changes its sign, by linear interpolation."""
    nonzero = np.flatnonzero(velocity)
    changes = np.flatnonzero(np.diff(np.sign(velocity[nonzero])))
    before = nonzero[changes]
    after = nonzero[changes + 1]
    fraction = velocity[before] / (velocity[before] - velocity[after])
    return list(time[before] + fraction * (time[after] - time[before]))
