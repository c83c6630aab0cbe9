"""Scenes of retargetings: the person and the robots side by side."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.actors import Actor, model_actor, rest_of_person
from geodesic_ocp.drawing.alignment_scene import BasePose, mountings, share_a_body, shoulder
from geodesic_ocp.drawing.analysis_figure import widest_of_thirds
from geodesic_ocp.drawing.model_scene import (
    HAND_SPEED,
    hand_frames,
    hand_trails,
    short_name,
    shown_samples,
)
from geodesic_ocp.drawing.scene import (
    Curve,
    EllipsoidTrack,
    FrameTrack,
    Gap,
    Playback,
    Plot,
    Scene,
    Solid,
    Span,
    Trail,
)
from geodesic_ocp.drawing.surroundings import clearances, mobility_ellipsoids, obstacle_solids
from geodesic_ocp.model.combine import combine
from geodesic_ocp.model.look import Indices
from geodesic_ocp.model.meshes import meshes
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.scores import hand_speeds

# Flexion of shoulder and elbow [rad], the first and the fourth joint of a human arm.


#: Layer of the motion by inverse kinematics, which tracks the whole path of the hand.
BASELINE = "inverse kinematics (QP)"
TARGET, SYNERGIES = "person's hand, mapped", "robot's hand"
LONGER = 1.005  # times the person's time, from which it is said


def robot_pane(retargeting: Retargeting, shown: Indices, *, start: float = 0.0) -> Scene:
    """Return the robots in motion, with the paths of their hands and of the person's.

    Mobility ellipsoids are those of the metric in which the paths were planned, clearances those
    from obstacles.

    Args:
        retargeting: result of `retarget`.
        shown: indices of the samples that are drawn.
        start: start of the motion in the playback's time [s].
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
    """Return names of the robots, each once."""
    return " and ".join(dict.fromkeys(arm.robot.name for arm in arms))


def _actors(
    arm: RetargetedArm, placed: BasePose, shown: Indices, hidden: frozenset[str]
) -> list[Actor]:
    """Return the robot as it moves, and what moves of it by inverse kinematics."""
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
    """Get links that the actor of an arm does not show, as another arm of the same robot does."""
    if not share_a_body(arms):
        return frozenset()
    robot = arms[number].robot
    links = [str(frame.name) for frame in robot.pin.frames]
    if number > 0:  # the first of them shows the body
        return frozenset(name for name in links if not robot.moves(name))
    others = [arm.robot for arm in arms[1:]]
    return frozenset(name for name in links if any(other.moves(name) for other in others))


def _obstacles(obstacles: Sequence[Obstacle], placed: BasePose, points: Array) -> Iterator[Solid]:
    """Yield obstacles in the base frame, in the scene; half-spaces as wide as the points (k, 3)
    [m].
    """
    for solid in obstacle_solids(obstacles, points.min(axis=0), points.max(axis=0)):
        yield replace(solid, vertices=placed.points(solid.vertices))


def _gaps(
    arm: RetargetedArm, q: Array, retargeting: Retargeting, placed: BasePose, which: str
) -> Iterator[Gap]:
    """Yield distances of the links from obstacles, in the scene."""
    obstacles, links, _, _ = retargeting.settings.collisions
    for gap in clearances(arm.robot, q, obstacles, links=links) if obstacles else ():
        starts, ends = placed.points(gap.starts), placed.points(gap.ends)
        yield replace(gap, name=f"{gap.name}{which}", starts=starts, ends=ends)


def _note(retargeting: Retargeting) -> str:
    stretch = retargeting.stretch
    return f"{stretch:.2f} times the person's time" if stretch > LONGER else ""


def person_pane(arms: Sequence[RetargetedArm], time: Array, shown: Indices) -> Scene:
    """Return the person in motion, as recorded, with the path of the hand.

    If the times last longer than the recording, the note says so.

    Args:
        arms: arms of a retargeting, of one arm of the person or of both.
        time: at which the samples are shown (k,) [s].
        shown: indices of the samples (k,).
    """
    analyses = observed(arms)
    model, q = _whole(arms, analyses)
    names = " and ".join(dict.fromkeys(each.model.name for each in analyses))
    return Scene(
        "person",
        time,
        (model_actor(model, q[shown], role="observed"), *rest_of_person(model)),
        hand_trails(model, q[shown], "observed"),
        frames=hand_frames(model, q[shown]),
        note=names + _slowed(arms, time),
    )


def observed(arms: Sequence[RetargetedArm]) -> tuple[Analysis, ...]:
    """Return the analyses of the person's motion, each once."""
    return tuple({id(arm.analysis): arm.analysis for arm in arms}.values())


def _slowed(arms: Sequence[RetargetedArm], time: Array) -> str:
    recorded = arms[0].analysis.motion.time
    shown, own = float(time[-1] - time[0]), float(recorded[-1] - recorded[0])
    if shown > LONGER * own:
        return "; slowed to the robot's time"
    if any(float(arm.motion.time[-1] - arm.motion.time[0]) > LONGER * shown for arm in arms):
        return "; as fast as recorded"
    return ""


