"""Velocities and speeds of an observed motion, checked."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import speeds_at

# Joints within this range do not move: it is below the noise of motion capture [rad or m].
_STILL = 1e-3


def observed_velocity(motion: Motion) -> Array:
    """The motion's velocities (k, n); ValueError if it has none."""
    if motion.velocity is None:
        raise ValueError("the motion has no velocities; use motion.filtered()")
    return motion.velocity


def moving_velocity(motion: Motion) -> Array:
    """The motion's velocities (k, n); ValueError if it has none, or no joint moves."""
    if np.ptp(motion.q, axis=0).max() < _STILL:
        raise ValueError(
            f"the motion never moves: every joint stays within {_STILL:g} rad from first to last"
        )
    return observed_velocity(motion)


def speeds(metric: Metric, motion: Motion) -> Array:
    """Observed speeds |q'|_G at every sample, (k,); ValueError if motion and metric do not fit."""
    if metric.dim != len(motion.joint_names):
        raise ValueError(
            f"the metric has dimension {metric.dim}, the motion {len(motion.joint_names)} joints"
        )
    if metric.joint_names is not None and metric.joint_names != motion.joint_names:
        raise ValueError(
            f"the motion's joints {', '.join(motion.joint_names)} are not the metric's in its "
            f"order, {', '.join(metric.joint_names)}; use motion.select(model.joint_names)"
        )
    return speeds_at(metric, motion.q, observed_velocity(motion))
