"""Inverse kinematics: configurations with a given pose, by many starts at once.

Damping in proportion to the squared error converges quadratically, also near singularities
(Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", IEEE
Trans. Robotics 27, 2011). What the pose leaves free serves to come nearer to a configuration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import casadi as ca
import numpy as np
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import (
    Array,
    as_number,
    as_rotation,
    as_vector,
    real_array,
    rotation_vector,
)
from geodesic_ocp.blocks import Terms, single_block
from geodesic_ocp.ipopt import Ipopt
from geodesic_ocp.model.distances import as_pair, signed_distances
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.model.primitives import Obstacle

# configurations (k, n) -> weighted pose errors (k, m), steps (k, n) and slides (k,)
Steps: TypeAlias = Callable[[Array], tuple[Array, Array, Array]]

# the latter if anything has been found
_STEPS = 40
_USUAL_STEPS = 24
_PATIENCE = 12  # steps after which starts far from the pose are given up
# pose errors [m] and [rad]
_FAR = 0.1
_EXACT_EACH = 1e-11
# of the squared error
_DAMPING = 0.05
_LEAST_DAMPING = 1e-12
_LONGEST = 0.7  # step [rad or m]
_SETTLED = 1e-2  # step [rad or m] along the configurations with the pose
_STUCK = 1e-2  # step relative to the pose error of a search that ends away from the pose
_SLIDE = 0.7  # of the way to the nearest configuration, as the pose's curvature is ignored


@dataclass(frozen=True, eq=False)
class Found:
    """Configurations (k, n), and the largest of their weighted pose errors (k,)."""

    q: Array
    errors: Array


def search_simultaneously(
    steps: Steps,
    starts: Array,
    bounds: tuple[Array, Array],
    enough: int,
    settled: float = _SETTLED,
) -> Found:
    """Return configurations within bounds whose pose errors vanish, or are least nearby.

    Args:
        steps: pose errors of many configurations, steps and slides, see `pose_steps`.
        starts: configurations (k, n) to search from.
        bounds: lower and upper (n,).
        enough: the search ends when so many have attained the pose and no longer move.
        settled: how little they still move [rad or m]; infinite if any configuration will do.
    """
    lower, upper = bounds
    q = np.clip(starts, lower, upper)
    done_q: list[Array] = []
    given_up: list[Array] = []
    for number in range(_STEPS):
        errors, step, slide = steps(q)
        largest = np.abs(errors).max(axis=1, initial=0.0)
        done = (largest <= _EXACT_EACH) & (slide <= settled)
        if np.any(done):
            done_q += list(q[done])
            if len(done_q) >= enough:
                break
        moves = np.abs(step).max(axis=1) > _STUCK * largest
        keep = ~done & moves & ((number < _PATIENCE) | (largest <= _FAR))
        given_up += list(q[~done & ~keep])
        q = np.clip(q[keep] + step[keep], lower, upper)
        if not len(q) or (done_q and number >= _USUAL_STEPS):
            break
    every = np.array([*done_q, *q, *given_up])
    return Found(every, np.abs(steps(every)[0]).max(axis=1, initial=0.0))


def _split(found: Array, rows: int) -> tuple[Array, Array, Array]:
    """Return pose errors (k, rows), steps (k, n) and slides (k,) from values of `step_terms`."""
    return found[:, :rows], found[:, rows:-1], found[:, -1]


def search_each(
    terms: Terms,
    poses: Array,
    starts: Array,
    bounds: tuple[Array, Array],
    weights: Array,
    steps: int = _USUAL_STEPS,
    one_each: bool = False,
) -> tuple[Array, Array]:
    """Return configurations (k, m, n) found from m starts for each of k poses, and pose errors
    (k, m, rows) there.

    Away from the poses they are those of local minima.

    Args:
        terms: pose errors and steps, see `step_terms`.
        poses: position, rotation by columns and axes, of each pose (k, .).
        starts: configurations (k, m, n) to search from.
        bounds: lower and upper (n,).
        weights: weights of the rows, in the search.
        steps: number of steps.
        one_each: whether a pose that one of its starts has reached needs no others, and those that
            are far away are not given up.
    """
    count, each, n = starts.shape
    target = np.repeat(np.arange(count), each)
    best = q = np.clip(starts.reshape(-1, n), *bounds)
    found = np.full((len(q), weights.size), np.inf)
    least = np.full(len(q), np.inf)
    active = np.arange(len(q))
    given = np.concatenate([weights, _given(bounds)])
    for number in range(steps + 1):
        p = np.hstack([poses[target[active]], np.tile(given, (len(q), 1))])
        errors, step, _ = _split(terms.at("value", q, p)[1], weights.size)
        weighted = weights * errors
        square = (weighted * weighted).sum(axis=1)
        better = square < least[active]
        rows = active[better]
        best[rows] = q[better]
        found[rows] = errors[better]
        least[rows] = square[better]
        largest = np.abs(weighted).max(axis=1)
        going = largest > _EXACT_EACH
        if one_each:
            reached = np.zeros(count, dtype=bool)
            reached[target[active[~going]]] = True
            going &= ~reached[target[active]]
        elif number >= _PATIENCE:
            going &= largest <= _FAR
        going &= np.abs(step).max(axis=1, initial=0.0) > _STUCK * largest
        active = active[going]
        if not len(active):
            break
        q = np.clip(q[going] + step[going], *bounds)
    return best.reshape(starts.shape), found.reshape(count, each, -1)


def pose_steps(
    q: Array,
    errors: Array,
    jacobians: Array,
    bounds: tuple[Array, Array],
    near: Array | None = None,
    settled: float = 0.0,
) -> tuple[Array, Array]:
    """Get steps (k, n), and the lengths (k,) of their parts along configurations with one pose.

    Parts that are not longer than `settled` are left out, so that pose errors vanish quadratically.
    """
    count, _, n = jacobians.shape
    given = np.tile(_given(bounds, near, settled), (count, 1))
    p = np.hstack([errors, jacobians.transpose(0, 2, 1).reshape(count, -1), given])
    found = _steps_from(errors.shape[1], n).at("value", q, p)[1]
    return found[:, :-1], found[:, -1]


@lru_cache(maxsize=32)
def _steps_from(rows: int, n: int) -> Terms:
    """Return steps and slides; p: errors, their Jacobian by columns, `_given`."""
    q = ca.SX.sym("q", n)
    p = ca.SX.sym("p", rows + rows * n + 3 * n + 2)
    errors, slopes, given = ca.vertsplit(p, [0, rows, rows + rows * n, p.numel()])
    return Terms(q, p, 0.0, _step(q, errors, ca.reshape(slopes, rows, n), given))


def _step(q: ca.SX, errors: ca.SX, jacobian: ca.SX, given: ca.SX) -> ca.SX:
    """Return a step (n,) and the length of its slide, from weighted errors and their Jacobian."""
    n = q.numel()
    free = ca.SX.ones(q.numel())
    square = ca.sumsqr(errors)
    lower, upper, near, share, settled = ca.vertsplit(
        given, [0, n, 2 * n, 3 * n, 3 * n + 1, 3 * n + 2]
    )
    damping = (_DAMPING * square + _LEAST_DAMPING) * ca.SX.eye(errors.numel())
    for _ in range(3):  # joints that would leave their range stay at its end
        own = jacobian @ ca.diag(free)
        closer = share * (near - q) * free
        factors = ca.ldl(own @ own.T + damping, False)
        corrections = own.T @ ca.ldl_solve(ca.horzcat(errors, own @ closer), *factors)
        slide = ca.if_else(square < _FAR**2, closer - corrections[:, 1], 0.0)
        length = ca.norm_2(slide)
        step = ca.if_else(length > settled, slide, 0.0) - corrections[:, 0]
        leaves = ca.logic_or(
            ca.logic_and(q <= lower, step < 0.0), ca.logic_and(q >= upper, step > 0.0)
        )
        free *= 1 - leaves
    return ca.vertcat(step * (_LONGEST / ca.fmax(ca.norm_2(step), _LONGEST)), length)


def _given(bounds: tuple[Array, Array], near: Array | None = None, settled: float = 0.0) -> Array:
    """Return lower and upper bounds (n,), and what steps come near to."""
    share = 0.0 if near is None else _SLIDE
    near = np.zeros_like(bounds[0]) if near is None else near
    return np.concatenate([*bounds, near, [share, settled]])


class CollisionAvoidance(NamedTuple):
    """Arguments of `signed_distances`, and the smallest distance allowed [m]."""

    obstacles: tuple[Obstacle, ...] = ()
    links: tuple[str, ...] | None = None
    pairs: tuple[tuple[str, str], ...] = ()
    margin: float = 0.0

    @classmethod
    def checked(
        cls,
        obstacles: Sequence[Obstacle],
        links: Sequence[str] | None,
        pairs: Sequence[tuple[str, str]],
        margin: float,
    ) -> CollisionAvoidance:
        """Build from arguments as users give them; ValueError if a pair or margin is malformed."""
        links = None if links is None else tuple(links)
        return cls(tuple(obstacles), links, tuple(map(as_pair, pairs)), as_number("margin", margin))

    @property
    def bodies(self) -> tuple[Any, Any, Any]:
        """Everything but the margin, which enters programs as a bound."""
        return self.obstacles, self.links, self.pairs

    @property
    def is_empty(self) -> bool:
        """True if nothing is kept apart."""
        return not (self.obstacles or self.pairs)


_TINY = 1e-12


def rotation_log(rotation: ca.SX) -> ca.SX:
    """Return rotation vector (3, 1) [rad], axis times angle, of a rotation (3, 3), up to an angle
    of pi.

    Computed from the unit quaternion, whose largest entry is found first, so that no division by
    zero occurs (Shepperd, "Quaternion from rotation matrix", J. Guidance and Control 1, 1978). At
    pi, where the axis is defined up to its sign, one of both is returned; the norm is right.
    """
    skew = rotation - rotation.T
    trace = ca.trace(rotation)
    turn = ca.vertcat(skew[2, 1], skew[0, 2], skew[1, 0])
    symmetric = rotation + rotation.T + (1 - trace) * ca.SX.eye(3)
    # 4 q q' for the unit quaternion q: a column is q times a number.
    products = ca.blockcat([[1 + trace, turn.T], [turn, symmetric]])
    column = products[:, 0]
    largest = products[0, 0]
    for k in (1, 2, 3):
        column = ca.if_else(products[k, k] > largest, products[:, k], column)
        largest = ca.fmax(products[k, k], largest)
    quaternion = column / ca.norm_2(column)
    quaternion = ca.if_else(quaternion[0] < 0, -quaternion, quaternion)
    square = ca.sumsqr(quaternion[1:])
    sine = ca.sqrt(ca.fmax(square, _TINY))
    factor = ca.if_else(square > _TINY, 2 * ca.atan2(sine, quaternion[0]) / sine, 2 + square / 3)
    return factor * quaternion[1:]


def pose_difference(
    rotation: Array, position: Array, target_rotation: Array, target_position: Array
) -> tuple[float, float]:
    """Return distance [m] and angle [rad] between two poses, given as (3, 3) and (3,) each."""
    vector = rotation_vector(target_rotation.T @ rotation)
    return float(np.linalg.norm(position - target_position)), float(np.linalg.norm(vector))


def as_directions(name: str, given: ArrayLike | None) -> Array:
    """Return unit directions (k, 3) from None, one direction (3,) or several (k, 3).

    Raises:
        ValueError: wrong shapes, a zero vector, or directions that span all of space.
    """
    if given is None:
        return np.zeros((0, 3))
    try:
        directions = np.atleast_2d(real_array(given))
    except (TypeError, ValueError):
        directions = np.zeros(0)
    if directions.shape == (1, 0) or directions.shape == (0, 3):
        return np.zeros((0, 3))
    lengths = np.linalg.norm(directions, axis=-1)
    scaled = directions / np.where(lengths > 0.0, lengths, 1.0)[..., None]
    if (
        directions.ndim != 2
        or directions.shape[1] != 3
        or not np.all(np.isfinite(directions))
        or not np.all(lengths > 0.0)
        or np.linalg.matrix_rank(np.nan_to_num(scaled)) > 2
    ):
        raise ValueError(
            f"{name} must be a direction (3,), or (k, 3) of at most two independent ones, not "
            f"zero, got {given!r}"
        )
    return np.asarray(scaled)


def complement(directions: Array) -> tuple[Array, int]:
    """Get orthonormal axes (3, 3), in columns, of which the first m span the directions, and m."""
    if not len(directions):
        return np.eye(3), 0
    across = scipy.linalg.null_space(directions)
    along = scipy.linalg.null_space(across.T)
    return np.hstack([along, across]), along.shape[1]


# Starts searched from simultaneously: first those nearby, which are the most promising.
_FIRST = 8
_AT_ONCE = 20
_MANY = 32  # at once, if several configurations are to be found
_SPREAD = 0.7  # [rad or m], standard deviation
_EXACT = 1e-9  # pose error [m] and [rad] of the simultaneous search


def search_bounds(model: Model, start: Array, limits: bool) -> tuple[Array, Array, Array]:
    """Return bounds (n,) of a search for configurations, and the start clipped to the limits.

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


