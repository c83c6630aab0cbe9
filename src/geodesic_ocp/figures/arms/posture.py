"""Postures: a model in some configurations, as bodies in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.arms.convex_parts import ConvexPart, convex_parts
from geodesic_ocp.model.model import Model


@dataclass(frozen=True, eq=False, repr=False)
class Postures:
    """A model in k configurations.

    Attributes:
        model: the model.
        parts: of its links.
        points: of each part in the model's base frame, (k, m, 3) [m], or (1, m, 3) if its link does
            not move.
        joints: origins of the frames of the moving links and of the hands, (k, j, 3) [m].
        hands: positions of the hands, (k, hands, 3) [m].
    """

    model: Model
    parts: tuple[ConvexPart, ...]
    points: tuple[Array, ...]
    joints: Array
    hands: Array

    def __repr__(self) -> str:
        return f"Postures({self.model.name!r}, {len(self.hands)} configurations)"

    def __len__(self) -> int:
        return len(self.hands)

    @classmethod
    def of(cls, model: Model, q: ArrayLike) -> Postures:
        """Of a model in configurations q (k, n) [rad or m]."""
        rows = np.atleast_2d(np.asarray(q, dtype=float))
        parts = convex_parts(model)
        poses = {part.link: model.frame_pose(part.link, rows) for part in parts if part.moves}
        points = tuple(
            part.points @ poses[part.link][0].transpose(0, 2, 1) + poses[part.link][1][:, None]
            if part.moves
            else part.points[None]
            for part in parts
        )
        hands = np.stack([model.frame_pose(hand, rows)[1] for hand in model.hands], axis=1)
        joints = np.concatenate([*(each[:, None] for _, each in poses.values()), hands], axis=1)
        return cls(model, parts, points, joints, hands)

    def still(self) -> list[Array]:
        """Points (m, 3) of the parts that do not move."""
        pairs = zip(self.parts, self.points, strict=True)
        return [points[0] for part, points in pairs if not part.moves]

    def moving(self) -> list[Array]:
        """Points (k, m, 3) of the parts that move."""
        pairs = zip(self.parts, self.points, strict=True)
        return [points for part, points in pairs if part.moves]
