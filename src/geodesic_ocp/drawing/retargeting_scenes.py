"""Scenes of retargetings: the person and the robots side by side."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.actors import is_drawn_by, model_actor, rest_of_person
from geodesic_ocp.drawing.analysis_figure import widest_of_thirds
from geodesic_ocp.drawing.look import Indices
from geodesic_ocp.drawing.model_scene import (
    HAND_SPEED,
    hand_frames,
    hand_trails,
    short_name,
    shown_samples,
)
from geodesic_ocp.drawing.scene import (
    Curve,
    FrameTrack,
    Gap,
    Playback,
    Plot,
    Scene,
    Solid,
    Span,
    Trail,
)
from geodesic_ocp.drawing.styles import Role
from geodesic_ocp.drawing.surroundings import (
    carried,
    clearances,
    mobility_ellipsoids,
    obstacle_solids,
)
from geodesic_ocp.model.anthropometry import trunk
from geodesic_ocp.model.combine import combine
from geodesic_ocp.model.human import DEFAULT_HEIGHT, stature
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.scores import hand_speeds

#: Layer of the motion by inverse kinematics, which tracks the whole path of the hand.
BASELINE = "inverse kinematics (QP)"
TARGET = "person's hand, mapped"
SYNERGIES = "robot's hand"
LONGER = 1.005  # times the person's time, from which it is said
Rows = dict[str, tuple[Span, ...]]  # spans by the name of their row


def _shoulder(arm: RetargetedArm, count: int) -> Array:
    """Return the person's shoulder in the scene (3,) [m]: the origin, or to one side of it if of
    two.
    """
    model = arm.analysis.model
    if count == 1 or not {"left", "right"} & set(model.name.split()):
        return np.zeros(3)
    height = stature(model) or DEFAULT_HEIGHT
    side = -1.0 if "left" in model.name else 1.0
    return np.array([side * trunk().half_width * height, 0.0, 0.0])


def _share_a_body(arms: Sequence[RetargetedArm]) -> bool:
    """Return whether the arms are of one robot: same links, shoulders at several places."""
    frames = [{str(frame.name) for frame in arm.robot.pin.frames} for arm in arms]
    shoulders = np.array([np.asarray(arm.mapping.target.shoulder) for arm in arms])
    are_distinct = len(np.unique(shoulders.round(6), axis=0)) == len(arms)
    return len(arms) > 1 and are_distinct and all(names == frames[0] for names in frames)


def robot_pane(retargeting: Retargeting, shown: Indices, start: float) -> Scene:
    """Return the robots in motion, with the paths of their hands and of the person's.

    Each robot's axes are along the person's, and its shoulder is at the person's; the arms of one
    robot keep their distance from each other, and their middle is the origin. Mobility ellipsoids
    are those of the metric in which the paths were planned, clearances those from obstacles.

    Args:
        retargeting: result of `retarget`.
        shown: indices of the samples that are drawn.
        start: start of the motion in the playback's time [s].
    """
    arms = retargeting.arms
    one_body = _share_a_body(retargeting.arms)
    middle = np.mean([np.asarray(arm.mapping.target.shoulder) for arm in arms], axis=0)
    time = retargeting.motion.time[shown]
    whole = Scene(robot_title(arms), time - time[0] + start, note=_note(retargeting))
    for number, arm in enumerate(arms):
        own = _arm_scene(retargeting, number, shown, one_body)
        turn = np.asarray(arm.mapping.target.base).T
        place = -turn @ (middle if one_body else np.asarray(arm.mapping.target.shoulder))
        if len(arm.hands) > 1:  # of a person with the shoulders at some height
            place = place + np.mean([np.asarray(each.mapping.source.shoulder) for each in arms], 0)
        if not one_body:
            place = place + _shoulder(arm, len(arms))
        whole = whole.beside(carried(own, turn[None], place[None]))
    return whole


def _arm_scene(retargeting: Retargeting, number: int, shown: Indices, one_body: bool) -> Scene:
    """Return an arm in axes of its robot's base; of one body, what moves is shown with each, and
    what stays with the first.
    """
    arms = retargeting.arms
    settings = retargeting.settings
    arm = arms[number]
    robots = [each.robot for each in arms]
    robot = arm.robot
    which = f", {arm.name}" if len(arms) > 1 else ""
    q = arm.motion.q[shown]
    tracked = arm.tracked.q[shown]
    turned, target = (each[shown] for each in arm.target_poses)
    rotations, positions = robot.hand_pose(q)
    links = [str(frame.name) for frame in robot.pin.frames]
    hidden = {each for each in links if one_body and not is_drawn_by(robots, number, each)}
    still = {each for each in links if not robot.moves(each)}
    overlay: dict[str, Any] = {"role": "baseline", "translucent": True, "layer": BASELINE}
    name = f"{robot.name}, {BASELINE}"
    ways: tuple[tuple[str, Array, Role, str], ...] = (
        (TARGET, target, "observed", "hand path"),
        (SYNERGIES, positions, "predicted", "hand path"),
        (BASELINE, robot.hand_pose(tracked)[1], "baseline", BASELINE),
    )
    gaps: tuple[Gap, ...] = ()
    solids: tuple[Solid, ...] = ()
    if settings.obstacles:
        obstacles, near, _, _ = settings.collisions
        gaps = clearances(robot, q, obstacles, links=near)
    if number == 0 or not one_body:
        around = np.vstack([target, positions, np.zeros(3)])
        solids = obstacle_solids(settings.obstacles, around.min(axis=0), around.max(axis=0))
    ellipsoids = mobility_ellipsoids(robot, q, arm.transfers[0].path.metric)
    return Scene(
        robot.name,
        retargeting.motion.time[shown],
        (
            model_actor(robot, q, hidden=hidden),
            model_actor(robot, tracked, name=name, hidden=hidden | still, **overlay),
        ),
        tuple(Trail(f"{name}{which}", line, role, line, layer) for name, line, role, layer in ways),
        solids,
        (
            FrameTrack(f"{SYNERGIES}{which}", rotations, positions),
            FrameTrack(f"{TARGET}{which}", turned, target),
        ),
        tuple(replace(each, name=f"{each.name}{which}") for each in ellipsoids),
        tuple(replace(each, name=f"{each.name}{which}") for each in gaps),
    )


def robot_title(arms: Sequence[RetargetedArm]) -> str:
    """Return names of the robots, each once."""
    return " and ".join(dict.fromkeys(arm.robot.name for arm in arms))


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
    caveats = dict.fromkeys(each.motion.caveat for each in analyses)
    return Scene(
        "person",
        time,
        (model_actor(model, q[shown], role="observed"), *rest_of_person(model)),
        hand_trails(model, q[shown], "observed"),
        frames=hand_frames(model, q[shown]),
        note="; ".join(filter(None, (names + _slowed(arms, time), *caveats))),
    )


def observed(arms: Sequence[RetargetedArm]) -> tuple[Analysis, ...]:
    """Return the analyses of the person's motion, each once."""
    return tuple({id(arm.analysis): arm.analysis for arm in arms}.values())


