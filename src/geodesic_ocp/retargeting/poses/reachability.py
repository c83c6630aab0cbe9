"""reachability: which poses a robot's hand cannot attain, and what mounting would help."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.poses.mounting import Mounting, mountings
from geodesic_ocp.retargeting.poses.nearest_poses import NearestPoses, nearest_poses, search_range
from geodesic_ocp.table import Table

_WITHIN = 1e-4  # [m] and [rad]
_STARTS, _STEPS = 20, 40
_FEW_STARTS, _FEW_STEPS = 6, 20  # of a mounting that is tried
_MOST_POSES = 24  # for which mountings are tried


@dataclass(frozen=True)
class Unreachable:
    """A pose out of reach.

    Attributes:
        index: of the pose.
        distance, angle: of the nearest pose within reach from it [m], [rad].
        beyond: what the pose is farther from the shoulder than the arm is long [m].
    """

    index: int
    distance: float
    angle: float
    beyond: float


@dataclass(frozen=True, eq=False, repr=False)
class Reachability:
    """Which of some poses a robot's hand attains.

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

    def __repr__(self) -> str:
        return f"Reachability({self.count - len(self.unreachable)} of {self.count} within reach)"

    def __str__(self) -> str:
        return self.advice or f"all {self.count} poses are within reach"

    def table(self) -> Table:
        """The poses out of reach."""
        header = ("pose", "distance [m]", "angle [rad]", "beyond the arm's length [m]")
        rows = tuple(
            (str(each.index), each.distance, each.angle, each.beyond) for each in self.unreachable
        )
        return Table(header, rows)


def reachability(
    robot: Model,
    alignment: Alignment,
    rotations: ArrayLike | None,
    positions: ArrayLike,
    *,
    scale: float | None = None,
) -> Reachability:
    """Which hand poses a robot attains within its limits, and what mounting would help.

    Mountings are tried around the given one: positions scaled down, the person's shoulder moved,
    and the base turned or tilted. The smallest change that brings all, or the most, poses within
    reach is advised.

    Args:
        robot: the arm.
        alignment: with which the poses were mapped to it.
        rotations: of the hand (k, 3, 3) in the robot's base; None leaves them free.
        positions: of the hand (k, 3) [m].
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
    starts = _random_starts(robot, len(placed))
    found = nearest_poses(robot, turned, placed, starts, _STEPS)
    beyond = distances_beyond(alignment, placed)
    attained = _attained(found)
    unreachable = tuple(
        Unreachable(int(k), float(found.distances[k]), float(found.angles[k]), float(beyond[k]))
        for k in np.flatnonzero(np.logical_not(attained))
    )
    if not unreachable:
        return Reachability(len(placed), (), None, len(placed), "")
    mounting, helped = _best(robot, alignment, turned, placed, found)
    if helped <= int(attained.sum()):
        mounting, helped = None, int(attained.sum())
    advice = _advice(robot, unreachable, len(placed), mounting, helped, scale, turned is not None)
    return Reachability(len(placed), unreachable, mounting, helped, advice)


def distances_beyond(alignment: Alignment, positions: ArrayLike) -> Array:
    """What positions (k, 3) are farther from the shoulder than the arm is long (k,) [m]."""
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


def _random_starts(robot: Model, count: int) -> Array:
    """Configurations (k, m, n): the middle of the limits, and random ones."""
    lower, upper = search_range(robot)
    random = np.random.default_rng(0).uniform(lower, upper, (_STARTS, robot.dof))
    random[0] = (lower + upper) / 2.0
    return np.repeat(random[None], count, axis=0)


def _attained(found: NearestPoses) -> Array:
    return np.asarray(np.maximum(found.distances, found.angles) <= _WITHIN)


def _best(
    robot: Model,
    alignment: Alignment,
    rotations: Array | None,
    positions: Array,
    found: NearestPoses,
) -> tuple[Mounting | None, int]:
    """The mounting with the most poses within reach, and their number."""
    # Poses as far from reach as possible decide; the others are nearly always kept.
    order = np.argsort(-(found.distances + found.angles), kind="stable")[:_MOST_POSES]
    person = alignment.to_person(
        np.repeat(np.eye(3)[None], len(positions), axis=0) if rotations is None else rotations,
        positions,
    )
    some = np.random.default_rng(1).uniform(
        *search_range(robot), (len(order), _FEW_STARTS - 1, robot.dof)
    )
    starts = np.concatenate([found.q[order][:, None], some], axis=1)
    best: Mounting | None = None
    most = -1
    _, nearest = robot.hand_pose(found.q)
    far = found.distances > _WITHIN
    missed = (positions - nearest)[far].mean(axis=0) if np.any(far) else np.zeros(3)
    for mounting in mountings(alignment, missed):
        turned, placed = mounting.poses(person[0][order], person[1][order])
        given = None if rotations is None else turned
        number = int(_attained(nearest_poses(robot, given, placed, starts, _FEW_STEPS)).sum())
        if number > most:
            best, most = mounting, number
        if most == len(order):
            break
    if best is None:
        return None, 0
    turned, placed = best.poses(*person)
    every = _random_starts(robot, len(placed))
    given = None if rotations is None else turned
    return best, int(_attained(nearest_poses(robot, given, placed, every, _STEPS)).sum())


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
            f"{said}. No mounting that was tried helps; leave the orientation of the hand free, or "
            "check the axes of the hand with `geodesic-ocp align`"
        )
    return f"{said}. {mounting.sentence(scale)}: then {helped} of {count} are within reach"
