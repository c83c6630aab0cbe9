"""Predictions of a recorded motion of second and higher order: cubics, splines, least effort."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple

import casadi as ca
import numpy as np
from scipy.interpolate import CubicSpline

from geodesic_ocp.arrays import Array
from geodesic_ocp.logarithm.cubics import cubic, spline
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.motion_problem import MotionProblem
from geodesic_ocp.ocp.problem import Equality
from geodesic_ocp.ocp.solve import solve
from geodesic_ocp.synergies.baselines import minimum_acceleration, minimum_jerk, minimum_jerk_hand
from geodesic_ocp.synergies.segment import observed_velocity
from geodesic_ocp.synergies.synergy import as_segments
from geodesic_ocp.trajectory.motion import Motion

# In place of |x|, sqrt(x^2 + c^2) - c [W]: the joints of an arm have some 1 to 10 W.
_CORNER = 0.5


@dataclass(frozen=True, eq=False)
class ThroughStates(MotionProblem):
    """A motion through recorded configurations and velocities at the ends of segments."""

    metric: Metric  # metric that gives the torques
    model: Model  # model whose weight the joints carry, where a cost includes gravity
    recorded: Motion  # the recording
    velocity: Array  # its velocities (k, n)
    # indices of the samples, the first and the last of the recording among them
    edges: Sequence[int]

    @property
    def duration(self) -> float:  # type: ignore[override]
        """Duration of the recording [s]."""
        return self.recorded.duration

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Equality]:
        """Return the states at both ends."""
        q = self.recorded.q
        v = self.velocity
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
    found = solve(kind(metric, model, motion, velocity, edges))
    t = motion.time - motion.time[0]
    return Motion(motion.time, found(t), motion.joint_names, found(t, 1), motion.subject)


def riemannian_cubics(
    metric: Metric, motion: Motion, segments: Sequence[tuple[int, int]]
) -> Motion:
    """Return the Riemannian cubic on every segment, between observed configurations and velocities.

    It minimizes int |D_t q'|^2_G dt, of which `minimum_acceleration` is the case of a constant
    metric, and receives what that receives.

    Args:
        metric: metric of the manifold.
        motion: observed, with velocities.
        segments: (start, stop) sample indices, each starting where the one before stopped, from
            the first sample to the last.

    Returns:
        The predicted motion at the recording's own times, with velocities.

    Raises:
        ValueError: the segments do not cover the motion, or there are no velocities.
        NotConverged: no cubic was found.
    """
    velocity = observed_velocity(motion)
    q = np.array(motion.q)
    v = np.array(velocity)
    for start, stop in as_segments(motion, segments):
        t = motion.time[start : stop + 1] - motion.time[start]
        part = cubic(
            metric, motion.q[start], velocity[start], motion.q[stop], velocity[stop], t[-1]
        )
        q[start : stop + 1] = part(t)
        v[start : stop + 1] = part(t, 1)
    return _like(motion, q, v)


def riemannian_spline(
    metric: Metric, motion: Motion, segments: Sequence[tuple[int, int]]
) -> Motion:
    """Return the Riemannian spline through the observed configurations at the segments' ends.

    It also receives the velocities at the first and the last sample; velocities in between are
    optimal. See `riemannian_cubics`.
    """
    time, q, velocities = _knots(motion, segments)
    found = spline(metric, time, q, v0=velocities[0], v1=velocities[1])
    return _like(motion, found(motion.time), found(motion.time, 1))


def cubic_spline(motion: Motion, segments: Sequence[tuple[int, int]]) -> Motion:
    """Return the cubic spline of every joint through the configurations at the segments' ends.

    It minimizes int |q''|^2 dt and receives what `riemannian_spline` receives.
    """
    time, q, velocities = _knots(motion, segments)
    found = CubicSpline(time, q, bc_type=((1, velocities[0]), (1, velocities[1])))
    return _like(motion, found(motion.time), found(motion.time, 1))


def _knots(
    motion: Motion, segments: Sequence[tuple[int, int]]
) -> tuple[Array, Array, tuple[Array, Array]]:
    """Return times and configurations at the segments' ends, and both end velocities."""
    edges = [0, *(stop for _, stop in as_segments(motion, segments))]
    velocity = observed_velocity(motion)
    return motion.time[edges], motion.q[edges], (velocity[0], velocity[-1])


def _like(motion: Motion, q: Array, velocity: Array) -> Motion:
    return Motion(motion.time, q, motion.joint_names, velocity, motion.subject)


OF_A_GEODESIC = "2 configurations, 2 speeds"
_TWO_STATES = "2 configurations, 2 velocities"
_KNOTS = "1 configuration; 2 velocities of the recording"
_Segments = Sequence[tuple[int, int]]


class SecondOrder(NamedTuple):
    """A prediction of second or higher order.

    Attributes:
        predict: gives the motion for a metric, a model, the observed motion and its segments.
        receives: what it receives for a segment, besides the duration.
        counterpart: name of what receives the same and needs neither metric nor model, if any.
        is_slow: whether it takes seconds for a recording.
    """

    predict: Callable[[Metric, Model, Motion, _Segments], Motion]
    receives: str
    counterpart: str | None = None
    is_slow: bool = False


def _effort(kind: type[ThroughStates], receives: str = _TWO_STATES) -> SecondOrder:
    return SecondOrder(partial(least_effort, kind), receives, _FLAT_CUBIC, True)


_FLAT_CUBIC = "minimum acceleration"
_FLAT_SPLINE = "cubic spline"
# By their names in tables.
SECOND_ORDER = {
    "Riemannian cubics": SecondOrder(
        lambda metric, _, *given: riemannian_cubics(metric, *given), _TWO_STATES, _FLAT_CUBIC
    ),
    _FLAT_CUBIC: SecondOrder(lambda *given: minimum_acceleration(*given[2:]), _TWO_STATES),
    "Riemannian spline": SecondOrder(
        lambda metric, _, *given: riemannian_spline(metric, *given), _KNOTS, _FLAT_SPLINE
    ),
    _FLAT_SPLINE: SecondOrder(lambda *given: cubic_spline(*given[2:]), _KNOTS),
    "minimum jerk": SecondOrder(
        lambda *given: minimum_jerk(*given[2:]), f"{_TWO_STATES}, 2 accelerations"
    ),
    "minimum jerk of the hand": SecondOrder(
        lambda _, *given: minimum_jerk_hand(*given),
        "1 configuration, 2 hand poses, velocities, accelerations",
    ),
    "least torque": _effort(LeastTorque),
    "least torque change": _effort(LeastTorqueChange, f"{_TWO_STATES}; torques continuous"),
    "least work": _effort(LeastWork),
    "least work and acceleration": _effort(LeastWorkAndAcceleration),
}


def second_order_names(effort: bool) -> list[str]:
    """Return the names of the predictions, with those of least effort if wanted."""
    return [name for name, each in SECOND_ORDER.items() if effort or not each.is_slow]
