"""reachability: which poses a robot's hand cannot attain, and what mounting would help."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from geodesic_ocp.arrays import Array, ShortRepr, as_positive
from geodesic_ocp.cells import Indices
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.ocp.pose_search import search_bounds, search_each, step_terms
from geodesic_ocp.retargeting.arm_alignment import Alignment
from geodesic_ocp.retargeting.paired_arm import PairedArm
from geodesic_ocp.tables import new_table

if TYPE_CHECKING:
    from pandas import DataFrame

_FITTING = tuple(np.arange(40, 19, -1) / 40.0)
_SCALES = (0.95, 0.9, 0.85, 0.8, 0.7, 0.6)
_SHIFTS = (0.1, 0.2, 0.3)  # of the arm's length
_ANGLES = (30, -30, 60, -60, 90, -90)  # [degrees]
_TURNS = (
    (2, (*_ANGLES, 180), "turn the robot's base about the vertical"),
    (0, _ANGLES, "tilt the robot's base about the person's right"),
    (1, _ANGLES, "tilt the robot's base about the person's forward axis"),
)
_WAYS = (("to the right", "to the left"), ("forward", "backward"), ("up", "down"))


@dataclass(frozen=True, eq=False)
class Mounting:
    """A changed alignment, and a factor of positions.

    Attributes:
        alignment: the changed one.
        factor: factor of positions, in addition to the present scale.
        change: what is changed, in words; the factor apart.
        arguments: what to pass to `go.retargeting.align`, such as "shoulder=(0.1, 0, 0.3)"; empty
            if only the factor is changed.
    """

    alignment: Alignment
    factor: float
    change: str
    arguments: str

    def poses(self, rotations: Array, positions: Array) -> tuple[Array, Array]:
        """Get poses of the robot's hand from those in the person's axes, with the present scale."""
        return self.alignment.to_robot(rotations, positions, scale=self.factor)

    def sentence(self, scale: float | None) -> str:
        """Return advice, such as "Scale positions by 0.9 (scale=0.7)"."""
        parts = []
        if self.change:
            parts.append(f"{self.change} (go.retargeting.align(robot, {self.arguments}))")
        if self.factor != 1.0:
            new = "" if scale is None else f" (scale={self.factor * scale:.3g})"
            parts.append(f"scale positions by {self.factor:g}{new}")
        text = " and ".join(parts)
        return text[0].upper() + text[1:]


def mountings(alignment: Alignment, missed: Array) -> list[Mounting]:
    """Return mountings to try, the smaller changes first.

    Args:
        alignment: the present one.
        missed: mean vector (3,) [m] from the nearest positions within reach to those out of reach,
            in the robot's base; zero if the positions are within reach.
    """
    size = float(np.linalg.norm(missed))
    directions = np.asarray(alignment.base).T
    back = []  # the person's shoulder, so that poses out of reach come nearer to the robot
    if size > 0.0:
        parts = (_SHIFTS[0] / 2.0, *_SHIFTS)
        back = [_moved(alignment, -missed / size * part * alignment.length) for part in parts]
    shifts = [
        _moved(alignment, sign * part * alignment.length * axis)
        for part in _SHIFTS
        for axis in directions
        for sign in (1.0, -1.0)
    ]
    turns = [
        _turned(alignment, axis, angle, verb) for axis, degrees, verb in _TURNS for angle in degrees
    ]
    smaller = [Mounting(alignment, factor, "", "") for factor in _SCALES]
    some = (*back[-1:], *shifts[:6], *turns)
    both = [replace(each, factor=factor) for factor in _SCALES[1::2] for each in some]
    return [*back, *smaller[:2], *shifts, *smaller[2:], *turns, *both]


def _moved(alignment: Alignment, shift: Array) -> Mounting:
    moved = np.round(np.asarray(alignment.shoulder) + shift, 3) + 0.0
    person = (moved - np.asarray(alignment.shoulder)) @ np.asarray(alignment.base)
    steps = [
        f"{abs(distance):.2f} m {names[int(distance < 0.0)]}"
        for distance, names in zip(person, _WAYS, strict=True)
        if abs(distance) >= 0.005
    ]
    return Mounting(
        replace(alignment, shoulder=moved),
        1.0,
        f"move the person's shoulder on the robot {' and '.join(steps)}",
        f"shoulder={_numbers(moved)}",
    )


def _turned(alignment: Alignment, axis: int, angle: int, verb: str) -> Mounting:
    """Return the robot's base turned by an angle [degrees] about an axis of the person."""
    turn = Rotation.from_euler("xyz"[axis], -angle, degrees=True).as_matrix()
    new = np.round(np.asarray(alignment.base) @ turn, 12) + 0.0
    rows = ", ".join(_numbers(row, 6) for row in new)
    return Mounting(
        replace(alignment, base=new), 1.0, f"{verb} by {angle} degrees", f"base=[{rows}]"
    )