def _slowed(arms: Sequence[RetargetedArm], time: Array) -> str:
    recorded = arms[0].analysis.motion.time
    shown = float(time[-1] - time[0])
    own = float(recorded[-1] - recorded[0])
    if shown > LONGER * own:
        return "; slowed to the robot's time"
    if any(float(arm.motion.time[-1] - arm.motion.time[0]) > LONGER * shown for arm in arms):
        return "; as fast as recorded"
    return ""


def _whole(arms: Sequence[RetargetedArm], analyses: Sequence[Analysis]) -> tuple[Model, Array]:
    """Return one arm, or both as one model, and its configurations (k, n)."""
    if len(analyses) == 1:
        return analyses[0].model, analyses[0].motion.q
    placed = {id(arm.analysis): _shoulder(arm, len(analyses)) for arm in arms}
    models = [each.model for each in analyses]
    both = combine(*models, placements=[placed[id(each)] for each in analyses])
    return both, np.hstack([each.motion.q for each in analyses])


_SYNERGIES = "geodesic synergies"
_MILLIMETRES = 1000.0
_UNITS = {"rad": "joint angle [rad]", "m": "prismatic joint [m]"}


def _plots(
    retargeting: Retargeting, shown: Indices, start: float, named: bool, number: int
) -> Iterator[Plot]:
    """Yield distance of the hand from the person's, its speed, joints, and shares of speed limits.

    Titles name the robots if `named`, and number those of equal names from 2 on.
    """
    time = retargeting.motion.time
    names = [arm.robot.name for arm in retargeting.arms]
    for arm in retargeting.arms:
        title = arm.title if names.count(arm.robot.name) > 1 else arm.robot.name
        title = title if named or len(names) > 1 else ""
        title += f" ({number})" if number > 1 else ""
        yield from _of_arm(arm, time[shown] - time[0] + start, shown, title)


