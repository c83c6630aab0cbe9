"""Meshes with fewer triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.geometry.look.mesh import Indices, Mesh

_SIZE = 1000.0  # of the largest mesh: the thresholds of the simplification are absolute
_APART = 4.0 * _SIZE  # between the meshes, to tell whose a vertex is
_FIXED = 0.7  # relative size of meshes that matter less, so that their errors count for less
# The bound of the errors grows to 1e-9 * 103^a, in squares of the unit of _SIZE: 0.34 % of it.
_GROWTH = 5.0
# Widths of the cells [size of the largest mesh] in which vertices become one, step by step.
_CELLS = (0.0, 1e-3, 2e-3, 4e-3, 6e-3, 9e-3, 1.3e-2, 2e-2, 3e-2, 4.5e-2)
_MANY = 8  # times as many triangles as wanted: the first cells would be of little use
_OF_SMALL = 0.02  # [size of the mesh], the largest of the first cells
_SAME_PLACE = 1e-6  # [size of the mesh]


def simplified(found: Sequence[Mesh], matters: Sequence[bool], count: int) -> list[Mesh]:
    """The meshes with about `count` triangles together, without those that are degenerate.

    Coincident vertices become one. While there are too many triangles, vertices in cells of a grid
    become one, in ever larger cells (vertex clustering: Rossignac and Borrel, 1993), and edges are
    collapsed where that changes any of the surfaces least (quadric error metrics: Garland and
    Heckbert, SIGGRAPH 1997), so that flat and small parts get few triangles. Vertices remain within
    the boxes around those that they replace. Meshes that do not matter, such as those of links that
    do not move, may change more.
    """
    largest = max((_size(mesh) for mesh in found), default=0.0)
    scales = [_SIZE / (largest or 1.0) * (1.0 if moves else _FIXED) for moves in matters]
    result = [_welded(mesh, 0.0, largest) for mesh in found]
    for cell in _CELLS[1 if _total(result) > _MANY * count else 0 :]:
        if cell > 0.0 and _total(result) > count:
            result = [_welded(mesh, cell, largest) for mesh in result]
        if _total(result) > count:
            result = _collapsed(result, scales, count)
    return [mesh for mesh in result if len(mesh.triangles)]


def _total(meshes: Sequence[Mesh]) -> int:
    return sum(len(mesh.triangles) for mesh in meshes)


def _collapsed(meshes: list[Mesh], scales: list[float], count: int) -> list[Mesh]:
    """All at once, side by side, for errors to be compared across meshes."""
    import fast_simplification

    middles = [mesh.vertices.sum(axis=0) / max(len(mesh.vertices), 1) for mesh in meshes]
    shifts = [np.array([number * _APART, 0.0, 0.0]) for number in range(len(meshes))]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    every = [
        (mesh.vertices - middle) * scale + shift
        for mesh, middle, scale, shift in zip(meshes, middles, scales, shifts, strict=True)
    ]
    corners = [mesh.triangles + start for mesh, start in zip(meshes, starts[:-1], strict=True)]
    before, old = np.concatenate(every), np.concatenate(corners)
    points, triangles, collapses = fast_simplification.simplify(
        before, old, target_count=count, agg=_GROWTH, return_collapses=True, preserve_border=True
    )
    whose = fast_simplification.replay_simplification(before, old, collapses)[2]
    points = _within(points, before, whose)
    owners = np.rint(points[triangles[:, 0], 0] / _APART).astype(np.int64)
    result = []
    for number, mesh in enumerate(meshes):
        used, own = np.unique(triangles[owners == number], return_inverse=True)
        vertices = (points[used] - shifts[number]) / scales[number] + middles[number]
        shape = own.reshape(-1, 3).astype(np.int64)
        result.append(replace(mesh, vertices=vertices, triangles=shape))
    return result


def _within(points: Array, before: Array, whose: Indices) -> Array:
    """Points inside the boxes around the vertices that they replace.

    The point of least error is far from them where surfaces are nearly flat, which makes spikes.
    """
    low, high = np.full(points.shape, np.inf), np.full(points.shape, -np.inf)
    np.minimum.at(low, whose, before)
    np.maximum.at(high, whose, before)
    return np.clip(points, low, high)


def _size(mesh: Mesh) -> float:
    return float(np.ptp(mesh.vertices, axis=0).max()) if len(mesh.vertices) else 0.0


def _welded(mesh: Mesh, cell: float, largest: float) -> Mesh:
    """The mesh with one vertex in each cell, or place, without triangles that have lost area.

    Args:
        mesh: of any size.
        cell: width of the cells, a share of the largest mesh; small meshes have smaller ones.
        largest: size of the largest mesh [m].
    """
    size = _size(mesh)
    width = max(min(cell * largest, max(_OF_SMALL, 5.0 * cell) * size), _SAME_PLACE * size)
    low = mesh.vertices.min(axis=0, initial=np.inf)
    x, y, z = np.rint((mesh.vertices - low) / (width or 1.0)).astype(np.int64).T
    count = round(1.0 / _SAME_PLACE) + 1  # cells along an axis, at most
    _, owner, members = np.unique(
        (x * count + y) * count + z, return_inverse=True, return_counts=True
    )
    middles = np.zeros((len(members), 3))
    np.add.at(middles, owner.reshape(-1), mesh.vertices)
    middles /= members[:, None]
    triangles = owner.reshape(-1)[mesh.triangles].reshape(-1, 3).astype(np.int64)
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    low, middle, high = np.sort(triangles, axis=1).T  # the same triangle, however it is turned
    every = (low * len(middles) + middle) * len(middles) + high
    _, first = np.unique(every, return_index=True)
    triangles = triangles[np.sort(first)]
    used, corners = np.unique(triangles, return_inverse=True)
    vertices = middles[used]
    return replace(mesh, vertices=vertices, triangles=corners.reshape(-1, 3).astype(np.int64))
