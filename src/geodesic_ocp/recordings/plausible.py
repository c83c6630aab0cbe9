"""Whether a recording can be in the units and of the joints of a model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.motion import Motion

# Recordings exceed the joint limits by tenths; more than this means wrong units [rad or m].
_FAR_OUTSIDE = 2.0
_LONGEST_STEP = 1.0  # [s] between samples of a recording
# No joint of a person, nor of an arm, is two revolutions from zero; in degrees, any motion is.
_LARGEST_ANGLE = 4.0 * np.pi  # [rad]


def check_plausible(model: Model, motion: Motion) -> None:
    """Check a motion of the model's joints for other units and for spikes.

    Raises:
        ValueError: samples are a second or more apart, or a joint jumps or is far outside its
            limits; asks whether angles are in degrees where they would fit the limits.
    """
    step = float(np.median(np.diff(motion.time)))
    if step >= _LONGEST_STEP:
        raise ValueError(f"samples are {step:g} s apart: is time in milliseconds? It must be in s")
    outside = np.maximum(model.lower - motion.q, motion.q - model.upper)
    if _are_degrees(model, motion.q, outside):
        worst_joint = int(np.argmax(outside.max(axis=0)))
        raise ValueError(_question(motion.joint_names[worst_joint], motion.q[:, worst_joint]))
    for column, joint in enumerate(motion.joint_names):
        q, low, high = motion.q[:, column], model.lower[column], model.upper[column]
        worst, jump = int(np.argmax(outside[:, column])), int(np.argmax(np.abs(np.diff(q))))
        if outside[worst, column] > _FAR_OUTSIDE:
            raise ValueError(
                f"{joint} is {q[worst]:.6g} at sample {worst}, far outside its limits "
                f"{low:.3g} to {high:.3g}: another unit, or a spike?"
            )
        if abs(q[jump + 1] - q[jump]) > _FAR_OUTSIDE:
            raise ValueError(f"{joint} jumps from {q[jump]:.6g} to {q[jump + 1]:.6g} at {jump}")


def check_radians(names: Sequence[str], q: Array) -> None:
    """Ask whether angles q (k, n) are in degrees, if one is two revolutions from zero.

    Raises:
        ValueError: they look like degrees.
    """
    if np.abs(q).max(initial=0.0) > _LARGEST_ANGLE:
        worst = int(np.argmax(np.abs(q).max(axis=0)))
        raise ValueError(
            f"{_question(names[worst], q[:, worst])}, and columns that are no angles are left out "
            "by joints=..."
        )


def _are_degrees(model: Model, q: Array, outside: Array) -> bool:
    """Whether most samples are far outside the limits, and none would be if it were in degrees."""
    angular = np.array(model.units) == "rad"
    if np.mean(np.any(outside[:, angular] > _FAR_OUTSIDE, axis=1)) < 0.5:
        return False  # a spike
    angles = np.deg2rad(q[:, angular])
    low, high = model.lower[angular] - _FAR_OUTSIDE, model.upper[angular] + _FAR_OUTSIDE
    return bool(np.all((low <= angles) & (angles <= high)))


def _question(joint: str, q: Array) -> str:
    return (
        f"{joint} reaches {q[int(np.argmax(np.abs(q)))]:.4g} rad: are these degrees? Angles are in "
        "rad; a table in degrees has the line '# unit: deg', an OpenSim file inDegrees=yes"
    )
