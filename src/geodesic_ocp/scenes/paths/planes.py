"""Curves in the space of their coordinates, and from where curves in a plane are seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.scenes.around.ellipsoids import inverse_tensors, longest_drawn, scaled_ellipsoids
from geodesic_ocp.scenes.markings import Trail
from geodesic_ocp.scenes.scene import Scene

UNIT_BALLS = "unit balls of the metric"
_SIZE = 0.08  # of the largest unit ball, relative to the path
_RINGS, _SIDES = 7, 60
_FLAT = 1e-9  # thickness of curves in a plane, relative to their extent
_ABOVE = 89.0  # [deg]: looking straight down, a camera could turn about itself


def coordinate_scene(metric: Metric, s: Array, q: Array) -> Scene:
    """A curve of up to three coordinates, with unit balls of the metric along it.

    Coordinates are lengths along x, y and z, whatever they mean: angles on a sphere stay angles.

    Args:
        metric: of the manifold, of dimension 1 to 3.
        s: of the samples (k,).
        q: coordinates (k, n).
    """
    points = _in_space(q)
    size = _SIZE * float(np.ptp(points, axis=0).max())
    images = np.zeros((len(q), 3, 3))
    images[:, : metric.dim, : metric.dim] = inverse_tensors(metric, q)
    squares, directions = np.linalg.eigh(images)
    lengths, longest = np.sqrt(np.maximum(squares, 0.0)), longest_drawn(squares[:, -1])
    ball = scaled_ellipsoids([(UNIT_BALLS, points, images)], size)
    rings: list[Trail] = []
    if metric.dim == 2 and size > 0.0 and longest > 0.0:
        angles = np.linspace(0.0, 2.0 * np.pi, _SIDES + 1)
        circle = np.column_stack([np.cos(angles), np.sin(angles)])
        axes = directions * (size * np.minimum(lengths / longest, 1.0))[:, None]
        for k in np.linspace(0, len(q) - 1, _RINGS).astype(int):
            if lengths[k].max() > 0.0:
                outline = points[k] + circle @ axes[k][:, 1:].T
                rings.append(Trail(UNIT_BALLS, outline, "neutral", layer=UNIT_BALLS))
    path = Trail("path", points, "observed", points, layer="path")
    names = metric.joint_names or [f"q[{index}]" for index in range(metric.dim)]
    axes_note = ", ".join(f"{axis}: {name}" for axis, name in zip("xyz", names, strict=False))
    if longest > 0.0 and size > 0.0:
        axes_note += f"; {UNIT_BALLS} drawn {size / longest:.3g} times their size"
    ball = tuple(replace(track, layer=UNIT_BALLS) for track in ball)
    title = metric.label or type(metric).__name__
    return Scene(title, s, trails=(path, *rings), ellipsoids=ball, note=axes_note)


def seen_from(points: Array) -> tuple[float, float] | None:
    """Azimuth and elevation [deg] that face the plane of points (k, 3), parallel to two axes.

    None if they lie in no such plane, or on a line.
    """
    if not len(points):
        return None
    ranges = np.ptp(points, axis=0)
    thin = ranges <= _FLAT * float(ranges.max())
    if thin.sum() != 1:
        return None
    return [(90.0, 0.0), (180.0, 0.0), (180.0, _ABOVE)][int(np.argmax(thin))]


def _in_space(q: Array) -> Array:
    """Coordinates (k, n) as points (k, 3): zero in the axes that are not there."""
    return np.pad(q, ((0, 0), (0, 3 - q.shape[1])))