def _whole(arms: Sequence[RetargetedArm], analyses: Sequence[Analysis]) -> tuple[Model, Array]:
    """Return one arm, or both as one model, and its configurations (k, n)."""
    if len(analyses) == 1:
        return analyses[0].model, analyses[0].motion.q
    placed = {id(arm.analysis): shoulder(arm, len(analyses)) for arm in arms}
    models = [each.model for each in analyses]
    both = combine(*models, placements=[placed[id(each)] for each in analyses])
    return both, np.hstack([each.motion.q for each in analyses])


_SYNERGIES = "geodesic synergies"
_MILLIMETRES = 1000.0
_UNITS = {"rad": "joint angle [rad]", "m": "prismatic joint [m]"}


def retargeting_plots(
    retargeting: Retargeting,
    shown: Indices,
    *,
    start: float = 0.0,
    name: bool = False,
    number: int = 1,
) -> tuple[Plot, ...]:
    """Return distance of the hand from the person's, its speed, joints, and shares of speed limits.

    Args:
        retargeting: result of `retarget`.
        shown: indices of the samples that are drawn.
        start: start of the motion in the playback's time [s].
        name: whether titles name the robot, although there is only one.
        number: number of the retargeting among those of robots of this name; titles say it from 2
            on.
    """
    time = retargeting.motion.time
    several = name or len(retargeting.arms) > 1
    plots: list[Plot] = []
    names = [arm.robot.name for arm in retargeting.arms]
    for arm in retargeting.arms:
        alike = names.count(arm.robot.name) > 1
        title = (arm.title if alike else arm.robot.name) if several else ""
        title += f" ({number})" if number > 1 else ""
        plots += _of_arm(arm, time[shown] - time[0] + start, shown, title)
    return tuple(plots)


def _of_arm(arm: RetargetedArm, time: Array, shown: Indices, title: str) -> Iterator[Plot]:
    robot, motions = arm.robot, {_SYNERGIES: arm.motion, BASELINE: arm.tracked}

    def both(values: dict[str, Array]) -> tuple[Curve, ...]:
        roles = {_SYNERGIES: "predicted", BASELINE: "baseline"}
        return tuple(
            Curve(label, time, each[shown], roles[label])  # type: ignore[arg-type]
            for label, each in values.items()
        )

    wanted = arm.target_poses[1]
    off = {
        label: _MILLIMETRES * np.linalg.norm(robot.hand_pose(motion.q)[1] - wanted, axis=1)
        for label, motion in motions.items()
    }
    yield Plot("hand's distance [mm]", both(off), _joined(title, f"from the {TARGET}"))
    speed = np.linalg.norm(np.gradient(wanted, arm.motion.time, axis=0), axis=1)
    speeds = {label: hand_speeds(robot, motion) for label, motion in motions.items()}
    yield Plot(HAND_SPEED, (Curve(TARGET, time, speed[shown], "observed"), *both(speeds)), title)
    for joint in widest_of_thirds(arm.motion.q):
        angles = {label: motion.q[:, joint] for label, motion in motions.items()}
        name = short_name(robot.joint_names[joint])
        yield Plot(_UNITS[robot.units[joint]], both(angles), _joined(title, name))
    if arm.has_speed_limits:
        shares = {
            label: (np.abs(np.asarray(motion.velocity)) / arm.limits.velocity).max(axis=1)
            for label, motion in motions.items()
        }
        what = _joined(title, "largest share of the limits")
        yield Plot("joint speed / limit", both(shares), what, (1.0,), "limit")


def _joined(title: str, what: str) -> str:
    return f"{title}: {what}" if title else what


_SAME_TIME = 1e-9  # [s]
_HIDDEN = (*Playback.hidden, BASELINE)


def retargeting_playback(retargeting: Retargeting, *, person: bool = True) -> Playback:
    """Return a person and a robot that moves like the person, in the robot's time.

    The robot's shoulder is where the person's is, and its base is turned as the alignment says. In
    its pane are the path of its hand, that of the person's hand, mapped to the robot, and, to be
    switched on, the motion by inverse kinematics that tracks the hand along its whole path. The
    slider has the person's synergies and those of the robot.

    Args:
        retargeting: result of `retarget`.
        person: whether the person is shown as well.
    """
    time = retargeting.motion.time
    shown, _ = shown_samples(time)
    scenes = [robot_pane(retargeting, shown, start=float(time[0]))]
    spans = _spans_of_robots(retargeting, time)
    if person:
        scenes.insert(0, person_pane(retargeting.arms, time[shown], shown))
        spans = _spans_of_person(retargeting, time) | spans
    return Playback(
        " and ".join(arm.title for arm in retargeting.arms),
        tuple(scenes),
        spans,
        retargeting_plots(retargeting, shown, start=float(time[0])),
        azimuth=_azimuth(retargeting),
        hidden=_HIDDEN,
    )


