"""Joints with one degree of freedom: their motion subspace, coordinates and placements."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array, is_symbolic

_ROUNDING = 1e-15


def motion_subspace(model: pin.Model, index: int) -> Array:
    """Twist (6,) of the joint per unit of its coordinate, (linear, angular) in the joint's frame.

    Raises:
        ValueError: the joint has not one degree of freedom, or not one of its own.
    """
    joint = model.joints[index]
    if joint.nv != 1 or joint.shortname() == "JointModelMimic":
        raise ValueError(
            f"joint {model.names[index]!r} is a {joint.shortname()}; "
            "only joints with one degree of freedom of their own can be used"
        )
    data = joint.createData()
    joint.calc(data, pin.neutral(model))
    return np.array(data.S, dtype=float).reshape(6)


def configuration(model: pin.Model, q: Any) -> Any:
    """Pinocchio's configuration vector (nq) for the joint coordinates q (nv).

    The two differ for continuous joints, which Pinocchio stores as (cos, sin) of the angle.
    """
    entries: list[Any] = []
    cos, sin = (ca.cos, ca.sin) if is_symbolic(q) else (np.cos, np.sin)
    for joint in list(model.joints)[1:]:
        coordinate = q[joint.idx_v]
        entries += [coordinate] if joint.nq == 1 else [cos(coordinate), sin(coordinate)]
    return ca.vertcat(*entries) if is_symbolic(q) else np.array(entries, dtype=float)


@contextmanager
def distinct_frames(*models: pin.Model) -> Iterator[dict[str, str]]:
    """Let the frames of models have names of their own, as Pinocchio's changes of models need it.

    Yields the old names by the new ones, for `restore_frames` of what was made of the models.
    """
    old, count = {}, 0
    before = [[str(frame.name) for frame in model.frames] for model in models]
    joints = {str(name) for model in models for name in model.names}
    for model in models:
        for frame in list(model.frames)[1:]:
            if frame.type == pin.FrameType.JOINT and frame.name in joints:
                continue  # Pinocchio looks joints up by name
            count += 1
            old[f"frame {count}"] = str(frame.name)
            frame.name = f"frame {count}"
    try:
        yield old
    finally:
        for model, names in zip(models, before, strict=True):
            for frame, name in zip(model.frames, names, strict=True):
                frame.name = name


def restore_frames(model: pin.Model, old: Mapping[str, str]) -> None:
    """Give frames the names back that they had before `distinct_frames`."""
    for frame in model.frames:
        frame.name = old.get(str(frame.name), str(frame.name))


def frame_index(model: pin.Model, name: str) -> int:
    """Number of the frame of that name; of a link and a joint of one name, the link's."""
    named = [number for number, frame in enumerate(model.frames) if frame.name == name]
    if not named:
        raise ValueError(f"the model has no frame {name!r}")
    bodies = [number for number in named if model.frames[number].type == pin.FrameType.BODY]
    return (bodies or named)[-1]


def without_noise(placement: pin.SE3) -> pin.SE3:
    """The placement with rounding noise in its rotation set to zero, which keeps graphs small.

    A file's "1.5708" or pi / 2 makes entries of 1e-16 that would multiply through every product.
    """
    rotation = np.where(np.abs(placement.rotation) < _ROUNDING, 0.0, placement.rotation)
    return pin.SE3(rotation, placement.translation)
