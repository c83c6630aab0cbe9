"""Stops of an arm: after each step of a command it can still come to rest within its limits.

A step is taken only if a stop from its end is known. Else it is changed towards the step that the
stop known before begins with, at last into that: by induction there is always one. (Fraichard,
Asama, "Inevitable collision states - a step towards safer robots?", Advanced Robotics 18, 2004.)
Stops are sequences of speeds, constant over a step each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.limits import JointLimits, usable_torque
from geodesic_ocp.model.model import Model

_SHARES = np.array([1.0, 0.5])  # of the largest accelerations, with which joints brake
_COUNTS = np.array([2, 4, 8, 15, 27, 50, 90])  # of steps of a stop
_BEST = 2  # stops between which and the known one a share of the step is sought
_LESS = 0.9, 0.5  # of that share, as torques are not quite linear
_TORQUE = 0.975  # share of the limits of torque, unless it takes more to hold the arm
_ROUNDING, _UNLIMITED = 1e-9, 1e9


@dataclass(frozen=True, eq=False)
class Stops:
    """Stops within limits of range, speed, acceleration, torque, torque rate and the hand's speed.

    Attributes:
        model, limits: model and limits of its joints.
        step: duration of a step [s].
        gravity: of free fall, in axes of the base (3,) [m/s^2].
    """

    model: Model
    limits: JointLimits
    step: float
    gravity: Array

    def after(
        self, q: Array, previous: Array, force: Array, speeds: Array, known: Array
    ) -> tuple[Array, Array]:
        """Return the speeds (n,) of the step that begins at q (n,), and a stop (k, n) after it.

        In the stops that are tried, each joint brakes evenly, or speeds are cubic polynomials of
        time with the slope between those before and those that are wanted. If they exceed limits,
        mixtures with the known stop are tried, by as much as torques that are linear in the speeds
        would allow.

        Args:
            q, previous: configuration, and speeds of the step before.
            force: torques (n,) at the beginning of the step before.
            speeds: speeds (n,) that are wanted.
            known: a stop (k, n) after the step before.
        """
        slower = self.step * self.limits.acceleration * (1.0 - _ROUNDING) * _SHARES[:, None]
        counts = np.ceil(np.max(np.abs(speeds) / slower, axis=1)).astype(int)
        counts = np.append(np.clip(counts, 1, _COUNTS[-1]), _COUNTS)
        given, k = (q, previous, force), 2 + max(len(known), _COUNTS[-1])
        steps = np.arange(k)[:, None]
        x = np.minimum(steps / _COUNTS[:, None, None], 1.0)
        slope = _COUNTS[:, None, None] * (speeds - previous)
        with np.errstate(invalid="ignore"):
            less = np.where(steps > 0, steps * slower[:, None], 0.0)
        evenly = np.sign(speeds) * np.maximum(np.abs(speeds) - less, 0.0)
        evenly[:, _COUNTS[-1] :] = 0.0
        tried = np.concatenate([evenly, (1.0 - x) ** 2 * ((1.0 + 2.0 * x) * speeds + x * slope)])
        stop = np.vstack([known, np.zeros((k - len(known), q.size))])
        room = self._room(*given, tried, counts)
        if not (kept := (room >= 0.0).all(axis=(1, 2))).any():
            here = np.clip(self._room(*given, stop[None], np.array([k])), 0.0, _UNLIMITED)
            short = np.maximum(-room, 0.0)
            shares = 1.0 - (short / np.maximum(here + short, _ROUNDING)).max(axis=(1, 2))
            best = np.argsort(-shares, kind="stable")[:_BEST]
            share = np.outer(_LESS, shares[best]).ravel()[:, None, None]
            tried = stop + share * np.tile(tried[best] - stop, (len(_LESS), 1, 1))
            lasting = np.maximum(len(known), np.tile(counts[best], len(_LESS)))
            kept = (self._room(*given, tried, lasting) >= 0.0).all(axis=(1, 2))
        stop = tried[np.argmax(kept)] if kept.any() else stop
        moving = np.flatnonzero(np.any(stop != 0.0, axis=1))
        return stop[0], stop[1 : 2 + max(moving, default=0)]

    def _room(self, q: Array, previous: Array, force: Array, speeds: Array, counts: Array) -> Array:
        """Return what is left of each limit (c, k, m) at speeds (c, k, n) from q on, which are zero
        after so many steps (c,).
        """
        limits, h, model = self.limits, self.step, self.model
        some = np.arange(speeds.shape[1]) <= counts[:, None] + 1  # up to the first one at rest
        first = np.broadcast_to(previous, (len(speeds), 1, q.size))
        before = np.concatenate([first, speeds[:, :-1]], axis=1)[some]
        ends, speed = (q + h * np.cumsum(speeds, axis=1))[some], speeds[some]
        begins, growth = ends - h * speed, (speed - before) / h
        found = [
            limits.velocity - np.abs(speed),
            limits.acceleration - np.abs(growth),
            ends - model.lower,
            model.upper - ends,
        ]
        if np.isfinite([limits.torque, limits.torque_rate]).any():
            still = np.zeros_like(begins)
            moving, holding = (begins, (before + speed) / 2.0, growth), (begins, still, still)
            q, v, a = map(np.vstack, zip(moving, holding, strict=True))
            torque, held = np.split(model.inverse_dynamics(q, v, a, self.gravity), 2)
            usable = usable_torque(limits.torque, np.abs(held), _TORQUE)
            then = np.vstack([force[None], torque[:-1]])
            then[np.concatenate([[0], some.sum(axis=1).cumsum()[:-1]])] = force
            found += [usable - np.abs(torque), limits.torque_rate - np.abs(torque - then) / h]
        if np.isfinite(limits.hand_speed):
            here, there = np.split(model.hand_pose(np.vstack([begins, ends]))[1], 2)
            way = np.linalg.norm(there - here, axis=1, keepdims=True)
            found.append(limits.hand_speed - way / h)
        room = np.full((*some.shape, sum(each.shape[1] for each in found)), np.inf)
        room[some] = np.hstack(found) + _ROUNDING
        return room
