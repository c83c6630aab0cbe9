"""Problems of the package: from configuration to configuration, or to a pose of the hand."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_rotation, as_vector, settle
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.manifold.metrics import metric_of
from geodesic_ocp.model.distances import as_pair, clearance_constraints
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.ocp.inverse_kinematics import configurations
from geodesic_ocp.ocp.nlp import ProblemDefinition
from geodesic_ocp.ocp.pose_search import (
    CollisionAvoidance,
    PoseSearch,
    as_directions,
    complement,
    rotation_log,
)
from geodesic_ocp.ocp.problem import Equality, Inequality, Problem, key_of

_NEEDS_MODEL = {"limits": "limits", "obstacles": "bodies", "pairs": "bodies"}


@dataclass(frozen=True, eq=False, kw_only=True)
class ConstrainedProblem(Problem):
    """A problem with optional limits on joints, speed and distances along the path.

    Attributes:
        limits: whether the joints stay within the limits of the metric's model.
        speed: largest |dq_j / ds| [rad or m over the whole path], one for all coordinates or (n,).
            Motions keep it as speeds of the joints [rad/s or m/s], so that where it is reached one
            from rest to rest takes 1.5 s or more (`Solution.to_motion`). None: no limit.
        obstacles: balls, capsules, boxes and half-spaces that the collision bodies keep clear of.
        links: links whose bodies keep clear of obstacles; None: all that move.
        pairs: pairs of links that keep clear of each other.
        margin: smallest distance [m] from obstacles and within pairs.
    """

    limits: bool = False
    speed: float | tuple[float, ...] | None = None
    obstacles: tuple[Obstacle, ...] = ()
    links: tuple[str, ...] | None = None
    pairs: tuple[tuple[str, str], ...] = ()
    margin: float = 0.0

    def check_path_constraints(self) -> None:
        """Check and convert the fields of this class; subclasses call it when they are created.

        Raises:
            ValueError: wrong shapes or values, links without bodies, or a metric without a model.
        """
        settle(self, speed=_as_speed(self.speed, self.metric.dim))
        for keyword in ("obstacles", "links", "pairs"):
            given = getattr(self, keyword)
            if given is not None and not isinstance(given, (list, tuple)):
                raise ValueError(f"{keyword} must be a list, got {given!r}")
        settle(self, obstacles=tuple(self.obstacles))
        settle(self, pairs=tuple(map(as_pair, self.pairs)))
        if self.links is not None:
            settle(self, links=tuple(self.links))
        for keyword, what in _NEEDS_MODEL.items():
            if getattr(self, keyword) and self._model is None:
                kind = type(self.metric).__name__
                raise ValueError(f"{keyword}: {kind} has no model with {what}")
        q, v = (ca.SX.sym(name, self.metric.dim) for name in "qv")
        self.constraints(q, v)

    @property
    def _model(self) -> Model | None:
        return getattr(self.metric, "model", None)

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Inequality]:
        """Return the requested constraints on joint limits, speed and distances."""
        conditions: list[Inequality] = []
        model = self._model
        if self.limits and model is not None:
            conditions.append((model.lower, q, model.upper, "joint limits"))
        if self.speed is not None:
            conditions.append((-np.array(self.speed), v, np.array(self.speed), "speed"))
        if model is not None and (self.obstacles or self.pairs):
            conditions += clearance_constraints(
                model,
                q,
                self.obstacles,
                links=self.links,
                pairs=self.pairs,
                margin=self.margin,
            )
        return conditions

    @property
    def constraint_key(self) -> tuple[Hashable, ...]:
        """The constraints that there are, for `structure`; empty if there are none."""
        if not (self.limits or self.speed or self.obstacles or self.pairs):
            return ()
        bodies = (self.obstacles, self.links, self.pairs)
        return (self.limits, self.speed is None, *map(key_of, bodies))


def _as_speed(speed: Any, dim: int) -> tuple[float, ...] | None:
    """Return the largest speeds (n,) of one number or n of them; ValueError if they are not
    positive.
    """
    if speed is None:
        return None
    speeds = as_vector("speed", np.broadcast_to(speed, dim) if np.ndim(speed) == 0 else speed, dim)
    if not np.all(speeds > 0.0):
        raise ValueError(f"speed must be positive, got {speed!r}")
    return tuple(speeds.tolist())


@dataclass(frozen=True, repr=False)
class PointToPoint(ShortRepr, ConstrainedProblem):
    """The geodesic between two configurations.

    Attributes:
        metric: metric of the manifold.
        q0, q1: start and goal (n,) [rad or m].
        limits: whether the joints stay within the limits of the metric's model.
        speed: largest |dq_j / ds| [rad or m over the whole path], one for all coordinates or (n,).
            Motions keep it as speeds of the joints [rad/s or m/s], so that where it is reached one
            from rest to rest takes 1.5 s or more (`Solution.to_motion`). None: no limit.
        obstacles: balls, capsules, boxes and half-spaces that the collision bodies keep clear of.
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
            settle(self, **{name: tuple(vector.tolist())})
        self.check_path_constraints()

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        """Return both ends."""
        return [(q0, self.q0, "start"), (q1, self.q1, "goal")]

    @property
    def structure(self) -> Hashable:
        """The metric, or its identity if it has no hash, and which constraints there are."""
        key = key_of(self.metric)
        return (key, *self.constraint_key) if self.constraint_key else key


