"""Several models as one system, such as both arms of a person."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import as_vector
from geodesic_ocp.model.model import Model

_SAME = 1e-9  # of gravity [m/s^2] and of rotations


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
    if placements is None:
        placements = [np.zeros(3)] * len(models)
    if len(placements) != len(models):
        raise ValueError(f"there are {len(models)} models and {len(placements)} placements")
    places = [_placement(f"placements[{i}]", place) for i, place in enumerate(placements)]

    parts = list(_with_own_names(models))
    gravity = places[0].rotation @ models[0].pin.gravity.linear
    whole = pin.Model()
    whole.gravity = pin.Motion(gravity, np.zeros(3))
    for model, (part, _), place in zip(models, parts, places, strict=True):
        turned = place.rotation @ model.pin.gravity.linear
        if np.abs(turned - gravity).max() > _SAME:
            raise ValueError(
                f"in the common axes gravity is {turned} m/s^2 for {model.name!r} and {gravity} "
                f"m/s^2 for {models[0].name!r}"
            )
        whole = pin.appendModel(whole, part, 0, place)
    whole.name = " and ".join(model.name for model in models)
    whole.gravity = pin.Motion(gravity, np.zeros(3))
    continuous = tuple(
        names[joint]
        for model, (_, names) in zip(models, parts, strict=True)
        for joint in model.continuous
    )
    return Model(whole, parts[0][1][models[0].hand], models[0].backend, continuous)


def _placement(name: str, given: Any) -> pin.SE3:
    rotation, place = (np.eye(3), given) if np.ndim(given[0]) == 0 else given
    matrix = np.array(rotation, dtype=float)
    if (
        matrix.shape != (3, 3)
        or not np.abs(matrix @ matrix.T - np.eye(3)).max() <= _SAME
        or np.linalg.det(matrix) < 0.0
    ):
        raise ValueError(f"{name}: not a rotation (3, 3): {rotation!r}")
    return pin.SE3(matrix, as_vector(name, place, 3))


def _with_own_names(models: Sequence[Model]) -> Iterator[tuple[pin.Model, dict[str, str]]]:
    """Each model with names that are its own alone, and these by the old ones."""
    everyone = Counter(name for model in models for name in _names(model.pin))
    titles = Counter(model.name for model in models)
    for number, model in enumerate(models, 1):
        title = model.name if titles[model.name] == 1 else f"{model.name} {number}"
        new = {
            name: f"{title}/{name}" if everyone[name] > 1 else name for name in _names(model.pin)
        }
        part = model.pin.copy()
        for index in range(1, part.njoints):
            part.names[index] = new[part.names[index]]
        for index in range(1, part.nframes):  # the first is the universe
            part.frames[index].name = new[part.frames[index].name]
        yield part, new


def _names(model: pin.Model) -> set[str]:
    frames = {str(frame.name) for frame in list(model.frames)[1:]}
    return frames | {str(name) for name in list(model.names)[1:]}
