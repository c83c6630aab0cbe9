"""Limits of a robot's joints on speed, acceleration, jerk and torque, and of its hand on speed.

URDF files state no limits on acceleration and jerk, MJCF files none on speed either.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from numbers import Real
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_number, as_positive, as_vector, settle
from geodesic_ocp.model.doubts import NO_LIMIT
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import convert, naming, read_record, read_structured
from geodesic_ocp.tables import markdown, new_table

if TYPE_CHECKING:
    from pandas import DataFrame

UNITS = {  # of revolute and of prismatic joints
    "velocity": "rad/s, m/s",
    "acceleration": "rad/s^2, m/s^2",
    "jerk": "rad/s^3, m/s^3",
    "torque": "N m, N",
    "torque_rate": "N m/s, N/s",
}
QUANTITIES = tuple(UNITS)
# From which limit a default follows, what that is called, and within which time [s] it is reached.
_DEFAULTS = {
    "acceleration": ("velocity", "speed", 0.25),
    "jerk": ("acceleration", "acceleration", 0.05),
}
_MOVEIT = {  # their names in files of MoveIt
    "velocity": "velocity",
    "acceleration": "acceleration",
    "jerk": "jerk",
    "torque": "effort",
}
_UNKNOWN = "not limited"  # the source of a limit that has none
_MOVING = 1.5  # times the torque that holds the arm, to move it


@dataclass(frozen=True, eq=False, repr=False)
class JointLimits(ShortRepr):
    """Largest magnitudes, (n,) each; infinite where there is no limit.

    Attributes:
        velocity: [rad/s or m/s].
        acceleration: [rad/s^2 or m/s^2].
        jerk: [rad/s^3 or m/s^3].
        torque: [N m or N].
        sources: where the numbers come from, by the name of the field.
        torque_rate: of the torque's rate of change [N m/s or N/s].
        hand_speed: one number, of the origin of the hand frame [m/s].
        unknown: joints whose speed no source limits and for which no limit was given, by name.

    Raises:
        ValueError: the fields differ in shape, or an entry is not positive.
    """

    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array
    sources: Mapping[str, str] = field(default_factory=dict)
    torque_rate: Array = field(default_factory=lambda: np.array(np.inf))
    hand_speed: float = np.inf
    unknown: tuple[str, ...] = ()
    _shown = QUANTITIES[:4]

    def __post_init__(self) -> None:
        shape = np.shape(self.velocity)
        if not self.hand_speed > 0.0:
            raise ValueError(f"hand_speed must be positive, or infinite: {self.hand_speed}")
        if np.ndim(self.torque_rate) == 0:
            settle(self, torque_rate=np.full(shape, self.torque_rate))
        for name in QUANTITIES:
            values = np.array(getattr(self, name), dtype=float)
            if values.ndim != 1 or values.shape != shape:
                raise ValueError(f"{name} must have shape {shape}, got {values.shape}")
            if not np.all(values > 0.0):
                raise ValueError(f"{name} must be positive, or infinite for no limit: {values}")
            values.flags.writeable = False
            settle(self, **{name: values})

    def table(self, model: Model | None = None) -> DataFrame:
        """Return the numbers by joint, named if the model is given, with their sources below."""
        numbered = [str(k + 1) for k in range(self.velocity.size)]
        shown = [
            name
            for name in QUANTITIES
            if name != "torque_rate" or np.isfinite(self.torque_rate).any()
        ]
        columns = [getattr(self, name).tolist() for name in shown]
        names = model.joint_names if model else numbered
        header = ("joint", *(f"{name} [{UNITS[name]}]" for name in shown))
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
    """Join the limits of the joints of several arms, one arm after the other."""
    velocity, acceleration, jerk, torque, rate = (
        np.concatenate([getattr(part, name) for part in parts]) for name in QUANTITIES
    )
    return JointLimits(velocity, acceleration, jerk, torque, torque_rate=rate)


@dataclass(frozen=True, eq=False, repr=False)
class LimitShares(ShortRepr):
    """Largest magnitudes of a trajectory as fractions of the limits, (n,) each.

    Attributes:
        velocity, acceleration, jerk, torque, torque_rate: zero where there is no limit.
        hand_speed: one number, likewise.
    """

    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array
    torque_rate: Array
    hand_speed: float

    @property
    def largest(self) -> float:
        """The largest of all."""
        return float(max(self.hand_speed, *(getattr(self, each).max() for each in QUANTITIES)))


# Numbers, or text: a share of the limit that there is otherwise, such as "50%".
Given: TypeAlias = ArrayLike | Mapping[str, float | str] | None


def joint_limits(
    model: Model,
    *,
    velocity: Given = None,
    acceleration: Given = None,
    jerk: Given = None,
    torque: Given = None,
    torque_rate: Given = None,
    hand_speed: float | str | None = None,
    file: str | PathLike[str] | None = None,
) -> JointLimits:
    """Return limits of a model's joints: given ones, else the file's, else published ones, else
    defaults.

    Files of robots state limits on speed and torque; zero and very large numbers in them count as
    no limit. Joints whose speed is then not limited are `JointLimits.unknown`, and retargeting to
    them is no success until a limit is given, infinite for none. Few makers publish limits on
    acceleration, jerk, the torque's rate and the hand's speed (`sources` names the document); the
    latter two have no defaults. The default acceleration reaches full speed within 0.25 s, the
    default jerk full acceleration within 0.05 s; published ones of the Panda and the xArm7 do so
    within 0.13 to 0.29 s and 0.002 to 0.04 s. A joint without a limit on its speed has none on
    these either, nor has one without a stated torque on its torque. Models of human arms have no
    such limits.

    >>> import geodesic_ocp as go
    >>> arm = go.human_arm("right")
    >>> go.execution.joint_limits(arm, velocity=4.0).acceleration
    array([16., 16., 16., 16., 16., 16., 16.])

    Args:
        model: a robot arm.
        velocity: one number for all joints, n numbers, or some by joint name, where the others are
            found as if none were given [rad/s or m/s]; infinite for no limit. In place of any
            number, a share of the limit that is found if none is given, such as "50%".
        acceleration: likewise [rad/s^2 or m/s^2].
        jerk: likewise [rad/s^3 or m/s^3].
        torque: likewise [N m, N for prismatic joints].
        torque_rate: likewise [N m/s, N/s for prismatic joints].
        hand_speed: one number or share, of the hand [m/s].
        file: a `joint_limits.yaml` of MoveIt, whose limits come before those of the model's file.

    Raises:
        ValueError: an unknown joint, not 1 or n numbers, one that is not positive, or a share
            of a limit that there is not.
    """
    given = {"velocity": velocity, "acceleration": acceleration, "jerk": jerk, "torque": torque}
    given["torque_rate"] = torque_rate
    torques = np.minimum(np.abs(model.pin.lowerEffortLimit), np.abs(model.pin.upperEffortLimit))
    in_file = {"velocity": model.pin.velocityLimit, "torque": torques}
    in_moveit = {} if file is None else _moveit_limits(Path(file), model)
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
        ways.append(("file of the model", np.where(in_it < NO_LIMIT, in_it, 0.0)))
        ways.append((str(file), in_moveit.get(name, none)))
        values = np.full(model.dof, np.inf)
        origins = [_UNKNOWN] * model.dof
        for origin, numbers in ways:
            for k in np.flatnonzero(numbers > 0.0).tolist():
                values[k] = numbers[k]
                origins[k] = origin
        for k, entry in _by_joint(name, value, model).items():
            label = f"{name} of {model.joint_names[k]}"
            values[k], origins[k] = _given(label, entry, values[k], origins[k])
        if name == "velocity":
            named = zip(model.joint_names, origins, strict=True)
            unknown = tuple(joint for joint, origin in named if origin == _UNKNOWN)
        found[name] = values
        sources[name] = _summary(origins, model.joint_names)
    fastest = np.inf
    sources["hand_speed"] = "not limited"
    if known and known.hand_speed is not None:
        fastest = known.hand_speed
        sources["hand_speed"] = known.source
    if hand_speed is not None:
        fastest, sources["hand_speed"] = _given(
            "hand_speed", hand_speed, fastest, sources["hand_speed"]
        )
    return JointLimits(**found, sources=sources, hand_speed=fastest, unknown=unknown)


def within_ranges(
    model: Model, position: Given = None, file: str | PathLike[str] | None = None
) -> Model:
    """Return the model with narrower ranges of its joints.

    >>> import geodesic_ocp as go
    >>> arm = go.human_arm()
    >>> narrow = go.execution.within_ranges(arm, "50%")
    >>> ((narrow.upper - narrow.lower) / (arm.upper - arm.lower)).round(6)
    array([0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5])

    Args:
        model: a robot arm.
        position: a share of the range about its middle, such as "90%", of all joints or by name.
        file: a `joint_limits.yaml` of MoveIt; what its ranges and the model's have in common comes
            before the share.

    Raises:
        ValueError: an unknown joint, no share, or a range with nothing in common with the model's.
    """
    with naming(joint_limits=file):
        lower = model.lower.copy()
        upper = model.upper.copy()
        for k, stated in ({} if file is None else _in_moveit(Path(file), model)).items():
            if stated.get("has_position_limits"):
                low, high = (
                    as_number(f"{file}: {end} of {model.joint_names[k]}", stated.get(end))
                    for end in ("min_position", "max_position")
                )
                lower[k], upper[k] = max(low, lower[k]), min(high, upper[k])
        for k, entry in _by_joint("position", position, model).items():
            if not _SHARE.fullmatch(str(entry)):
                raise ValueError(
                    f"position must be a share of the range such as 90%, got {entry!r}"
                )
            middle = (lower[k] + upper[k]) / 2.0
            range_of = f"range of {model.joint_names[k]}"
            half, _ = _given("position", entry, (upper[k] - lower[k]) / 2.0, range_of)
            lower[k] = middle - half
            upper[k] = middle + half
        return model.with_limits(lower, upper)


_SHARE = re.compile(r"(\d+\.?\d*) ?%")


def _by_joint(name: str, value: Given, model: Model) -> dict[int, Any]:
    """Return the given numbers and shares by the number of the joint."""
    if isinstance(value, Mapping):
        for joint in value:
            if joint not in model.joint_names:
                known = ", ".join(model.joint_names)
                raise ValueError(f"{name}: {joint!r} is not one of the joints {known}")
        return {model.joint_names.index(joint): entry for joint, entry in value.items()}
    if value is None:
        return {}
    entries = np.array(value, dtype=object)
    text = isinstance(value, str) and not _SHARE.fullmatch(value)
    if text or entries.shape not in ((), (model.dof,)):
        raise ValueError(
            f"{name} must be one number, {model.dof} numbers, or numbers by joint name, "
            f"got {value!r}"
        )
    return dict(enumerate(np.broadcast_to(entries, model.dof).tolist()))


def _given(name: str, entry: Any, otherwise: float, origin: str) -> tuple[float, str]:
    """Return a given limit, or a share of the one that there is otherwise, and its source."""
    if isinstance(entry, str) and (share := _SHARE.fullmatch(entry)):
        part = as_number(name, float(share[1]) / 100.0)
        if not (0.0 < part <= 1.0 and np.isfinite(otherwise)):
            raise ValueError(
                f"{name} must be above 0% and at most 100% of a limit, got {entry} of "
                f"{otherwise:g} ({origin})"
            )
        return part * otherwise, f"{entry} of: {origin}"
    number = float(entry) if not isinstance(entry, bool) and isinstance(entry, Real) else np.nan
    if not number > 0.0:
        raise ValueError(f"{name} must be positive, or infinite for no limit, got {entry!r}")
    return number, "given"


@dataclass(frozen=True)
class _MoveIt:
    joint_limits: dict[str, dict[str, bool | float]]


def _in_moveit(file: Path, model: Model) -> dict[int, dict[str, bool | float]]:
    """Return what the file states by the number of the joint, without its scaling factors, which
    are defaults of requests.
    """
    stated = convert(read_structured(file, "joint_limits.yaml of MoveIt"), _MoveIt, file)
    names = model.joint_names
    found = {names.index(joint): of for joint, of in stated.joint_limits.items() if joint in names}
    if not found:
        raise ValueError(f"{file}: has none of the joints {', '.join(names)}")
    return found


def _moveit_limits(file: Path, model: Model) -> dict[str, Array]:
    """Return limits (n,) by name, 0 where the file states none."""
    found = {name: np.zeros(model.dof) for name in _MOVEIT}
    for k, stated in _in_moveit(file, model).items():
        for name, theirs in _MOVEIT.items():
            if stated.get(f"has_{theirs}_limits"):
                label = f"{file}: max_{theirs} of {model.joint_names[k]}"
                found[name][k] = as_positive(label, stated.get(f"max_{theirs}", np.nan))
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
        hand_speed: of the hand [m/s].
    """

    source: str
    joints: tuple[str, ...]
    values: Mapping[str, tuple[float, ...]]
    hand_speed: float | None = None


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


def usable_torque(limit: Array, held: Array, share: float) -> Array:
    """Return the torques (n,) that a motion may use: a share of the limits, or more where holding
    the arm takes more; infinite where that is beyond the limit, as no motion helps.

    Args:
        limit: limits (n,) [N m or N].
        held: magnitudes of the torques that hold the arm (n,).
        share: above 0 and at most 1.
    """
    usable = np.where(held > share * limit, np.minimum(limit, _MOVING * held), share * limit)
    return np.where(held > limit, np.inf, usable)
