"""Scenes of motions and trajectories, on the model or the body to which their joints belong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.actors import is_drawn_by
from geodesic_ocp.drawing.model_scene import (
    HAND_SPEED,
    POSITIONS,
    TORQUES,
    VELOCITIES,
    hand_speed_plots,
    joint_plots,
    model_scene,
    overlaid,
    shown_samples,
)
from geodesic_ocp.drawing.scene import Curve, Playback, Plot, Scene, Span, beside, numbered_spans
from geodesic_ocp.drawing.styles import Role
from geodesic_ocp.drawing.surroundings import upright
from geodesic_ocp.execution.limits import JointLimits, joint_limits
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory
from geodesic_ocp.execution.replay import Replay
from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.human import DEFAULT_HEIGHT, both_arms, human_arm, human_upper_body
from geodesic_ocp.model.joint_axes import upward
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion


def body_of(motion: Motion) -> tuple[Model, str]:
    """Return the person's arm, both arms, or upper body whose joints a motion has, and a note on
    it.

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
        model = both_arms(found, height)
    elif found:
        model = found[0]
    else:
        raise ValueError(
            "the motion's joints are not those of a person's arm (RSx_joint, ...): give its model "
            f"after it; its joints are {', '.join(motion.joint_names)}"
        )
    known = "" if motion.subject.height else ", the height is not known"
    return model, f"assumed: {model.name} of {height:.2f} m{known}"


_SAME = 1e-6  # [m], entries of rotations


def robots_playback(
    robots: Sequence[Model], playbacks: Sequence[Playback], *, title: str = ""
) -> Playback:
    """Return the playbacks of several robots as one; the arms of one robot share its body, in one
    pane.

    Args:
        robots: at least one.
        playbacks: playbacks of each of them, with one scene, whose first actor is the robot.
        title: title of the whole; the titles of the playbacks by default.
    """
    together = beside(playbacks, title=title)
    scenes = [playback.scenes[0] for playback in playbacks]
    if not _are_one_body(robots, scenes):
        return together
    return replace(together, scenes=(_in_one_body(robots, scenes),))


def _are_one_body(robots: Sequence[Model], scenes: Sequence[Scene]) -> bool:
    """Return whether several models are arms of one robot.

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
    """Return one scene of the arms of a robot; what none of them moves is shown with the first."""
    names = list(dict.fromkeys(robot.name for robot in robots))
    labels = [robot.name for robot in robots]
    if len(names) < len(robots):
        labels = [f"arm {number}" for number in range(1, len(robots) + 1)]
    whole = Scene(" and ".join(names), scenes[0].time, note=scenes[0].note)
    for number, (scene, label) in enumerate(zip(scenes, labels, strict=True)):
        actors = []
        for actor in scene.actors:
            kept = (each for each in actor.meshes if is_drawn_by(robots, number, each.link))
            actors.append(replace(actor, meshes=tuple(kept)))
        trails = (replace(each, name=f"{each.name}, {label}") for each in scene.trails)
        whole = whole.beside(replace(scene, actors=tuple(actors), trails=tuple(trails)))
    frames = {frame.name: frame for frame in whole.frames}
    return replace(whole, frames=tuple(frames.values()))


_NOT_FILTERED = "speed of the recorded motion, without filtering"


def motion_playback(
    motion: Motion, model: Model, *, title: str = "", note: str = "", role: Role = "observed"
) -> Playback:
    """Return a model that follows a motion: the path of the hand, joint angles and hand speed.

    It is shown in axes of the model's base: the arm of a person moves relative to the trunk. Of
    more than 200 samples per second or 12000 altogether every n-th is shown, which the note of the
    scene says.

    >>> recording = go.trajectory.bundled_recording()
    >>> motion_playback(recording.motion, recording.model).scenes[0].trails[0]
    Trail(name='hand', points=<840 x 3 entries>)

    Args:
        motion: motion with the model's joints, by their names; others are left out.
        model: model that moves.
        title: title of the playback; the model's name by default.
        note: precedes the scene's own.
        role: role whose colour the path and the speed of the hand have.

    Raises:
        ValueError: the motion lacks joints of the model.
    """
    chosen = of_joints(motion, model)
    shown, thinned = shown_samples(chosen.time)
    others = len(motion.joint_names) - model.dof
    notes = [note, f"{others} more joints recorded" if others else "", thinned, motion.caveat]
    if chosen.trunk is not None:  # which moved, but the scene is that of the model's base
        notes.insert(1, f"the {'pelvis' if model.pin.existFrame('thorax') else 'trunk'} at rest")
    time = chosen.time[shown]
    q = chosen.q[shown]
    noted = "; ".join(filter(None, notes))
    scene = model_scene(model, time, q, title=title, role=role, note=noted)
    speeds = hand_speed_plots(model, {"hand": (chosen, role)}, shown)
    if chosen.velocity is None:  # the noise of the recording is in the speed
        speeds = tuple(replace(plot, title=_NOT_FILTERED) for plot in speeds)
    plots = (*joint_plots(model, time, q, POSITIONS), *speeds)
    return Playback(scene.title, (scene,), {}, plots, azimuth=viewed_from(model))


def of_joints(motion: Motion, model: Model) -> Motion:
    """Return the motion of the model's joints.

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
    """Return azimuth of the camera [deg] from which the hands of a model are seen best."""
    sides = {side for hand in model.hands for side in ("left", "right") if side in hand}
    names = {name[:1] for name in model.joint_names if name.endswith("Sx_joint")}
    if names == {"L"} or (not names and sides == {"left"}):
        return -50.0
    return 50.0 if len(names or sides) < 2 else 20.0