class SearchOutcome(NamedTuple):
    """A configuration, and Ipopt's verdict.

    Attributes:
        q: (n,).
        error: the largest pose error among those that must vanish, or overlap of collision bodies.
        success: whether Ipopt found a solution.
        objective: its value.
    """

    q: Array
    error: float
    success: bool
    objective: float


@dataclass(frozen=True, eq=False)
class PoseSearch:
    """Configurations of one model with a hand pose, sought from several starts.

    Attributes:
        model: model whose hands they are.
        near: configuration (n,) to stay near to.
        position, rotation: stacked positions and rotations of h hands, (3 h,), (3 h, 3).
        rows: which of the six rows of the pose error (position, rotation vector) of each hand are
            part of it.
        axes: axes (3, 3) of position errors.
        bound: bounds of the rows of the error: zero, or infinite where they are free.
        limits: whether the joints stay within their limits.
        bounds: lower and upper (n,) of the search.
        collisions: bodies that are kept apart.
        hands: names of the hands.
    """

    model: Model
    near: Array
    position: Array
    rotation: Array
    rows: tuple[int, ...]
    axes: Array
    bound: Array
    limits: bool
    bounds: tuple[Array, Array]
    collisions: CollisionAvoidance
    hands: tuple[str, ...]

    @classmethod
    def checked(
        cls,
        caller: str,
        model: Model,
        near: ArrayLike,
        position: ArrayLike | None,
        rotation: ArrayLike | None,
        *,
        limits: bool = True,
        free: ArrayLike | None = None,
        collisions: CollisionAvoidance | None = None,
        hands: tuple[str, ...] = (),
    ) -> PoseSearch:
        """Return the search for a pose as users give it; ValueError if it is malformed."""
        if position is None and rotation is None:
            raise ValueError(f"{caller} needs a position, a rotation or both")
        count = max(len(hands), 1)
        own = [0, 1, 2] if position is not None else []
        own += [3, 4, 5] if rotation is not None else []
        rows = [6 * number + row for number in range(count) for row in own]
        near = as_vector("near", near, as_model(model).dof)
        axes, num_free = complement(as_directions("free", free))
        is_held = np.tile([*(np.arange(3) >= num_free), True, True, True], count)[rows]
        blocks = [np.eye(3)] * count
        if rotation is not None:
            several = np.vsplit(np.asarray(rotation), count) if hands else [rotation]
            blocks = [as_rotation("rotation", each) for each in several]
        return cls(
            model,
            near,
            np.zeros(3 * count) if position is None else as_vector("position", position, 3 * count),
            np.vstack(blocks),
            tuple(rows),
            axes,
            np.where(is_held, 0.0, np.inf),
            limits,
            search_bounds(model, near, limits)[:2],
            collisions or CollisionAvoidance(),
            hands or (model.hand,),
        )

    def starts(self, count: int) -> list[Array]:
        """Return `near`, moved into the bounds, random ones around it, and random ones."""
        rng = np.random.default_rng(0)
        n = self.model.dof
        around = self.near + _SPREAD * rng.standard_normal((_FIRST - 1, n))
        others = rng.uniform(*self.bounds, (max(0, count - _FIRST), n))
        first = np.clip(np.vstack([self.near, around]), *self.bounds)
        return [*first[:count], *others]

    def simultaneously(
        self,
        starts: Sequence[Array],
        weights: Array,
        enough: int,
        settled: float = _SETTLED,
        least: int = 1,
    ) -> tuple[list[Array], list[Array], float]:
        """Return configurations with the pose, others, and the least error, without collision
        avoidance.

        Those with the pose are sorted by their distance from `near`, the others by their error.
        The search ends when enough of them move by less than `settled` [rad or m] towards it, or
        when at least some have been found from the most promising starts.
        """
        terms = step_terms(self.model, self.rows, self.hands)
        pose = self._parameters(0.0, np.zeros(0))[self.model.dof : -1]
        p = np.concatenate([pose, weights, _given(self.bounds, self.near, min(settled, _SETTLED))])

        def steps(q: Array) -> tuple[Array, Array, Array]:
            errors, step, slides = _split(terms.at("value", q, p)[1], weights.size)
            return weights * errors, step, slides

        attained: list[Array] = []
        others: list[tuple[float, Array]] = []
        first_batch = _FIRST if least <= 1 else _MANY
        edges = [0, *range(first_batch, len(starts), _AT_ONCE), len(starts)]
        for first, last in pairwise(edges):
            batch = np.array(starts[first:last])
            missing = enough - len(attained)
            ends = search_simultaneously(steps, batch, self.bounds, missing, settled)
            attained += list(ends.q[ends.errors <= _EXACT])
            others += [*zip(ends.errors.tolist(), ends.q, strict=True)]
            if len(attained) >= least:
                break
        others.sort(key=lambda pair: pair[0])
        attained.sort(key=lambda q: float(np.linalg.norm(q - self.near)))
        return attained, [q for _, q in others], others[0][0]

    def is_clear(self, q: Array) -> bool:
        """Return whether the collision bodies keep their distance at a configuration (n,)."""
        program, _ = _program(self.model, self.rows, self.collisions.bodies, self.hands)
        count = len(self.rows)
        x = np.concatenate([q, np.zeros(count)])
        _, g = program.nlp(x, self._parameters(0.0, np.zeros(count)))
        return bool(np.all(g.full()[count:] >= self.collisions.margin))

    def _parameters(self, stay: float, weights: Array) -> Array:
        pose = [self.position, *(each.ravel(order="F") for each in (self.rotation, self.axes))]
        return np.concatenate([self.near, *pose, [stay], weights])

    def outcomes(
        self, starts: Iterable[Array], weights: Array, stay: float
    ) -> Iterator[SearchOutcome]:
        """Yield outcomes of Ipopt from one start after the other.

        min stay |q - near|^2 / 2 + |weights e|^2 / 2 over q and the pose errors e, |e| <= bound.
        """
        n = self.model.dof
        count = len(self.rows)
        (lower, upper) = self.bounds
        program, errors = _program(self.model, self.rows, self.collisions.bodies, self.hands)
        num_distances = program.size_g - count
        least = np.repeat([0.0, self.collisions.margin], [count, num_distances])
        most = np.repeat([0.0, np.inf], [count, num_distances])
        p = self._parameters(stay, weights)
        lbx = np.concatenate([lower, -self.bound])
        ubx = np.concatenate([upper, self.bound])
        for start in starts:
            first = np.clip(errors(start, p).full()[:, 0], -self.bound, self.bound)
            x0 = np.concatenate([start, first])
            outcome = program(x0=x0, p=p, lbx=lbx, ubx=ubx, lbg=least, ubg=most)
            q = outcome.x[:n]
            overlap = float(np.max((least - outcome.g)[count:], initial=0.0))
            # The errors of q itself: Ipopt meets equalities to its own tolerance.
            held = errors(q, p).full()[self.bound == 0.0, 0]
            error = float(np.max(np.abs(held), initial=overlap))
            yield SearchOutcome(q, error, outcome.success, outcome.objective)


