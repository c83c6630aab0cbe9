"""check_trajectory: whether a robot can execute a sampled trajectory."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import maximum_filter1d

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.arm_paths import hand_speeds, joint_forces
from geodesic_ocp.execution.clearance import Clearance, least_distances
from geodesic_ocp.execution.limits import UNITS, JointLimits, joined_limits, joint_limits
from geodesic_ocp.model.model import Model
from geodesic_ocp.tables import markdown, new_table, text
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

if TYPE_CHECKING:
    from pandas import DataFrame

_SHOWN = 140  # characters of the first violation
# Files round numbers to six digits or so: that is no contradiction.
ROUNDING = (1e-6, 1e-5, 1e-4)  # of positions [rad], velocities [rad/s], accelerations [rad/s^2]
_SLACK = 1e-3  # fraction of a limit by which a value may exceed it
_NEARBY = 3  # successive steps over which the jerk is estimated
_INTERVAL = 0.01  # [s] between the samples at which distances are evaluated
_NEAR = 1e-6  # [m]: rounding of distances


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
    """

    violations: tuple[str, ...]
    usage: Mapping[str, Array]
    largest: Mapping[str, Array]
    joint_names: tuple[str, ...]
    clearance: float | None = None

    @property
    def passed(self) -> bool:
        """True if all conditions hold."""
        return not self.violations

    def __repr__(self) -> str:
        first = textwrap.shorten("passed" if self.passed else self.violations[0], _SHOWN)
        others = f", and {len(self.violations) - 1} more" if len(self.violations) > 1 else ""
        peaks = ", ".join(f"{name} {np.max(use):.0%}" for name, use in self.usage.items())
        return f"TrajectoryCheck({first}{others}; of the limits: {peaks})"

    def __str__(self) -> str:
        speeds = ", ".join(f"{speed:.3g} m/s" for speed in self.largest["hand_speed"])
        share = f"{max(self.usage['hand_speed']):.0%} of its limit"
        hand = f"fastest hand: {speeds}" + (f", {share}" if any(self.usage["hand_speed"]) else "")
        found = self.violations or ("all conditions hold",)
        return "\n".join([text(self.table()), "", hand, *found])

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
        found = self.violations or ("all conditions hold",)
        return markdown(self.table()) + "\n" + "\n".join(f"- {each}" for each in found) + "\n"


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

    >>> import geodesic_ocp as go
    >>> import numpy as np
    >>> arm = go.human_arm("right")
    >>> time, zeros = np.arange(5) / 100, np.zeros((5, 7))
    >>> still = go.JointTrajectory(time, zeros, zeros, zeros, arm.joint_names)
    >>> go.check_trajectory(still, arm).passed
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
    found = [*_time_faults(trajectory, uniform)]
    if len(trajectory.time) > 1 and np.all(np.diff(trajectory.time) > 0.0):
        found += _contradictions(trajectory)
    lower, upper = (
        np.concatenate([getattr(each, side) for each in models]) for side in ("lower", "upper")
    )
    found += _beyond_positions(trajectory, lower, upper)
    usage = {"position": _share_of_range(trajectory.positions, lower, upper)}
    largest: dict[str, Array] = {}
    states = trajectory.positions, trajectory.velocities, trajectory.accelerations
    torques = _torques(states, models, gravity)
    ends = trajectory.positions[[0, -1]]
    weights = _torques((ends, 0.0 * ends, 0.0 * ends), models, gravity)
    for name, (instants, sizes) in _magnitudes(trajectory, torques, weights, rest).items():
        bound = getattr(limit, name)
        largest[name] = np.max(sizes, axis=0, initial=0.0)
        usage[name] = largest[name] / bound
        found += _beyond(trajectory, name, instants, sizes, bound)
    speeds = _hand_speeds(trajectory, models)
    fastest = np.array([each.hand_speed for each in listed])
    largest["hand_speed"] = speeds.max(axis=0)
    usage["hand_speed"] = largest["hand_speed"] / fastest
    for number, k in _worst(speeds - (1.0 + _SLACK) * fastest):
        bound = np.broadcast_to(fastest, len(models))[number]
        found.append(
            f"the hand {models[number].hand} moves at {speeds[k, number]:.4g} m/s at "
            f"{trajectory.time[k]:.4g} s, its limit {bound:.4g}"
        )
    if rest:
        found += _unrest(trajectory)
    least = None
    if clearance is not None:
        least, near = _least_clearance(trajectory, clearance)
        found += near
    return TrajectoryCheck(tuple(found), usage, largest, trajectory.joint_names, least)


