"""What is wrong with a sampled trajectory, and what cannot be judged, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.clearance import Clearance, least_distances
from geodesic_ocp.execution.limits import UNITS, JointLimits
from geodesic_ocp.execution.sampled_magnitudes import (
    ROUNDING,
    Magnitudes,
    SampledJoints,
    peaks_above,
)
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

SLACK = 1e-3  # fraction of a limit by which a value may exceed it
_NEARBY = 3  # successive steps over which the jerk is estimated
_INTERVAL = 0.01  # [s] between the samples at which distances are evaluated
_NEAR = 1e-6  # [m]: rounding of distances


class Findings(NamedTuple):
    """What was found of one kind of limit.

    Attributes:
        violations: a sentence for each joint that exceeds its limit.
        not_judged: a sentence on joints that may exceed it or not, if there are any.
        beyond: which joints exceed their limits (n,).
    """

    violations: list[str]
    not_judged: list[str]
    beyond: NDArray[np.bool_]


def worst(excess: Array) -> Iterator[tuple[int, int]]:
    """Yield column and row of the largest number of each column (m, n) that has a positive one."""
    for column in np.flatnonzero(np.max(excess, axis=0, initial=0.0) > 0.0).tolist():
        yield column, int(np.argmax(excess[:, column]))


def judge(
    trajectory: JointTrajectory,
    kind: str,
    found: Magnitudes,
    limits: Array,
    *,
    where: str = "",
    reason: str = "",
) -> Findings:
    """Judge magnitudes of a kind against limits (n,).

    Args:
        where: of violations, such as " between samples".
        reason: why magnitudes are not known exactly.
    """
    allowed = (1.0 + SLACK) * limits
    certain = found.sizes - found.below - allowed
    possible = found.sizes + found.above - allowed
    units = UNITS[kind].split(", ")
    name = kind.replace("_", " ")
    violations = []
    for joint, k in worst(certain):
        unit = units[trajectory.units[joint] == "m"]
        mean = " on average over the step" if found.means[k] else ""
        violations.append(
            f"{name} of {trajectory.joint_names[joint]} is {found.sizes[k, joint]:.4g} {unit}"
            f"{mean}{where} at {found.at[k]:.4g} s, its limit {limits[joint]:.4g}"
        )
    beyond = np.asarray(np.max(certain, axis=0, initial=0.0) > 0.0)
    open_cases = [(joint, k) for joint, k in worst(possible) if not beyond[joint]]
    if not open_cases:
        return Findings(violations, [], beyond)
    joint, k = max(open_cases, key=lambda case: float(possible[case[1], case[0]]))
    low = max(found.sizes[k, joint] - found.below[k, joint], 0.0)
    high = found.sizes[k, joint] + found.above[k, joint]
    joints = ", ".join(trajectory.joint_names[each] for each, _ in open_cases)
    sentence = (
        f"not judged: {name}{where} of {joints}: {reason}; that of "
        f"{trajectory.joint_names[joint]} is {low:.4g} to {high:.4g} "
        f"{units[trajectory.units[joint] == 'm']} at {found.at[k]:.4g} s, its limit "
        f"{limits[joint]:.4g}"
    )
    return Findings(violations, [sentence], beyond)


def judge_hands(models: Sequence[Model], speeds: Magnitudes, limits: Array) -> Findings:
    """Judge speeds of the hands of all models (m, models)."""
    allowed = (1.0 + SLACK) * limits
    certain = speeds.sizes - speeds.below - allowed
    possible = speeds.sizes + speeds.above - allowed
    violations = [
        f"the hand {models[number].hand} moves at {speeds.sizes[k, number]:.4g} m/s at "
        f"{speeds.at[k]:.4g} s, its limit {limits[number]:.4g}"
        for number, k in worst(certain)
    ]
    beyond = np.asarray(np.max(certain, axis=0, initial=0.0) > 0.0)
    not_judged = [
        f"not judged: speed of the hand {models[number].hand}: derived from positions, it is up to "
        f"{speeds.sizes[k, number] + speeds.above[k, number]:.4g} m/s at {speeds.at[k]:.4g} s, its "
        f"limit {limits[number]:.4g}"
        for number, k in worst(possible)
        if not beyond[number]
    ]
    return Findings(violations, not_judged, beyond)


def judge_rest(sampled: SampledJoints, limits: JointLimits) -> Findings:
    """Judge whether joints are at rest at the first and the last sample.

    Not judged are joints that seem to move but may be at rest within their limits, and those whose
    speeds are known no better than by what their accelerations make of them within a step.
    """
    trajectory = sampled.trajectory
    violations = list[str]()
    not_judged = list[str]()
    found = sampled.end_speeds(limits)
    moving = found.speeds > found.possible
    unknown = np.zeros_like(moving)
    if 1 not in sampled.stated:
        gained = limits.acceleration * np.diff(trajectory.time)[[0, -1], None]
        unknown = ~moving & ((found.speeds > found.likely) | (found.rounding > gained))
    for k, end in ((0, "begins"), (-1, "ends")):
        at = f"at {trajectory.time[k]:.4g} s"
        for joint in np.flatnonzero(moving[k]).tolist():
            violations.append(
                f"{trajectory.joint_names[joint]} {end} at {found.speeds[k, joint]:.3g} "
                f"{trajectory.units[joint]}/s {at}, not at rest"
            )
        if unknown[k].any():
            joint = int(np.argmax(np.where(unknown[k], found.speeds[k], -1.0)))
            joints = ", ".join(np.array(trajectory.joint_names)[unknown[k]])
            not_judged.append(
                f"not judged: rest {at} of {joints}: derived from positions; "
                f"{trajectory.joint_names[joint]} seems to move at {found.speeds[k, joint]:.3g} "
                f"{trajectory.units[joint]}/s, and may be at rest"
            )
    return Findings(violations, not_judged, np.asarray(moving.any(axis=0)))


def time_faults(trajectory: JointTrajectory, uniform: bool) -> Iterator[str]:
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


def sample_consistency(trajectory: JointTrajectory) -> dict[str, tuple[Array, Array]]:
    """Return whether velocities are the derivatives of positions, and accelerations of velocities.

    The trapezoidal rule over a step h is wrong by at most J h^3 / 12 for positions and J h^2 / 4
    for velocities where the jerk is at most J, and by at most J h^3 / 8 and J h^2 / 2 where the
    acceleration jumps by J h within the step. The bounds are the latter, with the J that the
    accelerations in the file show in this step and its neighbours, and may have between samples
    (`peaks_above`), plus rounding to six digits, or to fewer if the numbers have fewer. They are of
    third and second order in h. If accelerations were derived from velocities, the jump is the sum
    of the changes of slope from the step before and to the step after.

    Returns:
        By "velocity" and "acceleration", differences between samples less the trapezoidal integral
        of it, (k - 1, n), and the largest magnitudes that these have if samples are consistent.
        None of a kind that was derived, or derived from.
    """
    h = np.diff(trajectory.time)[:, None]
    q = trajectory.positions
    v = trajectory.velocities
    a = trajectory.accelerations
    means = np.diff(a, axis=0) / h
    largest = np.abs(means) + peaks_above(means)
    if "acceleration" in trajectory.derived:
        slopes = np.pad(np.diff(v, axis=0) / h, ((1, 1), (0, 0)))  # at rest before and after
        changes = np.abs(np.diff(slopes, axis=0))
        largest = (changes[1:] + changes[:-1]) / h
    jerk = maximum_filter1d(largest, _NEARBY, axis=0, mode="nearest")
    found = {}
    for order, (kind, before, x, dx) in enumerate(
        (("velocity", "position", q, v), ("acceleration", "velocity", v, a))
    ):
        if {kind, before} & set(trajectory.derived):
            continue
        missed = np.diff(x, axis=0) - h * (dx[1:] + dx[:-1]) / 2.0
        rounding = np.maximum(ROUNDING[order], trajectory.last_digits(before))
        rounding = rounding + h * trajectory.last_digits(kind)
        bound = jerk * (h**3 / 8.0, h**2 / 2.0)[order]
        found[kind] = missed, bound + rounding
    return found


def contradictions(trajectory: JointTrajectory) -> Iterator[str]:
    """Yield velocities that are not derivatives of positions, accelerations not of velocities."""
    time = trajectory.time
    words = {
        "velocity": ("velocities", "positions", ""),
        "acceleration": ("accelerations", "velocities", "/s"),
    }
    for kind, (missed, bounds) in sample_consistency(trajectory).items():
        plural, of, per = words[kind]
        for joint, k in worst(np.abs(missed) / bounds - 1.0):
            yield (
                f"{plural} of {trajectory.joint_names[joint]} contradict its {of}: from "
                f"{time[k]:.4g} to {time[k + 1]:.4g} s they miss the change by "
                f"{abs(missed[k, joint]):.3g} {trajectory.units[joint]}{per}, at most "
                f"{bounds[k, joint]:.2g} is due to sampling"
            )


def beyond_positions(
    sampled: SampledJoints, lower: Array, upper: Array, interpolated: bool
) -> Iterator[str]:
    """Yield joints that leave their ranges at samples, or between them by interpolation alone."""
    trajectory = sampled.trajectory
    q = trajectory.positions
    allowed = np.maximum(ROUNDING[0], 0.5 * trajectory.last_digits("position"))
    found = list(worst(np.maximum(lower - q, q - upper) - allowed))
    for joint, k in found:
        yield _outside(trajectory, joint, (trajectory.time[k], q[k, joint], lower, upper), "")
    if not interpolated:
        return
    at, q, rounding = sampled.positions_between()
    known = {joint for joint, _ in found}
    for joint, k in worst(np.maximum(lower - q, q - upper) - allowed - rounding):
        if joint not in known:
            yield _outside(trajectory, joint, (at[k], q[k, joint], lower, upper), BETWEEN)


# Of the quintics of joint_trajectory_controller.
BETWEEN = " between samples, as a controller interpolates them,"


def _outside(
    trajectory: JointTrajectory,
    joint: int,
    place: tuple[float, float, Array, Array],
    where: str,
) -> str:
    time, position, lower, upper = place
    return (
        f"{trajectory.joint_names[joint]} is at {position:.4g} {trajectory.units[joint]}{where} at "
        f"{time:.4g} s, outside its range of {lower[joint]:.4g} to {upper[joint]:.4g}"
    )


def least_clearance(trajectory: JointTrajectory, clearance: Clearance) -> tuple[float, list[str]]:
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
