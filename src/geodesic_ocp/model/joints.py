"""Joints and frames of a Pinocchio model: coordinates, limits, armature, names, and reach."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, real_array

_ROUNDING = 1e-15
_COMPOSITE = "JointModelComposite"
# A continuous joint has no limits; these are wide enough for the shortest rotation between angles.
DEFAULT_LIMIT = 2.0 * np.pi  # [rad]
# Arrays (nv,), independent of how the coordinates of a joint are stored.
_PER_VELOCITY = (
    *("armature", "damping", "rotorGearRatio", "rotorInertia"),
    *("lowerDryFrictionLimit", "lowerEffortLimit", "lowerVelocityLimit"),
    *("upperDryFrictionLimit", "upperEffortLimit", "upperVelocityLimit"),
)
_NUM_RANDOM = 128
_NUM_STARTS = 8
_STRETCHED = 1e-7  # relative distance from the sum of the links' lengths


def motion_subspace(model: pin.Model, index: int) -> Array:
    """Return twist (6,) of the joint per unit of its coordinate, (linear, angular) in the joint
    frame.

    Raises:
        ValueError: the joint does not have one degree of freedom, or mimics another joint.
    """
    joint = model.joints[index]
    if joint.nv != 1 or joint.shortname() == "JointModelMimic":
        wanted = "only joints with one degree of freedom of their own can be used"
        raise ValueError(f"joint {model.names[index]!r} is a {joint.shortname()}; {wanted}")
    data = joint.createData()
    joint.calc(data, pin.neutral(model))
    return np.array(data.S, dtype=float).reshape(6)


def with_distinct_frames(*models: pin.Model) -> tuple[list[pin.Model], dict[str, str]]:
    """Return copies whose frames have unique names, as Pinocchio requires when it edits models.

    With them the original names by the new ones, for `restore_frames`.
    """
    original = dict[str, str]()
    copies = [model.copy() for model in models]
    joints = {str(name) for model in models for name in model.names}
    for copy in copies:
        for frame in list(copy.frames)[1:]:
            if frame.type == pin.FrameType.JOINT and frame.name in joints:
                continue  # Pinocchio looks joints up by name
            name = f"frame {len(original) + 1}"
            original[name], frame.name = str(frame.name), name
    return copies, original


def restore_frames(model: pin.Model, original: Mapping[str, str]) -> None:
    """Yield frames the names that they had before `with_distinct_frames`."""
    for frame in model.frames:
        frame.name = original.get(str(frame.name), str(frame.name))


def with_joint_frames(model: pin.Model) -> pin.Model:
    """Return the same model, in which each joint that carried no frame now has one of its own name.

    Where another frame has that name, "(joint)" follows it.
    """
    carried = {int(frame.parentJoint) for frame in model.frames}
    for index in sorted(set(range(1, model.njoints)) - carried):
        name = str(model.names[index])
        if not model.existFrame(name):
            model.addJointFrame(index)
        else:
            kind = pin.FrameType.OP_FRAME  # of the type JOINT Pinocchio expects the joint's name
            model.addFrame(pin.Frame(f"{name} (joint)", index, pin.SE3.Identity(), kind))
    return model


def frame_index(model: pin.Model, name: str) -> int:
    """Return index of the frame of that name; the link's, if a link and a joint share the name."""
    named = [number for number, frame in enumerate(model.frames) if frame.name == name]
    if not named:
        known = ", ".join(frame.name for frame in model.frames)
        raise ValueError(f"the model has no frame {name!r}; its frames are {known}")
    bodies = [number for number in named if model.frames[number].type == pin.FrameType.BODY]
    return (bodies or named)[-1]


def pose_at_zero(model: pin.Model, frame: str) -> tuple[Array, Array]:
    """Return rotation (3, 3) and position (3,) [m] of a frame at q = 0.

    Numbers of Pinocchio come far faster than those of a symbolic pose.
    """
    data = model.createData()
    index = frame_index(model, frame)
    pin.forwardKinematics(model, data, np.zeros(model.nv))
    place = pin.updateFramePlacement(model, data, index)
    return np.array(place.rotation), np.array(place.translation)


def link_of(model: pin.Model, index: int) -> str:
    """Return name of the link at the joint, or of the joint if the link has none."""
    for frame in model.frames:
        at_joint = frame.parentJoint == index and frame.placement.isIdentity()
        if at_joint and frame.type == pin.FrameType.BODY:
            return str(frame.name)
    return str(model.names[index])


def without_noise(placement: pin.SE3) -> pin.SE3:
    """Return the placement with rounding errors in its rotation set to zero, for small graphs.

    Angles such as pi / 2 leave entries of 1e-16, which would spread through every product.
    """
    rotation = np.where(np.abs(placement.rotation) < _ROUNDING, 0.0, placement.rotation)
    return pin.SE3(rotation, placement.translation)


def joint_values(
    name: str,
    given: ArrayLike | Mapping[str, float] | None,
    current: Array,
    joint_names: Sequence[str],
) -> Array:
    """Return numbers of the joints (n,), some by name, with the current ones where none is given.

    Raises:
        ValueError: an unknown joint, or not n numbers; names the argument.
    """
    if given is None:
        return current
    if isinstance(given, Mapping):
        for joint in given:
            if joint not in joint_names:
                known = ", ".join(joint_names)
                raise ValueError(f"{name}: {joint!r} is not one of the joints {known}")
        given = [given.get(joint, value) for joint, value in zip(joint_names, current, strict=True)]
    try:
        new = real_array(given)
    except (TypeError, ValueError):
        new = np.zeros(0)
    if new.shape != current.shape or np.any(np.isnan(new)):
        raise ValueError(f"{name} must be {current.size} numbers, got {given!r}")
    return new


