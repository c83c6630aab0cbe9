"""check_trajectory: whether a robot can execute a sampled trajectory."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.limits import UNITS, JointLimits, joined_limits, joint_limits
from geodesic_ocp.execution.sampled_magnitudes import KINDS_OF_MOTION, SampledJoints
from geodesic_ocp.execution.sampled_torques import SampledTorques
from geodesic_ocp.execution.trajectory_findings import (
    BETWEEN,
    Findings,
    beyond_positions,
    contradictions,
    judge,
    judge_hands,
    judge_rest,
    least_clearance,
    time_faults,
)
from geodesic_ocp.model.model import Model
from geodesic_ocp.tables import markdown, new_table, text
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

if TYPE_CHECKING:
    from pandas import DataFrame

_SHOWN = 140  # characters of the first violation
_PLURALS = ("positions", "velocities", "accelerations")  # by the order of the derivative


@dataclass(frozen=True, eq=False, repr=False)
class TrajectoryCheck:
    """Result of a check of a trajectory.

    Attributes:
        violations: one sentence for each joint and condition that does not hold, with the worst
            time, value and limit; none if all hold.
        usage: largest fraction of each limit that a joint takes (n,), by "position" (0 in the
            middle of the range, 1 at its ends), "velocity", "acceleration", "jerk", "torque" and
            "torque_rate"; 0 where there is no limit. By "hand_speed", of each model.
        largest: largest magnitudes (n,), by "velocity", "acceleration", "jerk", "torque" and
            "torque_rate", of samples and of means between samples [rad or m, per second..., N m or
            N]; by "hand_speed", of each model [m/s].
        joint_names: names of the n joints.
        clearance: least of the distances to be kept [m]; None: not checked.
        not_judged: one sentence for each kind of limit that some joints may exceed or not, as far
            as the samples tell, and for what a controller does between them if that is not known.
        between: largest magnitudes (n,) of a controller's quintic interpolation, by "velocity",
            "acceleration" and "jerk"; empty if velocities or accelerations are not stated.
    """

    violations: tuple[str, ...]
    usage: Mapping[str, Array]
    largest: Mapping[str, Array]
    joint_names: tuple[str, ...]
    clearance: float | None = None
    not_judged: tuple[str, ...] = ()
    between: Mapping[str, Array] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """True if all conditions hold that can be judged."""
        return not self.violations

    def __repr__(self) -> str:
        passed = f"passed, {len(self.not_judged)} not judged" if self.not_judged else "passed"
        first = textwrap.shorten(passed if self.passed else self.violations[0], _SHOWN)
        others = f", and {len(self.violations) - 1} more" if len(self.violations) > 1 else ""
        peaks = ", ".join(f"{name} {np.max(use):.0%}" for name, use in self.usage.items())
        return f"TrajectoryCheck({first}{others}; of the limits: {peaks})"

    def __str__(self) -> str:
        speeds = ", ".join(f"{speed:.3g} m/s" for speed in self.largest["hand_speed"])
        share = f"{max(self.usage['hand_speed']):.0%} of its limit"
        hand = f"fastest hand: {speeds}" + (f", {share}" if any(self.usage["hand_speed"]) else "")
        return "\n".join([text(self.table()), "", hand, *self._found])

    @property
    def _found(self) -> tuple[str, ...]:
        judged = " that can be judged" if self.not_judged else ""
        return (*(self.violations or (f"all conditions hold{judged}",)), *self.not_judged)

    def table(self) -> DataFrame:
        """Return largest magnitudes and fractions of limits, by joint."""
        columns = {"joint": self.joint_names, "position [limit]": self.usage["position"].tolist()}
        for name, unit in UNITS.items():
            if name == "torque_rate" and not np.any(self.usage[name]):
                continue
            columns[f"{name} [{unit}]"] = self.largest[name].tolist()
            columns[f"{name} [limit]"] = self.usage[name].tolist()
        return new_table(tuple(columns), tuple(zip(*columns.values(), strict=True)))

    def _repr_markdown_(self) -> str:
        return markdown(self.table()) + "\n" + "\n".join(f"- {each}" for each in self._found) + "\n"


def check_trajectory(
    trajectory: JointTrajectory,
    model: Model | Sequence[Model],
    limits: JointLimits | Sequence[JointLimits] | None = None,
    *,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
    rest: bool = True,
    uniform: bool = True,
    clearance: Clearance | None = None,
) -> TrajectoryCheck:
    """Check whether a robot can execute a sampled trajectory, of whatever origin.

    - Times increase strictly, and evenly unless `uniform` is False.
    - Samples agree with each other: differences of positions with velocities, and differences of
      velocities with accelerations, up to the error of the trapezoidal rule. With steps h it is at
      most J h^3 / 8 and J h^2 / 2, where J is the jerk that the accelerations show nearby.
    - Positions, velocities, accelerations, jerk, torques, their rates and the speeds of hands are
      within the limits, all but the first up to a thousandth. Means between samples count as well,
      such as the difference of two velocities over their step: what a trajectory has in between is
      at least as large.
    - It is at rest at both ends, unless `rest` is False. Then the accelerations there are jumps
      from zero, which limits on jerk concern as well.
    - Between samples, the quintics of their positions, velocities and accelerations, by which the
      joint_trajectory_controller of ros2_control interpolates, are within the limits of positions,
      velocities, accelerations and jerks.
    - Efforts, if stated, are those of inverse dynamics with this gravity and payload, and within
      the limits of the torques.

    Derivatives that are not stated (`JointTrajectory.derived`) are judged by divided differences
    of what is stated: a violation is one whatever the motion does between samples and beyond the
    last digits. What may or may not exceed a limit is said in `not_judged`, as is a controller's
    interpolation that is not known.

    >>> import geodesic_ocp as go
    >>> import numpy as np
    >>> arm = go.human_arm("right")
    >>> time, zeros = np.arange(5) / 100, np.zeros((5, 7))
    >>> still = go.trajectory.JointTrajectory(time, zeros, zeros, zeros, arm.joint_names)
    >>> go.execution.check_trajectory(still, arm).passed
    True

    Args:
        trajectory: its joints are those of the model in any order, or in the same order with a
            prefix that ends in a slash.
        model: the robot, payload included, or several whose joints follow each other.
        limits: limits of the joints of each model; None: `joint_limits(model)`.
        gravity: acceleration of free fall in the axes of each robot's base, (3,) or (robots, 3)
            [m/s^2].
        rest: whether it must begin and end at rest.
        uniform: whether it must be sampled evenly.
        clearance: distances to be kept, of the joints of all models in their order, such as those
            of `keep_clear`; None: not checked. They are evaluated every 10 ms, or at
            every sample if there are fewer, and exactly where the function is below its bound.

    Raises:
        ValueError: other joints or units than the model's; limits, gravity or clearance of other
            sizes.
    """
    models = [model] if isinstance(model, Model) else list(model)
    trajectory = _in_order(trajectory, models)
    parts = [joint_limits(each) for each in models] if limits is None else limits
    listed = [parts] if isinstance(parts, JointLimits) else parts
    limit = joined_limits(listed)
    count = len(trajectory.joint_names)
    if limit.velocity.size != count:
        raise ValueError(f"limits must be of {count} joints, got {limit.velocity.size}")
    lower = np.concatenate([each.lower for each in models])
    upper = np.concatenate([each.upper for each in models])
    sampled = SampledJoints(trajectory, rest)
    torques = SampledTorques.of(sampled, models, gravity)
    contradicted = [*contradictions(trajectory)] if sampled.increasing else []
    interpolated = sampled.increasing and not trajectory.derived and not contradicted
    found = [*time_faults(trajectory, uniform), *contradicted]
    found += beyond_positions(sampled, lower, upper, interpolated)
    usage = {"position": _share_of_range(trajectory.positions, lower, upper)}
    largest: dict[str, Array] = {}
    judged = dict[str, Findings]()
    magnitudes = {kind: sampled.of_kind(kind) for kind in KINDS_OF_MOTION}
    magnitudes |= {"torque": torques.magnitudes, "torque_rate": torques.rates}
    for kind, each in magnitudes.items():
        bound = getattr(limit, kind)
        largest[kind] = np.max(each.sizes, axis=0, initial=0.0)
        usage[kind] = largest[kind] / bound
        judged[kind] = judge(trajectory, kind, each, bound, reason=_reason(sampled, kind))
    fastest = np.array([each.hand_speed for each in listed])
    speeds = sampled.hand_speeds(models)
    largest["hand_speed"] = np.max(speeds.sizes, axis=0, initial=0.0)
    usage["hand_speed"] = largest["hand_speed"] / fastest
    judged["hand_speed"] = judge_hands(models, speeds, fastest)
    if rest:
        judged["rest"] = judge_rest(sampled, limit)
    between: dict[str, Array] = {}
    for kind in KINDS_OF_MOTION if interpolated else ():
        each = sampled.between(kind)
        between[kind] = each.sizes.max(axis=0)
        # What samples themselves exceed was said.
        bound = np.where(judged[kind].beyond, np.inf, getattr(limit, kind))
        digits = "the last digits of the samples alone change it"
        judged[f"{kind} between"] = judge(
            trajectory, kind, each, bound, where=BETWEEN, reason=digits
        )
    unknown = [each for one in judged.values() for each in one.not_judged]
    if sampled.increasing and trajectory.derived:
        unknown.append(_not_interpolated(trajectory))
    found += [each for one in judged.values() for each in one.violations]
    found += torques.efforts(trajectory, limit.torque)
    least = None
    if clearance is not None:
        least, near = least_clearance(trajectory, clearance)
        found += near
    return TrajectoryCheck(
        violations=tuple(found),
        usage=usage,
        largest=largest,
        joint_names=trajectory.joint_names,
        clearance=least,
        not_judged=tuple(unknown),
        between=between,
    )


def _reason(sampled: SampledJoints, kind: str) -> str:
    """Return why magnitudes of a kind are not known exactly."""
    rate = sampled.trajectory.rate
    at = "uneven samples" if rate is None else f"{rate:.4g} Hz"
    if kind in KINDS_OF_MOTION:
        return f"derived from {_PLURALS[sampled.source(KINDS_OF_MOTION[kind])]} at {at}"
    return f"with accelerations derived from {_PLURALS[sampled.source(2)]} at {at}"


def _not_interpolated(trajectory: JointTrajectory) -> str:
    """Return a sentence on what a controller does between samples."""
    lines = "velocity" in trajectory.derived
    curves, jumps = ("lines", "velocities") if lines else ("cubics", "accelerations")
    return (
        f"not judged: motion between samples: without {' and '.join(trajectory.derived)} of the "
        f"samples, a controller interpolates by {curves}, whose {jumps} jump at samples"
    )


def of_joints(trajectory: JointTrajectory, joints: Sequence[str]) -> JointTrajectory:
    """Return the trajectory of these joints, found by name.

    Names may differ by prefixes that end in a slash.

    Raises:
        ValueError: the trajectory has no such joint, or several.
    """
    given = trajectory.joint_names
    bare, wanted = ([name.rpartition("/")[2] for name in names] for names in (given, joints))
    columns = []
    if not set(joints) <= set(given) and bare == wanted:
        columns = list(range(len(given)))  # two arms of one kind, with other prefixes
    for joint, short in zip(joints, wanted, strict=True) if not columns else ():
        same = [k for k, name in enumerate(given) if name == joint]
        found = same or [k for k, name in enumerate(bare) if name == short]
        if len(found) != 1:
            raise ValueError(
                f"trajectory has {len(found) or 'no'} joints {joint}; it has {', '.join(given)}"
            )
        columns += found
    return trajectory.columns(columns, [given[k] for k in columns])


def _in_order(trajectory: JointTrajectory, models: Sequence[Model]) -> JointTrajectory:
    """Return the trajectory with the joints in the order of the models, and of no others."""
    names = [name for model in models for name in model.joint_names]
    units = [unit for model in models for unit in model.units]
    moved = trajectory.joint_names
    if len(names) != len(moved):
        what = f"the trajectory moves joints {', '.join(moved)}, the model {', '.join(names)}"
        advice = "leave the others out" if len(moved) > len(names) else "load it with fewer joints"
        raise ValueError(f"{what}: {advice}")
    ordered = of_joints(trajectory, names)
    for joint, mine, other in zip(ordered.joint_names, ordered.units, units, strict=True):
        if mine != other:
            raise ValueError(f"joint {joint!r} moves in {other}, the trajectory is in {mine}")
    return ordered


def _share_of_range(positions: Array, lower: Array, upper: Array) -> Array:
    """Return largest distance from the middle of the range over half the range (n,); 0 if
    unlimited.
    """
    limited = np.isfinite(lower) & np.isfinite(upper)
    low, high = (np.where(limited, side, 0.0) for side in (lower, upper))
    half = np.where(limited, np.maximum((high - low) / 2.0, np.finfo(float).tiny), np.inf)
    return np.asarray(np.max(np.abs(positions - (low + high) / 2.0) / half, axis=0, initial=0.0))
