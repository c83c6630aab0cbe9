"""The body that a recorded motion is a motion of, where its joints tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.limits import JointLimits, joint_limits
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory
from geodesic_ocp.execution.replay import Replay
from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.anthropometry import Side, trunk
from geodesic_ocp.model.combine import combine
from geodesic_ocp.model.human import DEFAULT_HEIGHT, human_arm, human_upper_body
from geodesic_ocp.model.joint_axes import upward
from geodesic_ocp.model.look import Indices
from geodesic_ocp.model.model import Model, hand_labels
from geodesic_ocp.scenes.beside import beside
from geodesic_ocp.scenes.scene import (
    Actor,
    Curve,
    FrameTrack,
    Playback,
    Plot,
    Role,
    Scene,
    Span,
    Trail,
    model_actor,
)
from geodesic_ocp.scenes.surroundings import mobility_ellipsoids, rest_of_person, upright
from geodesic_ocp.synergies.scores import hand_speeds
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion


def body_of(motion: Motion) -> tuple[Model, str]:
    """The person's arm, both arms, or upper body whose joints a motion has, and a note on it.

    Joints are known by their names, those of the Master Motor Map (RSx_joint, ...). The height is
    that of the subject.

    Raises:
        ValueError: the motion has the joints of no arm of a person.
    """
    height = motion.subject.height or DEFAULT_HEIGHT
    names = set(motion.joint_names)
    whole = human_upper_body(height)
    arms = [human_arm(side, height) for side in get_args(Side)]
    found = [arm for arm in arms if names.issuperset(arm.joint_names)]
    if names.issuperset(whole.joint_names):
        model = whole
    elif len(found) == 2:
        across = trunk().half_width * height
        model = combine(*found, placements=[(across, 0.0, 0.0), (-across, 0.0, 0.0)])
    elif found:
        model = found[0]
    else:
        raise ValueError(
            "the motion's joints are not those of a person's arm (RSx_joint, ...): give its model "
            f"after it; its joints are {', '.join(motion.joint_names)}"
        )
    known = "" if motion.subject.height else ", the height is not known"
    return model, f"assumed: {model.name} of {height:.2f} m{known}"


HAND_SPEED = "hand speed [m/s]"
# Labels of axes by the unit of the coordinate.
POSITIONS = {"rad": "joint angles [rad]", "m": "prismatic joints [m]"}
VELOCITIES = {"rad": "joint velocities [rad/s]", "m": "prismatic joints [m/s]"}
TORQUES = {"rad": "torques [N m]", "m": "forces [N]"}

_MANY = 8  # joints in one plot


def joint_plots(
    model: Model,
    time: Array,
    values: Array,
    labels: Mapping[str, str],
    *,
    marks: tuple[float, ...] = (),
    title: str = "",
) -> tuple[Plot, ...]:
    """Plots of one number for each joint over time.

    Args:
        model: whose joints they are.
        time: of the samples (k,).
        values: (k, n), in the order of `Model.joint_names`.
        labels: of the axes, by the unit of the coordinate, "rad" or "m"; joints whose labels
            differ are in different plots.
        marks: values of horizontal lines, which are limits.
        title: of the plots, before the names of the groups if there are several.
    """
    names = [short_name(name) for name in model.joint_names]
    plots = []
    for group, columns in joint_groups(model).items():
        for label in dict.fromkeys(labels[model.units[column]] for column in columns):
            shown = [column for column in columns if labels[model.units[column]] == label]
            curves = tuple(Curve(names[column], time, values[:, column]) for column in shown)
            said = ", ".join(filter(None, (title, group)))
            plots.append(Plot(label, curves, said, marks, "limit" if marks else ""))
    return tuple(plots)


def short_name(joint: str) -> str:
    """The name of a joint without "_joint" at its end."""
    return joint.removesuffix("_joint") or joint


def joint_groups(model: Model) -> dict[str, list[int]]:
    """Columns of the configuration by what the joints move; of up to 8 joints, all under "".

    >>> import geodesic_ocp as go
    >>> {name: len(group) for name, group in joint_groups(go.human_upper_body()).items()}
    {'trunk': 6, 'right arm': 7, 'left arm': 7}
    """
    if model.dof <= _MANY:
        return {"": list(range(model.dof))}
    labels = hand_labels(model.hands)
    chains = [set(model.pin.supports[model.joint_of(hand)]) for hand in model.hands]
    found: dict[str, list[int]] = {}
    for column, name in enumerate(model.joint_names):
        joint = model.pin.getJointId(name)
        moved = [label for label, chain in zip(labels, chains, strict=True) if joint in chain]
        found.setdefault(_moving(moved), []).append(column)
    return found


def _moving(hands: Sequence[str]) -> str:
    """What the joints that move these hands, and no others, are called."""
    if len(hands) != 1:
        return "trunk" if hands else "other joints"
    arm, _, frame = hands[0].rpartition("/")
    return arm or (frame.removesuffix("hand") + "arm" if frame.endswith("hand") else frame)


def hand_speed_plots(
    model: Model, motions: Mapping[str, tuple[Motion, Role]], shown: Indices | None = None
) -> tuple[Plot, ...]:
    """The speeds of all hands: of one motion in one plot, of several motions in one for each hand.

    Args:
        model: with the motions' joints, in this order.
        motions: by name, with roles.
        shown: indices of the samples that are drawn; all by default.
    """
    labels = hand_labels(model.hands)
    found: dict[str, list[Curve]] = {label: [] for label in labels}
    for label, hand in zip(labels, model.hands, strict=True):
        one = model if hand == model.hand else model.with_hand(hand)
        for name, (motion, role) in motions.items():
            speed = hand_speeds(one, motion)
            chosen = np.arange(len(motion)) if shown is None else shown
            found[label].append(Curve(name, motion.time[chosen], speed[chosen], role))
    if len(labels) == 1:
        return (Plot(HAND_SPEED, tuple(found[labels[0]])),)
    if len(motions) > 1:
        return tuple(Plot(HAND_SPEED, tuple(curves), label) for label, curves in found.items())
    return (Plot(HAND_SPEED, tuple(replace(c, name=n, role=None) for n, (c,) in found.items())),)


def model_scene(
    model: Model,
    time: Array,
    q: Array,
    *,
    title: str = "",
    role: Role = "observed",
    note: str = "",
    joints: bool = False,
) -> Scene:
    """A model in motion, in axes of its base.

    Args:
        model: whose links are shown, with the rest of the person if it is a person's.
        time: of the configurations (k,) [s].
        q: configurations (k, n) [rad or m].
        title: of the pane; the model's name by default.
        role: whose colour the paths of its hands have, and the arms of a person of whom the rest is
            shown, too.
        note: beside the title.
        joints: whether the joints have frames, too.
    """
    rest = rest_of(model)
    return Scene(
        title or model.name,
        time,
        # What moves stands out from the rest of the person.
        (model_actor(model, q, role=role if rest else None), *rest),
        hand_trails(model, q, role),
        frames=(
            FrameTrack("base", np.eye(3)[None], np.zeros((1, 3))),
            *(joint_frames(model, q) if joints else ()),
            *hand_frames(model, q),
        ),
        ellipsoids=mobility_ellipsoids(model, q),
        note=note,
    )


def hand_trails(
    model: Model, q: Array, role: Role, *, name: str = "", layer: str = "hand path"
) -> tuple[Trail, ...]:
    """The path of every hand, with a dot.

    Args:
        model, q: see `model_scene`.
        role: whose colour the paths have.
        name: follows the name of the hand, for the legend.
        layer: name of the switch that shows the paths.
    """
    trails = []
    for label, hand in zip(hand_labels(model.hands), model.hands, strict=True):
        points = np.asarray(model.frame_pose(hand, q)[1])
        # A hand that stands still has no path.
        moves = len(q) > 1 and bool(np.ptp(points, axis=0).max() > 0.0)
        if moves:
            named = f"{label}, {name}" if name else label
            trails.append(Trail(named, points, role, points, layer))
    return tuple(trails)


def hand_frames(model: Model, q: Array) -> tuple[FrameTrack, ...]:
    """The frames of all hands."""
    return tuple(FrameTrack(hand, *model.frame_pose(hand, q)) for hand in model.hands)


def joint_frames(model: Model, q: Array) -> tuple[FrameTrack, ...]:
    """The frames of all joints."""
    known = [name for name in model.joint_names if model.pin.existFrame(name)]
    return tuple(FrameTrack(name, *model.frame_pose(name, q)) for name in known)


def rest_of(model: Model) -> tuple[Actor, ...]:
    """What belongs to the person of whom the model is a part, such as the trunk of an arm."""
    rest = rest_of_person(model)
    return () if rest is None else (rest,)


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


RATE = 200.0  # [Hz], above which a screen and an eye gain nothing
MOST = 12000  # samples: a minute at that rate
_ROUNDED = 1.01  # time stamps are rounded, and a rate of 200.1 Hz is one of 200 Hz


def shown_samples(time: Array) -> tuple[NDArray[np.int64], str]:
    """Indices of the samples that are shown, and a note if these are not all.

    Every n-th sample and the last one, as they are, not interpolated: at most about 200 per second
    and 12000 altogether.

    >>> import numpy as np
    >>> shown, note = shown_samples(np.arange(1001) / 1000.0)
    >>> len(shown), note
    (201, 'every 5th of 1001 samples is shown')

    Args:
        time: of the samples (k,) [s], increasing.
    """
    count = len(time)
    if count < 3:
        return np.arange(count), ""
    rate = (count - 1) / float(time[-1] - time[0])
    step = int(np.ceil(max(rate / RATE, (count - 1) / (MOST - 1)) / _ROUNDED))
    if step <= 1:
        return np.arange(count), ""
    shown = np.unique(np.append(np.arange(0, count, step), count - 1))
    return shown, f"every {_ordinal(step)} of {count} samples is shown"


def _ordinal(number: int) -> str:
    endings = {1: "st", 2: "nd", 3: "rd"}
    teen = number % 100 in (11, 12, 13)
    return f"{number}{'th' if teen else endings.get(number % 10, 'th')}"


_NOT_FILTERED = "speed of the recorded motion, without filtering"


def motion_playback(motion: Motion, model: Model, *, title: str = "", note: str = "") -> Playback:
    """A model that follows a motion: the path of the hand, joint angles and hand speed.

    It is shown in axes of the model's base: the arm of a person moves relative to the trunk. Of
    more than 200 samples per second or 12000 altogether every n-th is shown, which the note of the
    scene says.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv").filtered()
    >>> motion_playback(motion, go.human_arm("left")).scenes[0].trails[0]
    Trail('hand', 840 points)

    Args:
        motion: with the model's joints, by their names; others are left out.
        model: that moves.
        title: of the playback; the model's name by default.
        note: precedes the scene's own.

    Raises:
        ValueError: the motion lacks joints of the model.
    """
    chosen = of_joints(motion, model)
    shown, thinned = shown_samples(chosen.time)
    others = len(motion.joint_names) - model.dof
    notes = [note, f"{others} more joints recorded" if others else "", thinned]
    if chosen.trunk is not None:  # which moved, but the scene is that of the model's base
        notes.insert(1, f"the {'pelvis' if model.pin.existFrame('thorax') else 'trunk'} at rest")
    time, q = chosen.time[shown], chosen.q[shown]
    scene = model_scene(model, time, q, title=title, note="; ".join(filter(None, notes)))
    speeds = hand_speed_plots(model, {"hand": (chosen, "observed")}, shown)
    if chosen.velocity is None:  # the noise of the recording is in the speed
        speeds = tuple(replace(plot, title=_NOT_FILTERED) for plot in speeds)
    plots = (*joint_plots(model, time, q, POSITIONS), *speeds)
    return Playback(scene.title, (scene,), {}, plots, azimuth=viewed_from(model))


def of_joints(motion: Motion, model: Model) -> Motion:
    """The motion of the model's joints.

    Raises:
        ValueError: the motion lacks some, or its angles seem to be degrees.
    """
    missing = [name for name in model.joint_names if name not in motion.joint_names]
    if missing:
        raise ValueError(
            f"the motion has no joint {', '.join(missing)} of {model.name}; it has "
            f"{', '.join(motion.joint_names)}"
        )
    chosen = motion.select(model.joint_names)
    metric = KineticEnergy(model)
    for extremes in (chosen.q.min(axis=0), chosen.q.max(axis=0)):
        metric.check_units("motion", extremes)
    return chosen


def viewed_from(model: Model) -> float:
    """Azimuth of the camera [deg] from which the hands of a model are seen best."""
    sides = {side for hand in model.hands for side in ("left", "right") if side in hand}
    names = {name[:1] for name in model.joint_names if name.endswith("Sx_joint")}
    if names == {"L"} or (not names and sides == {"left"}):
        return -50.0
    return 50.0 if len(names or sides) < 2 else 20.0


_HELD = 0.98  # of a second, for which each of several configurations is shown


def model_playback(model: Model, q: ArrayLike | None = None, *, title: str = "") -> Playback:
    """A model in one configuration, or in several, one a second, with the frames of its joints.

    Args:
        model: that is shown.
        q: a configuration (n,) or several (k, n) [rad or m]; by default each joint at zero, or at
            the limit that is nearest to zero.
        title: of the playback; the model's name by default.

    Raises:
        ValueError: q has another shape, is not finite, or seems to be in degrees.
    """
    given = np.clip(0.0, model.lower, model.upper) if q is None else np.array(q, dtype=float)
    rows = np.atleast_2d(given)
    if rows.ndim != 2 or rows.shape[1] != model.dof or not len(rows) or given.ndim == 0:
        raise ValueError(
            f"q must have shape ({model.dof},) or (k, {model.dof}) for {model.name}, got "
            f"{given.shape}"
        )
    if not np.all(np.isfinite(rows)):
        raise ValueError(f"q must be finite, got {given}")
    for row in rows:
        KineticEnergy(model).check_units("q", row)
    time, configurations, spans, note = np.zeros(1), rows, {}, ""
    if len(rows) > 1:
        # Each one is held: what lies between two of them is not known.
        starts = np.arange(len(rows), dtype=float)
        time = np.column_stack([starts, starts + _HELD]).reshape(-1)
        configurations = np.repeat(rows, 2, axis=0)
        each = (Span(str(k + 1), float(k), k + 1.0) for k in range(len(rows) - 1))
        last = Span(str(len(rows)), float(starts[-1]), float(time[-1]))
        spans = {"configurations": (*each, last)}
        note = f"{len(rows)} configurations, one a second"
    scene = model_scene(model, time, configurations, title=title, note=note, joints=True)
    scene = replace(scene, trails=())
    return Playback(scene.title, (scene,), spans, azimuth=viewed_from(model))


SPEED_SHARES, TORQUE_SHARES = "joint speeds [% of limit]", "torques [% of limit]"


def trajectory_playback(
    trajectory: JointTrajectory,
    model: Model,
    *,
    limits: JointLimits | None = None,
    gravity: ArrayLike | None = None,
    title: str = "",
) -> Playback:
    """A model that follows a joint trajectory: joints, speeds, torques and the path of the hand.

    Speeds and torques are relative to their limits where those of all joints are known.

    Args:
        trajectory: with the model's joints, by their names; others are left out.
        model: that moves; it is turned so that z points upwards.
        limits: of the model's joints; those of `joint_limits` by default.
        gravity: acceleration of free fall in axes of the model's base (3,) [m/s^2]; the model's by
            default.
        title: of the playback; the model's name by default.

    Raises:
        ValueError: the trajectory lacks joints of the model, or has a single sample or times that
            do not increase.
    """
    names = trajectory.joint_names
    motion = of_joints(
        Motion(trajectory.time, trajectory.positions, names, trajectory.velocities), model
    )
    columns = [names.index(name) for name in model.joint_names]
    for column, unit in zip(columns, model.units, strict=True):
        given = (trajectory.units or ("rad",) * len(names))[column]
        if given != unit:
            raise ValueError(f"joint {names[column]} is in {given}, but the model's is in {unit}")
    shown, thinned = shown_samples(motion.time)
    others = len(names) - model.dof
    notes = [f"{others} more joints given" if others else "", thinned]
    time, q = motion.time[shown], motion.q[shown]
    scene = model_scene(
        model, time, q, title=title, role="predicted", note="; ".join(filter(None, notes))
    )
    known = joint_limits(model) if limits is None else limits
    velocities = trajectory.velocities[shown][:, columns]
    plots = [
        *joint_plots(model, time, q, POSITIONS),
        *_shares(model, time, velocities, known.velocity, VELOCITIES, SPEED_SHARES),
    ]
    if trajectory.efforts is not None:
        efforts = trajectory.efforts[shown][:, columns]
        plots += torque_plots(model, time, efforts, known.torque)
    plots += hand_speed_plots(model, {"hand": (motion, "predicted")}, shown)
    up = upward(model)
    if gravity is not None and np.any(gravity):
        up = -np.asarray(gravity, dtype=float) / np.linalg.norm(gravity)
    scene = upright(scene, up)
    return Playback(scene.title, (scene,), {}, tuple(plots), azimuth=viewed_from(model))


def torque_plots(model: Model, time: Array, torques: Array, limits: Array) -> tuple[Plot, ...]:
    """Plots of joint torques (k, n) [N m or N], relative to their limits (n,) if all are known."""
    return _shares(model, time, torques, limits, TORQUES, TORQUE_SHARES)


def _shares(
    model: Model,
    time: Array,
    values: Array,
    limits: Array,
    labels: Mapping[str, str],
    share: str,
) -> tuple[Plot, ...]:
    """Plots of magnitudes as shares of limits, or of the values where a limit is not known."""
    if not np.all(np.isfinite(limits)):
        return joint_plots(model, time, values, labels)
    percent = 100.0 * np.abs(values) / limits
    return joint_plots(model, time, percent, dict.fromkeys(labels, share), marks=(100.0,))


def planned_playback(
    planned: PlannedTrajectory, *, rate: float = 100.0, title: str = ""
) -> Playback:
    """The motion of all arms of a planned trajectory, and the times of the paths of each.

    The arms of one robot are in one pane; others have a pane each, in axes of their base, as a
    trajectory does not know where they stand.

    Args:
        planned: by `plan_trajectory`, or that of a retargeting.
        rate: of the samples [Hz].
        title: of the playback; the names of the robots by default.

    Raises:
        ValueError: the rate is not positive.
    """
    whole = planned.sampled(rate)
    parts, first = [], 0
    for number, arm in enumerate(planned.arms):
        own = slice(first, first + arm.robot.dof)
        first = own.stop
        trajectory = JointTrajectory(
            whole.time,
            whole.positions[:, own],
            whole.velocities[:, own],
            whole.accelerations[:, own],
            arm.robot.joint_names,
            arm.robot.units,
            None if whole.efforts is None else whole.efforts[:, own],
        )
        part = trajectory_playback(trajectory, arm.robot, limits=arm.limits, gravity=arm.gravity)
        parts.append(replace(part, spans={"paths": _path_spans(planned, number)}))
    robots = [arm.robot for arm in planned.arms]
    return robots_playback(robots, parts, title=title)


def _path_spans(planned: PlannedTrajectory, number: int) -> tuple[Span, ...]:
    """Spans of the paths of an arm, numbered from 1; of those on which it moves."""
    arm = planned.arms[number]
    edges = planned.robot_time(arm.edges)
    spans = []
    for index, (path, start, stop) in enumerate(
        zip(arm.paths, edges[:-1], edges[1:], strict=True), 1
    ):
        if path.length > 0.0:
            text = f"path {index} ({stop - start:.2f} s)"
            spans.append(Span(str(index), float(start), float(stop), text))
    return tuple(spans)


_ERRORS = {"rad": "joint errors [rad]", "m": "prismatic joint errors [m]"}


def replay_playback(replay: Replay, *, title: str = "") -> Playback:
    """The simulated robot, and the trajectory that it follows as an overlay.

    Args:
        replay: of a trajectory.
        title: of the playback; the model's name by default.
    """
    model = replay.model
    playback = motion_playback(replay.motion, model, title=title, note=replay.controller)
    (scene,) = playback.scenes
    shown, _ = shown_samples(replay.motion.time)
    time, wanted = replay.motion.time[shown], replay.reference.positions[shown]
    overlay = model_actor(
        model, wanted, name="trajectory", role="predicted", translucent=True, layer="trajectory"
    )
    trails = hand_trails(model, wanted, "predicted", name="trajectory", layer="trajectory")
    scene = replace(scene, actors=(*scene.actors, overlay), trails=(*scene.trails, *trails))
    distance = Curve("hand", time, 1000.0 * replay.position_error[shown])
    plots = (
        *joint_plots(model, time, replay.error[shown], _ERRORS),
        Plot("hand error [mm]", (distance,)),
        *torque_plots(model, time, replay.torques[shown], replay.torque_limits),
    )
    return replace(playback, scenes=(scene,), plots=plots)
