"""Segmentation of a motion at zero crossings of the joint velocities, a baseline."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.synergies.observed_velocity import moving_velocity
from geodesic_ocp.synergies.segmentation.segment import (
    nearest_samples,
    parts_of_steps,
    times_between,
    velocity_between,
)
from geodesic_ocp.trajectory.motion import Motion


def segment_zero_velocity(
    motion: Motion, joints: int = 3, window: float = 0.05
) -> list[tuple[int, int]]:
    """Cut a motion where many joints reverse their direction at once.

    A segment starts where more than `joints` joint velocities cross zero within `window` [s], at
    the sample nearest to the mean time of these crossings (after Fod, Mataric, Jenkins, "Automated
    derivation of primitives for movement classification", Autonomous Robots 12, 2002). Crossings
    are located between the samples, so that the cuts hardly depend on the sampling rate.

    Returns:
        (start, stop) sample indices as from `segment`.

    Raises:
        ValueError: the motion has no velocities or never moves, or a number is out of range.
    """
    if joints < 0 or joints >= len(motion.joint_names):
        raise ValueError(f"joints must be 0 to {len(motion.joint_names) - 1}, got {joints}")
    window = as_positive("window", window, "s")
    times = times_between(motion, parts_of_steps(motion))
    observed = velocity_between(motion, moving_velocity(motion), times)
    crossings = sorted(
        (time, joint)
        for joint, velocity in enumerate(observed.T)
        for time in _zero_crossings(times, velocity)
    )
    cuts, after = [motion.time[0], motion.time[-1]], -np.inf
    for start, _ in crossings:
        if start <= after:
            continue
        group = [(time, joint) for time, joint in crossings if start <= time <= start + window]
        if len({joint for _, joint in group}) > joints:
            cuts.append(float(np.mean([time for time, _ in group])))
            after = start + window
    return list(pairwise(nearest_samples(motion, np.array(cuts))))


def _zero_crossings(time: Array, velocity: Array) -> list[float]:
    """Times at which one joint's velocity changes its sign, by linear interpolation."""
    nonzero = np.flatnonzero(velocity)
    changes = np.flatnonzero(np.diff(np.sign(velocity[nonzero])))
    before, after = nonzero[changes], nonzero[changes + 1]
    fraction = velocity[before] / (velocity[before] - velocity[after])
    return list(time[before] + fraction * (time[after] - time[before]))
