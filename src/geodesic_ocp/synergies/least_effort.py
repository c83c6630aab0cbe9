"""Motions of least effort through recorded states: least torque, torque change and work.

Costs that were proposed for the arm movements of people, with the inertia of a metric.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.motion_problem import MotionProblem, solve_motion
from geodesic_ocp.ocp.problem import Equality
from geodesic_ocp.synergies.segment import observed_velocity
from geodesic_ocp.synergies.synergy import as_segments
from geodesic_ocp.trajectory.motion import Motion

# In place of |x|, sqrt(x^2 + c^2) - c [W]: the joints of an arm have some 1 to 10 W.
_CORNER = 0.5


@dataclass(frozen=True, eq=False)
class ThroughStates(MotionProblem):
    """A motion through recorded configurations and velocities at the ends of segments.

    Attributes:
        metric: metric that gives the torques.
        model: model whose weight the joints carry, where a cost includes gravity.
        recorded: the recording.
        velocity: its velocities (k, n).
        edges: indices of the samples, the first and the last of the recording among them.
    """

    metric: Metric
    model: Model
    recorded: Motion
    velocity: Array
    edges: Sequence[int]

    @property
    def duration(self) -> float:  # type: ignore[override]
        """Duration of the recording [s]."""
        return self.recorded.duration

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Equality]:
        """Return the states at both ends."""
        q, v = self.recorded.q, self.velocity
        return [(q0, q[0]), (q1, q[-1]), (v0, v[0]), (v1, v[-1])]

    def via(self, q: ca.SX, v: ca.SX) -> Sequence[tuple[float, Sequence[Equality]]]:
        """Return the states where segments meet."""
        since = self.recorded.time - self.recorded.time[0]
        return [
            (float(since[k]), [(q, self.recorded.q[k]), (v, self.velocity[k])])
            for k in self.edges[1:-1]
        ]


class LeastTorque(ThroughStates):
    """Least int tau' tau dt, without gravity (Nelson, Biological Cybernetics 46, 1983)."""

    def cost(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
        """Return tau' tau [(N m)^2]."""
        return ca.dot(torque, torque)


class LeastTorqueChange(ThroughStates):
    """Least int |d tau/dt|^2 dt, without gravity (Uno, Kawato, Suzuki, Biological Cybernetics 61,
    1989, who move in a horizontal plane).

    Torques are continuous where segments meet.
    """

    def cost(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
        """Return zero."""
        return 0.0

    def rate_cost(self, q: ca.SX, v: ca.SX, a: ca.SX, jerk: ca.SX, torque_rate: ca.SX) -> Any:
        """Return |d tau/dt|^2 [(N m/s)^2]."""
        return ca.dot(torque_rate, torque_rate)


class LeastWorkAndAcceleration(ThroughStates):
    """Least int (sum_i |tau_i q_i'| + w |q''|^2) dt, with gravity: the absolute work of the joint
    torques and the smoothness of the joints (Berret, Chiovetto, Nori, Pozzo, PLoS Computational
    Biology 7(10), 2011).

    The weight w is not theirs: it was fitted (docs/explanation/second_order.md).
    """

    weight: ClassVar[float] = 0.3  # [J s^3]

    def torque(self, q: ca.SX, v: ca.SX, a: ca.SX) -> Any:
        """Return the generalised force with gravity."""
        rest = ca.SX.zeros(*q.shape)
        return super().torque(q, v, a) + self.model.inverse_dynamics(q, rest, rest)

    def cost(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
        """Return absolute power and weighted acceleration [W]."""
        power = ca.sum1(ca.sqrt((torque * v) ** 2 + _CORNER**2) - _CORNER)
        return power + self.weight * ca.dot(a, a)


class LeastWork(LeastWorkAndAcceleration):
    """The same with so small a weight that the motion is just unique: the cost of energy."""

    weight: ClassVar[float] = 0.01


def least_effort(
    kind: type[ThroughStates],
    metric: Metric,
    model: Model,
    motion: Motion,
    segments: Sequence[tuple[int, int]],
) -> Motion:
    """Return the motion of least effort through the observed states at the segments' ends.

    All segments are one program, in which they do not depend on each other unless torques are
    continuous. It receives what `minimum_acceleration` receives.

    Args:
        kind: which effort.
        metric: metric that gives the torques, such as the kinetic energy.
        model: model whose weight the joints carry.
        motion: observed, with velocities.
        segments: (start, stop) sample indices that cover the motion.

    Raises:
        ValueError: the segments do not cover the motion, or there are no velocities.
        NotConverged: Ipopt found no such motion.
    """
    velocity = observed_velocity(motion)
    edges = [0, *(stop for _, stop in as_segments(motion, segments))]
    found = solve_motion(kind(metric, model, motion, velocity, edges))
    t = motion.time - motion.time[0]
    return Motion(motion.time, found(t), motion.joint_names, found(t, 1), motion.subject)
