"""Stops of an arm: after each step of a command it can still come to rest within its limits.

A step is taken only if a stop from its end is known. Else it is changed towards the step that the
stop known before begins with, at last into that: by induction there is always one. (Fraichard,
Asama, "Inevitable collision states - a step towards safer robots?", Advanced Robotics 18, 2004.)
Stops are sequences of speeds, constant over a step each. Torques, their rates and speeds of the
hand are those of the command, which moving averages of these speeds make smooth (`Averages`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.limits import JointLimits, usable_torque
from geodesic_ocp.model.model import Model

# Shares of the largest rates of acceleration, and of the largest accelerations, with which joints
# brake, from hard to soft.
_RATES = np.array([1.0, 0.6, 0.36, 0.2, 0.1])
_SHARES = np.array([1.0, 0.9, 0.7, 0.5, 0.3])
_LONGEST = 90  # steps of a stop
_BEST = 2  # stops between which and the known one a share of the step is sought
_LESS = 0.9, 0.5  # of that share, as torques are not quite linear
_HELD = 0.1  # share of the torque that is counted on where holding the arm takes the rest
# left to the rounding of sums, and of limits
_SUMS = 1e-11
_ROUNDING = 1e-9
_UNLIMITED = 1e9


@dataclass(frozen=True, eq=False)
class Averages:
    """A command, the average over m steps of the average over a step of speeds constant in steps.

    Attributes:
        step: duration of a step [s].
        past: speeds (m + 1, n) of the last steps.
        position, velocity, acceleration, torque: of the command at their end (n,).
    """

    step: float
    past: Array
    position: Array
    velocity: Array
    acceleration: Array
    torque: Array

    @property
    def count(self) -> int:
        """Number m of steps of the second average."""
        return len(self.past) - 1

    def states(self, speeds: Array) -> tuple[Array, Array, Array]:
        """Return positions, velocities and accelerations (c, k, n) of the command after each of
        the steps that follow, at speeds (c, k, n). Between them its jerk is constant.
        """
        h = self.step
        count = self.count
        past = np.broadcast_to(self.past, (len(speeds), *self.past.shape))
        every = np.concatenate([past, speeds], axis=1)
        first = every[:, 1:-count]
        last = every[:, count + 1 :]
        sums = np.cumsum(every, axis=1)
        sums = sums[:, count + 1 :] - sums[:, : -count - 1]
        # The first average, over a step, has these speeds at the ends of the steps.
        v = (sums - (first + last) / 2.0) / count
        a = (last - first) / (h * count)
        v_before, a_before = (
            np.concatenate([np.broadcast_to(now, (len(each), 1, now.size)), each[:, :-1]], axis=1)
            for now, each in ((self.velocity, v), (self.acceleration, a))
        )
        moved = h * (v_before + h * (a_before / 3.0 + a / 6.0))
        return self.position + np.cumsum(moved, axis=1), v, a

    def after(self, speeds: Array, model: Model, gravity: Array) -> Averages:
        """Return the command after a step at speeds (n,)."""
        q, v, a = (each[0, 0] for each in self.states(speeds[None, None]))
        past = np.vstack([self.past[1:], speeds])
        return Averages(self.step, past, q, v, a, model.inverse_dynamics(q, v, a, gravity))


@dataclass(frozen=True, eq=False)
class Stops:
    """Stops within limits of range, speed, acceleration, torque, torque rate and the hand's speed.

    Attributes:
        model, limits: model and limits of its joints.
        gravity: of free fall, in axes of the base (3,) [m/s^2].
    """

    model: Model
    limits: JointLimits
    gravity: Array

    def after(self, q: Array, sent: Averages, speeds: Array, known: Array) -> tuple[Array, Array]:
        """Return the speeds (n,) of the step that begins at q (n,), and a stop (k, n) after it.

        If the stops that are tried exceed limits, mixtures with the known stop are tried, by as
        much as torques that are linear in the speeds would allow.

        Args:
            q: configuration that the steps so far lead to.
            sent: command after these steps.
            speeds: speeds (n,) that are wanted.
            known: a stop (k, n) after the step before.
        """
        size = max(len(known), _LONGEST) + sent.count + 1
        stop = np.vstack([known, np.zeros((size - len(known), q.size))])
        tried = self._tried(q, sent, speeds, stop)
        room = self._room(q, sent, tried)
        if not (kept := (room >= 0.0).all(axis=(1, 2))).any():
            shares = _share(self._room(q, sent, stop[None]), room).min(axis=(1, 2))
            best = np.argsort(-shares, kind="stable")[:_BEST]
            share = np.outer(_LESS, shares[best]).ravel()[:, None, None]
            tried = stop + share * np.tile(tried[best] - stop, (len(_LESS), 1, 1))
            kept = (self._room(q, sent, tried) >= 0.0).all(axis=(1, 2))
        stop = tried[np.argmax(kept)] if kept.any() else stop
        moving = np.flatnonzero(np.any(stop != 0.0, axis=1))
        return stop[0], stop[1 : 2 + max(moving, default=0)]

    def _tried(self, q: Array, sent: Averages, speeds: Array, known: Array) -> Array:
        """Return stops (c, k, n) that begin with a step at speeds (n,), from hard to soft.

        Each joint comes to rest with limited acceleration and rate of acceleration, in the least
        time: its acceleration becomes -b, stays, and becomes zero. Where a soft stop of a joint
        exceeds its range, speed or acceleration, or takes too long, it has the softest that does
        not, or a mixture of the hardest and of the stop (k, n) that is known.
        """
        limits = self.limits
        h = sent.step
        still = np.zeros_like(q)
        inertia = np.diag(self.model.mass_matrix(q))
        held = np.abs(self.model.inverse_dynamics(q, still, still, self.gravity))
        free = np.maximum(limits.torque - held, _HELD * limits.torque)
        rate = np.outer(_RATES, np.minimum(limits.torque_rate / inertia, _UNLIMITED))
        largest = np.minimum(np.minimum(limits.acceleration, free / inertia), _UNLIMITED)
        begun = (speeds - sent.past[-1]) / h
        away = np.where(speeds + begun * np.abs(begun) / (2.0 * rate) < 0.0, -1.0, 1.0)
        v = away * speeds
        a = away * begun
        # Braking: from a to -b, at -b, and from there to zero.
        b = np.sqrt(np.maximum(rate * v + a**2 / 2.0, 0.0))
        b = np.minimum(b, np.maximum((1.0 - _ROUNDING) * np.outer(_SHARES, largest), -a))
        first = (a + b) / rate
        last = b / rate
        lower = v + (a**2 - b**2) / (2.0 * rate)  # speed where the acceleration becomes -b
        middle = np.maximum(lower - b * last / 2.0, 0.0) / np.maximum(b, _ROUNDING)
        end = first + middle + last
        t = h * np.arange(len(known))[:, None]
        first, middle, last, v, a, b, rate, away, end, lower = (
            np.broadcast_to(each, rate.shape)[:, None]
            for each in (first, middle, last, v, a, b, rate, away, end, lower)
        )
        found = away * np.where(
            t < first,
            v + t * (a - rate * t / 2.0),
            np.where(
                t < first + middle,
                lower - b * (t - first),
                rate * np.maximum(end - t, 0.0) ** 2 / 2.0,
            ),
        )
        found[:, 0] = speeds
        here, room = (self._joint_room(q, sent, each) for each in (known[None], found))
        shares = np.where(end[:, 0] <= h * _LONGEST, _share(here, room).min(axis=(0, 2)), 0.0)
        softest = np.where(shares == 1.0, np.arange(len(found))[:, None], 0)
        chosen = np.maximum.accumulate(softest, axis=0)
        share, found = (
            np.take_along_axis(each, chosen[:, None], axis=0) for each in (shares[:, None], found)
        )
        return np.asarray(known + share * (found - known))

    def _joint_room(self, q: Array, sent: Averages, speeds: Array) -> Array:
        """Return what is left of speeds, accelerations and ranges (4, c, k, n)."""
        before = np.broadcast_to(sent.past[-1], (len(speeds), 1, q.size))
        growth = np.diff(np.concatenate([before, speeds], axis=1), axis=1) / sent.step
        ends = q + sent.step * np.cumsum(speeds, axis=1)
        left = [
            self.limits.velocity - np.abs(speeds),
            self.limits.acceleration - np.abs(growth),
            ends - self.model.lower,
            self.model.upper - ends,
        ]
        return np.array(left) - _SUMS

    def _room(self, q: Array, sent: Averages, speeds: Array) -> Array:
        """Return what is left of each limit (c, k, m) at speeds (c, k, n) from q on, until the
        command is at rest.
        """
        limits = self.limits
        h = sent.step
        model = self.model
        steps = np.arange(speeds.shape[1])
        last = np.max(steps * np.any(speeds != 0.0, axis=2), axis=1)
        some = steps <= last[:, None] + sent.count + 1
        room = [each[some] for each in self._joint_room(q, sent, speeds)]
        q, v, a = (each[some] for each in sent.states(speeds))
        if np.isfinite([limits.torque, limits.torque_rate]).any():
            still = np.zeros_like(v)
            both = (np.vstack([q, q]), np.vstack([v, still]), np.vstack([a, still]))
            torque, held = np.split(model.inverse_dynamics(*both, self.gravity), 2)
            then = np.vstack([sent.torque[None], torque[:-1]])
            then[np.concatenate([[0], some.sum(axis=1).cumsum()[:-1]])] = sent.torque
            usable = usable_torque(limits.torque, np.abs(held), 1.0)
            room += [usable - np.abs(torque), limits.torque_rate - np.abs(torque - then) / h]
        if np.isfinite(limits.hand_speed):
            ways = np.vstack([q - h / 2.0 * v, q + h / 2.0 * v])
            here, there = np.split(model.hand_pose(ways)[1], 2)
            room.append(limits.hand_speed - np.linalg.norm(there - here, axis=1)[:, None] / h)
        left = np.full((*some.shape, sum(each.shape[1] for each in room)), np.inf)
        left[some] = np.hstack(room) + _ROUNDING
        return left


def _share(here: Array, there: Array) -> Array:
    """Return how far from here to there what is left of limits is not negative, if linear."""
    here = np.clip(here, 0.0, _UNLIMITED)
    short = np.maximum(-there, 0.0)
    return np.asarray(1.0 - short / np.maximum(here + short, _ROUNDING))
