"""The panes of a video: scenes drawn from one camera."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.part import Moment, Part, moment, placed, smooth_surface
from geodesic_ocp.drawing.rendering import (
    Camera,
    Pixels,
    Single,
    Still,
    Stroke,
    covered,
    darken,
    dashes_of,
    draw_disc,
    floor_picture,
    joined,
    length_fractions,
    outline,
    still_surfaces,
    stroke,
    visible,
)
from geodesic_ocp.drawing.scene import Scene, Trail
from geodesic_ocp.drawing.styles import ROLES, SURROUNDINGS
from geodesic_ocp.model.look import Colour, Indices

_MOST = 12000  # triangles of a scene in a pane of this many pixels
_PIXELS = 300_000
_OVERLAY, _UNBOUNDED, _ELLIPSOID = 0.40, 0.30, 0.35  # opacities
_TINT = 0.12  # of white in the colours of roles, so that dark ones keep their shading
_INSTANTS = 24  # at which the space that is taken is looked at


def is_shown(layer: str, layers: Collection[str]) -> bool:
    """Return whether a layer is among those that are asked for; the nameless one always is."""
    return not layer or layer in layers


def scene_parts(scene: Scene, layers: Collection[str], pixels: float = _PIXELS) -> tuple[Part, ...]:
    """Return surfaces of the actors, obstacles and ellipsoids of a scene.

    They have about 12000 triangles in a large pane, fewer in one of fewer pixels.
    """
    actors = [actor for actor in scene.actors if is_shown(actor.layer, layers)]
    total = sum(len(mesh.triangles) for actor in actors for mesh in actor.meshes)
    most = _MOST * float(np.clip(np.sqrt(pixels / _PIXELS), 0.3, 1.0))
    share = min(1.0, most / max(total, 1))
    parts = []
    for actor in actors:
        for mesh in actor.meshes:
            if not len(mesh.triangles):
                continue
            surface = smooth_surface(
                mesh.vertices, mesh.triangles, int(share * len(mesh.triangles))
            )
            colour = mesh.colour if actor.role is None else role_tint(actor.role)
            alpha = _OVERLAY if actor.translucent else 1.0
            motion = actor.rotations[mesh.link], actor.positions[mesh.link]
            coloured = actor.role is not None
            parts.append(Part(*surface, colour, alpha, *motion, actor.translucent, coloured))
    still = np.eye(3)[None], np.zeros((1, 3))
    for solid in scene.solids:
        if is_shown(solid.layer, layers) and len(solid.triangles):
            surface = smooth_surface(solid.vertices, np.asarray(solid.triangles), _MOST)
            alpha = _UNBOUNDED if solid.unbounded else 1.0
            parts.append(Part(*surface, _colour("obstacle"), alpha, *still))
    for ellipsoid in scene.ellipsoids:
        if is_shown(ellipsoid.layer, layers):
            # A mirrored ellipsoid is the same one, with its triangles outside in.
            mirrored = np.linalg.det(ellipsoid.axes) < 0.0
            axes = np.where(mirrored[:, None, None], -ellipsoid.axes, ellipsoid.axes)
            parts.append(Part(*_ball(), _colour("ellipsoid"), _ELLIPSOID, axes, ellipsoid.centres))
    return tuple(parts)


def role_tint(role: str) -> Colour:
    """Return the colour of a role, slightly lighter than in plots."""
    from matplotlib.colors import to_rgb

    red, green, blue = (1.0 - _TINT) * np.array(to_rgb(ROLES[role]["color"])) + _TINT
    return float(red), float(green), float(blue)


def scene_points(scene: Scene, parts: tuple[Part, ...], layers: Collection[str]) -> Array:
    """Return points (m, 3) [m] that span the space in which the scene takes place."""
    points = [trail.points for trail in scene.trails if is_shown(trail.layer, layers)]
    points += [
        cloud.positions.reshape(-1, 3) for cloud in scene.clouds if is_shown(cloud.layer, layers)
    ]
    for part in parts:
        if part.alpha == _UNBOUNDED:
            continue
        ends = _extremes(part.vertices)
        chosen = np.unique(np.linspace(0, len(part.positions) - 1, _INSTANTS).astype(int))
        matrices = part.matrices[chosen if len(part.matrices) > 1 else [0]]
        moved = ends @ matrices.transpose(0, 2, 1) + part.positions[chosen][:, None]
        points.append(moved.reshape(-1, 3))
    every = np.concatenate([np.zeros((0, 3)), *points])
    every = every[np.isfinite(every).all(axis=1)]
    return every if len(every) else np.array(scene.bounds())


def _extremes(points: Array) -> Array:
    """Return the points (k, 3) that are farthest in each of 26 directions."""
    steps = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3)).reshape(3, -1)
    chosen: Array = points[np.unique((points @ steps).argmax(axis=0))]
    return chosen


def _ball() -> tuple[Array, Array, Indices]:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    points = np.array(ball.vertices, dtype=float)
    return points, points, np.array(ball.faces)


def _colour(name: str) -> Colour:
    from matplotlib.colors import to_rgb

    return to_rgb(SURROUNDINGS[name])


SAMPLES = 2  # pixels of the camera per pixel of the picture, in either direction
_FUTURE, _HIDDEN = 0.35, 0.30  # opacity of a path that is still ahead; of what is behind a surface
_FULL, _HALF = np.float32(255.0), np.float32(0.5)
_OUTLINE = 1.3  # width of the outline of overlays, as `Pane.scale`
_EDGE, _BEHIND = np.float32(0.95), np.float32(1.015)  # opacity; may lie behind by this, relatively
_OVER_COLOUR = np.float32(0.25)  # opacity of overlays, relative, over what is coloured
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
        camera: camera with `SAMPLES` pixels per pixel of the picture, in either direction.
        floor: its height [m].
        scale: scale of line widths [camera pixel].
        backdrop: what is behind everything, (height, width, 3) of the camera.
        still: surfaces that do not move.
        trails: trails that are shown, with their lines in the picture.
    """

    scene: Scene
    layers: Collection[str]
    parts: tuple[Part, ...]
    camera: Camera
    floor: float
    scale: float
    backdrop: Pixels
    still: Still
    trails: tuple[tuple[Trail, Stroke], ...]

    def picture(self, instant: float) -> NDArray[np.uint8]:
        """Return the scene at an instant, (height, width, 3)."""
        from PIL import Image

        when = moment(self.scene.time, instant)
        moving = tuple(part for part in self.parts if part.alpha == 1.0 and not part.still)
        shade, surfaces = self.still.shade, [self.still.seen]
        if moving:
            points, triangles = placed(moving, when), joined(moving)
            shade = np.maximum(shade, covered(points[0], triangles, self.floor, self.camera))
            surfaces.append(visible(moving, when, self.camera))
        picture = self.backdrop.copy()
        darken(picture, shade)
        flat = picture.reshape(-1, 3)
        closeness = np.zeros(len(flat), dtype=np.float32)
        coloured = np.zeros(len(flat), dtype=bool)
        for seen in surfaces:
            nearer = seen.closeness > closeness[seen.pixels]
            pixels = seen.pixels[nearer]
            flat[pixels] = seen.shades[nearer] * _FULL + _HALF
            closeness[pixels] = seen.closeness[nearer]
            coloured[pixels] = seen.coloured[nearer]
        for group in _groups(self.parts):
            self._add_clear(flat, closeness, coloured, group, when)
        for trail, line in self.trails:
            self._add_trail(picture, closeness, trail, line, when)
        self._add_markings(picture, closeness, when)
        return np.asarray(Image.fromarray(picture).reduce(SAMPLES))

    def _add_clear(
        self,
        flat: Pixels,
        closeness: Single,
        coloured: NDArray[np.bool_],
        parts: tuple[Part, ...],
        when: Moment,
    ) -> None:
        """Lay surfaces over the picture, and outline overlays."""
        seen = visible(parts, when, self.camera)
        behind = closeness[seen.pixels]
        alpha = np.float32(parts[0].alpha) * (seen.closeness >= behind)
        if not parts[0].overlay:
            _blend(flat, seen.pixels, seen.shades, alpha)
            return
        # What has a colour of its own keeps it.
        alpha *= np.where(coloured[seen.pixels], _OVER_COLOUR, np.float32(1.0))
        edge = outline(seen.pixels, self.camera.shape, max(round(_OUTLINE * self.scale), SAMPLES))
        opacity = np.where(seen.closeness * _BEHIND >= behind, _EDGE, _HIDDEN)
        alpha = np.where(edge, opacity.astype(np.float32), alpha)
        shades = np.where(edge[:, None], np.array(parts[0].colour, np.float32), seen.shades)
        _blend(flat, seen.pixels, shades, alpha)

    def _add_trail(
        self,
        picture: Pixels,
        closeness: Single,
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

    def _add_markings(self, picture: Pixels, closeness: Single, when: Moment) -> None:
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

    def _unhidden(self, line: Stroke, closeness: Single) -> Array:
        """Return opacity of the pixels of a line: less where a surface is before it."""
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
    # The floor has soft lines: one sample a pixel is enough.
    floor = floor_picture(camera.coarser(SAMPLES), middle, radius)
    backdrop = (255.0 * floor + 0.5).astype(np.uint8)
    backdrop = backdrop.repeat(SAMPLES, axis=0).repeat(SAMPLES, axis=1)
    still = still_surfaces(parts, float(low[2]), camera)
    trails = tuple(
        (
            trail,
            stroke(trail.points, camera, 2.4 * scale, dashes_of(ROLES[trail.role], 2.4 * scale)),
        )
        for trail in scene.trails
        if is_shown(trail.layer, layers) and len(trail.points) > 1
    )
    return Pane(scene, layers, parts, camera, float(low[2]), scale, backdrop, still, trails)


def _groups(parts: tuple[Part, ...]) -> list[tuple[Part, ...]]:
    """Return parts through which others are seen: those of one colour and opacity together."""
    groups: dict[object, list[Part]] = {}
    for part in parts:
        if part.alpha < 1.0:
            groups.setdefault((part.overlay, part.alpha, part.colour), []).append(part)
    return [tuple(group) for group in groups.values()]


def role_colour(role: str) -> tuple[float, float, float]:
    """Return red, green and blue, from 0 to 1, of a role."""
    from matplotlib.colors import to_rgb

    return to_rgb(ROLES[role]["color"])


def _blend(
    flat: Pixels, pixels: NDArray[np.int64], colours: Single | Array, alpha: Single | Array
) -> None:
    """Lay colours (p, 3) or (3,) of these opacities (p,) over pixels of a picture (n, 3)."""
    share = alpha[:, None]
    flat[pixels] = (1.0 - share) * flat[pixels] + share * (_FULL * colours) + _HALF
