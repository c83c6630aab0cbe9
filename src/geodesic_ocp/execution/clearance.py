"""Distances that a program keeps above lower bounds, of links and obstacles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from itertools import product
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from geodesic_ocp.arrays import Array, ShortRepr, as_number
from geodesic_ocp.blocks import at_rows
from geodesic_ocp.execution.link_pairs import (
    MARGIN,
    LinkPairs,
    PlacedSolid,
    PlacedSolids,
    as_configurations,
    exact_distance_at,
    is_closer_at,
    pairs_of,
    place_solids,
)
from geodesic_ocp.model.distances import (
    LineSegment,
    add_named,
    as_pair,
    line_segment,
    nearest_to_obstacle,
    segment_distance,
)
from geodesic_ocp.model.joints import motion_subspace
from geodesic_ocp.model.link_solids import Pose
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Capsule, HalfSpace, Obstacle
from geodesic_ocp.model.rigid_body import Placement, constant, joint_placements

_REMEMBERED = 4096  # configurations, as paths are checked for many distances


@dataclass(frozen=True, eq=False, repr=False)
class Clearance(ShortRepr):
    """Distances that a program keeps above lower bounds.

    Attributes:
        function: distances (m,) [m] at the configuration (N,) of all arms, one after the other.
        lower: smallest distances allowed (m,) [m].
        names: names of the distances, such as "panda_link2 to panda_link5".
        exact: distance [m] of the exact geometry, 0 where it overlaps, at a configuration (N,) for
            the distance of an index; None if it is not known.
        closer: whether that distance may be below a third argument [m], which takes a small part of
            the time of the distance; None: it has to be computed.
        parts: the distances by the coordinates that they depend on, None where these are not known;
            empty: of none.
    """

    function: ca.Function
    lower: Array
    names: tuple[str, ...]
    exact: Callable[[Array, int], float] | None = None
    closer: Callable[[Array, int, float], bool] | None = None
    parts: tuple[DistancePart | None, ...] = ()
    _shown = ("names", "lower", "dof")

    @property
    def dof(self) -> int:
        """Number N of joints of all arms."""
        return int(self.function.size1_in(0))

    def at(self, q: Array) -> Array:
        """Return the distances (k, m) [m] at configurations (k, N)."""
        return at_rows(self.function, q)

    def row(self, *indices: int) -> ca.Function:
        """Return one or more distances, as a function of (N,) with none of the others' operations.

        Raises:
            ValueError: there is no such distance.
        """
        for index in indices:
            if not 0 <= index < len(self.names):
                raise ValueError(f"index must be from 0 to {len(self.names) - 1}, got {index!r}")
        return _rows(self.function, indices)

    def only(self, indices: Sequence[int]) -> Clearance:
        """Return some of the distances."""
        if len(indices) == len(self.names):
            return self

        def exact(at: Array, number: int) -> float:
            assert self.exact is not None  # else it is not used
            return self.exact(at, indices[number])

        def closer(at: Array, number: int, distance: float) -> bool:
            return self.closer is None or self.closer(at, indices[number], distance)

        names = tuple(self.names[k] for k in indices)
        parts = tuple(self.parts[k] for k in indices) if self.parts else ()
        known = None if self.exact is None else exact
        lower = self.lower[list(indices)]
        return Clearance(self.row(*indices), lower, names, known, closer, parts)

    def part(self, index: int) -> DistancePart:
        """Return one of the distances by the coordinates that it depends on, or by all of them."""
        known = self.parts[index] if self.parts else None
        if known is not None:
            return known
        columns = tuple(range(self.dof))
        levers = np.full(self.dof, np.inf)
        return DistancePart(self.row(index), columns, np.zeros(0), levers)


@dataclass(frozen=True, eq=False, repr=False)
class DistancePart(ShortRepr):
    """A distance by the coordinates that it depends on.

    Attributes:
        function: distance [m] at these coordinates and, if there are any, for these numbers: the
            function of all capsules on the same two joints.
        columns: indices of the coordinates in the configuration of all arms.
        numbers: ends of the capsules, and what is taken off the distance of their segments [m].
        levers: how far the links move relative to each other at most, by each coordinate (k,)
            [m/rad] or [m/m]; infinite: it is not known.
    """

    function: ca.Function
    columns: tuple[int, ...]
    numbers: Array
    levers: Array
    _shown = ("columns",)

    def moved(self, q: Array, other: Array) -> Array:
        """Return a bound of how far points of the links move relative to each other [m], (...)."""
        steps = np.abs(q - other)[..., list(self.columns)]
        moves = steps > 0.0  # an infinite lever bounds nothing unless the coordinate stays
        by_each = np.multiply(steps, self.levers, where=moves, out=np.zeros(steps.shape))
        return np.asarray(by_each.sum(axis=-1))

    def expression(self, q: ca.SX) -> ca.SX:
        """Return the distance as an expression of the configuration of all arms."""
        given = q[list(self.columns)], self.numbers
        return ca.SX(self.function(*given[: self.function.n_in()]))


@lru_cache(maxsize=256)
def _rows(function: ca.Function, indices: tuple[int, ...]) -> ca.Function:
    q, distances = _expressions(function)
    return ca.Function("distances", [q], [distances[list(indices)]], ["q"], ["d"])


@lru_cache(maxsize=8)
def _expressions(function: ca.Function) -> tuple[ca.SX, ca.SX]:
    q = ca.SX.sym("q", function.size1_in(0))
    return q, function(q)


def keep_clear(
    arms: Model | Sequence[Model],
    *,
    pairs: LinkPairs | Sequence[tuple[str, str]] | None = None,
    obstacles: Sequence[Obstacle] = (),
    margin: float = MARGIN,
    placements: Sequence[Any] | None = None,
) -> Clearance | None:
    """Return distances of the capsules of links from each other and from obstacles; None if there
    are no.

    The capsules contain the links, so the distances are lower bounds of the exact ones, except for
    pairs with an excess (`LinkPairs.excess`), which is added to them.

    >>> import geodesic_ocp as go
    >>> arm, ball = go.human_arm(), go.Ball(centre=(0.3, 0.4, -0.1), radius=0.1)
    >>> go.execution.keep_clear(arm, obstacles=[ball])
    Clearance(names=<4 entries>, lower=[0.01, 0.01, 0.01, 0.01], dof=7)

    Args:
        arms: a model, or several.
        pairs: pairs of links, as from `link_pairs`, whose `constrained` ones are taken, or by name;
            None: those that `link_pairs` finds.
        obstacles: balls, capsules, boxes and half-spaces in the common base frame, which all moving
            links keep clear of.
        margin: smallest distance allowed [m]; of pairs that cannot come as far apart as twice that,
            half of the largest distance that they can have (`LinkPairs.reach`).
        placements: placements of the bases of the arms, see `link_pairs`.

    Raises:
        ValueError: an unknown link, obstacles that are fixed to a link, or a wrong margin.
    """
    margin = as_number("margin", margin)
    placed, named, excess, margins = _pairs(arms, pairs, placements, margin)
    q = ca.SX.sym("q", placed.dof)
    distances: dict[str, ca.SX] = {}
    lower: list[float] = []
    solids: list[tuple[PlacedSolid, PlacedSolid] | None] = []  # None: of a link and an obstacle
    parts: list[DistancePart | None] = []
    between = cache(partial(_between_joints, placed))
    for (one, other), wider, least in zip(named, excess, margins, strict=True):
        both = placed.by_name[one], placed.by_name[other]
        for capsules in product(*(each.solid.capsules for each in both)):
            points = [list(dict.fromkeys((each.start, each.end))) for each in capsules]
            counts = map(len, points)
            function, columns, levers = between(
                *((each.arm, each.solid.joint, next(counts)) for each in both)
            )
            radii = sum(each.radius for each in capsules) - wider
            numbers = np.concatenate([*map(np.ravel, points), [radii]])
            extents = np.array([each.solid.extent for each in both])
            part = DistancePart(function, columns, numbers, levers @ [*extents, 1.0])
            parts.append(part)
            add_named(distances, f"{one} to {other}", part.expression(q))
            solids.append(both)
            lower.append(least)
    segments = _segments(placed, q) if obstacles else {}
    moving = [each.name for each in placed.solids if each.moves]
    for number, obstacle in enumerate(obstacles):
        _check_obstacle(obstacle)
        for link in moving:
            name = f"{link} to {obstacle.name or f'obstacle {number}'}"
            for segment, radius in segments[link]:
                for *_, found in nearest_to_obstacle(segment, radius, obstacle):
                    add_named(distances, name, found)
                    solids.append(None)
                    parts.append(None)
                    lower.append(margin)
    if not distances:
        return None
    together = ca.cse(ca.vertcat(*distances.values()))
    function = ca.Function("clearance", [q], [together], ["q"], ["d"])

    @lru_cache(maxsize=_REMEMBERED)
    def poses(at: bytes) -> list[Pose]:
        return placed.joint_poses(np.frombuffer(at)[None])

    # Of the capsules of two links, each asks for the same distances.
    @lru_cache(maxsize=_REMEMBERED)
    def apart(pair: tuple[PlacedSolid, PlacedSolid], at: bytes) -> float:
        return exact_distance_at(*pair, poses(at), 0)

    @lru_cache(maxsize=_REMEMBERED)
    def nearer(pair: tuple[PlacedSolid, PlacedSolid], at: bytes, distance: float) -> bool:
        return is_closer_at(*pair, poses(at), 0, distance)

    def exact(at: Array, index: int) -> float:
        if (pair := solids[index]) is None:
            return max(0.0, float(function(at)[index]))
        return apart(pair, np.ascontiguousarray(at, dtype=float).tobytes())

    def closer(at: Array, index: int, distance: float) -> bool:
        if (pair := solids[index]) is None:
            return True
        return nearer(pair, np.ascontiguousarray(at, dtype=float).tobytes(), distance)

    return Clearance(function, np.array(lower), tuple(distances), exact, closer, tuple(parts))


def joined_clearance(parts: Sequence[Clearance], dof: int) -> Clearance:
    """Return all distances of clearances of the same joints as one clearance; none without any."""
    if len(parts) == 1:
        return parts[0]
    q = ca.SX.sym("q", dof)
    function = ca.Function("distances", [q], [ca.vertcat(*(each.function(q) for each in parts))])
    owners = [(part, index) for part in parts for index in range(len(part.names))]

    def exact(at: Array, number: int) -> float:
        part, index = owners[number]
        return part.exact(at, index) if part.exact else max(0.0, float(part.row(index)(at)))

    def closer(at: Array, number: int, distance: float) -> bool:
        part, index = owners[number]
        return part.closer is None or part.closer(at, index, distance)

    lower = np.concatenate([np.zeros(0), *(each.lower for each in parts)])
    names = tuple(part.names[index] for part, index in owners)
    known = tuple(part.parts[index] if part.parts else None for part, index in owners)
    return Clearance(function, lower, names, exact, closer, known)


def _between_joints(
    placed: PlacedSolids, one: tuple[int, int, int], other: tuple[int, int, int]
) -> tuple[ca.Function, tuple[int, ...], Array]:
    """Return the distance of capsules on two joints, the columns (k,) of the coordinates between,
    and the levers (k, 3) by the extents of both links and by 1.

    Args:
        placed: the links.
        one, other: index of the arm, of the joint in it, and number of points of the segment: one
            of a ball, two of a capsule.
    """
    q = ca.SX.sym("q", placed.dof)
    supports = []
    for arm, joint, _ in (one, other):
        supports.append([(arm, each) for each in list(placed.models[arm].pin.supports[joint])[1:]])
    common = set(supports[0]) & set(supports[1])
    first = np.cumsum([0, *(model.dof for model in placed.models)])
    locals_ = {
        arm: joint_placements(placed.models[arm].pin, q[first[arm] : first[arm + 1]])
        for arm in {one[0], other[0]}
    }
    segments = []
    symbols = []
    columns = dict[int, Array]()
    for side, ((arm, _, count), chain) in enumerate(zip((one, other), supports, strict=True)):
        model = placed.models[arm]
        length = np.eye(3)[side]
        for _, joint in reversed([each for each in chain if each not in common]):
            twist = motion_subspace(model.pin, joint)
            column = model.pin.joints[joint].idx_v
            slide = np.linalg.norm(twist[:3])
            turn = np.linalg.norm(twist[3:])
            columns[int(first[arm]) + column] = turn * length + slide * np.eye(3)[2]
            far = float(np.linalg.norm(model.pin.jointPlacements[joint].translation))
            if slide > 0.0:
                far += slide * max(abs(model.lower[column]), abs(model.upper[column]))
            length[2] += far
        at = Placement(*map(constant, placed.bases[arm]))
        if one[0] == other[0]:  # in the frame of the last joint that moves both
            at = Placement(ca.SX.eye(3), ca.SX.zeros(3))
        for each in chain:
            if each not in common:
                at = at @ locals_[arm][each[1]]
        symbols.append(ca.SX.sym("x", 3, count))
        ends = ca.horzsplit(symbols[-1])
        capsule: Any = Capsule(ends[0], ends[-1], 1.0)  # type: ignore[arg-type]
        segments.append(line_segment(capsule, at.rotation, at.translation))
    radii = ca.SX.sym("r")
    some = tuple(sorted(columns))
    numbers = ca.vertcat(*map(ca.vec, symbols), radii)
    apart = segment_distance(*segments) - radii
    function = ca.Function("distance", [q[list(some)], numbers], [apart])
    return function, some, np.array([columns[each] for each in some])


def _segments(placed: PlacedSolids, q: ca.SX) -> dict[str, list[tuple[LineSegment, float]]]:
    """Return segments and radii of the capsules of each link in the common base frame."""
    chains = []
    columns = np.cumsum([0, *(model.dof for model in placed.models)]).tolist()
    own_q = ca.vertsplit(q, columns)
    for model, base, own in zip(placed.models, placed.bases, own_q, strict=True):
        chain = [Placement(*map(constant, base))]
        for index, local in enumerate(joint_placements(model.pin, own)[1:], 1):
            chain.append(chain[model.pin.parents[index]] @ local)
        chains.append(chain)
    found: dict[str, list[tuple[LineSegment, float]]] = {name: [] for name in placed.by_name}
    for name, each in placed.by_name.items():
        joint = chains[each.arm][each.solid.joint]
        for capsule in each.solid.capsules:
            segment = line_segment(capsule, joint.rotation, joint.translation)
            found[name].append((segment, capsule.radius))
    return found


def _pairs(
    arms: Model | Sequence[Model],
    pairs: LinkPairs | Sequence[tuple[str, str]] | None,
    placements: Sequence[Any] | None,
    margin: float,
) -> tuple[PlacedSolids, Sequence[tuple[str, str]], Sequence[float], Sequence[float]]:
    """Return the links of the arms, the pairs to be kept apart, and excess and margin of each."""
    if pairs is None or isinstance(pairs, LinkPairs):
        found = pairs_of(arms, placements, pairs, margin)
        margins = [found.margin(*pair, margin) for pair in found.constrained]
        return found.solids, found.constrained, found.excess, margins
    placed = place_solids(arms, placements)
    named = [as_pair(pair) for pair in pairs]
    for link in (link for pair in named for link in pair):
        if link not in placed.by_name:
            raise ValueError(
                f"pairs: there is no link {link!r} with geometry within reach; there are "
                f"{', '.join(placed.by_name) or 'none'}"
            )
    return placed, named, [0.0] * len(named), [margin] * len(named)


def _check_obstacle(obstacle: Obstacle) -> None:
    if not isinstance(obstacle, Obstacle):
        raise ValueError(f"obstacles must be Ball, Capsule, Box or HalfSpace, got {obstacle!r}")
    if not isinstance(obstacle, HalfSpace) and obstacle.link is not None:
        raise ValueError(
            f"obstacles must not be fixed to a link, as to {obstacle.link!r}; add what a link "
            "carries with Model.with_bodies"
        )


@dataclass(frozen=True, eq=False, repr=False)
class ActiveRows(ShortRepr):
    """Distances that are too small at some of k configurations.

    Attributes:
        samples: indices of the configurations (j,).
        rows: index of the distance (j,) that is too small there, of `Clearance.row`.
        lower: bound (j,) [m] that `Clearance.row` has to keep near that configuration for the
            exact distance to be the one allowed.
        lacks: what `Clearance.row` lacks to that bound there (j,) [m].
    """

    samples: NDArray[np.int64]
    rows: NDArray[np.int64]
    lower: Array
    lacks: Array

    def __len__(self) -> int:
        return len(self.rows)


def active_rows(clearance: Clearance, q: ArrayLike, margin: float | Array = 0.0) -> ActiveRows:
    """Return the distances that are too small at configurations q (k, N).

    A path is planned without constraints first, checked at many points, and planned again with
    those distances alone that are too small, at the points where they are.

    If the exact geometry is known, a distance counts only if that of it is too small, too, so that
    wide capsules bend no path that is clear; its bound is lower by how much the capsules are closer
    than the links. Where links overlap the bound is that of the capsules.

    Args:
        clearance: the distances.
        q: configurations.
        margin: added to the smallest distances allowed [m], to all or to each (m,).

    Raises:
        ValueError: q has the wrong shape.
    """
    points = as_configurations("q", q, clearance.dof)
    distances = clearance.at(points).T
    least = clearance.lower + margin
    rows, samples = np.nonzero(distances < least[:, None])
    lower = least[rows]
    found = distances[rows, samples]
    if clearance.exact is not None:
        places = zip(samples.tolist(), rows.tolist(), lower.tolist(), strict=True)
        apart = np.array([_exact_below(clearance, points[k], row, most) for k, row, most in places])
        close = apart < lower
        lower = lower - np.where(apart > 0.0, apart - found, 0.0)
        samples = samples[close]
        rows = rows[close]
        lower = lower[close]
        found = found[close]
    return ActiveRows(samples, rows, lower, lower - found)


def largest_lacks(clearance: Clearance, q: ArrayLike, enough: float = np.inf) -> Array:
    """Return the most (k,) [m] that a distance lacks at configurations q (k, N), see `active_rows`;
    zero where none is too small.

    In less time, as few exact distances decide.

    Args:
        clearance: the distances.
        q: configurations.
        enough: of what lacks more, anything above this is returned [m].
    """
    points = as_configurations("q", q, clearance.dof)
    found = np.zeros(len(points))
    lacks = clearance.lower - clearance.at(points)
    for k, (point, own) in enumerate(zip(points, lacks, strict=True)):
        for row in np.argsort(-own).tolist():
            if own[row] <= found[k] or found[k] > enough:
                break  # capsules lack no less than the links
            amount = own[row]
            least = clearance.lower[row]
            if clearance.exact is not None:
                apart = _exact_below(clearance, point, row, max(0.0, least - found[k]))
                amount = least - apart if apart > 0.0 else amount
            found[k] = max(found[k], amount)
    return found


def _exact_below(clearance: Clearance, q: Array, index: int, most: float) -> float:
    """Return an exact distance [m]; infinite if it is known not to be below `most`."""
    assert clearance.exact is not None  # as the callers make sure
    if most < np.inf and clearance.closer and not clearance.closer(q, index, most):
        return np.inf
    return clearance.exact(q, index)


def least_distances(clearance: Clearance, q: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return least of each distance (m,) [m] over configurations q (k, N), and where it is (m,).

    It is that of the exact geometry where the function is below its bound, and the least of all
    distances always is.
    """
    distances = clearance.at(q).T
    samples = np.argmin(distances, axis=1)
    least = distances.min(axis=1)
    if clearance.exact is None:
        return least, samples
    smallest = np.inf
    for row in np.argsort(least).tolist():
        if least[row] >= max(clearance.lower[row], smallest):
            continue  # the function is a lower bound: this one is farther apart
        least[row], part = np.inf, clearance.part(row)
        farther = np.zeros(len(q), dtype=bool)
        for sample in np.argsort(distances[row]).tolist():
            if max(distances[row, sample], 0.0) >= least[row]:
                break  # the function is a lower bound: later samples are farther apart
            if farther[sample]:
                continue
            exact = clearance.exact(q[sample], row)
            if exact < least[row]:
                least[row] = exact
                samples[row] = sample
            farther |= part.moved(q, q[sample]) <= exact - least[row]
        smallest = min(smallest, least[row])
    return least, samples
