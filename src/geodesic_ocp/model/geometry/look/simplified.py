"""Meshes with fewer triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geodesic_ocp.model.geometry.look.mesh import Mesh

_SIZE = 1000.0  # of the largest mesh: the thresholds of the simplification are absolute
_APART = 4.0 * _SIZE  # between the meshes, to tell whose a vertex is
_FIXED = 0.4  # relative size of meshes that matter less, so that their errors count for less
# Attempts: width of the cells [size of the largest mesh] in which vertices become one, and how fast
# the bound of the errors grows: to 1e-9 * 103^a, in squares of the unit of _SIZE. Edges between the
# slivers of some CAD meshes cannot be collapsed; without the lower bound others would pay for that.
_ATTEMPTS = ((0.0, 7.0), (1e-3, 5.0), (2e-3, 5.0), (4e-3, 5.0), (8e-3, 6.0), (1.6e-2, 7.0))
_SAME_PLACE = 1e-6  # [size of the mesh]


def simplified(found: Sequence[Mesh], matters: Sequence[bool], count: int) -> list[Mesh]:
    """The meshes with about `count` triangles together, without those that are degenerate.

    Coincident vertices become one. If there are too many triangles, edges are collapsed where that
    changes any of the surfaces least (quadric error metrics: Garland and Heckbert, SIGGRAPH 1997),
    so that flat and small parts get few of them; if that does not suffice, close vertices become
    one before. Meshes that do not matter, such as those of links that do not move, may change more.
    """
    largest = max((_size(mesh) for mesh in found), default=0.0)
    result: list[Mesh] = []
    for cell, growth in _ATTEMPTS:
        welded = [_welded(mesh, cell * largest) for mesh in found]
        scales = [_SIZE / (largest or 1.0) * (1.0 if moves else _FIXED) for moves in matters]
        result = _collapsed(welded, scales, count, growth)
        if sum(len(mesh.triangles) for mesh in result) <= count:
            break
    return [mesh for mesh in result if len(mesh.triangles)]


def _collapsed(meshes: list[Mesh], scales: list[float], count: int, growth: float) -> list[Mesh]:
    """All at once, side by side, for errors to be compared across meshes."""
    if sum(len(mesh.triangles) for mesh in meshes) <= count:
        return meshes
    import fast_simplification

    middles = [mesh.vertices.mean(axis=0) for mesh in meshes]
    shifts = [np.array([number * _APART, 0.0, 0.0]) for number in range(len(meshes))]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    every = [
        (mesh.vertices - middle) * scale + shift
        for mesh, middle, scale, shift in zip(meshes, middles, scales, shifts, strict=True)
    ]
    corners = [mesh.triangles + start for mesh, start in zip(meshes, starts[:-1], strict=True)]
    points, triangles = fast_simplification.simplify(
        np.concatenate(every), np.concatenate(corners), target_count=count, agg=growth
    )[:2]
    owners = np.rint(points[triangles[:, 0], 0] / _APART).astype(np.int64)
    result = []
    for number, mesh in enumerate(meshes):
        used, own = np.unique(triangles[owners == number], return_inverse=True)
        vertices = (points[used] - shifts[number]) / scales[number] + middles[number]
        shape = own.reshape(-1, 3).astype(np.int64)
        result.append(replace(mesh, vertices=vertices, triangles=shape))
    return result


def _size(mesh: Mesh) -> float:
    return float(np.ptp(mesh.vertices, axis=0).max()) if len(mesh.vertices) else 0.0


def _welded(mesh: Mesh, cell: float) -> Mesh:
    """The mesh with one vertex in each cell [m], or place, without triangles that have lost area.

    Cells are at most a fiftieth of the mesh, for small meshes to keep their shape.
    """
    width = max(min(cell, _size(mesh) / 50.0), _size(mesh) * _SAME_PLACE)
    low = mesh.vertices.min(axis=0, initial=np.inf)
    x, y, z = np.rint((mesh.vertices - low) / (width or 1.0)).astype(np.int64).T
    count = round(1.0 / _SAME_PLACE) + 1  # cells along an axis, at most
    _, first, owner = np.unique((x * count + y) * count + z, return_index=True, return_inverse=True)
    triangles = owner.reshape(-1)[mesh.triangles].reshape(-1, 3).astype(np.int64)
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    used, corners = np.unique(triangles, return_inverse=True)
    vertices = mesh.vertices[first[used]]
    return replace(mesh, vertices=vertices, triangles=corners.reshape(-1, 3).astype(np.int64))