def geodesic_definition(metric: Metric) -> ProblemDefinition:
    """Return what every unconstrained `PointToPoint` in the metric has in common."""
    return replace(_FixedEnds(metric).definition(), key=(PointToPoint, key_of(metric)))


@dataclass(frozen=True, eq=False)
class _FixedEnds(Problem):
    """Fixed ends, which are not checked: there may be no metric at them."""

    metric: Metric

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        return [(q0, 0.0), (q1, 0.0)]


@dataclass(frozen=True, eq=False, repr=False)
class Reach(ShortRepr, ConstrainedProblem):
    """The path of least energy from a configuration to a pose of the hand.

    The position of the hand, its orientation, or both are prescribed at the end; whatever they
    leave open of the final configuration is free, so that the path arrives orthogonally to all
    configurations with that pose (transversality). Initial guesses are straight lines to
    configurations found by inverse kinematics. Start and pose can change without a new NLP.

    Attributes:
        model: model whose hand (end-effector) reaches; the metric is its kinetic energy.
        start: configuration (n,) [rad or m].
        position: position of the hand at the end, in the base frame, (3,) [m]; None leaves it free.
        rotation: rotation of the hand at the end, (3, 3); None leaves it free.
        free: directions in which the position is free, in the base's axes, (3,) or (k, 3): one
            direction makes the target a line, two a plane.
        through: positions (k, 3) [m] that the hand passes on its path, in this order.
        continuous_velocity_at_via: whether the velocity is continuous there; see `Problem`.
        limits, speed, obstacles, links, pairs, margin: along the path, see `PointToPoint`.

    Raises:
        ValueError: wrong shapes or values, or neither position nor rotation.
    """

    model: Model
    start: ArrayLike
    position: ArrayLike | None = None
    rotation: ArrayLike | None = None
    limits: bool = field(default=True, kw_only=True)
    free: ArrayLike | None = field(default=None, kw_only=True)
    through: ArrayLike = field(default=(), kw_only=True)
    continuous_velocity_at_via: bool = field(default=True, kw_only=True)  # type: ignore[misc]

    def __post_init__(self) -> None:
        dof = as_model(self.model).dof
        settle(self, start=as_vector("start", self.start, dof))
        if self.position is None and self.rotation is None:
            raise ValueError("Reach needs a position, a rotation or both")
        if self.position is not None:
            settle(self, position=as_vector("position", self.position, 3))
        if self.rotation is not None:
            settle(self, rotation=as_rotation("rotation", self.rotation))
        settle(self, free=as_directions("free", self.free))
        if len(np.asarray(self.free)) and self.position is None:
            raise ValueError("free: directions are those of a position, and there is none")
        points = [as_vector(f"through[{k}]", each, 3) for k, each in enumerate(_rows(self.through))]
        settle(self, through=np.array(points).reshape(-1, 3))
        self.check_path_constraints()

    @property
    def metric(self) -> Metric:  # type: ignore[override]
        """Kinetic energy of the model."""
        return metric_of(self.model)

    @property
    def parameters(self) -> Sequence[str]:  # type: ignore[override]
        """The prescribed parts of the hand's pose and the positions on its path."""
        given = [name for name in ("position", "rotation") if getattr(self, name) is not None]
        return [*given, "through"] if self._num_points else given

    @property
    def _num_points(self) -> int:
        through: Any = self.through  # numbers, or symbols in their place
        return int(through.shape[0])

    @property
    def structure(self) -> Hashable:
        """The model and which conditions there are."""
        free = tuple(map(tuple, np.asarray(self.free).tolist()))
        via = (self._num_points, self.continuous_velocity_at_via)
        return (self.model, *self.parameters, free, *via, *self.constraint_key)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        """Return the start, and the pose of the hand at the end."""
        rotation, position = self.model.hand_pose(q1)
        target: dict[str, Any] = {name: getattr(self, name) for name in self.parameters}
        conditions: list[Equality] = [(q0, self.start, "start")]
        if "position" in target:
            error = position - ca.SX(target["position"])
            if len(np.asarray(self.free)):
                axes, num_free = complement(np.asarray(self.free))
                error = ca.DM(axes[:, num_free:].T) @ error
            conditions.append((error, 0.0, "position"))
        if "rotation" in target:
            error = rotation_log(ca.SX(target["rotation"]).T @ rotation)
            conditions.append((error, 0.0, "rotation"))
        return conditions

    def via(self, q: ca.SX) -> Sequence[Sequence[Equality]]:
        """Return the position of the hand at each via point."""
        if not self._num_points:
            return []
        given: Any = self.through  # numbers, or symbols in their place
        points = ca.SX(given)
        _, position = self.model.hand_pose(q)
        names = (f"through[{k}]" for k in range(points.shape[0]))
        return [[(position - points[k, :].T, 0.0, name)] for k, name in enumerate(names)]

    def guess(self, s: Array) -> Array:
        """Return straight lines between configurations found by inverse kinematics, each near the
        last, to several at the end, (k, len(s), n).

        Raises:
            NotConverged: inverse kinematics found no configuration.
        """
        corners = [np.asarray(self.start)]
        for point in np.asarray(self.through):
            corners.append(self._configurations(f"through {point}", corners[-1], point)[0])
        pose = (self.position, self.rotation)
        ends = self._configurations("the end", corners[-1], *pose, free=self.free)
        pieces = len(corners)
        piece = np.minimum((pieces * s).astype(int), pieces - 1)
        share = (pieces * s - piece)[:, None]
        every = np.stack([[*corners, end] for end in ends])
        lines: Array = every[:, piece] + share * (every[:, piece + 1] - every[:, piece])
        return lines

    def _configurations(
        self, what: str, near: Array, position: Any, rotation: Any = None, free: Any = None
    ) -> list[Array]:
        collisions = CollisionAvoidance(self.obstacles, self.links, self.pairs, self.margin)
        given: dict[str, Any] = {"limits": self.limits, "free": free, "collisions": collisions}
        search = PoseSearch.checked("Reach", self.model, near, position, rotation, **given)
        try:
            return configurations(search)  # the first is nearly the nearest, as it is a guess
        except NotConverged as error:
            raise NotConverged(f"{what}: {error}") from None


def _rows(points: Any) -> list[Any]:
    """Return a list of points from (k, 3), or from one (3,)."""
    return [points] if len(points) and np.ndim(points[0]) == 0 else list(points)
