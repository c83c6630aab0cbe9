"""PointToPoint: the geodesic between two configurations."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import casadi as ca

from geodesic_ocp.arrays import ShortRepr
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.ocp.nlp import Structure
from geodesic_ocp.ocp.path_constraints import ConstrainedProblem
from geodesic_ocp.ocp.problem import Equality, Problem, key_of


@dataclass(frozen=True, repr=False)
class PointToPoint(ShortRepr, ConstrainedProblem):
    """The geodesic between two configurations.

    Attributes:
        metric: of the manifold.
        q0, q1: start and goal (n,) [rad or m].
        limits: whether the joints stay within the limits of the metric's model.
        speed: largest |dq_j / ds| [rad or m over the whole path], one for all coordinates or (n,);
            a motion at constant speed that lasts T has joint speeds 1 / T times these. None: no
            limit.
        obstacles: balls, capsules and half-spaces that the collision bodies keep clear of.
        links: links whose bodies keep clear of obstacles; None: all that move.
        pairs: pairs of links that keep clear of each other.
        margin: smallest distance [m] from obstacles and within pairs.

    Raises:
        ValueError: wrong shapes or numbers that are not finite, or the metric is singular there;
            limits or obstacles of a metric without a model.

    >>> import geodesic_ocp as go
    >>> line = go.PointToPoint(go.Euclidean(2), (0.0, 0.0), (3.0, 4.0), speed=5.0)
    >>> round(go.solve(line).path.length, 6)
    5.0
    """

    metric: Metric
    q0: tuple[float, ...]
    q1: tuple[float, ...]

    def __post_init__(self) -> None:
        metric = as_metric(self.metric)
        for name in ("q0", "q1"):
            vector = metric.point(name, getattr(self, name))
            object.__setattr__(self, name, tuple(vector.tolist()))
        self.check_path_constraints()

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        """Both ends."""
        return [(q0, self.q0, "start"), (q1, self.q1, "goal")]

    @property
    def structure(self) -> Hashable:
        """The metric, or its identity if it has no hash, and which constraints there are."""
        key = key_of(self.metric)
        return (key, *self.constraint_key) if self.constraint_key else key


def geodesic_structure(metric: Metric) -> Structure:
    """The structure shared by every unconstrained `PointToPoint` in the metric."""
    conditions = _FixedEnds(metric).definition().conditions
    return Structure((PointToPoint, key_of(metric)), metric, conditions)


@dataclass(frozen=True, eq=False)
class _FixedEnds(Problem):
    """Fixed ends, which are not checked: there may be no metric at them."""

    metric: Metric

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        return [(q0, 0.0), (q1, 0.0)]
