"""Meshes with fewer triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.geometry.look.mesh import Mesh

_SIZE = 1000.0  # of the largest mesh: the thresholds of the simplification are absolute
_APART = 4.0 * _SIZE  # between the meshes, to tell whose a vertex is
_FIXED = 0.4  # relative size of meshes that matter less, so that their errors count for less


def simplified(found: Sequence[Mesh], matters: Sequence[bool], count: int) -> list[Mesh]:
    """The meshes with at most `count` triangles together, without those that are degenerate.

    Coincident vertices become one. If there are too many triangles, edges are collapsed where that
    changes any of the surfaces least (quadric error metrics: Garland and Heckbert, SIGGRAPH 1997),
    so that flat and small parts get few of them. Meshes that do not matter, such as those of links
    that do not move, may change more.
    """
    welded = [_welded(mesh) for mesh in found]
    kept = [index for index, mesh in enumerate(welded) if len(mesh.triangles)]
    meshes = [welded[index] for index in kept]
    lengths = [len(mesh.triangles) for mesh in meshes]
    if sum(lengths) <= count:
        return meshes
    import fast_simplification

    middles = [mesh.vertices.mean(axis=0) for mesh in meshes]
    largest = max(float(np.ptp(mesh.vertices, axis=0).max()) for mesh in meshes)
    scales = [_SIZE / largest * (1.0 if matters[index] else _FIXED) for index in kept]
    # All at once, side by side, for errors to be compared across meshes.
    shifts = [np.array([number * _APART, 0.0, 0.0]) for number in range(len(meshes))]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    every: list[Array] = [
        (mesh.vertices - middle) * scale + shift
        for mesh, middle, scale, shift in zip(meshes, middles, scales, shifts, strict=True)
    ]
    corners = [mesh.triangles + start for mesh, start in zip(meshes, starts[:-1], strict=True)]
    points, triangles = fast_simplification.simplify(
        np.concatenate(every), np.concatenate(corners), target_count=count
    )[:2]
    owners = np.rint(points[triangles[:, 0], 0] / _APART).astype(np.int64)
    result = []
    for number, mesh in enumerate(meshes):
        used, own = np.unique(triangles[owners == number], return_inverse=True)
        vertices = (points[used] - shifts[number]) / scales[number] + middles[number]
        if len(own):
            shape = own.reshape(-1, 3).astype(np.int64)
            result.append(replace(mesh, vertices=vertices, triangles=shape))
    return result


def _welded(mesh: Mesh) -> Mesh:
    """The mesh without repeated vertices and triangles that have two corners in common."""
    import trimesh

    found = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=True)
    triangles = np.array(found.faces, dtype=np.int64).reshape(-1, 3)
    a, b, c = triangles.T
    proper = triangles[(a != b) & (b != c) & (c != a)]
    return replace(mesh, vertices=np.array(found.vertices, dtype=float), triangles=proper)
