"""The distances that a motion keeps: between links, of two arms, and from obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.clearance import Clearance, clearance_constraint
from geodesic_ocp.execution.link_pairs import LinkPairs, link_pairs
from geodesic_ocp.model.distances import signed_distances
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.settings import RetargetingSettings

TOUCHING = 1e-3  # [m]
_CLOSE = 2e-3  # [m], smallest distance of links whose capsules overlap in most configurations
_MORE = 2e-3  # [m] that paths keep beyond the margin, as the trajectory leaves them in corners
_LESS = 3e-3  # [m] by which it may come nearer than the capsules on a path


def motion_clearance(robots: Sequence[Model], settings: RetargetingSettings) -> Clearance | None:
    """The distances that the settings ask for; None if there are none, or no geometry is known.

    Pairs of links whose capsules overlap although the links are apart are among them, as the exact
    geometry decides (`active_rows`). Most of these are neighbours that are always near each other:
    they must not touch.

    Raises:
        ValueError: links or pairs without collision bodies.
    """
    if not settings.constrained:
        return None
    found: list[Clearance] = []
    if settings.self_collision and not settings.pairs:
        pairs_found = _pairs(tuple(robots), settings.margin)
        named = [*pairs_found.constrained, *pairs_found.exact_only]
        every = clearance_constraint(robots, pairs=named, margin=settings.margin) if named else None
        close = {f"{one} to {other}" for one, other in pairs_found.exact_only}
        if every is not None:
            wide = [name.partition(" (")[0] in close for name in every.names]
            found.append(replace(every, lower=np.where(wide, _CLOSE, every.lower)))
    obstacles, links, pairs, margin = settings.collisions
    if obstacles or pairs:
        total, first = sum(robot.dof for robot in robots), 0
        q = ca.SX.sym("q", total)
        for robot in robots:
            own = q[first : first + robot.dof]
            distances = signed_distances(robot, own, obstacles, links=links, pairs=pairs)
            function = ca.Function("distances", [q], [ca.vertcat(*distances.values())])
            found.append(Clearance(function, np.full(len(distances), margin), tuple(distances)))
            first += robot.dof
    return _together(found) if found else None


@lru_cache(maxsize=8)
def _pairs(robots: tuple[Model, ...], margin: float) -> LinkPairs:
    return link_pairs(robots, margin=margin)


def of_paths(clearance: Clearance) -> Clearance:
    """With the bounds that paths keep."""
    return replace(clearance, lower=np.asarray(clearance.lower) + _MORE)


def of_trajectory(clearance: Clearance, least: Array, kept: Sequence[int]) -> Clearance:
    """With the bounds that a trajectory keeps near paths.

    Distances of capsules that are below their bounds along the paths, although those of the links
    are not, have none: they would only hold the trajectory to the paths.

    Args:
        clearance: all distances.
        least: along the paths (m,) [m].
        kept: numbers of those that the paths were kept from.
    """
    bound = np.where(least < clearance.lower, -np.inf, clearance.lower)
    some = list(kept)
    bound[some] = np.minimum(clearance.lower[some], least[some] - _LESS)
    return replace(clearance, lower=bound)


def in_check(clearance: Clearance) -> Clearance:
    """With the bounds that a check of the trajectory asks for: links must not touch."""
    return replace(clearance, lower=np.full(len(clearance.names), TOUCHING))


def _together(parts: Sequence[Clearance]) -> Clearance:
    if len(parts) == 1:
        return parts[0]
    q = ca.SX.sym("q", parts[0].dof)
    function = ca.Function("distances", [q], [ca.vertcat(*(each.function(q) for each in parts))])
    lower = np.concatenate([each.lower for each in parts])
    owners = [(part, index) for part in parts for index in range(len(part.names))]

    def exact(configuration: Array, row: int) -> float:
        part, index = owners[row]
        if part.exact is not None:
            return part.exact(configuration, index)
        return max(0.0, float(part.row(index)(configuration)))

    return Clearance(function, lower, tuple(name for each in parts for name in each.names), exact)
