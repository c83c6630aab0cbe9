"""Frames of a video: pictures of a playback at given times."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.scenes.playback import Playback
from geodesic_ocp.viewer.video.drawing.camera import Camera, cameras, turned
from geodesic_ocp.viewer.video.drawing.pane import SAMPLES, Pane, pane
from geodesic_ocp.viewer.video.drawing.scene_parts import scene_parts, scene_points
from geodesic_ocp.viewer.video.layout import layout
from geodesic_ocp.viewer.video.panel import panel

Frame = NDArray[np.uint8]  # (height, width, 3)


def frames(
    playback: Playback,
    instants: Sequence[float],
    *,
    width: int,
    layers: Collection[str],
    turns: Sequence[float] | None = None,
) -> Iterator[Frame]:
    """Pictures of a playback.

    Args:
        playback: what is drawn.
        instants: of the pictures, in the playback's time.
        width: of the pictures [px], even.
        layers: those that are shown.
        turns: of the camera at each instant [rad]; None: it stands still.
    """
    scenes = playback.scenes
    # About half of a frame belongs to the panes.
    pixels = 0.5 * width**2 / len(scenes)
    parts = [scene_parts(scene, layers, pixels) for scene in scenes]
    points = [scene_points(scene, each, layers) for scene, each in zip(scenes, parts, strict=True)]

    def seen(shape: tuple[int, int]) -> list[Camera]:
        around = turns is not None
        return cameras(points, playback.azimuth, shape, around=around, elevation=playback.elevation)

    square = seen((1000, 1000))
    extents = [np.ptp(each.project(at)[0], axis=0) for each, at in zip(square, points, strict=True)]
    across, down = np.max(extents, axis=0)
    place = layout(playback, width, float(down / max(across, 1e-9)) * 1.05)
    shape = (SAMPLES * place.panes[0][3], SAMPLES * place.panes[0][2])
    scale = SAMPLES * place.unit

    def panes(angle: float) -> list[Pane]:
        made: list[Pane] = []
        for scene, each, at, camera in zip(scenes, parts, points, seen(shape), strict=True):
            middle: Array = (at.min(axis=0) + at.max(axis=0)) / 2.0
            view = turned(camera, middle, angle) if angle else camera
            made.append(pane(scene, layers, each, at, view, scale))
        return made

    around = panel(playback, place)
    drawn = panes(0.0)
    for index, instant in enumerate(instants):
        if turns is not None and turns[index]:
            drawn = panes(turns[index])
        pictures = [each.picture(instant) for each in drawn]
        yield around.picture(instant, list(zip(place.panes, pictures, strict=True)))
