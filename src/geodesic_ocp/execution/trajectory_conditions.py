"""Conditions on a sampled trajectory; each yields sentences on where it does not hold."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.sample_consistency import ROUNDING, SampleConsistency
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

_PER = {"velocity": "/s", "acceleration": "/s^2", "jerk": "/s^3"}


def time_faults(trajectory: JointTrajectory, uniform: bool) -> Iterator[str]:
    """Times that do not increase or are not evenly spaced."""
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


def contradictions(trajectory: JointTrajectory, found: SampleConsistency) -> Iterator[str]:
    """Velocities that are not the derivatives of positions, accelerations not of velocities."""
    for kind, of, values, bounds, per in (
        ("velocities", "positions", found.positions, found.position_bounds, ""),
        ("accelerations", "velocities", found.velocities, found.velocity_bounds, "/s"),
    ):
        excess = np.abs(values) / bounds
        for joint, name in enumerate(trajectory.joint_names):
            k = int(np.argmax(excess[:, joint])) if len(excess) else 0
            if len(excess) and excess[k, joint] > 1.0:
                unit = f"{trajectory.units[joint]}{per}"
                yield (
                    f"{kind} of {name} contradict its {of}: from {trajectory.time[k]:.4g} to "
                    f"{trajectory.time[k + 1]:.4g} s they miss the change by "
                    f"{abs(values[k, joint]):.3g} {unit}, at most {bounds[k, joint]:.2g} is due "
                    "to sampling"
                )


def beyond_positions(trajectory: JointTrajectory, lower: Array, upper: Array) -> Iterator[str]:
    """Joints that leave their range of positions."""
    q = trajectory.positions
    excess = np.maximum(lower - q, q - upper)
    for joint, name in enumerate(trajectory.joint_names):
        k = int(np.argmax(excess[:, joint]))
        if excess[k, joint] > ROUNDING[0]:
            yield (
                f"{name} is at {q[k, joint]:.4g} {trajectory.units[joint]} at "
                f"{trajectory.time[k]:.4g} s, outside its range of {lower[joint]:.4g} to "
                f"{upper[joint]:.4g}"
            )


def magnitudes(
    trajectory: JointTrajectory, torques: Array, rest: bool
) -> dict[str, tuple[Array, Array]]:
    """Times (m,) and magnitudes (m, n) of velocity, acceleration, jerk and torque.

    Samples, and means over steps, which the true largest magnitudes are not below; less what
    rounding in a file may add. At ends at rest, an acceleration is a jump from zero.
    """
    time, a = trajectory.time, trajectory.accelerations
    forward = np.diff(time)[:, None]
    steps = np.where(forward > 0.0, forward, np.inf)  # elsewhere there is no mean
    middles = (time[1:] + time[:-1]) / 2.0

    def means(values: Array, rounding: float) -> Array:
        return np.maximum(np.abs(np.diff(values, axis=0)) - rounding, 0.0) / steps

    jerk = middles, means(a, ROUNDING[2])
    if rest and len(steps):
        ends = np.maximum(np.abs(a[[0, -1]]) - ROUNDING[2], 0.0) / steps[[0, -1]]
        jerk = np.append(middles, time[[0, -1]]), np.vstack([jerk[1], ends])
    both = np.append(time, middles)
    return {
        "velocity": (
            both,
            np.vstack([np.abs(trajectory.velocities), means(trajectory.positions, ROUNDING[0])]),
        ),
        "acceleration": (
            both,
            np.vstack([np.abs(a), means(trajectory.velocities, ROUNDING[1])]),
        ),
        "jerk": jerk,
        "torque": (time, np.abs(torques)),
    }


def beyond(
    trajectory: JointTrajectory,
    name: str,
    instants: Array,
    sizes: Array,
    limits: Array,
    tolerance: float,
) -> Iterator[str]:
    """Joints whose magnitudes (m, n) at these instants exceed their limits (n,)."""
    for joint, title in enumerate(trajectory.joint_names):
        k = int(np.argmax(sizes[:, joint])) if len(sizes) else 0
        if len(sizes) and sizes[k, joint] > (1.0 + tolerance) * limits[joint]:
            angular = trajectory.units[joint] == "rad"
            force = "N m" if angular else "N"
            unit = force if name == "torque" else f"{trajectory.units[joint]}{_PER[name]}"
            mean = name == "jerk" or k >= len(trajectory.time)
            yield (
                f"{name} of {title} is {sizes[k, joint]:.4g} {unit}"
                + (" on average over the step" if mean else "")
                + f" at {instants[k]:.4g} s, its limit {limits[joint]:.4g}"
            )


def unrest(trajectory: JointTrajectory) -> Iterator[str]:
    """Joints that move at the first or the last sample."""
    for k, end in ((0, "begins"), (-1, "ends")):
        for joint, name in enumerate(trajectory.joint_names):
            speed = abs(trajectory.velocities[k, joint])
            if speed > ROUNDING[1]:
                yield (
                    f"{name} {end} at {speed:.3g} {trajectory.units[joint]}/s at "
                    f"{trajectory.time[k]:.4g} s, not at rest"
                )
