"""Candidates at the waypoints, and the shortest path through them, at which the program starts.

The nodes of the graph are configurations with the poses of the waypoints. An edge costs the energy
of the straight line, and the time that the joints' speed limits add to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.blocks import Terms
from geodesic_ocp.execution.clearance import Clearance, largest_lacks
from geodesic_ocp.model.joint_axes import upright
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.pose_search import search_bounds, search_each, step_terms
from geodesic_ocp.retargeting.paired_arm import (
    REACHED,
    middle_of_ranges,
    nearest_configurations,
)
from geodesic_ocp.retargeting.revolutions import periods, shorter_way, unwrapped
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.retargeting.waypoints import ArmWaypoints, ObjectiveWeights

_STARTS = 96  # of the search at each waypoint
_CARRIED = 32  # more, the configurations found at the waypoint before
_MOST = 64  # configurations at a waypoint
_SAME = 0.05  # [rad or m]
# Poses out of reach: errors up to this factor above the least, and this much more [m or rad]. The
# nearest pose may be on the other side of a singularity.
_NEARLY = 1.5
_MORE = 0.02
_NEAR = 32  # more of them that miss a pose within reach
_POSE_ROUNDS = 4  # of searches, whose results are joined
_PERHAPS = 1e-4  # error of the nearest pose [m or rad] up to which the pose may be attained
_MISSED = 1e3, 1e5  # range of weights of squared errors [1/m^2] or [1/rad^2]
_TINY = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Candidates(ShortRepr):
    """Configurations (k, n) with the pose of a waypoint, or with the nearest ones.

    Attributes:
        q: the configurations.
        errors: errors of their poses (k,) [m or rad]; zero for those that attain the pose.
        allowed: whether their poses may be missed by as much (k,).
    """

    q: Array
    errors: Array
    allowed: NDArray[np.bool_]

    @classmethod
    def attaining(cls, *configurations: Array) -> Candidates:
        """Return configurations with the pose."""
        count = len(configurations)
        return cls(np.array(configurations), np.zeros(count), np.ones(count, dtype=bool))

    @property
    def within_reach(self) -> bool:
        """True if any of them attains the pose."""
        return bool(self.errors.min() == 0.0)

    @property
    def missed(self) -> Array:
        """Weights of the squared errors (k,); zero for those that attain the pose.

        The nearer the pose, the larger: of a pose out of reach as that of the nearest one, and of
        one within reach as that of each.
        """
        least = self.errors if self.within_reach else np.full_like(self.errors, self.errors.min())
        weights = np.clip(np.maximum(least, _TINY) ** -2, *_MISSED)
        return np.where(self.errors == 0.0, 0.0, weights)

    def joined(self, other: Candidates) -> Candidates:
        """Join candidates; if any attains the pose, drop those that miss it by too much."""
        q = np.vstack([self.q, other.q])
        errors = np.concatenate([self.errors, other.errors])
        allowed = np.concatenate([self.allowed, other.allowed])
        return _chosen(q, errors, allowed, _MOST * _POSE_ROUNDS)


@lru_cache(maxsize=8)
def first_candidates(waypoints: ArmWaypoints, num_starts: int = _STARTS) -> tuple[Candidates, ...]:
    """Get configurations at each waypoint, from random starts and those of the waypoint before."""
    count = waypoints.count + 1
    given = waypoints.start
    rng = np.random.default_rng(0)
    middle = middle_of_ranges(waypoints.arm)[0]
    lower, upper, _ = search_bounds(waypoints.arm, middle, waypoints.limited)
    starts = rng.uniform(lower, upper, (count, num_starts, waypoints.arm.dof))
    if waist := [waypoints.arm.joint_names.index(each) for each in waypoints.arm.shared_joints]:
        starts[:, :, waist] = upright(waypoints.arm)[waist]
    starts[:, 0] = middle
    layers = candidates_near(waypoints, starts)
    if given is not None:
        layers[0] = Candidates.attaining(given)
    carried = [layers[max(0, number - 1)].q[:_CARRIED] for number in range(count)]
    more = candidates_near(
        waypoints, np.array([np.resize(q, starts[0, :_CARRIED].shape) for q in carried])
    )
    found = [
        _reached(layer.joined(other), waypoints, number)
        for number, (layer, other) in enumerate(zip(layers, more, strict=True))
    ]
    return tuple(found if given is None else [layers[0], *found[1:]])


def _reached(layer: Candidates, waypoints: ArmWaypoints, number: int) -> Candidates:
    """Return the candidates, after a more thorough search for a pose that they nearly attain."""
    arm = waypoints.arm
    near = layer.q[0]
    pose = waypoints.poses[number]
    if layer.within_reach or max(pose.error(arm, near)) > _PERHAPS:
        return layer
    q = nearest_configurations(arm, near, pose, waypoints.limited, waypoints.weights)[0]
    attained = max(pose.error(arm, q)) <= REACHED
    return Candidates.attaining(q).joined(layer) if attained else layer


def candidates_near(waypoints: ArmWaypoints, starts: Array) -> list[Candidates]:
    """Return configurations at all waypoints, each near one of its starts (m + 1, k, n).

    Those of a body have its waist upright as well as free, as free ones hardly have it in common,
    and a waist may be too slow to change from one to the other.
    """
    arm = waypoints.arm
    weights = waypoints.row_weights
    free = np.full(waypoints.arm.dof, np.inf)
    lower, upper = (arm.lower, arm.upper) if waypoints.limited else (-free, free)
    terms = step_terms(arm, waypoints.rows, waypoints.hands)
    p = np.array([[*pose.numbers, *np.eye(3).ravel()] for pose in waypoints.poses])
    bounds = [(lower, upper)]
    still = upright(arm)
    if arm.shared_joints:
        waist = np.isin(arm.joint_names, arm.shared_joints)
        bounds.append((np.where(waist, still, lower), np.where(waist, still, upper)))
    every = [search_each(terms, p, starts, each, weights) for each in bounds]
    q, rows = (np.concatenate(each, axis=1) for each in zip(*every, strict=True))
    errors = np.abs(weights * rows).max(axis=2)
    errors = np.where(errors <= REACHED * 1e-2, 0.0, errors)
    found = []
    for number, own in enumerate(zip(q, errors, strict=True)):
        allowed = (own[1] == 0.0) | waypoints.is_allowed(number, own[0])
        found.append(_chosen(*own, allowed, _MOST))
    return found


def _chosen(q: Array, errors: Array, allowed: NDArray[np.bool_], most: int) -> Candidates:
    """Return distinct ones of configurations (k, n), up to a number, those with the least errors
    first.
    """
    least = float(errors.min())
    taken = allowed if least == 0.0 else allowed | (errors <= _NEARLY * least + _MORE)
    order = np.argsort(errors, kind="stable")
    order = order[taken[order]]
    kept: list[int] = []
    near = 0
    same = np.zeros(len(q), dtype=bool)
    for index in order.tolist():
        if same[index]:
            continue
        near += bool(least == 0.0 and errors[index] > 0.0)
        if len(kept) - near >= most or near > _NEAR:
            continue
        kept.append(index)
        same |= np.abs(q - q[index]).max(axis=1) <= _SAME
    return Candidates(q[kept], errors[kept], allowed[kept])


def shortest_path(
    node_costs: Sequence[Array],
    edge_costs: Sequence[Array],
    further: Callable[[Sequence[tuple[int, int]]], Array] | None = None,
) -> tuple[list[int], float]:
    """Return one node of each layer, with the least sum of costs.

    Args:
        node_costs: node costs of each layer, (k_i,).
        edge_costs: costs (k_i, k_i+1) of the edges from each layer to the next one.
        further: nodes, each a layer and an index -> costs (j,) in addition, not negative. They are
            asked for only where the shortest path by what is known passes.

    Returns:
        Indices of the nodes, and their cost.
    """
    nodes = [np.array(costs, dtype=float) for costs in node_costs]
    known = set[tuple[int, int]]()
    while True:
        total = nodes[0]
        before = list[NDArray[np.int64]]()
        for edges, costs in zip(edge_costs, nodes[1:], strict=True):
            sums = total[:, None] + edges
            best = np.argmin(sums, axis=0)
            before.append(best)
            total = sums[best, np.arange(best.size)] + costs
        chosen = [int(np.argmin(total))]
        for best in reversed(before):
            chosen.append(int(best[chosen[-1]]))
        new = [each for each in enumerate(reversed(chosen)) if each not in known]
        if further is None or not new:
            return chosen[::-1], float(total.min())
        known.update(new)
        for (layer, index), cost in zip(new, further(new), strict=True):
            nodes[layer][index] += cost


def with_further_edges(
    node_costs: Sequence[Array],
    edge_costs: Sequence[Array],
    further: Callable[[int, Any, Any], Array],
    path: Sequence[int],
    cost: float,
) -> list[Array]:
    """Return the costs of edges with further ones where the shortest path may lead, else infinity.

    Args:
        node_costs, edge_costs: see `shortest_path`.
        further: number of a layer, and indices of nodes in it and in the next (j,) -> costs (j,) in
            addition, not negative.
        path, cost: a path and its cost without these, which bound the shortest one.
    """
    most = cost + sum(float(further(k, [a], [b])[0]) for k, (a, b) in enumerate(pairwise(path)))
    # Least costs up to each node, and from it on.
    before = [node_costs[0]]
    after = [np.zeros_like(node_costs[-1])]
    for edges, costs in zip(edge_costs, node_costs[1:], strict=True):
        before.append((before[-1][:, None] + edges).min(axis=0) + costs)
    for edges, costs in zip(edge_costs[::-1], node_costs[:0:-1], strict=True):
        after.append((edges + costs + after[-1]).min(axis=1))
    found = []
    for layer, (edges, costs) in enumerate(zip(edge_costs, node_costs[1:], strict=True)):
        through = before[layer][:, None] + edges + costs + after[-2 - layer]
        first, second = np.nonzero(through <= most * (1.0 + 1e-9))
        found.append(np.full_like(edges, np.inf))
        found[-1][first, second] = edges[first, second] + further(layer, first, second)
    return found


_ROUNDS = 3  # of new candidates around those chosen
_FAR = 0.25  # of the arm's length
_TOO_NEAR = 100.0  # cost of links closer than their bounds [1/m]
AT_REST = 1e-9  # action [J s]
DETOUR = 40.0  # weight of the hand's distance from the person's halfway, in the graph
_SPREAD = 0.3  # [rad or m]; number of starts around each
_AROUND = 12  # [rad or m]; number of starts around each


class RememberedLacks:
    """What distances that depend on one arm lack to their bounds, by the exact geometry, and a
    record of what they lack at the configurations that were asked for.

    Wide capsules overlap in most configurations, also of links that are far apart.

    Attributes:
        own: those distances, of the joints of all arms.
        columns: joints of the arm.
    """

    def __init__(self, own: Clearance, columns: slice) -> None:
        self.own = own
        self.columns = columns
        self._known: dict[bytes, float] = {}

    def __call__(self, q: Array) -> Array:
        """Return the most that any of them lacks (k,) [m] at configurations (k, n)."""
        keys = [each.tobytes() for each in q]
        if new := [k for k, key in enumerate(keys) if key not in self._known]:
            most = largest_lacks(self.own, self._points(q[new])).tolist()
            self._known.update(zip((keys[k] for k in new), most, strict=True))
        return np.array([self._known[key] for key in keys])

    def none(self, q: Array) -> bool:
        """Return whether no distance lacks anything at a configuration (n,), in less time."""
        return not largest_lacks(self.own, self._points(q[None]), 0.0).any()

    def _points(self, q: Array) -> Array:
        points = np.zeros((len(q), self.own.dof))
        points[:, self.columns] = q
        return points


class StartConfigurations(NamedTuple):
    """Configurations at the waypoints (m + 1, n), and their cost.

    `missed` are the weights of the errors of poses that are missed (m + 1,), zero for the others,
    and `allowed` tells which of these may be missed by as much.
    """

    q: Array
    missed: Array
    allowed: NDArray[np.bool_]
    cost: float


@lru_cache(maxsize=8)
def least_action(waypoints: ArmWaypoints, layers: tuple[Candidates, ...]) -> float:
    """Return action [J s] of the straight lines between those candidates for which it is least."""
    return best_candidates(waypoints, ObjectiveWeights(1.0, 1.0, 0.0, 0.0, 0.0, 0.0), layers).cost


def graph_weights(
    waypoints: ArmWaypoints, layers: tuple[Candidates, ...], settings: RetargetingSettings
) -> ObjectiveWeights:
    """Return the weights of the objective for one arm by itself, in units of its least action."""
    action = least_action(waypoints, layers)
    duration = float(waypoints.ends[-1] - waypoints.begins[0])
    weights = settings.stretch_weight, settings.posture_weight, settings.likeness_weight
    return ObjectiveWeights(action if action > AT_REST else 1.0, duration, *weights, DETOUR)


def own_lacks(
    clearance: Clearance | None, arms: Sequence[ArmWaypoints], number: int
) -> RememberedLacks | None:
    """Return what distances lack to their bounds, those that depend on one arm alone; None if there
    are none.
    """
    if clearance is None:
        return None
    first = sum(arm.arm.dof for arm in arms[:number])
    after = first + arms[number].arm.dof
    q = ca.SX.sym("q", clearance.dof)
    distances = clearance.function(q)
    rows = ca.which_depends(distances, q[first:after], 1, True)
    if (others := ca.vertcat(q[:first], q[after:])).numel():
        shared = ca.which_depends(distances, others, 1, True)
        rows = [mine and not theirs for mine, theirs in zip(rows, shared, strict=True)]
    if not any(rows):
        return None
    own = clearance.only(np.flatnonzero(rows).tolist())
    return RememberedLacks(own, slice(first, after))


def can_hold(waypoints: ArmWaypoints, lacks: RememberedLacks | None, q: Array) -> Iterator[bool]:
    """Yield for configurations (k, n) whether links are apart, and joints strong enough."""
    for strong, each in zip(waypoints.strong_enough(q), q, strict=True):
        yield bool(strong) and (lacks is None or lacks.none(each))


def attained(
    waypoints: ArmWaypoints, layers: Sequence[Candidates], lacks: RememberedLacks | None
) -> list[bool]:
    """Return which poses any of the candidates attains, within what is allowed, with links apart
    and joints strong enough to hold the arm there.
    """
    return [any(can_hold(waypoints, lacks, layer.q[layer.allowed])) for layer in layers]


@lru_cache(maxsize=8)
def find_start(
    waypoints: ArmWaypoints,
    weights: ObjectiveWeights,
    layers: tuple[Candidates, ...],
    lacks: RememberedLacks | None,
) -> StartConfigurations:
    """Return the configurations at the waypoints from which the program starts.

    Args:
        waypoints: waypoints of an arm.
        weights: weights of the objective.
        layers: configurations at each waypoint, around which others are sought.
        lacks: what distances lack, see `own_lacks`.
    """
    rng = np.random.default_rng(1)
    best = best_candidates(waypoints, weights, layers, lacks)
    last = len(layers) - 1
    for _ in range(_ROUNDS):
        around = np.array([best.q[[max(0, k - 1), k, min(k + 1, last)]] for k in range(last + 1)])
        spread = np.repeat(around, _AROUND // 3, axis=1)
        random = spread + _SPREAD * rng.standard_normal(spread.shape)
        starts = np.concatenate([around, around.mean(axis=1, keepdims=True), random], axis=1)
        more = candidates_near(waypoints, starts)
        finer = [layer.joined(other) for layer, other in zip(layers, more, strict=True)]
        if waypoints.start is not None:
            finer[0] = layers[0]
        layers = tuple(finer)
        before = best
        best = best_candidates(waypoints, weights, layers, lacks)
        if best.cost > 0.99 * before.cost:
            break
    return best


def best_candidates(
    waypoints: ArmWaypoints,
    weights: ObjectiveWeights,
    layers: Sequence[Candidates],
    lacks: RememberedLacks | None = None,
) -> StartConfigurations:
    """Return the shortest path through the candidates; see `find_start`.

    Between them, continuous joints turn the shorter way.
    """
    every = np.vstack([layer.q for layer in layers])
    ends = np.cumsum([len(layer.q) for layer in layers])[:-1]
    (_, masses) = _mass_matrices(waypoints.arm).at("value", every, np.zeros(0))
    dof = every.shape[1]
    matrices = np.split(masses.reshape(-1, dof, dof), ends)
    parameters = [
        waypoints.parameters(number, layer.missed, weights) for number, layer in enumerate(layers)
    ]
    # Of posture, likeness, gravity torques, and missed poses.
    costs = waypoints.terms.at("value", every, np.vstack(parameters))[0][:, 0] / len(layers)
    nodes = np.split(costs, ends)
    edges = [_edge_costs(waypoints, weights, layers, matrices, k) for k in range(len(layers) - 1)]

    def too_near(nodes: Sequence[tuple[int, int]]) -> Array:
        assert lacks is not None
        return _TOO_NEAR * lacks(np.array([layers[layer].q[index] for layer, index in nodes]))

    period = periods(waypoints.arm, waypoints.limited)
    further = None if lacks is None else too_near
    chosen, cost = shortest_path(nodes, edges, further)
    if weights.detour:

        def detours(layer: int, first: Any, second: Any) -> Array:
            here = layers[layer].q[first]
            middle = here + shorter_way(layers[layer + 1].q[second] - here, period) / 2.0
            return weights.detour * off_the_way(waypoints, layer, middle)

        edges = with_further_edges(nodes, edges, detours, chosen, cost)
        chosen, cost = shortest_path(nodes, edges, further)
    q = np.array([layer.q[index] for layer, index in zip(layers, chosen, strict=True)])
    free = np.full(dof, np.inf)
    bounds = (waypoints.arm.lower, waypoints.arm.upper) if waypoints.limited else (-free, free)
    middle = middle_of_ranges(waypoints.arm)[0] if waypoints.start is None else None
    q = unwrapped(q, period, bounds, middle)
    pairs = list(zip(layers, chosen, strict=True))
    missed = np.array([layer.missed[index] for layer, index in pairs])
    allowed = np.array([layer.allowed[index] for layer, index in pairs])
    return StartConfigurations(q, missed, allowed & (missed > 0.0), cost)


@lru_cache(maxsize=16)
def _mass_matrices(arm: Model) -> Terms:
    q = ca.SX.sym("q", arm.dof)
    return Terms(q, constraints=ca.vec(arm.mass_matrix(q)), lasting=True)


def _edge_costs(
    waypoints: ArmWaypoints,
    weights: ObjectiveWeights,
    layers: Sequence[Candidates],
    matrices: list[Array],
    number: int,
) -> Array:
    here = layers[number].q
    there = layers[number + 1].q
    duration = waypoints.durations[number]
    period = periods(waypoints.arm, waypoints.limited)
    change = shorter_way(there[None, :, :] - here[:, None, :], period)
    first = np.einsum("abi,abi->ab", change @ matrices[number], change)
    forces = (change.swapaxes(0, 1) @ matrices[number + 1]).swapaxes(0, 1)
    last = np.einsum("abi,abi->ab", forces, change)
    action = (first + last) / (4.0 * duration)
    needed = (np.abs(change) / (waypoints.speed[number] * duration)).max(axis=2)
    late = duration * np.maximum(0.0, needed - 1.0)
    return np.asarray(action / weights.action + weights.stretch * late / weights.duration)


def off_the_way(waypoints: ArmWaypoints, number: int, middle: Array) -> Array:
    """Return squared distance (k,) of the hand from the person's halfway through a movement, at q
    (k, n).

    In units of 1 rad and of a fraction of the arm's length, per movement and hand. Of two ways
    around, on which the hand turns to either side, one is that of the person.
    """
    distances, angles = waypoints.halfway[number].errors(waypoints.arm, middle)
    squares = angles**2 + (distances / (_FAR * waypoints.alignment.length)) ** 2
    return np.asarray(squares.mean(axis=1) / waypoints.count)