def _numbers(values: Array, digits: int = 3) -> str:
    return f"({', '.join(f'{value:.{digits}g}' for value in values)})"


class NearestPoses(NamedTuple):
    """The nearest poses found.

    Attributes:
        q: configurations (k, n).
        distances: distances of the hand from the targets (k,) [m].
        angles: likewise (k,) [rad]; zero if the rotation is free.
    """

    q: Array
    distances: Array
    angles: Array

    @property
    def within_reach(self) -> NDArray[np.bool_]:
        """Which targets are attained (k,)."""
        return np.asarray(np.maximum(self.distances, self.angles) <= _WITHIN)


def nearest_poses(
    robot: Model, rotations: Array | None, positions: Array, starts: Array, steps: int
) -> NearestPoses:
    """Return configurations within the limits whose hand poses are nearest to k targets.

    Levenberg-Marquardt steps on |p - position|^2 + angle^2 ([m], [rad]) from m starts for each
    target, on all of them at once; the best of each is kept.

    Args:
        robot: the arm.
        rotations: (k, 3, 3) in its base frame; None leaves them free.
        positions: (k, 3) [m].
        starts: configurations (k, m, n).
        steps: number of steps.
    """
    count = len(starts)
    rows = tuple(range(3 if rotations is None else 6))
    turned = np.repeat(np.eye(3)[None], count, axis=0) if rotations is None else rotations
    by_columns = turned.transpose(0, 2, 1).reshape(count, 9)
    axes = np.tile(np.eye(3).ravel(), (count, 1))
    p = np.hstack([positions, by_columns, axes])
    terms = step_terms(robot, rows, (robot.hand,))
    weights = np.ones(len(rows))
    q, errors = search_each(terms, p, starts, search_range(robot), weights, steps, True)
    nearest = np.arange(count), (errors**2).sum(axis=2).argmin(axis=1)
    distances = np.linalg.norm(errors[nearest][:, :3], axis=1)
    return NearestPoses(q[nearest], distances, np.linalg.norm(errors[nearest][:, 3:], axis=1))


def nearest_of_each(
    robot: Model, rotations: Array | None, positions: Array, starts: Array, steps: int
) -> NearestPoses:
    """Return `nearest_poses` for c sets of k targets at once, with leading axes (c, k).

    Args:
        robot, steps: see there.
        rotations: (c, k, 3, 3) in its base frame; None leaves them free.
        positions: (c, k, 3) [m].
        starts: configurations (k, m, n), of every set.
    """
    sets, count, _ = positions.shape
    turned = None if rotations is None else rotations.reshape(-1, 3, 3)
    every = np.tile(starts, (sets, 1, 1))
    found = nearest_poses(robot, turned, positions.reshape(-1, 3), every, steps)
    return NearestPoses(*(each.reshape(sets, count, *each.shape[1:]) for each in found))


def search_range(robot: Model) -> tuple[Array, Array]:
    """Return lower and upper bounds (n,) of the search: the limits, or half a revolution either
    way.
    """
    lower, upper, _ = search_bounds(robot, np.zeros(robot.dof), True)
    return lower, upper


_WITHIN = 1e-4  # [m] and [rad]
_STARTS = 20
_STEPS = 40
# of a mounting that is tried
_FEW_STARTS = 6
_FEW_STEPS = 20
_MOST_POSES = 24  # for which mountings are tried
_TOGETHER = 8  # mountings that are tried at once


@dataclass(frozen=True)
class Unreachable:
    """A pose out of reach.

    Attributes:
        index: index of the pose.
        distance, angle: distance and angle of the nearest pose within reach from it [m], [rad].
        beyond: what the pose is farther from the shoulder than the arm is long [m].
    """

    index: int
    distance: float
    angle: float
    beyond: float


