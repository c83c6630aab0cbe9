"""Inverse kinematics by optimisation: configurations that bring the hand to a pose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_rotation, as_vector
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.ipopt import Ipopt
from geodesic_ocp.model.as_model import as_model
from geodesic_ocp.model.geometry.signed_distances import signed_distances
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.ocp.ik.collision_avoidance import CollisionAvoidance
from geodesic_ocp.ocp.ik.free_directions import as_directions, complement
from geodesic_ocp.ocp.ik.pose_error import rotation_log

_STARTS, _ENOUGH = 60, 4
_STARTS_NEAREST = 24
_REACHED = 1e-6  # [m] and [rad]
# Among configurations with the same pose error, the one near the start: too small a weight to
# change the pose error.
_STAY = 1e-6


def inverse_kinematics(
    model: Model,
    near: ArrayLike,
    position: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    *,
    limits: bool = True,
    free: ArrayLike | None = None,
    obstacles: Sequence[Obstacle] = (),
    links: Sequence[str] | None = None,
    pairs: Sequence[tuple[str, str]] = (),
    margin: float = 0.0,
) -> Array:
    """The configuration (n,) nearest to a given one, joint by joint, with a pose of the hand.

    min |q - near|^2 over q such that the hand has the position, the rotation, or both. The search
    starts from several configurations and covers one revolution of joints with a larger range.

    Args:
        model: whose hand (end-effector) is placed.
        near: configuration (n,) to stay near to [rad or m].
        position: of the hand (3,) [m] in the base frame; None leaves it free.
        rotation: of the hand (3, 3); None leaves it free.
        limits: whether the joints stay within their limits.
        free: directions (3,) or (k, 3) in which the position is free.
        obstacles, links, pairs: collision bodies to keep apart, see `signed_distances`.
        margin: smallest distance allowed between them [m].

    Raises:
        ValueError: wrong shapes or values, or neither position nor rotation.
        NotConverged: no such configuration was found; the message gives the smallest error reached.

    Example:
        >>> import geodesic_ocp as go
        >>> arm = go.human_arm()
        >>> q = go.inverse_kinematics(arm, [0.3, 0, -0.4, 0.9, 0, 0, 0], [0.10, 0.45, -0.05])
        >>> arm.hand_pose(q)[1].round(6).tolist()
        [0.1, 0.45, -0.05]
    """
    collisions = CollisionAvoidance.checked(obstacles, links, pairs, margin)
    return inverse_kinematics_solutions(model, near, position, rotation, limits, free, collisions)[
        0
    ]


def inverse_kinematics_solutions(
    model: Model,
    near: ArrayLike,
    position: ArrayLike | None,
    rotation: ArrayLike | None,
    limits: bool,
    free: ArrayLike | None,
    collisions: CollisionAvoidance,
    enough: int = _ENOUGH,
) -> list[Array]:
    """Up to `enough` configurations of `inverse_kinematics`, each from another start.

    They are sorted by their distance from `near`, which is also the first start.
    """
    search = _Search.checked("inverse_kinematics", model, near, position, rotation, collisions)
    axes, num_free = complement(as_directions("free", free))
    held = np.array([*(np.arange(3) >= num_free), True, True, True])[list(search.rows)]
    bound = np.where(held, 0.0, np.inf)
    found, smallest = [], np.inf
    for outcome in search.outcomes(limits, _STARTS, axes, np.zeros(6), 1.0, bound):
        error = float(np.max(np.abs(outcome.errors[held]), initial=outcome.overlap))
        smallest = min(smallest, error)
        if outcome.success and error <= _REACHED:
            found.append(outcome.q)
            if len(found) == enough:
                break
    if not found:
        given = {"position": position, "rotation": rotation}
        what = [name for name, value in given.items() if value is not None]
        unit = "m or rad" if len(what) > 1 else {"position": "m", "rotation": "rad"}[what[0]]
        raise NotConverged(
            f"no configuration of {model.name!r}{' within its limits' if limits else ''}"
            f"{'' if collisions.is_empty else ', clear of collision bodies,'} was found for the "
            f"hand's {' and '.join(what)}: the smallest error reached is {smallest:.3g} {unit}"
        )
    return sorted(found, key=lambda q: float(np.linalg.norm(q - search.near)))


def nearest_configuration(
    model: Model,
    near: ArrayLike,
    position: ArrayLike | None,
    rotation: ArrayLike | None,
    weights: tuple[float, float],
    limits: bool,
    collisions: CollisionAvoidance,
) -> Array:
    """The configuration (n,) whose hand pose is nearest to one that may be out of reach.

    min (a |p - position|)^2 + (b angle)^2 with weights (a, b) [1/m], [1/rad], from several starts;
    the angle is that of the rotation between the two poses.

    Raises:
        ValueError: wrong shapes or values, or neither position nor rotation.
        NotConverged: no start led to a configuration that is clear of the collision bodies.
    """
    search = _Search.checked("nearest_configuration", model, near, position, rotation, collisions)
    bound = np.full(len(search.rows), np.inf)
    each = np.repeat(weights, 3)
    outcomes = search.outcomes(limits, _STARTS_NEAREST, np.eye(3), each, _STAY, bound)
    found = [outcome for outcome in outcomes if outcome.success]
    if not found:
        raise NotConverged(f"no configuration of {model.name!r} was found near the hand pose")
    return min(found, key=lambda outcome: outcome.objective).q


def search_bounds(model: Model, start: Array, limits: bool) -> tuple[Array, Array, Array]:
    """Bounds (n,) of a search for configurations, and the start clipped to the limits.

    Joints with a range above one revolution are searched over one revolution, which covers all
    poses without winding up: half a revolution to either side, shifted to lie within the limits.
    """
    lower = model.lower if limits else np.full(model.dof, -np.inf)
    upper = model.upper if limits else np.full(model.dof, np.inf)
    inside = np.clip(start, lower, upper)
    wide = ~(upper - lower <= 2.0 * np.pi)
    with np.errstate(invalid="ignore"):  # prismatic joints without limits
        first = np.clip(inside - np.pi, lower, upper - 2.0 * np.pi)
    lower = np.where(wide, first, lower)
    upper = np.where(wide, first + 2.0 * np.pi, upper)
    return lower, upper, np.asarray(inside)


@dataclass(frozen=True, eq=False)
class _SearchOutcome:
    """A configuration, its pose errors, the overlap of collision bodies, and Ipopt's verdict."""

    q: Array
    errors: Array
    overlap: float
    success: bool
    objective: float


