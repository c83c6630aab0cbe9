"""Reach: the path of least energy from a configuration to a pose of the hand."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_rotation, as_vector
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.ocp.inverse_kinematics import inverse_kinematics
from geodesic_ocp.ocp.path_constraints import ConstrainedProblem
from geodesic_ocp.ocp.pose_search import as_directions, complement, rotation_log
from geodesic_ocp.ocp.problem import Equality


@dataclass(frozen=True, eq=False, repr=False)
class Reach(ShortRepr, ConstrainedProblem):
    """The path of least energy from a configuration to a pose of the hand.

    The position of the hand, its orientation, or both are prescribed at the end; whatever they
    leave open of the final configuration is free, so that the path arrives orthogonally to all
    configurations with that pose (transversality). The initial guess is the straight line to a
    configuration found by inverse kinematics. Start and pose can change without a new NLP.

    Attributes:
        model: whose hand (end-effector) reaches; the metric is its kinetic energy.
        start: configuration (n,) [rad or m].
        position: of the hand at the end, in the base frame, (3,) [m]; None leaves it free.
        rotation: of the hand at the end, (3, 3); None leaves it free.
        free: directions in which the position is free, in the base's axes, (3,) or (k, 3): one
            direction makes the target a line, two a plane.
        through: positions (k, 3) [m] that the hand passes on its path, in this order.
        continuous_velocity_at_via: whether the velocity is continuous there; see `Problem`.
        limits: whether the joints stay within the limits of the metric's model.
        speed: largest |dq_j / ds| [rad or m over the whole path], one for all coordinates or (n,);
            a motion at constant speed that lasts T has joint speeds 1 / T times these. None: no
            limit.
        obstacles: balls, capsules and half-spaces that the collision bodies keep clear of.
        links: links whose bodies keep clear of obstacles; None: all that move.
        pairs: pairs of links that keep clear of each other.
        margin: smallest distance [m] from obstacles and within pairs.

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
        object.__setattr__(self, "start", as_vector("start", self.start, dof))
        if self.position is None and self.rotation is None:
            raise ValueError("Reach needs a position, a rotation or both")
        if self.position is not None:
            object.__setattr__(self, "position", as_vector("position", self.position, 3))
        if self.rotation is not None:
            object.__setattr__(self, "rotation", as_rotation("rotation", self.rotation))
        object.__setattr__(self, "free", as_directions("free", self.free))
        if len(np.asarray(self.free)) and self.position is None:
            raise ValueError("free: directions are those of a position, and there is none")
        points = [as_vector(f"through[{k}]", each, 3) for k, each in enumerate(_rows(self.through))]
        object.__setattr__(self, "through", np.array(points).reshape(-1, 3))
        self.check_path_constraints()

    @property
    def metric(self) -> Metric:  # type: ignore[override]
        """Kinetic energy of the model."""
        return KineticEnergy(self.model)

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
        """The start, and the pose of the hand at the end."""
        rotation, position = self.model.hand_pose(q1)
        target: dict[str, Any] = {name: getattr(self, name) for name in self.parameters}
        conditions: list[Equality] = [(q0, self.start, "start")]
        if "position" in target:
            axes, num_free = complement(np.asarray(self.free))
            held = ca.DM(axes[:, num_free:].T)
            conditions.append((held @ (position - ca.SX(target["position"])), 0.0, "position"))
        if "rotation" in target:
            error = rotation_log(ca.SX(target["rotation"]).T @ rotation)
            conditions.append((error, 0.0, "rotation"))
        return conditions

    def via(self, q: ca.SX) -> Sequence[Sequence[Equality]]:
        """The position of the hand at each via point."""
        given: Any = self.through  # numbers, or symbols in their place
        points = ca.SX(given)
        _, position = self.model.hand_pose(q)
        names = (f"through[{k}]" for k in range(points.shape[0]))
        return [[(position - points[k, :].T, 0.0, name)] for k, name in enumerate(names)]

    def guess(self, s: Array) -> Array:
        """Straight lines between configurations found by inverse kinematics, each near the last.

        Raises:
            NotConverged: inverse kinematics found no configuration.
        """
        keep: dict[str, Any] = {
            name: getattr(self, name)
            for name in ("limits", "obstacles", "links", "pairs", "margin")
        }
        corners = [np.asarray(self.start)]
        for point in np.asarray(self.through):
            corners.append(self._configuration(f"through {point}", corners[-1], point, **keep))
        pose = (self.position, self.rotation)
        corners.append(self._configuration("the end", corners[-1], *pose, free=self.free, **keep))
        knots = np.linspace(0.0, 1.0, len(corners))
        return np.column_stack([np.interp(s, knots, column) for column in np.transpose(corners)])

    def _configuration(self, what: str, *given: Any, **keep: Any) -> Array:
        try:
            return inverse_kinematics(self.model, *given, **keep)
        except NotConverged as error:
            raise NotConverged(f"{what}: {error}") from None


def _rows(points: Any) -> list[Any]:
    """A list of points from (k, 3), or from one (3,)."""
    return [points] if len(points) and np.ndim(points[0]) == 0 else list(points)
