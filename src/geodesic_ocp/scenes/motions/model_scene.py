"""The scene of one model: its links, the rest of the person, hands' paths, frames, ellipsoids."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model, hand_labels
from geodesic_ocp.scenes.actor import Actor, Role, model_actor
from geodesic_ocp.scenes.around.ellipsoids import mobility_ellipsoids
from geodesic_ocp.scenes.around.person import rest_of_person
from geodesic_ocp.scenes.markings import FrameTrack, Trail
from geodesic_ocp.scenes.scene import Scene


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
