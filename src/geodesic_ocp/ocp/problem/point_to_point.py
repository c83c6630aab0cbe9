"""PointToPoint: the geodesic between two configurations, and what all such problems share."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import casadi as ca

from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.ocp.nlp.conditions import conditions
from geodesic_ocp.ocp.nlp.structure import Structure
from geodesic_ocp.ocp.problem.path_constraints import Restricted
from geodesic_ocp.ocp.problem.problem import Equality, Problem, key_of


@dataclass(frozen=True)
class PointToPoint(Restricted):
    """The geodesic between two configurations.

    Attributes:
        metric: of the manifold.
        q0, q1: start and goal (n,) [rad or m].
        limits: whether the joints stay within the limits of the metric's model.
        speed: largest |dq_j / ds| [rad or m for the whole path], for all coordinates or (n,); a
            motion at constant speed in a duration T has speeds 1 / T times these. None: any.
        obstacles: balls, capsules and half-spaces that the model's bodies keep clear of.
        links: whose bodies those are; None: of all that move.
        pairs: of links that keep clear of each other.
        margin: least distance [m] from obstacles and in pairs.

    Raises:
        ValueError: wrong shapes or numbers that are not finite, or the metric is singular there;
            limits or obstacles of a metric without a model.
    """

    metric: Metric
    q0: tuple[float, ...]
    q1: tuple[float, ...]

    def __post_init__(self) -> None:
        metric = as_metric(self.metric)
        for name in ("q0", "q1"):
            vector = metric.point(name, getattr(self, name))
            object.__setattr__(self, name, tuple(vector.tolist()))
        self.check_restrictions()

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        """Both ends."""
        return [(q0, self.q0, "start"), (q1, self.q1, "goal")]

    @property
    def structure(self) -> Hashable:
        """The metric, or its identity where it has no hash, and what constraints there are."""
        key = key_of(self.metric)
        return (key, *self.restrictions) if self.restrictions else key


def structure_of_geodesics(metric: Metric) -> Structure:
    """The structure of every `PointToPoint` in the metric, wherever its ends may be."""
    return Structure((PointToPoint, key_of(metric)), metric, conditions(_Anywhere(metric)))


@dataclass(frozen=True, eq=False)
class _Anywhere(Problem):
    """Fixed ends, of which nothing is asked."""

    metric: Metric

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        return [(q0, 0.0), (q1, 0.0)]
