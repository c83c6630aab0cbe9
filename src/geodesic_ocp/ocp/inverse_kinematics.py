"""Inverse kinematics of a model, clear of obstacles where that is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.ocp.pose_search import CollisionAvoidance, PoseSearch

_STARTS = 60
_ENOUGH = 4
_STARTS_NEAREST = 28
# configurations that are too few, and further starts of Ipopt then
_FEW = 2
_LAST_RESORT = 6
_BEST = 4  # starts of Ipopt for a pose out of reach, from different configurations
_DIFFERENT = 0.3  # [rad or m]
_REACHED = 1e-6  # [m] and [rad]
_PARTS = ((0, "position", "m"), (3, "rotation", "rad"))  # first rows, names and units
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
    """Return the configuration (n,) nearest to a given one, joint by joint, with a pose of the
    hand.

    min |q - near|^2 over q such that the hand has the position, the rotation, or both. The search
    starts from several configurations and covers one revolution of joints with a larger range.

    Args:
        model: model whose hand (end-effector) is placed.
        near: configuration (n,) to stay near to [rad or m].
        position: position of the hand (3,) [m] in the base frame; None leaves it free.
        rotation: rotation of the hand (3, 3); None leaves it free.
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
        >>> q = go.ocp.inverse_kinematics(arm, [0.3, 0, -0.4, 0.9, 0, 0, 0], [0.10, 0.45, -0.05])
        >>> arm.hand_pose(q)[1].round(6).tolist()
        [0.1, 0.45, -0.05]
    """
    collisions = CollisionAvoidance.checked(obstacles, links, pairs, margin)
    given = model, near, position, rotation
    options: dict[str, Any] = {"limits": limits, "free": free, "collisions": collisions}
    search = PoseSearch.checked("inverse_kinematics", *given, **options)
    q = configurations(search)[0]
    (exact,) = search.outcomes([q], np.zeros(len(search.rows)), 1.0)
    nearer = np.linalg.norm(exact.q - search.near) <= np.linalg.norm(q - search.near)
    return exact.q if exact.success and exact.error <= _REACHED and nearer else q


def configurations(
    search: PoseSearch, enough: int = _ENOUGH, settled: float = 1e-2, least: int = 1
) -> list[Array]:
    """Return at least `least` configurations with a hand pose, if there are as many, from several
    starts.

    They are sorted by their distance from `near`, which is also the first start. Each is near to a
    local minimum of that distance, not exactly at it: the search still moves by `settled` a step.

    Raises:
        NotConverged: no such configuration was found.
    """
    starts = search.starts(_STARTS)
    collisions = search.collisions
    weights = (search.bound == 0.0).astype(float)
    found, others, smallest = search.simultaneously(starts, weights, enough, settled, least)
    candidates: list[Array] = []
    attained = 0
    if not collisions.is_empty:
        candidates = [*found, *starts]
        attained = len(found)
        found = []
        smallest = np.inf
    elif len(found) < min(_FEW, enough):
        # Joints that stop at their limits can trap that search, not Ipopt's interior points.
        candidates = [starts[0], *others[len(found) :][:1], *starts[-_LAST_RESORT:]]
        enough = len(found) + _FEW + 1
    for number, q in enumerate(candidates):
        if number < attained and search.is_clear(q):
            found.append(q)
        else:
            (outcome,) = search.outcomes([q], np.zeros(len(search.rows)), 1.0)
            smallest = min(smallest, outcome.error)
            if outcome.success and outcome.error <= _REACHED:
                found.append(outcome.q)
        if len(found) == enough:
            break
    if not found:
        units = {name: unit for row, name, unit in _PARTS if row in search.rows}
        raise NotConverged(
            f"no configuration of {search.model.name!r}"
            f"{' within its limits' if search.limits else ''}"
            f"{'' if collisions.is_empty else ', clear of collision bodies,'} was found for the "
            f"hand's {' and '.join(units)}: the smallest error reached is {smallest:.3g} "
            f"{' or '.join(units.values())}"
        )
    return sorted(found, key=lambda q: float(np.linalg.norm(q - search.near)))


def nearest_configuration(search: PoseSearch, weights: tuple[float, float]) -> Array:
    """Return the configuration (n,) whose hand pose is nearest to one that may be out of reach.

    min (a |p - position|)^2 + (b angle)^2 with weights (a, b) [1/m], [1/rad], from several starts;
    the angle is that of the rotation between the two poses.

    Raises:
        NotConverged: no start led to a configuration that is clear of the collision bodies.
    """
    search = replace(search, bound=np.full(len(search.rows), np.inf))
    rows = np.repeat(weights, 3)[np.array(search.rows) % 6]
    starts = search.starts(_STARTS_NEAREST)
    _, nearest, _ = search.simultaneously(starts, rows, len(starts))
    best: list[Array] = []
    for q in nearest:
        if len(best) < _BEST and all(np.abs(q - other).max() > _DIFFERENT for other in best):
            best.append(q)
    starts = best if search.collisions.is_empty else [*best, *starts]
    found = [outcome for outcome in search.outcomes(starts, rows, _STAY) if outcome.success]
    if not found:
        raise NotConverged(
            f"no configuration of {search.model.name!r} was found near the hand pose"
        )
    return min(found, key=lambda outcome: outcome.objective).q
