"""How large velocities, accelerations, jerks, torques and their rates of sampled joints are.

What samples state is taken as it is. The rest is derived by divided differences: k! times the one
of order k is the derivative of order k somewhere among its k + 1 samples, whatever the motion
does between them. So it is a lower bound of the largest magnitude, up to the last digits of the
numbers. By how much the largest one may exceed it is estimated by the change from one difference
to the next. At ends at rest, samples continue at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.arm_paths import hand_speeds
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.interpolation import within_intervals
from geodesic_ocp.trajectory.joint_trajectory import KINDS, JointTrajectory

# Files round numbers to six digits or so: that is no contradiction.
ROUNDING = (1e-6, 1e-5, 1e-4)  # of positions [rad], velocities [rad/s], accelerations [rad/s^2]
KINDS_OF_MOTION = {"velocity": 1, "acceleration": 2, "jerk": 3}  # by order of the derivative


class Magnitudes(NamedTuple):
    """Magnitudes of one kind.

    Attributes:
        at: instants (m,) [s].
        sizes: magnitudes (m, n).
        below: by how much less they may be (m, n), by the last digits of the numbers.
        above: by how much more, nearby (m, n).
        means: whether they are means over a step (m,).
    """

    at: Array
    sizes: Array
    below: Array
    above: Array
    means: Array

    @classmethod
    def exact(cls, at: Array, sizes: Array, means: bool = False) -> Magnitudes:
        """Return magnitudes that are known."""
        zeros = np.zeros_like(sizes)
        return cls(at, sizes, zeros, zeros, np.full(at.shape, means))

    def and_those(self, others: Magnitudes) -> Magnitudes:
        """Return both."""
        return Magnitudes(*(np.concatenate(pair) for pair in zip(self, others, strict=True)))


def differences(time: Array, values: Array, order: int) -> Array:
    """Return the divided differences of an order, times its factorial, (k - order, n).

    Zero where times (k,) do not increase.
    """
    for k in range(1, order + 1):
        spans = (time[k:] - time[:-k])[:, None]
        values = k * np.diff(values, axis=0) / np.where(spans > 0.0, spans, np.inf)
    return values


def _rounded(time: Array, digits: Array, order: int) -> Array:
    """Return by how much half a digit (n,) of each value may change the differences."""
    found: Array = np.tile(0.5 * digits, (time.size, 1))
    for k in range(1, order + 1):
        spans = (time[k:] - time[:-k])[:, None]
        found = k * (found[1:] + found[:-1]) / np.where(spans > 0.0, spans, np.inf)
    return found


def peaks_above(values: Array) -> Array:
    """Return by how much a derivative may exceed its differences (m, n), by their changes.

    One whose slope changes its sign halfway between two second differences, a step h apart, exceeds
    them by 13/24 of the slope times h, and they the next ones by 23/24. A smooth maximum exceeds
    them by less: a parabola by a third of the change at most.
    """
    if len(values) < 2:
        return np.zeros_like(values)
    steps = np.abs(np.diff(values, axis=0))
    before = np.vstack([steps[:1], steps])
    after = np.vstack([steps, steps[-1:]])
    return np.asarray(13.0 / 23.0 * np.maximum(before, after))


def _at_samples(values: Array, count: int) -> Array:
    """Return the larger ones of neighbouring rows until there are as many as samples."""
    while len(values) != count:
        if len(values) < count:
            values = np.vstack([values[:1], values, values[-1:]])
        values = np.maximum(values[:-1], values[1:])
    return values


class EndSpeeds(NamedTuple):
    """Speeds at the first and the last sample, (2, n) each [rad/s or m/s].

    Attributes:
        speeds: magnitudes.
        likely: those that joints at rest may seem to have, by the samples nearby.
        possible: those that joints at rest may seem to have within their limits.
        rounding: those that the last digits may make.
    """

    speeds: Array
    likely: Array
    possible: Array
    rounding: Array


@dataclass(frozen=True, eq=False)
class SampledJoints:
    """Samples of all joints of some robots.

    Attributes:
        trajectory: samples.
        rest: whether the robots are at rest before and after them.
    """

    trajectory: JointTrajectory
    rest: bool

    @property
    def stated(self) -> tuple[int, ...]:
        """Orders of the derivatives that are stated, from 0 for positions."""
        derived = self.trajectory.derived
        return tuple(k for k, kind in enumerate(KINDS[:3]) if kind not in derived)

    def values(self, order: int) -> Array:
        """Return positions, velocities or accelerations (k, n)."""
        each = self.trajectory
        return (each.positions, each.velocities, each.accelerations)[order]

    @property
    def increasing(self) -> bool:
        """True if there are several samples, at increasing times."""
        steps = np.diff(self.trajectory.time)
        return bool(steps.size and np.all(steps > 0.0))

    def source(self, order: int) -> int:
        """Return the order of the stated derivatives from which this one is derived, or is."""
        return max(each for each in self.stated if each <= order)

    def of_kind(self, kind: str) -> Magnitudes:
        """Return magnitudes of "velocity", "acceleration" or "jerk"."""
        order = KINDS_OF_MOTION[kind]
        source = self.source(order)
        if source < min(order, 2):
            return self._derived(source, order - source)
        if order == 3:
            return self._means(source, self.rest)
        found = Magnitudes.exact(self.trajectory.time, np.abs(self.values(order)))
        return found.and_those(self._means(order - 1)) if order - 1 in self.stated else found

    def _means(self, source: int, jumps: bool = False) -> Magnitudes:
        """Return means over steps; at rest, also jumps at the ends."""
        time, values = self._padded(source, 1 if jumps else 0)
        digits = np.maximum(ROUNDING[source], self.trajectory.last_digits(KINDS[source]))
        sizes = np.abs(differences(time, values, 1))
        found = Magnitudes.exact(self._centres(time, 1), sizes, means=True)
        return found._replace(below=_rounded(time, digits, 1))

    def _derived(self, source: int, order: int) -> Magnitudes:
        time, values = self._padded(source, order if self.rest else 0)
        found = differences(time, values, order)
        rounded = _rounded(time, self.trajectory.last_digits(KINDS[source]), order)
        return Magnitudes(
            at=self._centres(time, order),
            sizes=np.abs(found),
            below=rounded,
            above=rounded + peaks_above(found),
            means=np.full(len(found), True),
        )

    def _padded(self, source: int, count: int) -> tuple[Array, Array]:
        """Return times and values with so many rows before and after, at rest."""
        time = self.trajectory.time
        values = self.values(source)
        if len(time) < 2:
            return time, values
        rows = np.arange(1.0, count + 1.0)
        before = time[0] - (time[1] - time[0]) * rows[::-1]
        after = time[-1] + (time[-1] - time[-2]) * rows
        ends = values[[0, -1]] if source == 0 else np.zeros((2, values.shape[1]))
        first, last = (np.tile(end, (count, 1)) for end in ends)
        return np.concatenate([before, time, after]), np.vstack([first, values, last])

    def _centres(self, time: Array, order: int) -> Array:
        """Return the middles of the samples of differences, within the trajectory (m,)."""
        if len(time) <= order:
            return np.zeros(0)
        middles = (time[order:] + time[: len(time) - order]) / 2.0
        return np.clip(middles, *self.trajectory.time[[0, -1]])

    @cached_property
    def accelerations(self) -> tuple[Array, Array]:
        """Accelerations at the samples, and by how much they may be wrong if derived, (k, n)."""
        given = self.trajectory.accelerations
        count = len(given)
        if 2 in self.stated or not self.increasing:
            return given, np.zeros_like(given)
        source = self.source(2)
        time, values = self._padded(source, 1 if self.rest else 0)
        found = differences(time, values, 2 - source)
        if source == 1:  # two means of a step each, around every sample
            found = (found[1:] + found[:-1]) / 2.0
        if len(found) < count:
            found = np.vstack([found[:1], found, found[-1:]])
        return found, _at_samples(self.of_kind("acceleration").above, count)

    def end_speeds(self, limits: JointLimits) -> EndSpeeds:
        """Return speeds at both ends, and how well they are known.

        Derived from the first three positions, they differ by at most J (t1 - t0) (t2 - t0) / 6
        with jerks of at most J: the limit, or about the largest of the differences there, rest
        before included. A joint that starts from rest moves by at most half of its largest
        acceleration times the square of the first step.
        """
        digits = self.trajectory.last_digits(KINDS[self.source(1)])
        if 1 in self.stated:
            speeds = np.abs(self.trajectory.velocities[[0, -1]])
            known = np.tile(np.maximum(ROUNDING[1], digits), (2, 1))
            return EndSpeeds(speeds, known, known, known)
        found = list[Array]()
        time, q = self._padded(0, 3)
        for sign in (1, -1):
            inner = np.abs(time[::sign] - time[::sign][3])[3:6]
            values = q[::sign][3:6]
            first = inner[1]
            slope = differences(inner, values, 1)[0]
            bend = differences(inner, values, 2)[0] / 2.0
            noise = _rounded(inner, digits, 1)[0]
            rounding = noise + first / 2.0 * _rounded(inner, digits, 2)[0]
            # All differences that have one of the first two steps.
            jerk = np.abs(differences(time, q, 3)[::sign][:5]).max(axis=0)
            most = np.where(np.isfinite(limits.jerk), limits.jerk, jerk)
            share = first * inner[2] / 6.0
            too_far = np.abs(slope) > limits.acceleration * first / 2.0 + noise
            likely = share * jerk + rounding
            possible = np.where(too_far, 0.0, share * most + rounding)
            found.append(np.array([np.abs(slope - first * bend), likely, possible, rounding]))
        return EndSpeeds(*np.stack(found, axis=1))

    def between(self, kind: str) -> Magnitudes:
        """Return magnitudes of the quintics between samples, see `within_intervals`."""
        at, values, rounding = self._within(KINDS_OF_MOTION[kind])
        means = np.full(at.shape, False)
        return Magnitudes(at, np.abs(values), rounding, rounding, means)

    def positions_between(self) -> tuple[Array, Array, Array]:
        """Return times, positions of the quintics, and what the last digits change of them."""
        return self._within(0)

    def _within(self, order: int) -> tuple[Array, Array, Array]:
        time = self.trajectory.time
        count = len(self.trajectory.joint_names)
        states = np.array([self.values(each) for each in range(3)])
        digits = np.array([self.trajectory.last_digits(kind) for kind in KINDS[:3]])
        step = np.diff(time)[:, None]
        found = within_intervals(step, states[:, :-1], states[:, 1:], order, digits)
        at = (time[:-1, None] + step * found.shares).ravel()
        return at, found.values.reshape(-1, count), found.rounding.reshape(-1, count)

    def hand_speeds(self, models: Sequence[Model]) -> Magnitudes:
        """Return speeds of the hands of all models (m, models) [m/s].

        With derived velocities, means over steps between positions of the hands.
        """
        ends = np.cumsum([model.dof for model in models])[:-1]
        states = (np.split(self.values(order), ends, axis=1) for order in range(2))
        found = list[Magnitudes]()
        time = self.trajectory.time
        for model, q, v in zip(models, *states, strict=True):
            if 1 in self.stated or not self.increasing:
                found.append(Magnitudes.exact(time, hand_speeds(model, q, v)[:, None]))
                continue
            digits = np.split(self.trajectory.last_digits("position"), ends)[len(found)]
            found.append(_chords(model, time, q, digits))
        return Magnitudes(
            at=found[0].at,
            sizes=np.hstack([each.sizes for each in found]),
            below=np.hstack([each.below for each in found]),
            above=np.hstack([each.above for each in found]),
            means=found[0].means,
        )


def _chords(model: Model, time: Array, q: Array, digits: Array) -> Magnitudes:
    """Return mean speeds of the fastest hand over steps (m, 1) [m/s]."""
    steps = np.diff(time)
    places = [model.frame_pose(hand, q)[1] for hand in model.hands]
    means = np.max([np.linalg.norm(np.diff(each, axis=0), axis=1) for each in places], axis=0)
    speeds = (means / steps)[:, None]
    # Half a digit of each joint at both ends of a step.
    turned = [hand_speeds(model, q, np.tile(each, (len(q), 1))) for each in np.diag(digits)]
    moved = np.sum(turned, axis=0)
    rounded = (np.maximum(moved[:-1], moved[1:]) / steps)[:, None]
    return Magnitudes(
        at=(time[1:] + time[:-1]) / 2.0,
        sizes=speeds,
        below=rounded,
        above=rounded + peaks_above(speeds),
        means=np.full(steps.shape, True),
    )
