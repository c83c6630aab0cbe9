"""Clearances: how far the collision bodies of a model stay from obstacles and each other."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.distances import has_symbols, nearest_points
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.scenes.markings import Gap

MOST = 8  # gaps in a scene; with more, none could be read
_NUMBER = re.compile(r" \(\d+\)$")  # at the end of a name that occurs more than once


def clearances(
    model: Model,
    q: Array,
    obstacles: Sequence[Obstacle] = (),
    *,
    links: Sequence[str] | None = None,
    pairs: Sequence[tuple[str, str]] = (),
    names: Collection[str] | None = None,
    most: int = MOST,
) -> tuple[Gap, ...]:
    """Nearest points and distances between bodies over time, in the model's base frame.

    Of many, the ones that come closest are kept, in the order of the constraints: first of those
    whose names differ in a number only, such as both ends of a capsule above a table, then of all.

    Args:
        model: with collision bodies; without any, there are no clearances.
        q: configurations (k, n) [rad or m].
        obstacles, links, pairs: see `signed_distances`; obstacles with symbols are left out.
        names: of those that are wanted, as in the constraints; None, or if there are none of
            these names: all.
        most: largest number of gaps.
    """
    if not model.bodies:
        return ()
    known = [obstacle for obstacle in obstacles if not has_symbols(obstacle)]
    found = nearest_points(model, q, known, links=links, pairs=pairs)
    wanted = {name: found[name] for name in found if names is None or name in names} or found
    closest: dict[str, str] = {}
    if len(wanted) > most:
        for name in sorted(wanted, key=lambda name: float(wanted[name].distances.min())):
            closest.setdefault(_NUMBER.sub("", name), name)
    kept = list(closest.values())[:most] or list(wanted)
    return tuple(
        Gap(name, each.starts, each.ends, each.distances)
        for name, each in wanted.items()
        if name in kept
    )