@dataclass(frozen=True, eq=False)
class _Search:
    """The program of one model and pose, solved from several starts.

    Attributes:
        rows: which of the six rows of the pose error (position, rotation vector) are part of it.
    """

    model: Model
    near: Array
    position: Array
    rotation: Array
    rows: tuple[int, ...]
    collisions: CollisionAvoidance

    @classmethod
    def checked(
        cls,
        caller: str,
        model: Model,
        near: ArrayLike,
        position: ArrayLike | None,
        rotation: ArrayLike | None,
        collisions: CollisionAvoidance,
    ) -> _Search:
        if position is None and rotation is None:
            raise ValueError(f"{caller} needs a position, a rotation or both")
        rows = [*range(3)] if position is not None else []
        rows += [*range(3, 6)] if rotation is not None else []
        return cls(
            model,
            as_vector("near", near, as_model(model).dof),
            np.zeros(3) if position is None else as_vector("position", position, 3),
            np.eye(3) if rotation is None else as_rotation("rotation", rotation),
            ((0, 1, 2) if position is not None else ())
            + ((3, 4, 5) if rotation is not None else ()),
            collisions,
        )

    def outcomes(
        self, limits: bool, starts: int, axes: Array, weights: Array, stay: float, bound: Array
    ) -> Iterator[_SearchOutcome]:
        """One outcome after the other, from `near` and from random starts.

        min stay |q - near|^2 / 2 + |weights e|^2 / 2 over q and the pose errors e, |e| <= bound,
        with position errors in the given axes (3, 3).
        """
        n, rows = self.model.dof, list(self.rows)
        lower, upper, inside = search_bounds(self.model, self.near, limits)
        program, errors = _program(self.model, self.rows, self.collisions.bodies)
        least = np.concatenate([np.zeros(len(rows)), self._margins(program.size_g - len(rows))])
        pose = [self.position, self.rotation.ravel(order="F"), axes.ravel(order="F")]
        p = np.concatenate([self.near, *pose, [stay], weights[rows]])
        lbx, ubx = np.concatenate([lower, -bound]), np.concatenate([upper, bound])
        most = np.concatenate([np.zeros(len(rows)), np.full(least.size - len(rows), np.inf)])
        rng = np.random.default_rng(0)
        for start in (inside, *rng.uniform(lower, upper, (starts - 1, n))):
            first = np.clip(errors(start, p).full()[:, 0], -bound, bound)
            x0 = np.concatenate([start, first])
            outcome = program(x0=x0, p=p, lbx=lbx, ubx=ubx, lbg=least, ubg=most)
            q = outcome.x[:n]
            overlap = float(np.max(least[len(rows) :] - outcome.g[len(rows) :], initial=0.0))
            # The errors of q itself: Ipopt meets equalities to its own tolerance.
            now = errors(q, p).full()[:, 0]
            yield _SearchOutcome(q, now, overlap, outcome.success, outcome.objective)

    def _margins(self, count: int) -> Array:
        return np.full(count, self.collisions.margin)


@lru_cache(maxsize=32)
def _program(
    model: Model, rows: tuple[int, ...], bodies: tuple[Any, Any, Any]
) -> tuple[Ipopt, ca.Function]:
    """The program in x = (q, e), and the pose errors e (q, p); then come the distances."""
    n, count = model.dof, len(rows)
    q, e = ca.SX.sym("q", n), ca.SX.sym("e", count)
    p = ca.SX.sym("p", n + 22 + count)
    near, position, rotation, axes, stay, weights = ca.vertsplit(
        p, np.cumsum([0, n, 3, 9, 9, 1, count]).tolist()
    )
    hand_rotation, hand_position = model.hand_pose(q)
    errors = ca.vertcat(
        ca.reshape(axes, 3, 3).T @ (hand_position - position),
        rotation_log(ca.reshape(rotation, 3, 3).T @ hand_rotation),
    )[list(rows)]
    obstacles, links, pairs = bodies
    distances = signed_distances(model, q, obstacles, links=links, pairs=pairs)
    f = stay * ca.sumsqr(q - near) / 2 + ca.sumsqr(weights * e) / 2
    g = ca.vertcat(errors - e, *distances.values())
    nlp = {"x": ca.vertcat(q, e), "p": p, "f": f, "g": g}
    return Ipopt(nlp), ca.Function("pose_errors", [q, p], [errors])
