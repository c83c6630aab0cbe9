"""A configuration in which the hand has a pose: inverse kinematics by optimisation."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import null_space

from geodesic_ocp.arrays import Array, as_number, as_rotation, as_vector
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.ipopt import Ipopt
from geodesic_ocp.model.geometry.signed_distances import as_pair, signed_distances
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle

# A rotation by pi is taken for none by the error below, but is left by any small step.
_TINY = 1e-14
_STARTS, _ENOUGH = 60, 4
_UNITS = {
    (True, False): "m",
    (False, True): "(sine of half an angle)",
    (True, True): "(m, or sine of half an angle)",
}
_REACHED = 1e-6  # [m], or sine of half an angle


class Clear(NamedTuple):
    """Bodies that are kept apart: see `signed_distances`."""

    obstacles: tuple[Obstacle, ...] = ()
    links: tuple[str, ...] | None = None
    pairs: tuple[tuple[str, str], ...] = ()
    margin: float = 0.0

    @classmethod
    def of(
        cls,
        obstacles: Sequence[Obstacle],
        links: Sequence[str] | None,
        pairs: Sequence[tuple[str, str]],
        margin: float,
    ) -> Clear:
        """Of keywords as users give them; ValueError where the margin is no number."""
        links = None if links is None else tuple(links)
        return cls(tuple(obstacles), links, tuple(map(as_pair, pairs)), as_number("margin", margin))

    @property
    def bodies(self) -> tuple[Any, Any, Any]:
        """All but the margin, which is a bound and no part of a program."""
        return self.obstacles, self.links, self.pairs


def rotation_error(rotation: ca.SX, wanted: ca.SX) -> ca.SX:
    """sin(angle / 2) axis (3, 1) of the turn from one rotation (3, 3) to another.

    It grows up to a turn by pi, where the skew part of the rotation alone would vanish again.
    """
    turn = wanted.T @ rotation
    skew = ca.inv_skew(turn - turn.T) / 2
    return skew / ca.sqrt(ca.fmax(1 + ca.trace(turn), 0) + _TINY)


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
    """The configuration (n,) nearest to another, joint by joint, with this hand's pose.

    min |q - near|^2 over q with the hand at the position, turned as the rotation, or both; from
    several starts, and within a turn of joints whose limits are further apart.

    Args:
        model: whose hand is placed.
        near: configuration (n,) to stay near to.
        position: of the hand (3,) [m] in the base's frame; None leaves it free.
        rotation: of the hand (3, 3); None leaves it free.
        limits: whether the joints stay within their limits.
        free: directions in which the position may differ, (3,) or (k, 3).
        obstacles, links, pairs: that bodies keep clear of, see `signed_distances`.
        margin: least distance [m] from them.

    Raises:
        ValueError: wrong shapes or values, or neither position nor rotation.
        NotConverged: no such configuration was found from any of several starts; says how near one came.
    """
    clear = Clear.of(obstacles, links, pairs, margin)
    return inverse_kinematics_solutions(model, near, position, rotation, limits, free, clear)[0]


def inverse_kinematics_solutions(
    model: Model,
    near: ArrayLike,
    position: ArrayLike | None,
    rotation: ArrayLike | None,
    limits: bool,
    free: ArrayLike | None,
    clear: Clear,
    enough: int = _ENOUGH,
) -> list[Array]:
    """So many such configurations, from as many starts, the nearest first: see `inverse_kinematics`.

    The first start is `near` itself.
    """
    start = as_vector("near", near, model.dof)
    place = np.zeros(3) if position is None else as_vector("position", position, 3)
    turn = np.eye(3) if rotation is None else as_rotation("rotation", rotation)
    if position is None and rotation is None:
        raise ValueError("inverse_kinematics needs a position, a rotation or both")
    lower, upper, inside = room(model, start, limits)
    held = tuple(map(tuple, across(as_directions("free", free)).tolist()))
    solver, equalities = _program(
        model, held if position is not None else (), rotation is not None, clear.bodies
    )
    upper_g = np.where(np.arange(solver.size_g) < equalities, 0.0, np.inf)
    lower_g = np.where(upper_g == 0.0, 0.0, clear.margin)
    rng = np.random.default_rng(0)
    p = np.concatenate([start, place, turn.ravel(order="F")])
    found, nearest = [], np.inf
    for x0 in (inside, *rng.uniform(lower, upper, (_STARTS - 1, model.dof))):
        outcome = solver(x0=x0, p=p, lbx=lower, ubx=upper, lbg=lower_g, ubg=upper_g)
        miss = float(np.maximum(lower_g - outcome.g, outcome.g - upper_g).max())
        nearest = min(nearest, miss)
        if outcome.success and miss <= _REACHED:
            found.append(outcome.x)
            if len(found) == enough:
                break
    if not found:
        what = [
            name
            for name, given in (("position", position), ("rotation", rotation))
            if given is not None
        ]
        raise NotConverged(
            f"no configuration of {model.name!r}{' within its limits' if limits else ''}"
            f"{', clear of bodies,' if clear.obstacles or clear.pairs else ''} has the hand's "
            f"{' and '.join(what)}: the nearest one misses {'them' if len(what) > 1 else 'it'} by "
            f"{nearest:.3g} {_UNITS[position is not None, rotation is not None]}"
        )
    return sorted(found, key=lambda q: float(np.linalg.norm(q - start)))


def room(model: Model, start: Array, limits: bool) -> tuple[Array, Array, Array]:
    """Bounds (n,) of a search for configurations, and the start within them.

    Where there is more room than a turn, one turn leads anywhere; unbounded steps would wind the
    arm up. It is half a turn to either side, or what is left on one side and the rest on the other.
    """
    lower = model.lower if limits else np.full(model.dof, -np.inf)
    upper = model.upper if limits else np.full(model.dof, np.inf)
    inside = np.clip(start, lower, upper)
    wide = ~(upper - lower <= 2.0 * np.pi)
    with np.errstate(invalid="ignore"):  # of slides without limits
        first = np.clip(inside - np.pi, lower, upper - 2.0 * np.pi)
    lower = np.where(wide, first, lower)
    upper = np.where(wide, first + 2.0 * np.pi, upper)
    return lower, upper, np.asarray(inside)


def as_directions(name: str, given: ArrayLike | None) -> Array:
    """Directions (k, 3) of none, one (3,) or several (k, 3), at most two of them independent.

    Raises:
        ValueError: wrong shapes, a direction of no length, or no place is left to be given.
    """
    if given is None:
        return np.zeros((0, 3))
    try:
        directions = np.atleast_2d(np.array(given, dtype=float))
    except (TypeError, ValueError):
        directions = np.zeros(0)
    if directions.shape == (1, 0) or directions.shape == (0, 3):
        return np.zeros((0, 3))
    sizes = np.linalg.norm(directions, axis=-1)
    scaled = directions / np.where(sizes > 0.0, sizes, 1.0)[..., None]
    if (
        directions.ndim != 2
        or directions.shape[1] != 3
        or not np.all(np.isfinite(directions))
        or not np.all(sizes > 0.0)
        or np.linalg.matrix_rank(np.nan_to_num(scaled)) > 2
    ):
        raise ValueError(
            f"{name} must be a direction (3,), or (k, 3) of at most two independent ones, not "
            f"zero, got {given!r}"
        )
    return np.asarray(scaled)


def across(directions: Array) -> Array:
    """Orthonormal rows (3 - k, 3) at right angles to the directions."""
    if not len(directions):
        return np.eye(3)
    return np.asarray(null_space(directions).T)


@lru_cache(maxsize=32)
def _program(
    model: Model,
    held: tuple[tuple[float, ...], ...],
    turned: bool,
    clear: tuple[Any, Any, Any],
) -> tuple[Ipopt, int]:
    """The program, and how many of its conditions are equalities; the others are distances."""
    n = model.dof
    q, p = ca.SX.sym("q", n), ca.SX.sym("p", n + 12)
    rotation, position = model.hand_pose(q)
    away = q - p[:n]
    conditions = []
    if held:
        conditions.append(ca.DM(held) @ (position - p[n : n + 3]))
    if turned:
        conditions.append(rotation_error(rotation, ca.reshape(p[n + 3 :], 3, 3)))
    equalities = ca.vertcat(*conditions)
    obstacles, links, pairs = clear
    distances = signed_distances(model, q, obstacles, links=links, pairs=pairs)
    g = ca.vertcat(equalities, *distances.values())
    return Ipopt({"x": q, "p": p, "f": ca.sumsqr(away) / 2, "g": g}), int(equalities.shape[0])
