"""Plots of the joints and the hands of a model over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.look import Indices
from geodesic_ocp.model.model import Model, hand_labels
from geodesic_ocp.scenes.actor import Role
from geodesic_ocp.scenes.playback import Curve, Plot
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
