"""Actor: a model in motion in a scene."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.look import Mesh
from geodesic_ocp.model.meshes import meshes
from geodesic_ocp.model.model import Model

# What something shows; each role has one colour in scenes, plots and figures.
Role: TypeAlias = Literal[
    "observed",
    "predicted",
    "baseline",
    "second baseline",
    "third baseline",
    "fourth baseline",
    "neutral",
]


@dataclass(frozen=True, eq=False, repr=False)
class Actor:
    """A model that moves, or stands still, in a scene.

    Attributes:
        name: of the model, for the legend.
        meshes: of its links, each in the frame of its link.
        rotations: of each link in the scene, (k, 3, 3), or (1, 3, 3) if it does not move.
        positions: of each link in the scene, (k, 3) or (1, 3) [m].
        role: whose colour it has; None: the colours of its meshes.
        translucent: drawn as an overlay through which others are seen.
        layer: name of the switch that shows it; "" if it is always shown.
    """

    name: str
    meshes: tuple[Mesh, ...]
    rotations: Mapping[str, Array]
    positions: Mapping[str, Array]
    role: Role | None = None
    translucent: bool = False
    layer: str = ""

    def __repr__(self) -> str:
        return f"Actor({self.name!r}, {len(self.meshes)} meshes)"


def model_actor(
    model: Model,
    q: Array,
    *,
    name: str = "",
    rotation: ArrayLike | None = None,
    position: ArrayLike = (0.0, 0.0, 0.0),
    role: Role | None = None,
    translucent: bool = False,
    layer: str = "",
    hidden: Collection[str] = (),
    shown: tuple[Mesh, ...] | None = None,
) -> Actor:
    """The links of a model in configurations q.

    Args:
        model: whose links are shown.
        q: configurations (k, n) [rad or m].
        name: the model's by default.
        rotation, position: of the model's base in the scene, (3, 3) and (3,) [m].
        role, translucent, layer: see `Actor`.
        hidden: links that are not drawn.
        shown: meshes; those of `meshes` by default.
    """
    turn = np.eye(3) if rotation is None else np.asarray(rotation, dtype=float)
    parts = meshes(model) if shown is None else shown
    parts = tuple(part for part in parts if part.link not in hidden)
    rotations, positions = {}, {}
    for link in dict.fromkeys(part.link for part in parts):
        # One pose is enough for a link that does not move.
        turned, moved = model.frame_pose(link, q if model.moves(link) else q[:1])
        rotations[link] = turn @ turned
        positions[link] = moved @ turn.T + np.asarray(position, dtype=float)
    return Actor(name or model.name, parts, rotations, positions, role, translucent, layer)
