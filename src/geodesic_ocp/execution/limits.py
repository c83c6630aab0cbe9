"""Limits of a robot's joints on speed, acceleration, jerk and torque.

URDF files state no limits on acceleration and jerk, MJCF files none on speed either.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_vector, real_array
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import convert, read_record
from geodesic_ocp.tables import markdown, new_table

if TYPE_CHECKING:
    from pandas import DataFrame

UNITS = {  # of revolute and of prismatic joints
    "velocity": "rad/s, m/s",
    "acceleration": "rad/s^2, m/s^2",
    "jerk": "rad/s^3, m/s^3",
    "torque": "N m, N",
}
QUANTITIES = tuple(UNITS)
# From which limit a default follows, what that is called, and within which time [s] it is reached.
_DEFAULTS = {
    "acceleration": ("velocity", "speed", 0.25),
    "jerk": ("acceleration", "acceleration", 0.05),
}
_PLACEHOLDER = 1e5  # [rad/s or N m]: numbers in files from here on stand for no limit


@dataclass(frozen=True, eq=False, repr=False)
class JointLimits(ShortRepr):
    """Largest magnitudes, (n,) each; infinite where there is no limit.

    Attributes:
        velocity: [rad/s or m/s].
        acceleration: [rad/s^2 or m/s^2].
        jerk: [rad/s^3 or m/s^3].
        torque: [N m or N].
        sources: where the numbers come from, by the name of the field.

    Raises:
        ValueError: the fields differ in shape, or an entry is not positive.
    """

    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array
    sources: Mapping[str, str] = field(default_factory=dict)
    _shown = QUANTITIES

    def __post_init__(self) -> None:
        shape = np.shape(self.velocity)
        for name in QUANTITIES:
            values = np.array(getattr(self, name), dtype=float)
            if values.ndim != 1 or values.shape != shape:
                raise ValueError(f"{name} must have shape {shape}, got {values.shape}")
            if not np.all(values > 0.0):
                raise ValueError(f"{name} must be positive, or infinite for no limit: {values}")
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def table(self, model: Model | None = None) -> DataFrame:
        """Return the numbers by joint, named if the model is given, with their sources below."""
        numbered = [str(k + 1) for k in range(self.velocity.size)]
        columns = [getattr(self, name).tolist() for name in QUANTITIES]
        names = model.joint_names if model else numbered
        header = ("joint", *(f"{name} [{unit}]" for name, unit in UNITS.items()))
        note = "; ".join(f"{name}: {source}" for name, source in self.sources.items())
        return new_table(header, tuple(zip(names, *columns, strict=True)), note)

    def _repr_markdown_(self) -> str:
        return markdown(self.table())


def checked_limits(model: Model, limits: JointLimits) -> JointLimits:
    """Return the limits; ValueError if they are not those of the model's joints."""
    if not isinstance(limits, JointLimits) or limits.velocity.size != model.dof:
        raise ValueError(f"limits must be JointLimits of {model.dof} joints, got {limits!r}")
    return limits


def checked_start(model: Model, given: ArrayLike) -> Array:
    """Return the configuration (n,) to begin in; ValueError if it is outside the limits."""
    start = as_vector("start", given, model.dof)
    for joint, value, low, high in zip(
        model.joint_names, start, model.lower, model.upper, strict=True
    ):
        if not low <= value <= high:
            raise ValueError(
                f"start: {joint} is at {value:.4g}, outside its limits {low:.4g} to {high:.4g}"
            )
    return start


def joined_limits(parts: Sequence[JointLimits]) -> JointLimits:
    """Join the limits of several arms, one arm after the other."""
    velocity, acceleration, jerk, torque = (
        np.concatenate([getattr(part, name) for part in parts]) for name in QUANTITIES
    )
    return JointLimits(velocity, acceleration, jerk, torque)


@dataclass(frozen=True, eq=False, repr=False)
class LimitShares(ShortRepr):
    """Largest magnitudes of a trajectory as fractions of the limits, (n,) each.

    Attributes:
        velocity, acceleration, jerk, torque: zero where there is no limit.
    """

    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array

    @property
    def largest(self) -> float:
        """The largest of all."""
        return float(np.max([self.velocity, self.acceleration, self.jerk, self.torque]))