def retargetings_playback(retargetings: Sequence[Retargeting]) -> Playback:
    """Return several robots that move like one person, or like several, each person shown once.

    All begin at the same time. If the robots take different times, the person takes the time of the
    recording, and each robot its own. Panes and plots of equal title are numbered.

    Args:
        retargetings: results of `retarget`, at least one.

    Raises:
        ValueError: there is none.
    """
    if not retargetings:
        raise ValueError("retargetings must be at least one, got none")
    if len(retargetings) == 1:
        return retargeting_playback(retargetings[0])
    groups: dict[tuple[int, ...], list[Retargeting]] = {}
    for each in retargetings:
        key = tuple(id(analysis) for analysis in observed(each.arms))
        groups.setdefault(key, []).append(each)
    scenes: list[Scene] = []
    plots: list[Plot] = []
    spans: dict[str, tuple[Span, ...]] = {}
    met = Counter[str]()

    def titled(scene: Scene) -> Scene:
        met[scene.title] += 1
        number = met[scene.title]
        return replace(scene, title=f"{scene.title} ({number})") if number > 1 else scene

    for robots in groups.values():
        time = _common_time(robots)
        shown, _ = shown_samples(time)
        scenes.append(titled(person_pane(robots[0].arms, time[shown], shown)))
        spans |= _distinct(_spans_of_person(robots[0], time), spans)
        for each in robots:
            own = each.motion.time - each.motion.time[0]
            scenes.append(titled(robot_pane(each, shown)))
            spans |= _distinct(_spans_of_robots(each, own), spans)
            number = met[robot_title(each.arms)]
            plots += retargeting_plots(each, shown, name=True, number=number)
    titles = dict.fromkeys(chain(*((arm.title for arm in each.arms) for each in retargetings)))
    return Playback(
        ", ".join(titles),
        tuple(scenes),
        spans,
        tuple(plots),
        azimuth=_azimuth(retargetings[0]),
        hidden=_HIDDEN,
    )


def _common_time(robots: Sequence[Retargeting]) -> Array:
    """Return times (k,) of the person's samples: those of the robots if they agree, from zero."""
    times = [each.motion.time - each.motion.time[0] for each in robots]
    if all(np.abs(time - times[0]).max() <= _SAME_TIME for time in times):
        return np.asarray(times[0])
    recorded = robots[0].arms[0].analysis.motion.time
    return np.asarray(recorded - recorded[0])


def _spans_of_person(retargeting: Retargeting, time: Array) -> dict[str, tuple[Span, ...]]:
    """Return the person's synergies, in a row for each arm, numbered from 1.

    They are where they are at these times of the samples (k,) [s]; their texts say how long they
    took the person.
    """
    analyses = observed(retargeting.arms)
    found = {}
    for analysis in analyses:
        row = "person" if len(analyses) == 1 else analysis.model.name.removeprefix("human ")
        spans = []
        for number, each in enumerate(analysis.synergies, 1):
            start, stop = (float(time[sample]) for sample in (each.start, each.stop))
            spans.append(
                Span(str(number), start, stop, f"synergy {number} ({each.duration:.2f} s)")
            )
        found[row] = tuple(spans)
    return found


def _spans_of_robots(retargeting: Retargeting, time: Array) -> dict[str, tuple[Span, ...]]:
    """Get the synergies of each robot, with the numbers of the person's of which they are made."""
    found: dict[str, tuple[Span, ...]] = {}
    for arm in retargeting.arms:
        spans = tuple(_span(number, group, time) for number, group in enumerate(arm.groups, 1))
        found |= _distinct({arm.robot.name: spans}, found)
    return found


def _span(number: int, group: SynergyGroup, time: Array) -> Span:
    start, stop = (float(time[sample]) for sample in (group.start, group.stop))
    if group.kind == "rest":
        return Span("rest", start, stop, f"rest ({stop - start:.2f} s)")
    first, last = group.members[0] + 1, group.members[-1] + 1
    made_of = f"{first}" if first == last else f"{first}-{last}"
    text = f"synergy {number} ({stop - start:.2f} s), person's {made_of}"
    return Span(str(number), start, stop, text)


def _distinct(
    rows: dict[str, tuple[Span, ...]], others: dict[str, tuple[Span, ...]]
) -> dict[str, tuple[Span, ...]]:
    """Return the rows, with numbers after the names that are taken."""
    found: dict[str, tuple[Span, ...]] = {}
    for name, spans in rows.items():
        names = (name, *(f"{name} ({number})" for number in range(2, len(others) + 3)))
        found[next(each for each in names if each not in others)] = spans
    return found


def _azimuth(retargeting: Retargeting) -> float:
    """Return direction from which the arms are seen well [deg]: from their side if that is the
    same.
    """
    arms = retargeting.arms
    robots = {arm.mapping.target.side or "right" for arm in arms}
    people = {arm.mapping.source.side or "right" for arm in arms}
    if len(robots) > 1 or len(people) > 1:
        return 20.0
    sign = -1.0 if "left" in robots else 1.0
    return sign * (50.0 if robots == people else 10.0)
