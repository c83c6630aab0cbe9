"""Whether a recording can be in the units and of the joints of a model."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.motion import Motion

# Recordings exceed the joint limits by tenths; more than this means wrong units [rad or m].
_FAR_OUTSIDE = 2.0
_LONGEST_STEP = 1.0  # [s] between samples of a recording


def check_plausible(model: Model, motion: Motion) -> None:
    """Check a motion of the model's joints for other units and for spikes.

    Raises:
        ValueError: samples are a second or more apart, or a joint jumps or is far outside its
            limits.
    """
    step = float(np.median(np.diff(motion.time)))
    if step >= _LONGEST_STEP:
        raise ValueError(f"samples are {step:g} s apart: is time in milliseconds? It must be in s")
    for joint, low, high, q in zip(
        motion.joint_names, model.lower, model.upper, motion.q.T, strict=True
    ):
        outside = np.maximum(low - q, q - high)
        worst, jump = int(np.argmax(outside)), int(np.argmax(np.abs(np.diff(q))))
        if outside[worst] > _FAR_OUTSIDE:
            raise ValueError(
                f"{joint} is {q[worst]:.6g} at sample {worst}, far outside its limits "
                f"{low:.3g} to {high:.3g}: another unit, or a spike?"
            )
        if abs(q[jump + 1] - q[jump]) > _FAR_OUTSIDE:
            raise ValueError(f"{joint} jumps from {q[jump]:.6g} to {q[jump + 1]:.6g} at {jump}")
