"""Constraints along a path: obstacles, limits on speed, and clearances."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import as_number, as_vector
from geodesic_ocp.model.distances import as_pair, signed_distances
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.ocp.problem import Inequality, Problem, key_of

_NEEDS_MODEL = {"limits": "limits", "obstacles": "bodies", "pairs": "bodies"}


def clearance_constraints(
    model: Model,
    q: ca.SX,
    obstacles: Sequence[Obstacle] = (),
    *,
    links: Sequence[str] | None = None,
    pairs: Sequence[tuple[str, str]] = (),
    margin: float = 0.0,
) -> list[Inequality]:
    """Path constraints that keep a model's collision bodies apart from obstacles and each other.

    Args:
        model: with collision bodies (`Model.bodies`).
        q: symbols of the configuration (n, 1).
        obstacles, links, pairs: see `signed_distances`.
        margin: smallest distance allowed [m].

    Raises:
        ValueError: the model, or a named link, has no collision bodies.
    """
    margin = as_number("margin", margin)
    distances = signed_distances(model, q, obstacles, links=links, pairs=pairs)
    return [(margin, distance, np.inf, name) for name, distance in distances.items()]


@dataclass(frozen=True, eq=False, kw_only=True)
class ConstrainedProblem(Problem):
    """A problem with optional limits on joints, speed and distances along the path.

    Attributes:
        limits: whether the joints stay within the limits of the metric's model.
        speed: largest |dq_j / ds| [rad or m over the whole path], one for all coordinates or (n,);
            a motion at constant speed that lasts T has joint speeds 1 / T times these. None: no
            limit.
        obstacles: balls, capsules and half-spaces that the collision bodies keep clear of.
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
        object.__setattr__(self, "speed", _as_speed(self.speed, self.metric.dim))
        for keyword in ("obstacles", "links", "pairs"):
            given = getattr(self, keyword)
            if given is not None and not isinstance(given, (list, tuple)):
                raise ValueError(f"{keyword} must be a list, got {given!r}")
        object.__setattr__(self, "obstacles", tuple(self.obstacles))
        object.__setattr__(self, "pairs", tuple(map(as_pair, self.pairs)))
        if self.links is not None:
            object.__setattr__(self, "links", tuple(self.links))
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
        """The requested constraints on joint limits, speed and distances."""
        conditions: list[Inequality] = []
        model = self._model
        if self.limits and model is not None:
            conditions.append((model.lower, q, model.upper, "joint limits"))
        if self.speed is not None:
            conditions.append((-np.array(self.speed), v, np.array(self.speed), "speed"))
        if model is not None and (self.obstacles or self.pairs):
            conditions += clearance_constraints(
                *(model, q, self.obstacles),
                links=self.links,
                pairs=self.pairs,
                margin=self.margin,
            )
        return conditions

    @property
    def constraint_key(self) -> tuple[Hashable, ...]:
        """Which constraints there are, for `structure`; empty if there are none."""
        if not (self.limits or self.speed or self.obstacles or self.pairs):
            return ()
        bodies = (self.obstacles, self.links, self.pairs)
        return (self.limits, self.speed is None, *map(key_of, bodies))


def _as_speed(speed: Any, dim: int) -> tuple[float, ...] | None:
    """The largest speeds (n,) of one number or n of them; ValueError if they are not positive."""
    if speed is None:
        return None
    speeds = as_vector("speed", np.broadcast_to(speed, dim) if np.ndim(speed) == 0 else speed, dim)
    if not np.all(speeds > 0.0):
        raise ValueError(f"speed must be positive, got {speed!r}")
    return tuple(speeds.tolist())
