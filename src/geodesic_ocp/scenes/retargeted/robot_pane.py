"""The pane of the robots of a retargeting."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.look import Indices
from geodesic_ocp.model.meshes import meshes
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.scenes.actor import Actor, model_actor
from geodesic_ocp.scenes.around.clearances import clearances
from geodesic_ocp.scenes.around.ellipsoids import mobility_ellipsoids
from geodesic_ocp.scenes.around.obstacles import obstacle_solids
from geodesic_ocp.scenes.markings import EllipsoidTrack, FrameTrack, Gap, Solid, Trail
from geodesic_ocp.scenes.retargeted.mounting import BasePose, mountings, share_a_body
from geodesic_ocp.scenes.scene import Scene

#: Layer of the motion by inverse kinematics, which tracks the whole path of the hand.
BASELINE = "inverse kinematics (QP)"
TARGET, SYNERGIES = "person's hand, mapped", "robot's hand"
LONGER = 1.005  # times the person's time, from which it is said


def robot_pane(retargeting: Retargeting, shown: Indices, *, start: float = 0.0) -> Scene:
    """The robots in motion, with the paths of their hands and of the person's.

    Mobility ellipsoids are those of the metric in which the paths were planned, clearances those
    from obstacles.

    Args:
        retargeting: result of `retarget`.
        shown: indices of the samples that are drawn.
        start: of the motion in the playback's time [s].
    """
    arms = retargeting.arms
    actors: list[Actor] = []
    trails: list[Trail] = []
    frames: list[FrameTrack] = []
    solids: list[Solid] = []
    ellipsoids: list[EllipsoidTrack] = []
    gaps: list[Gap] = []
    for number, (arm, placed) in enumerate(zip(arms, mountings(arms), strict=True)):
        which = f", {arm.robot.name}" if len(arms) > 1 else ""
        hidden = _hidden(arms, number)
        actors += _actors(arm, placed, shown, hidden)
        q, turned, points = arm.motion.q[shown], *(each[shown] for each in arm.target_poses)
        rotations, positions = arm.robot.hand_pose(q)
        _, tracked = arm.robot.hand_pose(arm.tracked.q[shown])
        for name, line, role, layer in (
            (TARGET, points, "observed", "hand path"),
            (SYNERGIES, positions, "predicted", "hand path"),
            (BASELINE, tracked, "baseline", BASELINE),
        ):
            line = placed.points(line)
            trails.append(Trail(f"{name}{which}", line, role, line, layer))  # type: ignore[arg-type]
        for name, axes, line in ((SYNERGIES, rotations, positions), (TARGET, turned, points)):
            frames.append(FrameTrack(f"{name}{which}", placed.rotations(axes), placed.points(line)))
        for each in mobility_ellipsoids(arm.robot, q, arm.transfers[0].path.metric):
            centres, axes = placed.points(each.centres), placed.rotations(each.axes)
            named = f"{each.name}{which}"
            ellipsoids.append(replace(each, name=named, centres=centres, axes=axes))
        gaps += _gaps(arm, q, retargeting, placed, which)
        if number == 0 or not share_a_body(arms):
            around = np.vstack([points, positions, np.zeros(3)])
            solids += _obstacles(retargeting.settings.obstacles, placed, around)
    time = retargeting.motion.time[shown]
    return Scene(
        robot_title(arms),
        time - time[0] + start,
        tuple(actors),
        tuple(trails),
        tuple(solids),
        frames=tuple(frames),
        ellipsoids=tuple(ellipsoids),
        gaps=tuple(gaps),
        note=_note(retargeting),
    )


def robot_title(arms: Sequence[RetargetedArm]) -> str:
    """Names of the robots, each once."""
    return " and ".join(dict.fromkeys(arm.robot.name for arm in arms))


def _actors(
    arm: RetargetedArm, placed: BasePose, shown: Indices, hidden: frozenset[str]
) -> list[Actor]:
    """The robot as it moves, and what moves of it by inverse kinematics."""
    robot, parts = arm.robot, meshes(arm.robot)
    still = frozenset(part.link for part in parts if not robot.moves(part.link))

    def moving(q: Array, **how: Any) -> Actor:
        at = placed.rotation, placed.position
        return model_actor(robot, q[shown], rotation=at[0], position=at[1], shown=parts, **how)

    name = f"{robot.name}, {BASELINE}"
    overlay: dict[str, Any] = {"role": "baseline", "translucent": True, "layer": BASELINE}
    return [
        moving(arm.motion.q, hidden=hidden),
        moving(arm.tracked.q, name=name, hidden=hidden | still, **overlay),
    ]


def _hidden(arms: tuple[RetargetedArm, ...], number: int) -> frozenset[str]:
    """Links that the actor of an arm does not show, as another arm of the same robot does."""
    if not share_a_body(arms):
        return frozenset()
    robot = arms[number].robot
    links = [str(frame.name) for frame in robot.pin.frames]
    if number > 0:  # the first of them shows the body
        return frozenset(name for name in links if not robot.moves(name))
    others = [arm.robot for arm in arms[1:]]
    return frozenset(name for name in links if any(other.moves(name) for other in others))


def _obstacles(obstacles: Sequence[Obstacle], placed: BasePose, points: Array) -> Iterator[Solid]:
    """Obstacles in the base frame, in the scene; half-spaces as wide as the points (k, 3) [m]."""
    for solid in obstacle_solids(obstacles, points.min(axis=0), points.max(axis=0)):
        yield replace(solid, vertices=placed.points(solid.vertices))


def _gaps(
    arm: RetargetedArm, q: Array, retargeting: Retargeting, placed: BasePose, which: str
) -> Iterator[Gap]:
    """Distances of the links from obstacles, in the scene."""
    obstacles, links, _, _ = retargeting.settings.collisions
    for gap in clearances(arm.robot, q, obstacles, links=links) if obstacles else ():
        starts, ends = placed.points(gap.starts), placed.points(gap.ends)
        yield replace(gap, name=f"{gap.name}{which}", starts=starts, ends=ends)


def _note(retargeting: Retargeting) -> str:
    stretch = retargeting.stretch
    return f"{stretch:.2f} times the person's time" if stretch > LONGER else ""