_HELD = 0.98  # of a second, for which each of several configurations is shown


def model_playback(model: Model, q: np.ndarray | None = None) -> Playback:
    """Return a model in one configuration, or in several, one a second, with the frames of its
    joints.

    Args:
        q: a configuration (n,) or several (k, n) [rad or m]; by default each joint at zero, or at
            the limit that is nearest to zero.

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
    time = np.zeros(1)
    configurations = rows
    spans = {}
    note = ""
    if len(rows) > 1:
        # Each one is held: what lies between two of them is not known.
        starts = np.arange(len(rows), dtype=float)
        time = np.column_stack([starts, starts + _HELD]).reshape(-1)
        configurations = np.repeat(rows, 2, axis=0)
        each = (Span(str(k + 1), float(k), k + 1.0) for k in range(len(rows) - 1))
        last = Span(str(len(rows)), float(starts[-1]), float(time[-1]))
        spans = {"configurations": (*each, last)}
        note = f"{len(rows)} configurations, one a second"
    scene = model_scene(model, time, configurations, note=note, joints=True)
    scene = replace(scene, trails=())
    return Playback(scene.title, (scene,), spans, azimuth=viewed_from(model))


SPEED_SHARES = "joint speeds [% of limit]"
TORQUE_SHARES = "torques [% of limit]"


def trajectory_playback(
    trajectory: JointTrajectory,
    model: Model,
    *,
    limits: JointLimits | None = None,
    gravity: ArrayLike | None = None,
    title: str = "",
) -> Playback:
    """Return a model that follows a joint trajectory: joints, speeds, torques and the path of the
    hand.

    Speeds and torques are relative to their limits where those of all joints are known.

    Args:
        trajectory: trajectory with the model's joints, by their names; others are left out.
        model: model that moves; it is turned so that z points upwards.
        limits: limits of the model's joints; those of `joint_limits` by default.
        gravity: acceleration of free fall in axes of the model's base (3,) [m/s^2]; the model's by
            default.
        title: title of the playback; the model's name by default.

    Raises:
        ValueError: the trajectory lacks joints of the model, or has a single sample or times that
            do not increase.
    """
    names = trajectory.joint_names
    whole = Motion(trajectory.time, trajectory.positions, names, trajectory.velocities)
    motion = of_joints(whole, model)
    columns = [names.index(name) for name in model.joint_names]
    for column, unit in zip(columns, model.units, strict=True):
        given = (trajectory.units or ("rad",) * len(names))[column]
        if given != unit:
            raise ValueError(f"joint {names[column]} is in {given}, but the model's is in {unit}")
    playback = motion_playback(whole, model, title=title, role="predicted")
    shown, _ = shown_samples(motion.time)
    time = motion.time[shown]
    known = joint_limits(model) if limits is None else limits
    velocities = trajectory.velocities[shown][:, columns]
    shares = _shares(model, time, velocities, known.velocity, VELOCITIES, SPEED_SHARES)
    if trajectory.efforts is not None:
        efforts = trajectory.efforts[shown][:, columns]
        shares += torque_plots(model, time, efforts, known.torque)
    plots = sorted((*playback.plots, *shares), key=lambda plot: plot.label == HAND_SPEED)
    up = upward(model)
    if gravity is not None and np.any(gravity):
        up = -np.asarray(gravity, dtype=float) / np.linalg.norm(gravity)
    return replace(playback, scenes=(upright(playback.scenes[0], up),), plots=tuple(plots))


def torque_plots(model: Model, time: Array, torques: Array, limits: Array) -> tuple[Plot, ...]:
    """Return plots of joint torques (k, n) [N m or N], relative to their limits (n,) if all are
    known.
    """
    return _shares(model, time, torques, limits, TORQUES, TORQUE_SHARES)


def _shares(
    model: Model,
    time: Array,
    values: Array,
    limits: Array,
    labels: Mapping[str, str],
    share: str,
) -> tuple[Plot, ...]:
    """Get plots of magnitudes as shares of limits, or of the values where a limit is not known."""
    if not np.all(np.isfinite(limits)):
        return joint_plots(model, time, values, labels)
    percent = 100.0 * np.abs(values) / limits
    return joint_plots(model, time, percent, dict.fromkeys(labels, share), marks=(100.0,))


_RATE = 100.0  # [Hz], of planned trajectories


def planned_playback(planned: PlannedTrajectory) -> Playback:
    """Return the motion of all arms of a planned trajectory, and the times of the paths of each.

    The arms of one robot are in one pane; others have a pane each, in axes of their base, as a
    trajectory does not know where they stand.

    Args:
        planned: trajectory of `plan_trajectory`, or of a retargeting.
    """
    whole = planned.sampled(_RATE)
    parts = []
    first = 0
    for number, arm in enumerate(planned.arms):
        own = slice(first, first + arm.robot.dof)
        first = own.stop
        trajectory = whole.columns(own, arm.robot.joint_names)
        part = trajectory_playback(trajectory, arm.robot, limits=arm.limits, gravity=arm.gravity)
        parts.append(replace(part, spans={"paths": _path_spans(planned, number)}))
    robots = [arm.robot for arm in planned.arms]
    return robots_playback(robots, parts)


def _path_spans(planned: PlannedTrajectory, number: int) -> tuple[Span, ...]:
    """Return spans of the paths of an arm, numbered from 1; of those on which it moves."""
    arm = planned.arms[number]
    edges = planned.robot_time(arm.edges)
    spans = zip(arm.paths, numbered_spans("path", pairwise(edges)), strict=True)
    return tuple(span for path, span in spans if path.length > 0.0)


_ERRORS = {"rad": "joint errors [rad]", "m": "prismatic joint errors [m]"}


def replay_playback(replay: Replay) -> Playback:
    """Return the simulated robot, and the trajectory that it follows as an overlay.

    Args:
        replay: replay of a trajectory.
    """
    model = replay.model
    playback = motion_playback(replay.motion, model, note=replay.controller)
    (scene,) = playback.scenes
    shown, _ = shown_samples(replay.motion.time)
    time = replay.motion.time[shown]
    wanted = replay.reference.positions[shown]
    scene = overlaid(scene, model, wanted, "trajectory", "predicted", layer="trajectory")
    distance = Curve("hand", time, 1000.0 * replay.position_error[shown])
    plots = (
        *joint_plots(model, time, replay.error[shown], _ERRORS),
        Plot("hand error [mm]", (distance,)),
        *torque_plots(model, time, replay.torques[shown], replay.torque_limits),
    )
    return replace(playback, scenes=(scene,), plots=plots)