@dataclass(frozen=True, eq=False, repr=False)
class Reachability(ShortRepr):
    """Reachability: which poses a robot's hand attains.

    Attributes:
        count: number of poses.
        unreachable: those out of reach.
        mounting: the change that brings most of them within reach; None: none is needed, or no
            change that was tried helps.
        helped: number of poses within reach with that change.
        advice: sentences that say so; empty if all poses are within reach.
    """

    count: int
    unreachable: tuple[Unreachable, ...]
    mounting: Mounting | None
    helped: int
    advice: str
    _shown = ("count", "helped", "advice")

    def __str__(self) -> str:
        return self.advice or f"all {self.count} poses are within reach"

    def table(self) -> DataFrame:
        """Return the poses out of reach."""
        header = ("pose", "distance [m]", "angle [rad]", "beyond the arm's length [m]")
        rows = tuple(
            (str(each.index), each.distance, each.angle, each.beyond) for each in self.unreachable
        )
        return new_table(header, rows)


def reachability(
    robot: Model,
    alignment: Alignment,
    rotations: ArrayLike | None,
    positions: ArrayLike,
    *,
    scale: float | None = None,
) -> Reachability:
    """Return hand poses that a robot attains within its limits, and the mounting that would help.

    Mountings are tried around the given one: positions scaled down, the person's shoulder moved,
    and the base turned or tilted. The smallest change that brings all, or the most, poses within
    reach is advised.

    >>> import geodesic_ocp as go
    >>> arm = go.human_arm("right")
    >>> q = [[0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1], [1.2, -0.2, -0.9, 1.6, -0.3, 0.1, 0.4]]
    >>> poses = arm.hand_pose(q)
    >>> found = go.retargeting.reachability(arm, go.retargeting.align(arm), *poses)
    >>> found.count, len(found.unreachable)
    (2, 0)

    Args:
        robot: the arm.
        alignment: alignment with which the poses were mapped to it.
        rotations: rotations of the hand (k, 3, 3) in the robot's base; None leaves them free.
        positions: positions of the hand (k, 3) [m].
        scale: factor of positions that they were mapped with; the advice then names a new one.

    Raises:
        ValueError: wrong types or shapes.
    """
    robot = as_model(robot)
    if not isinstance(alignment, Alignment):
        raise ValueError(f"alignment must be an Alignment, got {alignment!r}")
    turned, placed = _as_poses(rotations, positions)
    if scale is not None:
        scale = as_positive("scale", scale)
    starts = random_starts(robot, len(placed))
    found = nearest_poses(robot, turned, placed, starts, _STEPS)
    beyond = distances_beyond(alignment, placed)
    attained = found.within_reach
    unreachable = tuple(
        Unreachable(int(k), float(found.distances[k]), float(found.angles[k]), float(beyond[k]))
        for k in np.flatnonzero(np.logical_not(attained))
    )
    if not unreachable:
        return Reachability(len(placed), (), None, len(placed), "")
    mounting: Mounting | None
    mounting, helped = _best(robot, alignment, turned, placed, found)
    if helped <= int(attained.sum()):
        mounting = None
        helped = int(attained.sum())
    advice = _advice(robot, unreachable, len(placed), mounting, helped, scale, turned is not None)
    return Reachability(len(placed), unreachable, mounting, helped, advice)


def scaled_to_fit(pairs: Sequence[PairedArm]) -> list[PairedArm]:
    """Return arms with positions scaled down until the most poses are within reach.

    The largest such factor, to 0.025, from 1 down to 0.5; one for all arms, as they move together.
    """
    best = 1.0
    for pair in pairs:
        robot = pair.robot
        samples = pair.key_samples
        turned, placed = (each[samples] for each in pair.target_poses)
        rotations = turned[None] if pair.settings.orientation_weight > 0.0 else None
        shoulder = np.asarray(pair.mapping.target.shoulder)
        starts = random_starts(robot, len(turned))
        factor = 1.0
        most = -1
        for tried in _FITTING:
            scaled = (shoulder + tried * (placed - shoulder))[None]
            found = nearest_of_each(robot, rotations, scaled, starts, _STEPS)
            if (within := int(found.within_reach.sum())) > most:
                factor = tried
                most = within
            if most == len(samples):
                break
        best = min(best, factor)
    return [pair.scaled(best) for pair in pairs]


def distances_beyond(alignment: Alignment, positions: ArrayLike) -> Array:
    """Return how much farther than the arm's length positions (k, 3) are from the shoulder [m]."""
    arm = np.asarray(positions, dtype=float) - np.asarray(alignment.shoulder)
    return np.asarray(np.maximum(np.linalg.norm(arm, axis=-1) - alignment.length, 0.0))


