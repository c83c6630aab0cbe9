"""Scene: models in motion, and what is drawn around them, in one coordinate system."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.scenes.actor import Actor
from geodesic_ocp.scenes.markings import (
    EllipsoidTrack,
    FrameTrack,
    Gap,
    PointCloud,
    Solid,
    Trail,
)

_EMPTY = 0.5  # [m], half the size of a scene in which there is nothing


@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """One pane: actors and what is drawn around them; x points right, y forward and z up.

    Attributes:
        title: above the pane.
        time: of the samples (k,), increasing; a single one if nothing moves.
        note: beside the title, in smaller type.
    """

    title: str
    time: Array
    actors: tuple[Actor, ...] = ()
    trails: tuple[Trail, ...] = ()
    solids: tuple[Solid, ...] = ()
    frames: tuple[FrameTrack, ...] = ()
    ellipsoids: tuple[EllipsoidTrack, ...] = ()
    gaps: tuple[Gap, ...] = ()
    clouds: tuple[PointCloud, ...] = ()
    note: str = ""

    def __repr__(self) -> str:
        return f"Scene({self.title!r}, {len(self.actors)} actors, {len(self.time)} samples)"

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the switches that it needs, in order of first use."""
        kinds = (
            *(self.actors, self.trails, self.solids, self.clouds),
            *(self.gaps, self.frames, self.ellipsoids),
        )
        names = [str(item.layer) for items in kinds for item in items]
        return tuple(name for name in dict.fromkeys(names) if name)

    def bounds(self) -> tuple[Array, Array]:
        """Corners (3,) [m] of a box around the actors, the trails and obstacles of finite size."""
        points = [np.zeros((0, 3))]
        for actor in self.actors:
            for mesh in actor.meshes:
                box = np.array([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
                corners = np.array(np.meshgrid(*box.T)).reshape(3, -1).T
                turned = corners @ actor.rotations[mesh.link].transpose(0, 2, 1)
                points.append((turned + actor.positions[mesh.link][:, None]).reshape(-1, 3))
        points += [trail.points for trail in self.trails]
        points += [solid.vertices for solid in self.solids if not solid.unbounded]
        every = np.concatenate(points)
        if not len(every):
            return np.full(3, -_EMPTY), np.full(3, _EMPTY)
        return every.min(axis=0), every.max(axis=0)
