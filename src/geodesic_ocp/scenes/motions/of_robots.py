"""Several robots in motion: a pane each, or one where they are the arms of one robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geodesic_ocp.model.model import Model
from geodesic_ocp.scenes.beside import beside
from geodesic_ocp.scenes.playback import Playback
from geodesic_ocp.scenes.scene import Scene

_SAME = 1e-6  # [m], entries of rotations


def robots_playback(
    robots: Sequence[Model], playbacks: Sequence[Playback], *, title: str = ""
) -> Playback:
    """The playbacks of several robots as one; the arms of one robot share its body, in one pane.

    Args:
        robots: at least one.
        playbacks: of each of them, with one scene, whose first actor is the robot.
        title: of the whole; the titles of the playbacks by default.
    """
    together = beside(playbacks, title=title)
    scenes = [playback.scenes[0] for playback in playbacks]
    if not _are_one_body(robots, scenes):
        return together
    return replace(together, scenes=(_in_one_body(robots, scenes),))


def _are_one_body(robots: Sequence[Model], scenes: Sequence[Scene]) -> bool:
    """Whether several models are arms of one robot.

    They have the same links, each moved by one of them at most, and what none of them moves is at
    the same place.
    """
    links = [{str(frame.name) for frame in robot.pin.frames} for robot in robots]
    if len(robots) < 2 or any(each != links[0] for each in links):
        return False
    moving = {link: sum(robot.moves(link) for robot in robots) for link in links[0]}
    if max(moving.values()) > 1:
        return False
    first, *others = (scene.actors[0] for scene in scenes)
    return all(
        np.allclose(first.positions[link], other.positions[link], rtol=0.0, atol=_SAME)
        and np.allclose(first.rotations[link], other.rotations[link], rtol=0.0, atol=_SAME)
        for other in others
        for link in first.positions
        if not moving[link]
    )


def _in_one_body(robots: Sequence[Model], scenes: Sequence[Scene]) -> Scene:
    """One scene of the arms of a robot; what none of them moves is shown with the first."""
    actors = []
    for number, (robot, scene) in enumerate(zip(robots, scenes, strict=True)):
        others = [*robots[:number], *robots[number + 1 :]]
        for actor in scene.actors:
            kept = tuple(
                mesh
                for mesh in actor.meshes
                if robot.moves(mesh.link)
                or (number == 0 and not any(other.moves(mesh.link) for other in others))
            )
            actors.append(replace(actor, meshes=kept))
    names = list(dict.fromkeys(robot.name for robot in robots))
    labels = [robot.name for robot in robots]
    if len(names) < len(robots):
        labels = [f"arm {number}" for number in range(1, len(robots) + 1)]
    return replace(
        scenes[0],
        title=" and ".join(names),
        actors=tuple(actors),
        trails=tuple(
            replace(trail, name=f"{trail.name}, {label}")
            for label, scene in zip(labels, scenes, strict=True)
            for trail in scene.trails
        ),
        frames=tuple({frame.name: frame for scene in scenes for frame in scene.frames}.values()),
        ellipsoids=tuple(each for scene in scenes for each in scene.ellipsoids),
    )