def of_joints(trajectory: JointTrajectory, joints: Sequence[str]) -> JointTrajectory:
    """Return the trajectory of these joints, found by name, without torques.

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
    states = trajectory.positions, trajectory.velocities, trajectory.accelerations
    q, v, a = (state[:, columns] for state in states)
    names, units = (tuple(each[k] for k in columns) for each in (given, trajectory.units))
    return JointTrajectory(trajectory.time, q, v, a, names, units)


def _in_order(trajectory: JointTrajectory, models: Sequence[Model]) -> JointTrajectory:
    """Return the trajectory with the joints in the order of the models, and of no others."""
    names = [name for model in models for name in model.joint_names]
    units = [unit for model in models for unit in model.units]
    moved = trajectory.joint_names
    if len(names) != len(moved):
        raise ValueError(
            f"the trajectory moves joints {', '.join(moved)}, the model {', '.join(names)}"
        )
    ordered = of_joints(trajectory, names)
    for joint, mine, other in zip(ordered.joint_names, ordered.units, units, strict=True):
        if mine != other:
            raise ValueError(f"joint {joint!r} moves in {other}, the trajectory is in {mine}")
    return ordered


def _torques(
    states: tuple[Array, Array, Array], models: Sequence[Model], gravity: ArrayLike
) -> Array:
    """Return inverse dynamics of all models at states (k, n) [N m or N]."""
    falls = np.array(gravity, dtype=float)
    if falls.shape not in ((3,), (len(models), 3)) or not np.all(np.isfinite(falls)):
        raise ValueError(f"gravity must be 3 numbers, or 3 for each robot, got {gravity!r}")
    return joint_forces(models, list(np.broadcast_to(falls, (len(models), 3))), *states)


def _hand_speeds(trajectory: JointTrajectory, models: Sequence[Model]) -> Array:
    """Return speeds of the hands of all models at the samples (k, models) [m/s]."""
    ends = np.cumsum([model.dof for model in models])[:-1]
    states = (
        np.split(each, ends, axis=1) for each in (trajectory.positions, trajectory.velocities)
    )
    return np.stack([hand_speeds(*each) for each in zip(models, *states, strict=True)], axis=1)


def _share_of_range(positions: Array, lower: Array, upper: Array) -> Array:
    """Return largest distance from the middle of the range over half the range (n,); 0 if
    unlimited.
    """
    limited = np.isfinite(lower) & np.isfinite(upper)
    low, high = (np.where(limited, side, 0.0) for side in (lower, upper))
    half = np.where(limited, np.maximum((high - low) / 2.0, np.finfo(float).tiny), np.inf)
    return np.asarray(np.max(np.abs(positions - (low + high) / 2.0) / half, axis=0, initial=0.0))


def sample_consistency(trajectory: JointTrajectory) -> dict[str, tuple[Array, Array]]:
    """Return whether velocities are the derivatives of positions, and accelerations of velocities.

    The trapezoidal rule over a step h is wrong by at most J h^3 / 12 for positions and J h^2 / 4
    for velocities where the jerk is at most J, and by at most J h^3 / 8 and J h^2 / 2 where the
    acceleration jumps by J h within the step. The bounds are the latter, with the J that the
    accelerations in the file show in this step and its neighbours, plus rounding to six digits.
    They are of third and second order in h.

    Returns:
        By "velocity" and "acceleration", differences between samples less the trapezoidal integral
        of it, (k - 1, n), and the largest magnitudes that these have if samples are consistent.
    """
    h = np.diff(trajectory.time)[:, None]
    q, v, a = trajectory.positions, trajectory.velocities, trajectory.accelerations
    jerk = maximum_filter1d(np.abs(np.diff(a, axis=0)) / h, _NEARBY, axis=0, mode="nearest")
    missed = [np.diff(x, axis=0) - h * (dx[1:] + dx[:-1]) / 2.0 for x, dx in ((q, v), (v, a))]
    return {
        "velocity": (missed[0], jerk * h**3 / 8.0 + ROUNDING[0]),
        "acceleration": (missed[1], jerk * h**2 / 2.0 + ROUNDING[1]),
    }


def _time_faults(trajectory: JointTrajectory, uniform: bool) -> Iterator[str]:
    """Yield times that do not increase or are not evenly spaced."""
    steps = np.diff(trajectory.time)
    if not steps.size:
        yield "the trajectory has one sample only"
    elif not np.all(steps > 0.0):
        k = int(np.argmin(steps > 0.0))
        yield (
            f"time does not increase: sample {k + 1} at {trajectory.time[k + 1]:.6g} s follows "
            f"{trajectory.time[k]:.6g} s"
        )
    elif uniform and trajectory.rate is None:
        yield (
            f"samples are not evenly spaced: steps of {1e3 * steps.min():.4g} to "
            f"{1e3 * steps.max():.4g} ms"
        )


def _worst(excess: Array) -> Iterator[tuple[int, int]]:
    """Yield column and row of the largest number of each column (m, n) that has a positive one."""
    for column in np.flatnonzero(np.max(excess, axis=0, initial=0.0) > 0.0).tolist():
        yield column, int(np.argmax(excess[:, column]))


def _contradictions(trajectory: JointTrajectory) -> Iterator[str]:
    """Yield velocities that are not derivatives of positions, accelerations not of velocities."""
    time, found = trajectory.time, sample_consistency(trajectory)
    words = ("velocities", "positions", ""), ("accelerations", "velocities", "/s")
    for (kind, of, per), (missed, bounds) in zip(words, found.values(), strict=True):
        for joint, k in _worst(np.abs(missed) / bounds - 1.0):
            yield (
                f"{kind} of {trajectory.joint_names[joint]} contradict its {of}: from "
                f"{time[k]:.4g} to {time[k + 1]:.4g} s they miss the change by "
                f"{abs(missed[k, joint]):.3g} {trajectory.units[joint]}{per}, at most "
                f"{bounds[k, joint]:.2g} is due to sampling"
            )


def _beyond_positions(trajectory: JointTrajectory, lower: Array, upper: Array) -> Iterator[str]:
    """Yield joints that leave their range of positions."""
    q = trajectory.positions
    for joint, k in _worst(np.maximum(lower - q, q - upper) - ROUNDING[0]):
        yield (
            f"{trajectory.joint_names[joint]} is at {q[k, joint]:.4g} {trajectory.units[joint]} at "
            f"{trajectory.time[k]:.4g} s, outside its range of {lower[joint]:.4g} to "
            f"{upper[joint]:.4g}"
        )


def _magnitudes(
    trajectory: JointTrajectory, torques: Array, weights: Array, rest: bool
) -> dict[str, tuple[Array, Array]]:
    """Return times (m,) and magnitudes (m, n) of velocity, acceleration, jerk, torque and its rate.

    Samples, and means over steps, which the true largest magnitudes are not below; less what
    rounding in a file may add. At ends at rest, an acceleration is a jump from zero, and a torque
    one from the weight (2, n).
    """
    time, a = trajectory.time, trajectory.accelerations
    forward = np.diff(time)[:, None]
    steps = np.where(forward > 0.0, forward, np.inf)  # elsewhere there is no mean
    middles = (time[1:] + time[:-1]) / 2.0

    def means(values: Array, rounding: float) -> Array:
        return np.maximum(np.abs(np.diff(values, axis=0)) - rounding, 0.0) / steps

    jerk, rate = (middles, means(a, ROUNDING[2])), (middles, means(torques, ROUNDING[2]))
    if rest and len(steps):
        with_ends = np.append(middles, time[[0, -1]])
        jumps = a[[0, -1]], torques[[0, -1]] - weights
        jerk, rate = (
            (
                with_ends,
                np.vstack([inner, np.maximum(np.abs(jump) - ROUNDING[2], 0.0) / steps[[0, -1]]]),
            )
            for (_, inner), jump in zip((jerk, rate), jumps, strict=True)
        )
    both = np.append(time, middles)
    q, v = trajectory.positions, trajectory.velocities
    return {
        "velocity": (both, np.vstack([np.abs(v), means(q, ROUNDING[0])])),
        "acceleration": (both, np.vstack([np.abs(a), means(v, ROUNDING[1])])),
        "jerk": jerk,
        "torque": (time, np.abs(torques)),
        "torque_rate": rate,
    }


def _beyond(
    trajectory: JointTrajectory, kind: str, at: Array, sizes: Array, limits: Array
) -> Iterator[str]:
    """Yield joints whose magnitudes (m, n) at instants (m,) exceed their limits (n,)."""
    for joint, k in _worst(sizes - (1.0 + _SLACK) * limits):
        unit = UNITS[kind].split(", ")[trajectory.units[joint] == "m"]
        mean = kind in ("jerk", "torque_rate") or k >= len(trajectory.time)
        yield (
            f"{kind.replace('_', ' ')} of {trajectory.joint_names[joint]} is "
            f"{sizes[k, joint]:.4g} {unit}"
            + (" on average over the step" if mean else "")
            + f" at {at[k]:.4g} s, its limit {limits[joint]:.4g}"
        )


def _unrest(trajectory: JointTrajectory) -> Iterator[str]:
    """Yield joints that move at the first or the last sample."""
    for k, end in ((0, "begins"), (-1, "ends")):
        speeds = np.abs(trajectory.velocities[k])
        for joint in np.flatnonzero(speeds > ROUNDING[1]).tolist():
            yield (
                f"{trajectory.joint_names[joint]} {end} at {speeds[joint]:.3g} "
                f"{trajectory.units[joint]}/s at {trajectory.time[k]:.4g} s, not at rest"
            )


def _least_clearance(trajectory: JointTrajectory, clearance: Clearance) -> tuple[float, list[str]]:
    """Get the least of all distances [m], and a sentence for each that is below its lower bound."""
    joints = len(trajectory.joint_names)
    if clearance.dof != joints:
        raise ValueError(f"clearance must be of the {joints} joints of all models: {clearance!r}")
    last = len(trajectory.time) - 1
    stride = max(int(_INTERVAL * last / max(trajectory.duration, _NEAR) + 1e-9), 1)
    chosen = np.unique(np.append(np.arange(0, last, stride), last))
    least, samples = least_distances(clearance, trajectory.positions[chosen])
    near = []
    for k in np.flatnonzero(least < clearance.lower - _NEAR).tolist():
        near.append(
            f"{clearance.names[k]}: {least[k]:.3g} m apart at "
            f"{trajectory.time[chosen[samples[k]]]:.4g} s, at least {clearance.lower[k]:.3g} m "
            "must remain"
        )
    return float(least.min()), near