@lru_cache(maxsize=32)
def _pose_errors(model: Model, rows: tuple[int, ...], hands: tuple[str, ...]) -> ca.Function:
    """Return the pose errors (q, p) -> e; p: near, position, rotation, axes, stay, weights."""
    n = model.dof
    count = len(hands)
    edges = np.cumsum([0, 3 * count, 9 * count, 9]).tolist()
    q = ca.SX.sym("q", n)
    p = ca.SX.sym("p", n + edges[-1] + 1 + len(rows))
    position, rotation, axes = ca.vertsplit(p[n : n + edges[-1]], edges)
    error = stacked_error(
        model, hands, q, position, ca.reshape(rotation, 3 * count, 3), ca.reshape(axes, 3, 3)
    )
    return ca.Function("pose_errors", [q, p], [error[list(rows)]])


def stacked_error(
    model: Model, hands: Sequence[str], q: ca.SX, position: ca.SX, rotation: ca.SX, axes: Any
) -> ca.SX:
    """Return the six rows of the pose error of each of h hands (6 h, 1), positions in some axes.

    Args:
        model, hands, q: the hands of a model at q (n,).
        position, rotation: their targets (3 h, 1) and (3 h, 3).
        axes: (3, 3), in columns.
    """
    errors = []
    for number, hand in enumerate(hands):
        own = slice(3 * number, 3 * number + 3)
        hand_rotation, hand_position = model.frame_pose(hand, q)
        errors.append(axes.T @ (hand_position - position[own]))
        errors.append(rotation_log(rotation[own, :].T @ hand_rotation))
    stacked: ca.SX = ca.vertcat(*errors)
    return stacked