def continuous_joints(model: pin.Model) -> tuple[str, ...]:
    """Return names of the joints that Pinocchio stores as cosine and sine of their angle."""
    joints = zip(model.names, model.joints, strict=True)
    return tuple(str(name) for name, joint in joints if (joint.nq, joint.nv) == (2, 1))


def with_angles(model: pin.Model) -> pin.Model:
    """Return a copy in which the coordinate of every continuous joint is its angle, within +-2 pi
    rad, and a composite of one joint is that joint.

    Joints and frames keep their indices; Pinocchio's configuration vector is then q itself.
    """
    continuous = continuous_joints(model)
    if not continuous and all(joint.shortname() != _COMPOSITE for joint in model.joints):
        return model.copy()
    result = pin.Model()
    result.name = model.name
    result.gravity = model.gravity
    result.inertias[0] = model.inertias[0]
    lower = model.lowerPositionLimit
    upper = model.upperPositionLimit
    for index in range(1, model.njoints):
        joint = model.joints[index]
        name = model.names[index]
        low = lower[joint.idx_q]
        high = upper[joint.idx_q]
        placement = model.jointPlacements[index]
        while joint.shortname() == _COMPOSITE:
            parts = joint.extract()
            joint = parts.joints[0]
            placement = placement * parts.jointPlacements[0]
        if name in continuous:
            low = -DEFAULT_LIMIT
            high = DEFAULT_LIMIT
            joint = joint_along(motion_subspace(model, index)[3:])
        row = result.joints[result.addJoint(model.parents[index], joint, placement, name)].idx_q
        result.lowerPositionLimit[row] = low
        result.upperPositionLimit[row] = high
        result.inertias[index] = model.inertias[index]
    for values in _PER_VELOCITY:
        setattr(result, values, getattr(model, values).copy())
    for frame in list(model.frames)[1:]:
        result.addFrame(frame, False)
    return result


def joint_along(axis: Array, kind: str = "revolute") -> Any:
    """Return a revolute or prismatic joint of a unit axis, of the types for x, y or z where it is
    one.
    """
    for letter, unit in zip("XYZ", np.eye(3), strict=True):
        if np.array_equal(axis, unit):
            return getattr(pin, f"JointModel{kind[0].upper()}{letter}")()
    return getattr(pin, f"JointModel{kind.capitalize()}Unaligned")(axis)


def max_reach(
    model: pin.Model, frame: int, lower: Array, upper: Array, joint: int | None = None
) -> float:
    """Return largest distance [m] found between a frame and a joint.

    Minimizes -|p(q) - p_joint(q)|^2 within the joint limits from the best of many random
    configurations, until a stretched chain is found, which nothing exceeds.

    Args:
        model: model with one coordinate per joint.
        frame: index of the frame.
        lower, upper: joint limits (n,) [rad or m]; an unlimited angle is restricted to one
            revolution, and an unlimited prismatic joint has infinite reach.
        joint: index of the joint; None: the first that moves the frame, at its zero position.
    """
    data = model.createData()
    chain = list(model.supports[model.frames[frame].parentJoint])[1:]
    if not chain:
        return 0.0
    axes = pin.LOCAL_WORLD_ALIGNED

    def negative_square(q: Array) -> tuple[float, Array]:
        jacobian = pin.computeFrameJacobian(model, data, q, frame, axes)[:3]
        position = pin.updateFramePlacement(model, data, frame).translation
        if joint is None:
            arm = position - model.jointPlacements[chain[0]].translation
        else:
            pin.computeJointJacobians(model, data, q)
            arm = position - data.oMi[joint].translation
            jacobian = jacobian - pin.getJointJacobian(model, data, joint, axes)[:3]
        return -float(arm @ arm), -2.0 * jacobian.T @ arm

    # Of the stretched chain; unknown where it does not begin at the joint, or has a slide.
    start = chain[0] if joint is None else joint
    behind = [model.jointPlacements[index] for index in chain if index > start]
    places = [*behind, model.frames[frame].placement]
    longest = sum(float(np.linalg.norm(place.translation)) for place in places)
    if start not in chain:
        longest = np.inf
    for index in chain:
        i = model.joints[index].idx_v
        subspace = motion_subspace(model, index)
        if np.any(subspace[:3]):
            longest = np.inf
        if not np.any(subspace[3:]) and not np.isfinite(upper[i] - lower[i]):
            return np.inf
    low = np.where(np.isfinite(lower), lower, -np.pi)
    high = np.where(np.isfinite(upper), upper, np.pi)
    bounds = list(zip(low, high, strict=True))
    random = np.random.default_rng(0).uniform(low, high, (_NUM_RANDOM, model.nv))
    options = {"jac": True, "bounds": bounds, "method": "L-BFGS-B"}
    reached = 0.0
    for first in sorted(random, key=lambda q: negative_square(q)[0])[:_NUM_STARTS]:
        found = scipy.optimize.minimize(negative_square, first, **options)
        reached = max(reached, float(np.sqrt(-found.fun)))
        if reached >= (1.0 - _STRETCHED) * longest:
            break
    return reached