def _as_poses(rotations: ArrayLike | None, positions: ArrayLike) -> tuple[Array | None, Array]:
    placed = np.asarray(positions, dtype=float)
    if placed.ndim != 2 or placed.shape[1] != 3 or not len(placed):
        raise ValueError(f"positions must have shape (k, 3), at least one, got {placed.shape}")
    turned = None if rotations is None else np.asarray(rotations, dtype=float)
    if turned is not None and turned.shape != (len(placed), 3, 3):
        raise ValueError(f"rotations must have shape ({len(placed)}, 3, 3), got {turned.shape}")
    for name, given in (("positions", placed), ("rotations", turned)):
        if given is not None and not np.all(np.isfinite(given)):
            raise ValueError(f"{name} must be finite")
    return turned, placed


def random_starts(robot: Model, count: int) -> Array:
    """Return configurations (k, m, n): the middle of the limits, and random ones."""
    lower, upper = search_range(robot)
    random = np.random.default_rng(0).uniform(lower, upper, (_STARTS, robot.dof))
    random[0] = (lower + upper) / 2.0
    return np.repeat(random[None], count, axis=0)


def _best(
    robot: Model,
    alignment: Alignment,
    rotations: Array | None,
    positions: Array,
    found: NearestPoses,
) -> tuple[Mounting, int]:
    """Return the mounting with the most poses within reach, and their number."""
    turned = np.tile(np.eye(3), (len(positions), 1, 1)) if rotations is None else rotations
    person = alignment.to_person(turned, positions)

    def within_reach(
        several: Sequence[Mounting], some: Indices, starts: Array, steps: int
    ) -> NDArray[np.int64]:
        """Return the numbers of poses within reach, found together for several mountings."""
        poses = [mounting.poses(*(each[some] for each in person)) for mounting in several]
        mapped, placed = map(np.stack, zip(*poses, strict=True))
        wanted = None if rotations is None else mapped
        found = nearest_of_each(robot, wanted, placed, starts, steps)
        return np.asarray(found.within_reach.sum(axis=1))

    # Poses as far from reach as possible decide; the others are nearly always kept.
    order = np.argsort(-(found.distances + found.angles), kind="stable")[:_MOST_POSES]
    random = np.random.default_rng(1).uniform(
        *search_range(robot), (len(order), _FEW_STARTS - 1, robot.dof)
    )
    starts = np.concatenate([found.q[order][:, None], random], axis=1)
    _, nearest = robot.hand_pose(found.q)
    far = found.distances > _WITHIN
    missed = (positions - nearest)[far].mean(axis=0) if np.any(far) else np.zeros(3)
    best = None
    most = -1
    tried = mountings(alignment, missed)
    for first in range(0, len(tried), _TOGETHER):
        several = tried[first : first + _TOGETHER]
        numbers = within_reach(several, order, starts, _FEW_STEPS)
        if numbers.max() > most:
            best = several[numbers.argmax()]
            most = int(numbers.max())
        if most == len(order):
            break
    assert best is not None
    every = np.arange(len(positions))
    starts = random_starts(robot, every.size)
    return best, int(within_reach([best], every, starts, _STEPS)[0])


def _advice(
    robot: Model,
    unreachable: tuple[Unreachable, ...],
    count: int,
    mounting: Mounting | None,
    helped: int,
    scale: float | None,
    turned: bool,
) -> str:
    far = max(each.distance for each in unreachable)
    angle = max(each.angle for each in unreachable)
    many = len(unreachable)
    said = (
        f"{many} of {count} poses {'is' if many == 1 else 'are'} out of reach of {robot.name!r}, "
        f"by up to {far:.2g} m{f' and {angle:.2g} rad' if turned else ''}"
    )
    if too_far := sum(each.beyond > 0.0 for each in unreachable):
        said += f" ({too_far} farther from the shoulder than the arm is long)"
    if mounting is None:
        return (
            f"{said}. No mounting that was tried helps; leave the orientation of the hand free, "
            "see go.retargeting.place_base, or check the axes of the hand with `geodesic-ocp align`"
        )
    return (
        f"{said}. {mounting.sentence(scale)}: then {helped} of {count} are within reach. "
        "go.retargeting.place_base (--mount auto) seeks the best place"
    )
