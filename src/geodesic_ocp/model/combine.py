"""Several models as one system, such as both arms of a person."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array, as_rotation, as_vector
from geodesic_ocp.model.joints import restore_frames, with_distinct_frames
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Body

_SAME_GRAVITY = 1e-9  # [m/s^2]


def combine(*models: Model, placements: Sequence[Any] | None = None) -> Model:
    """Combine models into one, whose configuration concatenates theirs.

    The mass matrix is block diagonal. Names of joints and frames that occur in several models are
    prefixed with the model's name, as in "human left arm/hand"; models of the same name are
    numbered. The model has the hands of all (`Model.hands`); `Model.hand` is that of the first, and
    `Model.with_hand` selects another.

    >>> arms = go.human_arm("left"), go.human_arm("right")
    >>> both = go.model.combine(*arms, placements=[(-0.2, 0.0, 1.4), (0.2, 0.0, 1.4)])
    >>> both.dof, both.hands
    (14, ('human left arm/hand', 'human right arm/hand'))

    Args:
        models: two or more models.
        placements: for each model the position of its base in the common base frame, (3,) [m], or
            a pair of rotation (3, 3) and position. None: all base frames coincide.

    Raises:
        ValueError: fewer than two models, wrong placements, or gravities that differ.
    """
    if len(models) < 2 or not all(isinstance(model, Model) for model in models):
        raise ValueError(f"combine takes two or more models, got {models!r}")
    bases = [pin.SE3(*each) for each in base_placements(placements, len(models), "models")]
    names = _unique_names(models)
    gravity = bases[0].rotation @ models[0].pin.gravity.linear
    parts = []
    for model, new_names, base in zip(models, names, bases, strict=True):
        own_gravity = base.rotation @ model.pin.gravity.linear
        if np.abs(own_gravity - gravity).max() > _SAME_GRAVITY:
            both = f"{own_gravity} m/s^2 for {model.name!r} and {gravity} m/s^2 for"
            raise ValueError(f"in the common base frame gravity is {both} {models[0].name!r}")
        parts.append(_renamed(model.pin, new_names))
    whole = pin.Model()
    distinct, original = with_distinct_frames(*parts)
    for part, base in zip(distinct, bases, strict=True):
        whole = pin.appendModel(whole, part, 0, base)
    restore_frames(whole, original)
    whole.name = " and ".join(model.name for model in models)
    whole.gravity = pin.Motion(gravity, np.zeros(3))
    whole.armature = np.concatenate([part.armature for part in parts])  # which is lost
    pairs = list(zip(models, names, strict=True))
    continuous = [new[name] for model, new in pairs for name in model.continuous]
    hands = [new[hand] for model, new in pairs for hand in model.hands]
    hand = names[0][models[0].hand]
    bodies = partial(_bodies, models, names)
    return Model(whole, hand, models[0].backend, tuple(continuous), bodies, tuple(hands))


def _bodies(models: Sequence[Model], names: Sequence[Mapping[str, str]]) -> tuple[Body, ...]:
    """Return the bodies of all models, with the new names of their links."""
    return tuple(
        replace(body, link=new[str(body.link)], name=new.get(body.name, body.name))
        for model, new in zip(models, names, strict=True)
        for body in model.bodies
    )


def base_placements(
    given: Sequence[Any] | None, count: int, of: str
) -> tuple[tuple[Array, Array], ...]:
    """Return rotation (3, 3) and position (3,) [m] of each base in the common one.

    Args:
        given: positions, or pairs of rotation and position; None: all bases coincide.
        count: how many there must be.
        of: what they are, in the plural.

    Raises:
        ValueError: another number, or wrong shapes.
    """
    if given is None:
        return ((np.eye(3), np.zeros(3)),) * count
    if not isinstance(given, (Sequence, np.ndarray)) or len(given) != count:
        raise ValueError(f"placements must be one for each of {count} {of}, got {given!r}")
    poses = []
    for index, value in enumerate(given):
        rotation = np.eye(3)
        position = value
        if isinstance(value, (tuple, list)) and len(value) == 2 and np.ndim(value[0]) > 0:
            rotation, position = value
        name = f"placements[{index}]"
        poses.append((as_rotation(name, rotation), as_vector(name, position, 3)))
    return tuple(poses)


def _unique_names(models: Sequence[Model]) -> list[dict[str, str]]:
    """Return for each model unique names of its joints and frames, by the original ones."""
    counts = Counter(name for model in models for name in _names(model.pin))
    taken = {name for name, count in counts.items() if count == 1}
    result = []
    for model in models:
        new = {}
        title = model.name
        number = 1
        if sum(other.name == model.name for other in models) > 1:
            title = f"{model.name} {number}"
        shared = [name for name in sorted(_names(model.pin)) if counts[name] > 1]
        while any(f"{title}/{name}" in taken for name in shared):
            number += 1
            title = f"{model.name} {number}"
        for name in _names(model.pin):
            new[name] = f"{title}/{name}" if name in shared else name
        taken |= set(new.values())
        result.append({**new, "universe": "universe"})
    return result


def _renamed(model: pin.Model, new: Mapping[str, str]) -> pin.Model:
    part = model.copy()
    for index in range(1, part.njoints):
        part.names[index] = new[part.names[index]]
    for index in range(1, part.nframes):  # the first is the universe
        part.frames[index].name = new[part.frames[index].name]
    return part


def _names(model: pin.Model) -> set[str]:
    frames = {str(frame.name) for frame in list(model.frames)[1:]}
    return frames | {str(name) for name in list(model.names)[1:]}