def joint_limits(
    model: Model,
    *,
    velocity: ArrayLike | Mapping[str, float] | None = None,
    acceleration: ArrayLike | Mapping[str, float] | None = None,
    jerk: ArrayLike | Mapping[str, float] | None = None,
    torque: ArrayLike | Mapping[str, float] | None = None,
) -> JointLimits:
    """Return limits of a model's joints: given ones, else the file's, else published ones, else
    defaults.

    Files of robots state limits on speed and torque; zero and very large numbers in them count as
    no limit. Few makers publish limits on acceleration and jerk (`sources` names the document). The
    default acceleration reaches full speed within 0.25 s, the default jerk full acceleration within
    0.05 s; published ones of the Panda and the xArm7 do so within 0.13 to 0.29 s and 0.002 to
    0.04 s. A joint without a limit on its speed has none on these either, nor has one without a
    stated torque on its torque. Models of human arms have no such limits.

    >>> import geodesic_ocp as go
    >>> arm = go.human_arm("right")
    >>> go.execution.joint_limits(arm, velocity=4.0).acceleration
    array([16., 16., 16., 16., 16., 16., 16.])

    Args:
        model: a robot arm.
        velocity: one number for all joints, n numbers, or some by joint name, where the others are
            found as if none were given [rad/s or m/s]; infinite for no limit.
        acceleration: likewise [rad/s^2 or m/s^2].
        jerk: likewise [rad/s^3 or m/s^3].
        torque: likewise [N m, N for prismatic joints].

    Raises:
        ValueError: an unknown joint, not 1 or n numbers, or one that is not positive.
    """
    given = {"velocity": velocity, "acceleration": acceleration, "jerk": jerk, "torque": torque}
    torques = np.minimum(np.abs(model.pin.lowerEffortLimit), np.abs(model.pin.upperEffortLimit))
    in_file = {"velocity": model.pin.velocityLimit, "torque": torques}
    known = known_limits(model)
    none = np.zeros(model.dof)
    found: dict[str, Array] = {}
    sources: dict[str, str] = {}
    for name, value in given.items():
        published = known.values.get(name, none) if known else none
        # From the weakest source to the strongest; what is not positive is not stated.
        ways = [(known.source if known else "", np.array(published))]
        if name in _DEFAULTS:
            before, what, time = _DEFAULTS[name]
            default = np.where(np.isfinite(found[before]), found[before] / time, 0.0)
            ways.insert(0, (f"default: full {what} within {time:g} s", default))
        in_it = np.array(in_file.get(name, none))
        ways.append(("file of the model", np.where(in_it < _PLACEHOLDER, in_it, 0.0)))
        ways.append(("given", _given(name, value, model)))
        values, origins = np.full(model.dof, np.inf), ["not limited"] * model.dof
        for origin, numbers in ways:
            for k in np.flatnonzero(numbers > 0.0).tolist():
                values[k], origins[k] = numbers[k], origin
        found[name] = values
        sources[name] = _summary(origins, model.joint_names)
    return JointLimits(**found, sources=sources)


def _given(name: str, value: ArrayLike | Mapping[str, float] | None, model: Model) -> Array:
    """Return the given numbers (n,), 0 where there is none."""
    found = np.zeros(model.dof)
    if value is None:
        return found
    joints = list(value) if isinstance(value, Mapping) else list(model.joint_names)
    for joint in joints:
        if joint not in model.joint_names:
            known = ", ".join(model.joint_names)
            raise ValueError(f"{name}: {joint!r} is not one of the joints {known}")
    try:
        numbers = real_array(list(value.values()) if isinstance(value, Mapping) else value)
    except (TypeError, ValueError):
        numbers = np.zeros((0, 0))
    if isinstance(value, str) or (numbers.ndim > 0 and numbers.shape != (len(joints),)):
        raise ValueError(
            f"{name} must be one number, {model.dof} numbers, or numbers by joint name, "
            f"got {value!r}"
        )
    if not np.all(numbers > 0.0):
        raise ValueError(f"{name} must be positive, or infinite for no limit, got {value!r}")
    found[[model.joint_names.index(joint) for joint in joints]] = numbers
    return found


def _summary(origins: Sequence[str], joints: Sequence[str]) -> str:
    """Return one sentence; with the joints where they differ."""
    named: dict[str, list[str]] = {}
    for origin, joint in zip(origins, joints, strict=True):
        named.setdefault(origin, []).append(joint)
    if len(named) == 1:
        return origins[0]
    return ", ".join(f"{origin} ({', '.join(each)})" for origin, each in named.items())


@dataclass(frozen=True)
class KnownLimits:
    """Published limits of a robot's joints, in their order from the base.

    Attributes:
        source: the document, and what it states.
        joints: ends of the names of the joints.
        values: values by the name of a field of JointLimits, in its units.
    """

    source: str
    joints: tuple[str, ...]
    values: Mapping[str, tuple[float, ...]]


@cache
def published_limits() -> Mapping[str, KnownLimits]:
    """Return the limits of all robots by name, from `data/joint_limits.json`."""
    file = Path(__file__).parents[1] / "data" / "joint_limits.json"
    record = read_record(file, "geodesic_ocp published limits of joints", 1, "published limits")
    return {name: convert(each, KnownLimits, file) for name, each in record["robots"].items()}


def known_limits(model: Model) -> KnownLimits | None:
    """Get the published limits of this robot, known by name and joints; None if there are none."""
    name = re.sub(r" with [0-9.e+-]+ kg$", "", model.name)  # that of a model with a payload
    known = published_limits().get(name)
    if known is None or model.dof != len(known.joints):
        return None
    pairs = zip(model.joint_names, known.joints, strict=True)
    return known if all(mine.endswith(published) for mine, published in pairs) else None