def _of_arm(arm: RetargetedArm, time: Array, shown: Indices, title: str) -> Iterator[Plot]:
    robot = arm.robot
    motions = {_SYNERGIES: arm.motion, BASELINE: arm.tracked}

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


def retargeting_playback(*retargetings: Retargeting) -> Playback:
    """Return robots that move like one person, or like several, each person shown once.

    The robot's shoulder is where the person's is, and its base is turned as the alignment says. In
    its pane are the path of its hand, that of the person's hand, mapped to the robot, and, to be
    switched on, the motion by inverse kinematics that tracks the hand along its whole path. The
    slider has the person's synergies and those of the robot.

    Several begin at the same time. If the robots take different times, the person takes the time of
    the recording, and each robot its own. Panes and plots of equal title are numbered.

    Args:
        retargetings: results of `retarget`, at least one.
    """
    several = len(retargetings) > 1
    start = 0.0 if several else float(retargetings[0].motion.time[0])
    groups: dict[tuple[int, ...], list[Retargeting]] = {}
    for each in retargetings:
        key = tuple(id(analysis) for analysis in observed(each.arms))
        groups.setdefault(key, []).append(each)
    scenes: list[Scene] = []
    plots: list[Plot] = []
    spans: Rows = {}
    met = Counter[str]()

    def add(scene: Scene) -> int:
        met[scene.title] += 1
        number = met[scene.title]
        title = f"{scene.title} ({number})" if number > 1 else scene.title
        scenes.append(replace(scene, title=title))
        return number

    for robots in groups.values():
        time = _common_time(robots) + start
        shown, _ = shown_samples(time)
        add(person_pane(robots[0].arms, time[shown], shown))
        spans |= _distinct(_spans_of_person(robots[0], time), spans)
        for each in robots:
            own = each.motion.time - each.motion.time[0] + start
            number = add(robot_pane(each, shown, start))
            for arm in each.bodies:
                row = tuple(_span(k, group, own) for k, group in enumerate(arm.groups, 1))
                spans |= _distinct({arm.robot.name: row}, spans)
            plots += _plots(each, shown, start, several, number)
    titles = dict.fromkeys(arm.title for each in retargetings for arm in each.arms)
    return Playback(
        (", " if several else " and ").join(titles),
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


def _spans_of_person(retargeting: Retargeting, time: Array) -> Rows:
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


def _span(number: int, group: SynergyGroup, time: Array) -> Span:
    start, stop = (float(time[sample]) for sample in (group.start, group.stop))
    if group.kind == "rest":
        return Span("rest", start, stop, f"rest ({stop - start:.2f} s)")
    first = group.members[0] + 1
    last = group.members[-1] + 1
    made_of = f"{first}" if first == last else f"{first}-{last}"
    text = f"synergy {number} ({stop - start:.2f} s), person's {made_of}"
    return Span(str(number), start, stop, text)


def _distinct(rows: Rows, others: Rows) -> Rows:
    """Return the rows, with numbers after the names that are taken."""
    found: Rows = {}
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
