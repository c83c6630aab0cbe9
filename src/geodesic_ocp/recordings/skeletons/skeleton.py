"""Skeleton and SkeletonMotion: a tree of joints, and how it moves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from geodesic_ocp.arrays import Array


@dataclass(frozen=True, eq=False, repr=False)
class Skeleton:
    """A tree of joints in its rest pose, in which the frames of all joints are parallel.

    Attributes:
        names: of the n joints, parents before their children; empty at the ends of limbs.
        parents: index of each joint's parent; -1 for the root.
        offsets: of each joint from its parent in the rest pose, (n, 3), in the file's unit.
        hinges: unit axis (3,) in the rest pose, by index, of joints that turn about one axis only.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array
    hinges: Mapping[int, Array] = field(default_factory=dict)

    def path(self, joint: int) -> list[int]:
        """Indices of the joints from the root to this one."""
        path = []
        while joint >= 0:
            path.append(joint)
            joint = self.parents[joint]
        return path[::-1]

    def way(self, start: int, end: int) -> list[int]:
        """Indices of the joints from the first after `start` to `end`, which comes after it."""
        path = self.path(end)
        return path[path.index(start) + 1 :]

    def __repr__(self) -> str:
        shown = ", ".join(self.names[:8]) + (", ..." if len(self.names) > 8 else "")
        return f"Skeleton({len(self.names)} joints: {shown})"


@dataclass(frozen=True, eq=False, repr=False)
class SkeletonMotion:
    """The motion of a skeleton, joint by joint.

    Attributes:
        skeleton: the joints.
        time: (k,) [s].
        rotation: from the index of a joint to its rotations relative to its parent, (k, 3, 3); one
            (3, 3) if it does not turn.
        position: from the index of a joint to its positions relative to its parent, (k, 3), in the
            file's unit; (3,) if it stays at its offset.
    """

    skeleton: Skeleton
    time: Array
    rotation: Callable[[int], Array]
    position: Callable[[int], Array]

    def __repr__(self) -> str:
        return f"SkeletonMotion({len(self.time)} samples of {self.skeleton!r})"


def forward_kinematics(
    motion: SkeletonMotion, joints: Iterable[int]
) -> dict[int, tuple[Array, Array]]:
    """Rotations (k, 3, 3) and positions (k, 3) in the file's space of the frames of these joints.

    Those of the joints on the way from the root are included.
    """
    count = len(motion.time)
    poses: dict[int, tuple[Array, Array]] = {
        -1: (np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3)))
    }
    for joint in sorted({each for last in joints for each in motion.skeleton.path(last)}):
        rotations, positions = poses[motion.skeleton.parents[joint]]
        relative = np.broadcast_to(motion.position(joint), (count, 3))
        poses[joint] = (
            rotations @ motion.rotation(joint),
            positions + np.einsum("kij,kj->ki", rotations, relative),
        )
    del poses[-1]
    return poses
