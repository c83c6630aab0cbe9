"""Motions of least cost as classes: a running cost in q, q', q'', torque and time.

The default cost is that of Riemannian cubics, int |D_t q'|^2_G / 2 dt = int tau' G^-1 tau / 2 dt.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, TypeAlias

import casadi as ca

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.ocp.problem import Equality, Inequality

Duration: TypeAlias = float | tuple[float, float]


class MotionProblem(ABC):
    """A motion q(t), t in [0, duration], of least int cost dt under conditions.

    A subclass, usually a frozen dataclass whose fields all have defaults, defines `metric`,
    `duration` and `boundary`, and if needed `cost`, `torque`, `constraints`, `via` and `guess`.
    Expressions are built from CasADi SX symbols.

    Attributes:
        metric: metric of the manifold.
        duration: duration of the motion [s], or the shortest and the longest one (two numbers), of
            which the best is found.
        obstacles: stationary obstacles that `go.show` draws; no condition by themselves.
    """

    metric: Metric
    duration: Duration
    obstacles: Sequence[Obstacle] = ()

    @abstractmethod
    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Equality]:
        """Return equalities (expression, value[, name]) in positions and velocities at both ends.

        What they leave free is optimal.
        """

    def cost(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
        """Return the running cost: by default tau' G(q)^-1 tau / 2, tau the `torque`.

        A cost of one is the duration.
        """
        return ca.dot(torque, ca.solve(self.metric.matrix(q), torque)) / 2.0

    def rate_cost(self, q: ca.SX, v: ca.SX, a: ca.SX, jerk: ca.SX, torque_rate: ca.SX) -> Any:
        """Return what jerk q''' and rate of the `torque` add to the running cost: zero.

        If the jerk occurs in it, accelerations and torques are continuous.
        """
        return 0.0

    def torque(self, q: ca.SX, v: ca.SX, a: ca.SX) -> Any:
        """Return the generalised force of the motion: by default G a + Gamma(v, v), no gravity.

        With gravity it is `model.inverse_dynamics(q, v, a)`.
        """
        return self.metric.matrix(q) @ a + self.metric._christoffel_force(q, v, v)

    def constraints(
        self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX
    ) -> Sequence[Inequality]:
        """Return bounds (lower, expression, upper[, name]) along the motion."""
        return ()

    def via(self, q: ca.SX, v: ca.SX) -> Sequence[tuple[float, Sequence[Equality]]]:
        """Return times between 0 and a given duration [s], increasing, each with its equalities."""
        return ()

    def guess(self, t: Array) -> Array | None:
        """Return positions (len(t), n) to start from; None: a cubic spline through what is known.

        Coordinates that no condition determines stay at those of the nearest end, or zero.
        """
        return None


class MotionPhases(ABC):
    """Motions one after the other, each with dynamics, cost, conditions and duration of its own.

    A subclass defines `phases`, and `join` where more than positions and velocities changes from
    one to the next, as at an impact. `boundary` of a phase may be empty where the join says all.
    """

    @property
    @abstractmethod
    def phases(self) -> Sequence[MotionProblem]:
        """The phases in order, in the same coordinates."""

    @property
    def metric(self) -> Metric:
        """Metric of the first phase."""
        return self.phases[0].metric

    @property
    def obstacles(self) -> Sequence[Obstacle]:
        """Obstacles of all phases."""
        return tuple(dict.fromkeys(each for phase in self.phases for each in phase.obstacles))

    def join(self, number: int, q0: ca.SX, v0: ca.SX, q1: ca.SX, v1: ca.SX) -> Sequence[Equality]:
        """Return equalities between the end (q0, v0) of a phase and the start (q1, v1) of the next.

        By default both are equal. `number` is that of the phase that ends, from zero.
        """
        return [(q1 - q0, 0.0, "position"), (v1 - v0, 0.0, "velocity")]
