"""The panes of a video: scenes drawn from one camera."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.camera import Camera
from geodesic_ocp.drawing.look import Indices
from geodesic_ocp.drawing.rendering import (
    Part,
    Pixels,
    Single,
    Stroke,
    Visible,
    at,
    creased,
    darken,
    dashes_of,
    draw_disc,
    edges,
    floor_picture,
    length_fractions,
    moment,
    placed,
    shade,
    stroke,
    visible,
)
from geodesic_ocp.drawing.scene import Scene, Trail
from geodesic_ocp.drawing.styles import ROLES, SURROUNDINGS, mixed

# opacities
_OVERLAY = 0.40
_UNBOUNDED = 0.30
_ELLIPSOID = 0.35
TINT = 0.12  # of white in the colours of bodies, so that dark ones keep their shading


def scene_parts(scene: Scene) -> tuple[Part, ...]:
    """Return surfaces of the actors, obstacles and ellipsoids of a scene."""
    parts = []
    for actor in scene.actors:
        for mesh in (each for each in actor.meshes if len(each.triangles)):
            surface = creased(mesh.vertices, mesh.triangles)
            coloured = actor.role is not None
            colour = mesh.colour if actor.role is None else mixed(ROLES[actor.role]["color"], TINT)
            alpha = _OVERLAY if actor.translucent else 1.0
            motion = actor.rotations[mesh.link], actor.positions[mesh.link]
            parts.append(Part(*surface, colour, alpha, *motion, actor.translucent, coloured))
    still = np.eye(3)[None], np.zeros((1, 3))
    for solid in (each for each in scene.solids if len(each.triangles)):
        surface = creased(solid.vertices, np.asarray(solid.triangles))
        alpha = _UNBOUNDED if solid.unbounded else 1.0
        parts.append(Part(*surface, mixed(SURROUNDINGS["obstacle"]), alpha, *still))
    for each in scene.ellipsoids:
        # A mirrored ellipsoid is the same one, with its triangles outside in.
        mirrored = np.linalg.det(each.axes) < 0.0
        axes = np.where(mirrored[:, None, None], -each.axes, each.axes)
        colour = mixed(SURROUNDINGS["ellipsoid"])
        parts.append(Part(*_ball(), colour, _ELLIPSOID, axes, each.centres))
    return tuple(parts)


def _ball() -> tuple[Array, Array, Indices]:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    points = np.array(ball.vertices, dtype=float)
    return points, points, np.array(ball.faces)


SAMPLES = 2  # pixels of the camera per pixel of the picture, in either direction
# opacity of a path that is still ahead; of what is behind a surface
_FUTURE = 0.35
_HIDDEN = 0.30
_FULL = np.float32(255.0)
_HALF = np.float32(0.5)
_OUTLINE = 1.3  # width of the outline of overlays, as `Pane.scale`
# opacity; may lie behind by this, relatively
_EDGE = np.float32(0.95)
_BEHIND = np.float32(1.015)
_OVER_COLOUR = np.float32(0.25)  # opacity of overlays, relative, over what is coloured
_AXIS = 0.12  # [m], length of the axes of a frame


@dataclass(frozen=True, eq=False, repr=False)
class Pane:
    """A scene before a camera."""

    scene: Scene
    parts: tuple[Part, ...]  # surfaces of the scene
    camera: Camera  # camera with `SAMPLES` pixels per pixel of the picture, in either direction
    floor: float  # its height [m]
    scale: float  # scale of line widths [camera pixel]
    backdrop: Pixels  # what is behind everything, (height, width, 3) of the camera
    # what is seen of surfaces that do not move, and where they shade the floor
    still: tuple[Visible, Pixels]
    trails: tuple[tuple[Trail, Stroke], ...]  # trails with their lines in the picture

    def picture(self, instant: float) -> NDArray[np.uint8]:
        """Return the scene at an instant, (height, width, 3)."""
        from PIL import Image

        when = moment(self.scene.time, instant)
        picture = self.backdrop.copy()
        flat = picture.reshape(-1, 3)
        closeness = np.zeros(len(flat), dtype=np.float32)
        coloured = np.zeros(len(flat), dtype=bool)
        moving = placed([part for part in self.parts if part.alpha == 1.0 and not part.still], when)
        darken(picture, np.maximum(self.still[1], shade(moving, self.floor, self.camera)))
        for seen in (self.still[0], visible(moving, self.camera)):
            nearer = seen.closeness > closeness[seen.pixels]
            pixels = seen.pixels[nearer]
            flat[pixels] = seen.shades[nearer] * _FULL + _HALF
            closeness[pixels] = seen.closeness[nearer]
            coloured[pixels] = seen.coloured[nearer]
        for group in _groups(self.parts):
            self._add_clear(flat, closeness, coloured, group, when)
        for trail, line in self.trails:
            past = np.ones(len(line.fraction), dtype=bool)
            if trail.dot is not None:
                past = line.fraction <= at(length_fractions(trail.dot)[:, None], when)[0]
            colour = ROLES[trail.role]["color"]
            self._add_line(flat, closeness, line, colour, np.where(past, 1.0, _FUTURE))
            if trail.dot is not None:
                dot = at(trail.dot, when)[None]
                self._add_discs(picture, dot, 5.5, "white")
                self._add_discs(picture, dot, 4.0, colour)
        for ends, colour in self._markings(when):
            line = stroke(ends, self.camera, 2.0 * self.scale)
            self._add_line(flat, closeness, line, colour)
        for cloud in self.scene.clouds:
            colour = SURROUNDINGS["marker"] if cloud.role is None else ROLES[cloud.role]["color"]
            self._add_discs(picture, at(cloud.positions, when), 2.2, colour)
        return np.asarray(Image.fromarray(picture).reduce(SAMPLES))

    def _add_clear(
        self,
        flat: Pixels,
        closeness: Single,
        coloured: NDArray[np.bool_],
        parts: list[Part],
        when: float,
    ) -> None:
        """Lay surfaces over the picture, and outline overlays."""
        seen = visible(placed(parts, when), self.camera)
        behind = closeness[seen.pixels]
        shades = seen.shades
        alpha = np.float32(parts[0].alpha) * (seen.closeness >= behind)
        if parts[0].overlay:
            # What has a colour of its own keeps it.
            alpha *= np.where(coloured[seen.pixels], _OVER_COLOUR, np.float32(1.0))
            width = max(round(_OUTLINE * self.scale), SAMPLES)
            edge = edges(seen.pixels, self.camera.shape, width)
            opacity = np.where(seen.closeness * _BEHIND >= behind, _EDGE, _HIDDEN)
            alpha = np.where(edge, opacity.astype(np.float32), alpha)
            shades = np.where(edge[:, None], np.array(parts[0].colour, np.float32), shades)
        _blend(flat, seen.pixels, shades, alpha)

    def _add_line(
        self, flat: Pixels, closeness: Single, line: Stroke, colour: str, alpha: float | Array = 1.0
    ) -> None:
        """Draw a line, faintly where a surface is before it."""
        seen = line.fragments
        opacity = alpha * np.where(seen.closeness >= closeness[seen.pixels], 1.0, _HIDDEN)
        _blend(flat, seen.pixels, np.array(mixed(colour)), opacity)

    def _add_discs(self, picture: Pixels, points: Array, radius: float, colour: str) -> None:
        """Draw discs at points (m, 3) [m] that are known."""
        places, depths = self.camera.project(points)
        for place, depth in zip(places, depths, strict=True):
            if np.isfinite(place).all() and depth > 0.0:
                draw_disc(picture, place, radius * self.scale, np.array(mixed(colour)))

    def _markings(self, when: float) -> Iterable[tuple[Array, str]]:
        """Yield ends (2, 3) [m] and colours of the axes of frames, and of gaps."""
        for frame in self.scene.frames:
            origin = at(frame.positions, when)
            axes = at(frame.rotations, when).T
            for axis, name in zip(axes, "xyz", strict=True):
                yield np.array([origin, origin + _AXIS * axis]), SURROUNDINGS[name]
        for gap in self.scene.gaps:
            kind = "overlap" if at(gap.distances[:, None], when)[0] < 0.0 else "gap"
            yield np.array([at(gap.starts, when), at(gap.ends, when)]), SURROUNDINGS[kind]


def pane(
    scene: Scene, parts: tuple[Part, ...], points: Array, camera: Camera, scale: float
) -> Pane:
    """Draw what does not move; the other arguments are those of `Pane`, and `Scene.points`."""
    low = points.min(axis=0)
    high = points.max(axis=0)
    middle = np.array([*(low + high)[:2] / 2.0, low[2]])
    radius = 1.1 * float(np.linalg.norm((high - low)[:2]) / 2.0) + 0.25
    # The floor has soft lines: one sample a pixel is enough.
    floor = floor_picture(camera.coarser(SAMPLES), middle, radius)
    backdrop = (255.0 * floor + 0.5).astype(np.uint8)
    backdrop = backdrop.repeat(SAMPLES, axis=0).repeat(SAMPLES, axis=1)
    surfaces = placed([each for each in parts if each.alpha == 1.0 and each.still], 0.0)
    still = visible(surfaces, camera), shade(surfaces, float(low[2]), camera)
    width = 2.4 * scale
    trails = tuple(
        (each, stroke(each.points, camera, width, dashes_of(ROLES[each.role], width)))
        for each in scene.trails
        if len(each.points) > 1
    )
    return Pane(scene, parts, camera, float(low[2]), scale, backdrop, still, trails)


def _groups(parts: tuple[Part, ...]) -> list[list[Part]]:
    """Return parts through which others are seen: those of one colour and opacity together."""
    groups: dict[object, list[Part]] = {}
    for part in parts:
        if part.alpha < 1.0:
            groups.setdefault((part.overlay, part.alpha, part.colour), []).append(part)
    return list(groups.values())


def _blend(
    flat: Pixels, pixels: NDArray[np.int64], colours: Single | Array, alpha: Single | Array
) -> None:
    """Lay colours (p, 3) or (3,) of these opacities (p,) over pixels of a picture (n, 3)."""
    share = alpha[:, None]
    flat[pixels] = (1.0 - share) * flat[pixels] + share * (_FULL * colours) + _HALF
