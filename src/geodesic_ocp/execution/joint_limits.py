"""Limits of a robot's joints on speed, acceleration, jerk and torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, real_array, short_repr
from geodesic_ocp.execution.known_limits import known_limits
from geodesic_ocp.model.model import Model
from geodesic_ocp.table import Table

QUANTITIES = ("velocity", "acceleration", "jerk", "torque")
TO_FULL_SPEED = 0.25  # [s], at the default acceleration
TO_FULL_ACCELERATION = 0.05  # [s], at the default jerk
_PLACEHOLDER = 1e5  # [rad/s or N m]: numbers in files from here on stand for no limit
_NONE = "not limited"


@dataclass(frozen=True, eq=False, repr=False)
class JointLimits:
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

    def __repr__(self) -> str:
        return short_repr(replace(self, sources={}))

    def table(self, model: Model | None = None) -> Table:
        """The numbers by joint, named if the model is given, with their sources below."""
        count = self.velocity.size
        names = [str(k + 1) for k in range(count)] if model is None else model.joint_names
        columns = [getattr(self, name).tolist() for name in QUANTITIES]
        rows = tuple(zip(names, *columns, strict=True))
        header = (
            "joint",
            "velocity [rad/s, m/s]",
            "acceleration [rad/s^2, m/s^2]",
            "jerk [rad/s^3, m/s^3]",
            "torque [N m, N]",
        )
        note = "; ".join(f"{name}: {source}" for name, source in self.sources.items())
        return Table(header, rows, note)

    def _repr_markdown_(self) -> str:
        return self.table().markdown()


def joint_limits(
    model: Model,
    *,
    velocity: ArrayLike | Mapping[str, float] | None = None,
    acceleration: ArrayLike | Mapping[str, float] | None = None,
    jerk: ArrayLike | Mapping[str, float] | None = None,
    torque: ArrayLike | Mapping[str, float] | None = None,
) -> JointLimits:
    """Limits of a model's joints: given ones, else the file's, else published ones, else defaults.

    Files of robots state limits on speed and torque; zero and very large numbers in them count as
    no limit. Few makers publish limits on acceleration and jerk (`sources` names the document). The
    default acceleration reaches full speed within 0.25 s, the default jerk full acceleration within
    0.05 s; published ones of the Panda and the xArm7 do so within 0.13 to 0.29 s and 0.002 to
    0.04 s. A joint without a limit on its speed has none on these either, nor has one without a
    stated torque on its torque. Models of human arms have no such limits.

    >>> import geodesic_ocp as go
    >>> arm = go.human_arm("right")
    >>> go.joint_limits(arm, velocity=4.0).acceleration
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
    arguments = {name: _argument(name, value, model) for name, value in given.items()}
    torques = np.minimum(np.abs(model.pin.lowerEffortLimit), np.abs(model.pin.upperEffortLimit))
    in_file = {"velocity": np.array(model.pin.velocityLimit), "torque": torques}
    known = known_limits(model)
    found: dict[str, Array] = {}
    sources: dict[str, str] = {}
    for name in QUANTITIES:
        values = np.full(model.dof, np.inf)
        origins = [_NONE] * model.dof
        before, time = {
            "acceleration": ("velocity", TO_FULL_SPEED),
            "jerk": ("acceleration", TO_FULL_ACCELERATION),
        }.get(name, ("", 1.0))
        for k, joint in enumerate(model.joint_names):
            stated = float(in_file[name][k]) if name in in_file else 0.0
            if joint in arguments[name]:
                values[k], origins[k] = arguments[name][joint], "given"
            elif 0.0 < stated < _PLACEHOLDER:
                values[k], origins[k] = stated, "file of the model"
            elif known is not None and name in known.values:
                values[k], origins[k] = known.values[name][k], known.source
            elif before and np.isfinite(found[before][k]):
                values[k] = found[before][k] / time
                what = "speed" if before == "velocity" else before
                origins[k] = f"default: full {what} within {time:g} s"
        found[name] = values
        sources[name] = _summary(origins, model.joint_names)
    return JointLimits(**found, sources=sources)


def _argument(
    name: str, given: ArrayLike | Mapping[str, float] | None, model: Model
) -> dict[str, float]:
    """The given numbers by joint."""
    if given is None:
        return {}
    if isinstance(given, Mapping):
        for joint in given:
            if joint not in model.joint_names:
                known = ", ".join(model.joint_names)
                raise ValueError(f"{name}: {joint!r} is not one of the joints {known}")
    joints = list(given) if isinstance(given, Mapping) else list(model.joint_names)
    values = list(given.values()) if isinstance(given, Mapping) else given
    try:
        numbers = real_array(values)
    except (TypeError, ValueError):
        numbers = np.zeros((0, 0))
    if numbers.ndim == 0:
        numbers = np.full(len(joints), float(numbers))
    if isinstance(given, str) or numbers.shape != (len(joints),):
        raise ValueError(
            f"{name} must be one number, {model.dof} numbers, or numbers by joint name, "
            f"got {given!r}"
        )
    if not np.all(numbers > 0.0):
        raise ValueError(f"{name} must be positive, or infinite for no limit, got {given!r}")
    return dict(zip(joints, numbers.tolist(), strict=True))


def _summary(origins: Sequence[str], joints: Sequence[str]) -> str:
    """One sentence; with the joints where they differ."""
    distinct = list(dict.fromkeys(origins))
    if len(distinct) == 1:
        return distinct[0]
    parts = []
    for origin in distinct:
        named = [joint for joint, each in zip(joints, origins, strict=True) if each == origin]
        parts.append(f"{origin} ({', '.join(named)})")
    return ", ".join(parts)
