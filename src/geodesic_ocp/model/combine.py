"""Several models as one system, such as both arms of a person."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import as_rotation, as_vector
from geodesic_ocp.model.joints import distinct_frames, restore_frames
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Body

_SAME = 1e-9  # of gravity [m/s^2]


def combine(*models: Model, placements: Sequence[Any] | None = None) -> Model:
    """The models side by side as one, whose configuration is theirs, one after the other.

    Its mass matrix has theirs for diagonal blocks. Names of joints and frames that occur in more
    than one of the models get the model's in front: "human left arm/hand"; models of one name are
    numbered. Its hand is that of the first model, and `Model.with_hand` takes another's.

    Args:
        models: two or more.
        placements: for each model the place of its base in the common one: (3,) [m], or a pair of
            a rotation (3, 3) and a place. None: all bases are one.

    Raises:
        ValueError: fewer than two models, wrong placements, or gravities that differ.
    """
    if len(models) < 2 or not all(isinstance(model, Model) for model in models):
        raise ValueError(f"combine takes two or more models, got {models!r}")
    places = _placements(placements, len(models))
    names = _own_names(models)
    gravity = places[0].rotation @ models[0].pin.gravity.linear
    parts = []
    for model, own, place in zip(models, names, places, strict=True):
        turned = place.rotation @ model.pin.gravity.linear
        if np.abs(turned - gravity).max() > _SAME:
            raise ValueError(
                f"in the common axes gravity is {turned} m/s^2 for {model.name!r} and {gravity} "
                f"m/s^2 for {models[0].name!r}"
            )
        parts.append(_renamed(model.pin, own))
    whole = pin.Model()
    with distinct_frames(*parts) as old:
        for part, place in zip(parts, places, strict=True):
            whole = pin.appendModel(whole, part, 0, place)
    restore_frames(whole, old)
    whole.name = " and ".join(model.name for model in models)
    whole.gravity = pin.Motion(gravity, np.zeros(3))
    continuous = [
        own[name] for model, own in zip(models, names, strict=True) for name in model.continuous
    ]
    shapes = partial(_bodies, models, names)
    return Model(whole, names[0][models[0].hand], models[0].backend, tuple(continuous), shapes)


def _bodies(models: Sequence[Model], names: Sequence[Mapping[str, str]]) -> tuple[Body, ...]:
    """The bodies of all models, at links by their new names."""
    return tuple(
        replace(body, link=own[str(body.link)], name=own.get(body.name, body.name))
        for model, own in zip(models, names, strict=True)
        for body in model.bodies
    )


def _placements(given: Sequence[Any] | None, count: int) -> list[pin.SE3]:
    if given is None:
        return [pin.SE3.Identity()] * count
    if not isinstance(given, (Sequence, np.ndarray)) or len(given) != count:
        raise ValueError(f"placements must be one for each of {count} models, got {given!r}")
    return [_placement(f"placements[{index}]", place) for index, place in enumerate(given)]


def _placement(name: str, given: Any) -> pin.SE3:
    rotation, place = np.eye(3), given
    if isinstance(given, (tuple, list)) and len(given) == 2 and np.ndim(given[0]) > 0:
        rotation, place = given
    return pin.SE3(as_rotation(name, rotation), as_vector(name, place, 3))


def _own_names(models: Sequence[Model]) -> list[dict[str, str]]:
    """For each model, names of joints and frames that are its own alone, by the old ones."""
    everyone = Counter(name for model in models for name in _names(model.pin))
    taken = {name for name, count in everyone.items() if count == 1}
    result = []
    for model in models:
        own, title, number = {}, model.name, 1
        if sum(other.name == model.name for other in models) > 1:
            title = f"{model.name} {number}"
        shared = [name for name in sorted(_names(model.pin)) if everyone[name] > 1]
        while any(f"{title}/{name}" in taken for name in shared):
            number += 1
            title = f"{model.name} {number}"
        for name in _names(model.pin):
            own[name] = f"{title}/{name}" if name in shared else name
        taken |= set(own.values())
        result.append({**own, "universe": "universe"})
    return result


def _renamed(model: pin.Model, own: Mapping[str, str]) -> pin.Model:
    part = model.copy()
    for index in range(1, part.njoints):
        part.names[index] = own[part.names[index]]
    for index in range(1, part.nframes):  # the first is the universe
        part.frames[index].name = own[part.frames[index].name]
    return part


def _names(model: pin.Model) -> set[str]:
    frames = {str(frame.name) for frame in list(model.frames)[1:]}
    return frames | {str(name) for name in list(model.names)[1:]}
