"""Parts: rigid or stretched surfaces of a scene over time, ready to be drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.look import Colour

_CREASE = np.deg2rad(35.0)  # [rad]: edges between faces that differ by more stay sharp


@dataclass(frozen=True, eq=False, repr=False)
class Part:
    """A surface that moves.

    Attributes:
        vertices: (v, 3) [m].
        normals: at the vertices (v, 3), outward.
        triangles: (m, 3), indices of vertices, counter-clockwise seen from outside.
        colour: red, green and blue, from 0 to 1.
        alpha: how opaque it is, from 0 to 1.
        matrices: matrices of its motion x -> M x + p, (k, 3, 3) or (1, 3, 3).
        positions: p, (k, 3) or (1, 3) [m].
        overlay: whether it is outlined, and others are seen through it.
        coloured: whether it has the colour of a role.
    """

    vertices: Array
    normals: Array
    triangles: NDArray[np.int64]
    colour: Colour
    alpha: float
    matrices: Array
    positions: Array
    overlay: bool = False
    coloured: bool = False

    @property
    def still(self) -> bool:
        """True if it stays where it is."""
        return len(self.matrices) == 1 and len(self.positions) == 1


def smooth_surface(
    vertices: Array, triangles: NDArray[np.int64], most: int
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return vertices, normals and triangles of a surface of about `most` triangles, edges kept."""
    import fast_simplification
    import trimesh

    if len(triangles) > most:
        points, faces = fast_simplification.simplify(
            np.ascontiguousarray(vertices, dtype=float),
            np.ascontiguousarray(triangles, dtype=np.int64),
            target_count=max(most, 12),
        )[:2]
        vertices, triangles = np.asarray(points, dtype=float), np.asarray(faces, dtype=np.int64)
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    smooth = trimesh.graph.smooth_shade(mesh, angle=_CREASE, facet_minarea=None)
    return (
        np.array(smooth.vertices, dtype=float),
        np.array(smooth.vertex_normals, dtype=float),
        np.array(smooth.faces, dtype=np.int64),
    )


@dataclass(frozen=True, eq=False, repr=False)
class Moment:
    """An instant between two samples of a scene."""

    before: int
    after: int
    weight: float

    def of(self, samples: Array) -> Array:
        """Return the value of samples (k, ...) there; a single one is constant."""
        if len(samples) == 1 or self.before == self.after:
            sample: Array = samples[min(self.before, len(samples) - 1)]
            return sample
        between: Array = (1.0 - self.weight) * samples[self.before]
        between += self.weight * samples[self.after]
        return between


def moment(time: Array, instant: float) -> Moment:
    """Return the instant, or the end of the time (k,) that is nearest to it."""
    after = int(np.clip(np.searchsorted(time, instant), 0, len(time) - 1))
    if after == 0 or instant >= time[-1]:
        return Moment(after, after, 0.0)
    step = time[after] - time[after - 1]
    return Moment(after - 1, after, float((instant - time[after - 1]) / step))


def placed(parts: tuple[Part, ...], when: Moment) -> tuple[Array, Array]:
    """Get vertices (v, 3) [m] and normals (v, 3), not of unit length, of all parts in the scene."""
    points, normals = [], []
    for part in parts:
        matrix = when.of(part.matrices)
        points.append(part.vertices @ matrix.T + when.of(part.positions))
        # The matrix of cofactors turns normals, also where the surface is flattened.
        cofactors = np.cross(matrix[:, [1, 2, 0]].T, matrix[:, [2, 0, 1]].T)
        normals.append(part.normals @ cofactors)
    return np.concatenate(points), np.concatenate(normals)