def _errors_and_slopes(
    model: Model, rows: tuple[int, ...], hands: tuple[str, ...], q: ca.SX, p: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Return pose errors and how they change with the joints; p: position, rotation by columns,
    axes.

    The derivative of the rotation vector is replaced by the angular velocity in the hand's axes,
    which it approaches as the error vanishes, and which changes its length in the same way.
    """
    every = ca.vertcat(ca.SX.zeros(model.dof), p, ca.SX.zeros(1 + len(rows)))
    errors = _pose_errors(model, rows, hands)(q, every)
    axes = ca.reshape(p[12 * len(hands) :], 3, 3)
    twists = []
    jacobians = ca.vertsplit(model.stacked_jacobians(hands, q), 6)
    for hand, jacobian in zip(hands, jacobians, strict=True):
        rotation, _ = model.frame_pose(hand, q)
        twists += [axes.T @ jacobian[:3, :], rotation.T @ jacobian[3:, :]]
    return errors, ca.densify(ca.vertcat(*twists)[list(rows), :])


@lru_cache(maxsize=32)
def step_terms(model: Model, rows: tuple[int, ...], hands: tuple[str, ...]) -> Terms:
    """Return pose errors (m,), steps (n,) and lengths of their slides, see `pose_steps`.

    p: that of `_errors_and_slopes`, weights of the rows, `_given`.
    """
    n = model.dof
    count = len(rows)
    size = 12 * len(hands) + 9
    q = ca.SX.sym("q", n)
    p = ca.SX.sym("p", size + count + 3 * n + 2)
    pose, weights, given = ca.vertsplit(p, [0, size, size + count, p.numel()])
    errors, slopes = _errors_and_slopes(model, rows, hands, q, pose)
    step = _step(q, weights * errors, ca.diag(weights) @ slopes, given)
    return Terms(q, p, 0.0, ca.vertcat(errors, step), lasting=True)


@lru_cache(maxsize=32)
def _program(
    model: Model, rows: tuple[int, ...], bodies: tuple[Any, Any, Any], hands: tuple[str, ...]
) -> tuple[Ipopt, ca.Function]:
    """Return the program in x = (q, e), and the pose errors e (q, p); then come the distances."""
    n = model.dof
    count = len(rows)
    function = _pose_errors(model, rows, hands)
    q = ca.SX.sym("q", n)
    e = ca.SX.sym("e", count)
    p = ca.SX.sym("p", function.size1_in(1))
    near = p[:n]
    stay = p[-count - 1]
    weights = p[-count:]
    obstacles, links, pairs = bodies
    distances = signed_distances(model, q, obstacles, links=links, pairs=pairs)
    f = stay * ca.sumsqr(q - near) / 2 + ca.sumsqr(weights * e) / 2
    g = ca.vertcat(function(q, p) - e, *distances.values())
    return single_block(Terms(ca.vertcat(q, e), p, f, g)), function
