"""Pane: the picture of one scene at any time."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.styles import ROLES
from geodesic_ocp.scenes.markings import Trail
from geodesic_ocp.scenes.scene import Scene
from geodesic_ocp.viewer.video.camera import Camera
from geodesic_ocp.viewer.video.fragments import nearest_fragments
from geodesic_ocp.viewer.video.light import floor_picture, lit, shadow
from geodesic_ocp.viewer.video.part import Moment, Part, moment, placed
from geodesic_ocp.viewer.video.scene_parts import is_shown
from geodesic_ocp.viewer.video.strokes import (
    Stroke,
    dashes_of,
    draw_disc,
    length_fractions,
    stroke,
)

SAMPLES = 2  # pixels of the camera per pixel of the picture, in either direction
_FUTURE, _HIDDEN = 0.35, 0.30  # opacity of a path that is still ahead; of what is behind a surface
_WHITE = np.ones(3)
_AXES = np.array([[0.80, 0.15, 0.15], [0.15, 0.60, 0.20], [0.15, 0.30, 0.85]])  # x, y, z
_GAP, _MARKER = np.array([0.70, 0.10, 0.25]), np.array([0.20, 0.22, 0.26])
_AXIS = 0.12  # [m], length of the axes of a frame


@dataclass(frozen=True, eq=False, repr=False)
class Pane:
    """A scene before a camera.

    Attributes:
        scene: what is drawn.
        layers: those that are shown.
        parts: surfaces of the scene.
        camera: with `SAMPLES` pixels per pixel of the picture, in either direction.
        floor: its height [m].
        scale: of line widths [camera pixel].
        backdrop: what is behind everything, (height, width, 3) of the camera.
        trails: that are shown, with their lines in the picture.
    """

    scene: Scene
    layers: Collection[str]
    parts: tuple[Part, ...]
    camera: Camera
    floor: float
    scale: float
    backdrop: NDArray[np.float32]
    trails: tuple[tuple[Trail, Stroke], ...]

    def picture(self, instant: float) -> NDArray[np.uint8]:
        """The scene at an instant, (height, width, 3)."""
        when = moment(self.scene.time, instant)
        opaque = tuple(part for part in self.parts if part.alpha == 1.0)
        picture = self.backdrop.copy()
        flat = picture.reshape(-1, 3)
        closeness = np.zeros(len(flat))
        if opaque:
            self._add_surfaces(flat, closeness, opaque, when)
        clear = tuple(part for part in self.parts if part.alpha < 1.0)
        if clear:
            self._add_surfaces(flat, closeness, clear, when)
        for trail, line in self.trails:
            self._add_trail(picture, closeness, trail, line, when)
        self._add_markings(picture, closeness, when)
        height, width = self.camera.shape
        blocks = picture.reshape(height // SAMPLES, SAMPLES, width // SAMPLES, SAMPLES, 3)
        mean = sum(blocks[:, i, :, j] for i in range(SAMPLES) for j in range(SAMPLES))
        return (np.asarray(mean) * (255.0 / SAMPLES**2) + 0.5).astype(np.uint8)

    def _add_surfaces(
        self, flat: NDArray[np.float32], closeness: Array, parts: tuple[Part, ...], when: Moment
    ) -> None:
        points, normals = placed(parts, when)
        sizes = np.cumsum([0, *(len(part.vertices) for part in parts)])
        triangles = np.concatenate(
            [part.triangles + first for part, first in zip(parts, sizes[:-1], strict=True)]
        )
        counts = [len(part.triangles) for part in parts]
        colours = np.repeat([part.colour for part in parts], counts, axis=0)
        alphas = np.repeat([part.alpha for part in parts], counts)
        if alphas[0] == 1.0:
            dark = shadow(points, triangles, self.floor, self.camera)
            flat *= dark.reshape(-1, 1)
        pixels, depths = self.camera.project(points)
        x, y = pixels[triangles].transpose(2, 0, 1)
        after_x, after_y = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
        front = (x * after_y - after_x * y).sum(axis=1) < 0.0  # y points down
        triangles, colours, alphas = triangles[front], colours[front], alphas[front]
        seen = nearest_fragments(pixels[triangles], depths[triangles], self.camera.shape)
        corners = triangles[seen.triangles]
        smooth = sum(
            seen.weights[:, corner, None] * normals[corners[:, corner]] for corner in range(3)
        )
        shades = lit(colours[seen.triangles], np.asarray(smooth), self.camera)
        alpha = alphas[seen.triangles] * (seen.closeness >= closeness[seen.pixels])
        _blend(flat, seen.pixels, shades, alpha)
        if alphas[:1] == 1.0:
            closeness[seen.pixels] = seen.closeness

    def _add_trail(
        self,
        picture: NDArray[np.float32],
        closeness: Array,
        trail: Trail,
        line: Stroke,
        when: Moment,
    ) -> None:
        colour = np.array(role_colour(trail.role))
        past = np.ones(len(line.fraction), dtype=bool)
        if trail.dot is not None:
            past = line.fraction <= when.of(length_fractions(trail.dot)[:, None])[0]
        alpha = np.where(past, 1.0, _FUTURE) * self._unhidden(line, closeness)
        _blend(picture.reshape(-1, 3), line.fragments.pixels, colour, alpha)
        if trail.dot is not None:
            at = self.camera.project(when.of(trail.dot))[0]
            draw_disc(picture, at, 5.5 * self.scale, _WHITE, 1.0)
            draw_disc(picture, at, 4.0 * self.scale, colour, 1.0)

    def _add_markings(self, picture: NDArray[np.float32], closeness: Array, when: Moment) -> None:
        lines = []
        for frame in self.scene.frames:
            if is_shown(frame.layer, self.layers):
                origin, axes = when.of(frame.positions), when.of(frame.rotations).T
                ends = [np.array([origin, origin + _AXIS * axis]) for axis in axes]
                lines += list(zip(ends, _AXES, strict=True))
        for gap in self.scene.gaps:
            if is_shown(gap.layer, self.layers):
                lines.append((np.array([when.of(gap.starts), when.of(gap.ends)]), _GAP))
        for points, colour in lines:
            line = stroke(points, self.camera, 2.0 * self.scale)
            alpha = self._unhidden(line, closeness)
            _blend(picture.reshape(-1, 3), line.fragments.pixels, colour, alpha)
        for cloud in self.scene.clouds:
            if is_shown(cloud.layer, self.layers):
                colour = _MARKER if cloud.role is None else np.array(role_colour(cloud.role))
                places, depths = self.camera.project(when.of(cloud.positions))
                for place, depth in zip(places, depths, strict=True):
                    if np.isfinite(place).all() and depth > 0.0:
                        draw_disc(picture, place, 2.2 * self.scale, colour, 1.0)

    def _unhidden(self, line: Stroke, closeness: Array) -> Array:
        """Opacity of the pixels of a line: less where a surface is before it."""
        seen = line.fragments
        return np.where(seen.closeness >= closeness[seen.pixels], 1.0, _HIDDEN)


def pane(
    scene: Scene,
    layers: Collection[str],
    parts: tuple[Part, ...],
    points: Array,
    camera: Camera,
    scale: float,
) -> Pane:
    """Draw what does not move; the other arguments are those of `Pane`, and `scene_points`."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = np.array([*(low + high)[:2] / 2.0, low[2]])
    radius = 1.1 * float(np.linalg.norm((high - low)[:2]) / 2.0) + 0.25
    backdrop = floor_picture(camera, middle, radius).astype(np.float32)
    trails = tuple(
        (
            trail,
            stroke(trail.points, camera, 2.4 * scale, dashes_of(ROLES[trail.role], 2.4 * scale)),
        )
        for trail in scene.trails
        if is_shown(trail.layer, layers) and len(trail.points) > 1
    )
    return Pane(scene, layers, parts, camera, float(low[2]), scale, backdrop, trails)


def role_colour(role: str) -> tuple[float, float, float]:
    """Red, green and blue, from 0 to 1, of a role."""
    from matplotlib.colors import to_rgb

    return to_rgb(ROLES[role]["color"])


def _blend(
    flat: NDArray[np.float32], pixels: NDArray[np.int64], colours: Array, alpha: Array
) -> None:
    """Lay colours (p, 3) or (3,) of these opacities (p,) over pixels of a picture (n, 3)."""
    share = alpha[:, None]
    flat[pixels] = (1.0 - share) * flat[pixels] + share * colours
