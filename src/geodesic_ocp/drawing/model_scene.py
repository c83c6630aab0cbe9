"""Scenes of a model in motion, with plots of its joints and hands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.actors import model_actor, rest_of_person
from geodesic_ocp.drawing.look import Indices
from geodesic_ocp.drawing.scene import Curve, FrameTrack, Plot, Scene, Trail
from geodesic_ocp.drawing.styles import Role
from geodesic_ocp.drawing.surroundings import mobility_ellipsoids
from geodesic_ocp.model.model import Model, hand_labels
from geodesic_ocp.synergies.scores import hand_speeds
from geodesic_ocp.trajectory.motion import Motion

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
) -> tuple[Plot, ...]:
    """Return plots of one number for each joint over time.

    Args:
        time: time of the samples (k,).
        values: (k, n), in the order of `Model.joint_names`.
        labels: labels of the axes, by the unit of the coordinate, "rad" or "m"; joints whose labels
            differ are in different plots.
        marks: values of horizontal lines, which are limits.
    """
    names = [short_name(name) for name in model.joint_names]
    plots = []
    for group, columns in joint_groups(model).items():
        for label in dict.fromkeys(labels[model.units[column]] for column in columns):
            shown = [column for column in columns if labels[model.units[column]] == label]
            curves = tuple(Curve(names[column], time, values[:, column]) for column in shown)
            plots.append(Plot(label, curves, group, marks, "limit" if marks else ""))
    return tuple(plots)


def short_name(joint: str) -> str:
    """Return the name of a joint without "_joint" at its end."""
    return joint.removesuffix("_joint") or joint


def joint_groups(model: Model) -> dict[str, list[int]]:
    """Return columns of the configuration by what the joints move; of up to 8 joints, all under "".

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
    """Return the names of the joints that move these hands, and no others."""
    if len(hands) != 1:
        return "trunk" if hands else "other joints"
    arm, _, frame = hands[0].rpartition("/")
    return arm or (frame.removesuffix("hand") + "arm" if frame.endswith("hand") else frame)


def hand_speed_plots(
    model: Model, motions: Mapping[str, tuple[Motion, Role]], shown: Indices | None = None
) -> tuple[Plot, ...]:
    """Return the speeds of all hands: of one motion in one plot, of several motions in one for each
    hand.

    Args:
        model: model with the motions' joints, in this order.
        motions: motions by name, with roles.
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
    """Return a model in motion, in axes of its base.

    Args:
        model: model whose links are shown, with the rest of the person if it is a person's.
        time: time of the configurations (k,) [s].
        q: configurations (k, n) [rad or m].
        title: title of the pane; the model's name by default.
        role: role whose colour the paths of its hands have, and the arms of a person of whom the
            rest is shown, too.
        note: beside the title.
        joints: whether the joints have frames, too.
    """
    rest = rest_of_person(model)
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
    """Return the path of every hand, with a dot.

    Args:
        model, q: see `model_scene`.
        role: role whose colour the paths have.
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


def overlaid(
    scene: Scene, model: Model, q: Array, name: str, role: Role, *, layer: str = "hand path"
) -> Scene:
    """Return the scene with a second motion of its model as an overlay, in a layer of its name.

    Args:
        scene: scene of the model.
        model, q: see `model_scene`.
        name: of the overlay, follows those of the hands.
        role: role whose colour it has.
        layer: name of the switch that shows the paths of its hands.
    """
    actor = model_actor(model, q, name=name, role=role, translucent=True, layer=name)
    trails = hand_trails(model, q, role, name=name, layer=layer)
    return replace(scene, actors=(*scene.actors, actor), trails=(*scene.trails, *trails))


def hand_frames(model: Model, q: Array) -> tuple[FrameTrack, ...]:
    """Return the frames of all hands."""
    return tuple(FrameTrack(hand, *model.frame_pose(hand, q)) for hand in model.hands)


def joint_frames(model: Model, q: Array) -> tuple[FrameTrack, ...]:
    """Return the frames of all joints."""
    known = [name for name in model.joint_names if model.pin.existFrame(name)]
    return tuple(FrameTrack(name, *model.frame_pose(name, q)) for name in known)


RATE = 200.0  # [Hz], above which a screen and an eye gain nothing
MOST = 12000  # samples: a minute at that rate
_ROUNDED = 1.01  # time stamps are rounded, and a rate of 200.1 Hz is one of 200 Hz


def shown_samples(time: Array) -> tuple[NDArray[np.int64], str]:
    """Return indices of the samples that are shown, and a note if these are not all.

    Every n-th sample and the last one, as they are, not interpolated: at most about 200 per second
    and 12000 altogether.

    >>> shown, note = shown_samples(np.arange(1001) / 1000.0)
    >>> len(shown), note
    (201, 'every 5th of 1001 samples is shown')

    Args:
        time: time of the samples (k,) [s], increasing.
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
