"""Recording: a motion of a person, with the model of the person's arm."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array, settle
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.files.text_lines import check_seconds
from geodesic_ocp.trajectory.motion import Motion


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """A recorded motion, with the model of the arm that moved.

    Attributes:
        model: the arm, scaled to the person.
        motion: motion of the model's joints, with velocities (`Motion.filtered`).
        name: name of the recording, such as the name of its file.
        subject: identifies the person; recordings of equal subjects are not independent.
        fit: the `MarkerFit` from which the motion was obtained; None for other recordings.

    Raises:
        ValueError: the motion lacks a joint of the model, or has no velocities.
    """

    model: Model
    motion: Motion
    name: str = ""
    subject: str = ""
    fit: Any = None

    def __post_init__(self) -> None:
        motion = self.motion.select(self.model.joint_names)
        if motion.velocity is None:
            raise ValueError(f"{self.name or 'motion'}: no velocities; use motion.filtered()")
        settle(self, motion=motion)
        settle(self, subject=self.subject or motion.subject.name or self.name)

    def __repr__(self) -> str:
        return f"Recording({self.name!r} of {self.subject!r}, {self.model.name}, {self.motion!r})"


def as_recordings(given: Any) -> tuple[Recording, ...]:
    """Return one recording, or several, as a tuple; ValueError for anything else and for none."""
    listed = (given,) if isinstance(given, Recording) else given
    found = tuple(listed) if isinstance(listed, Iterable) else ()
    if not found or not all(isinstance(each, Recording) for each in found):
        raise ValueError("recordings must be one or more of go.trajectory.Recording")
    return found


# Recordings exceed the joint limits by tenths; more than this means wrong units [rad or m].
_FAR_OUTSIDE = 2.0
# No joint of a person, nor of an arm, is two revolutions from zero; in degrees, any motion is.
LARGEST_ANGLE = 4.0 * np.pi  # [rad]

# Joints of people reach a little beyond the model's limits; not by this much for this long.
_OUTSIDE = np.radians(10.0)  # [rad], and share of the samples
_OFTEN = 0.2  # [rad], and share of the samples
# A shoulder whose first and last axis are this near to parallel, and turn so far in one sample.
# cosine of Sz, [rad]
_NEARLY_LOCKED = 0.17
_FAST = 0.5
PASSIVE = np.radians(20.0)  # [rad] range of every joint, below which an arm is passive
PASSIVE_REASON = "this arm is passive: no joint moves by more than 20 deg"
_STILL = 3.2  # a range of angles that is all of a motion in radians, and hardly one in degrees


def check_units(model: Model, motion: Motion) -> None:
    """Ask whether time is in milliseconds, or angles are in degrees, of a motion of the model.

    Raises:
        ValueError: samples are a second or more apart, or most angles are far outside the limits
            and would not be in degrees.
    """
    check_seconds(motion.time)
    outside = np.maximum(model.lower - motion.q, motion.q - model.upper)
    if _are_degrees(model, motion.q, outside):
        worst_joint = int(np.argmax(outside.max(axis=0)))
        question = _question(motion.joint_names[worst_joint], motion.q[:, worst_joint])
        if _is_within_a_revolution(motion):
            question += (
                "; or are they between 0 and 360 deg, in place of -180 and 180? An offset of -360 "
                "in columns=... (--columns) turns them back"
            )
        raise ValueError(question)


def check_before_unwrapping(model: Model, motion: Motion) -> None:
    """Check units as `check_units`, unless the numbers may be angles that were wrapped.

    In other units, some steps would look like whole revolutions.
    """
    if not _is_within_a_revolution(motion):
        check_units(model, motion)


def _is_within_a_revolution(motion: Motion) -> bool:
    return bool(np.abs(motion.q).max() <= 2.0 * np.pi)


def check_plausible(model: Model, motion: Motion) -> None:
    """Check a motion of the model's joints for other units and for jumps.

    Raises:
        ValueError: as `check_units`, or a joint jumps or is far outside its limits.
    """
    check_units(model, motion)
    outside = np.maximum(model.lower - motion.q, motion.q - model.upper)
    for column, joint in enumerate(motion.joint_names):
        q = motion.q[:, column]
        low = model.lower[column]
        high = model.upper[column]
        worst = int(np.argmax(outside[:, column]))
        jump = int(np.argmax(np.abs(np.diff(q))))
        if outside[worst, column] > _FAR_OUTSIDE:
            raise ValueError(
                f"{joint} is {q[worst]:.6g} at sample {worst}, far outside its limits "
                f"{low:.3g} to {high:.3g}: another unit, left and right swapped, or a spike?"
            )
        if abs(q[jump + 1] - q[jump]) > _FAR_OUTSIDE:
            raise ValueError(f"{joint} jumps from {q[jump]:.6g} to {q[jump + 1]:.6g} at {jump}")


def within_limits(model: Model, motion: Motion) -> Motion:
    """Return the motion of the model's joints with each angle that was wrapped in the revolution in
    which the middle of its samples is nearest to the middle of the joint's range.

    A file whose angles are between -180 and 180 deg does not say in which revolution they are.
    """
    q = motion.q.copy()
    for column, joint in enumerate(motion.joint_names):
        middle = 0.5 * (model.lower[column] + model.upper[column])
        wrapped = any(each.kind == "wrap" and each.joint == joint for each in motion.outliers)
        if wrapped and np.isfinite(middle):
            away = float(np.median(q[:, column])) - middle
            q[:, column] -= 2.0 * np.pi * np.round(away / (2.0 * np.pi))
    return replace(motion, q=q)


def check_radians(names: Sequence[str], q: Array) -> None:
    """Ask whether angles q (k, n), NaN in gaps, are in degrees, if one is two revolutions from
    zero.

    Raises:
        ValueError: they look like degrees.
    """
    sizes = np.nan_to_num(np.abs(q))
    if sizes.max(initial=0.0) > LARGEST_ANGLE:
        worst = int(np.argmax(sizes.max(axis=0)))
        raise ValueError(
            f"{_question(names[worst], q[:, worst])}, and columns that are no angles are left out "
            "by joints=..."
        )


def ask_about_limits(model: Model, motion: Motion, name: str) -> None:
    """Yield a RuntimeWarning if joints are beyond the model's limits for much of the recording.

    Args:
        model: model whose joints the motion has.
        motion: motion of these joints.
        name: name of the recording, with which the warning begins.
    """
    outside = np.maximum(model.lower - motion.q, motion.q - model.upper)
    found = []
    for column, joint in enumerate(motion.joint_names):
        share = float(np.mean(outside[:, column] > _OUTSIDE))
        if model.units[column] == "rad" and share > _OFTEN:
            worst = motion.q[int(np.argmax(outside[:, column])), column]
            low, high = np.degrees([model.lower[column], model.upper[column]])
            found.append(
                f"{joint} reaches {np.degrees(worst):.0f} deg (limits {low:.0f} to {high:.0f} deg) "
                f"and is more than 10 deg beyond its limits in {share:.0%} of the samples"
            )
    if found:
        warnings.warn(
            f"{name}: {'; '.join(found)}: has the file another convention, are left and right "
            "swapped, or has a joint another sign than assumed? Such as an elevation written as a "
            "positive number",
            RuntimeWarning,
            stacklevel=3,
        )


def range_of_motion(motion: Motion) -> float:
    """Return the largest range of a joint over a motion [rad or m]."""
    return float(np.ptp(motion.q, axis=0).max())


def warn_of_gimbal_lock(motion: Motion, name: str) -> None:
    """Yield a RuntimeWarning if the shoulder turns fast because its axes are nearly parallel.

    Where Sz is near 90 degrees, Sx and Sy turn about nearly the same axis, and may change by
    radians while the arm hardly moves.

    Args:
        motion: motion of an arm of the Master Motor Map; of other joints nothing is said.
        name: name of the recording, with which the warning begins.
    """
    for letter in "RL":
        x, z, y = (f"{letter}S{axis}_joint" for axis in "xzy")
        if not {x, y, z} <= set(motion.joint_names):
            continue
        first, middle, last = motion.select([x, z, y]).q.T
        steps = np.minimum(np.abs(np.diff(first)), np.abs(np.diff(last)))
        steps[np.abs(np.cos(middle[1:])) > _NEARLY_LOCKED] = 0.0
        at = int(np.argmax(steps))
        if steps[at] > _FAST:
            warnings.warn(
                f"{name}: {x} and {y} turn by {np.degrees(steps[at]):.0f} deg within one sample, "
                f"at {motion.time[at + 1]:.2f} s, as {z} is {np.degrees(middle[at + 1]):.0f} deg, "
                "near gimbal lock: there joint angles and their velocities say little about the "
                "arm's motion",
                RuntimeWarning,
                stacklevel=3,
            )


def ask_about_degrees(name: str, q: Array) -> None:
    """Yield a RuntimeWarning if angles q (k, n) [deg], as the file states, may be radians.

    Args:
        name: name of the recording, with which the warning begins.
        q: (k, n) numbers of the file, NaN in gaps; without any sample nothing is asked.
    """
    q = q[:, ~np.isnan(q).all(axis=0)]
    if not q.size or np.nanmax(np.abs(q)) > 2.0 * np.pi:
        return
    largest = float(np.max(np.nanmax(q, axis=0) - np.nanmin(q, axis=0)))
    if 0.1 < largest <= _STILL:
        warnings.warn(
            f"{name}: no joint moves by more than {largest:.2g} deg: are the "
            "angles in radians, although the file says degrees?",
            RuntimeWarning,
            stacklevel=3,
        )


def _are_degrees(model: Model, q: Array, outside: Array) -> bool:
    """Return whether most samples are far outside the limits, but would not be in degrees."""
    angular = np.array(model.units) == "rad"
    if np.mean(np.any(outside[:, angular] > _FAR_OUTSIDE, axis=1)) < 0.5:
        return False  # a spike
    angles = np.deg2rad(q[:, angular])
    low = model.lower[angular] - _FAR_OUTSIDE
    high = model.upper[angular] + _FAR_OUTSIDE
    return bool(np.all((low <= angles) & (angles <= high)))


def _question(joint: str, q: Array) -> str:
    return (
        f"{joint} reaches {q[int(np.nanargmax(np.abs(q)))]:.4g} rad: are these degrees? Angles are "
        "in rad; a table in degrees has the line '# unit: deg', an OpenSim file inDegrees=yes"
    )


def prepared(
    model: Model,
    motion: Motion,
    source: str,
    *,
    resample: float | None = None,
    cutoff: float | None = None,
    duration: float | None = None,
    unfiltered: bool = False,
) -> Motion:
    """Return the motion of the model's joints, checked, without outliers, and filtered.

    Args:
        model: the arm.
        motion: motion of its joints, and maybe of others.
        source: name of the recording, with which warnings begin.
        resample: interpolate at this rate first [Hz].
        cutoff, duration: of the filter, see `Motion.filtered`.
        unfiltered: take the motion as it is, with the velocities of a cubic spline.

    Raises:
        RecordingError: the motion lacks a joint of the model.
        ValueError: as `check_plausible`, or the motion is too short or uneven for the filter.
    """
    motion = motion.select(model.joint_names)
    check_before_unwrapping(model, motion)
    motion = within_limits(model, motion.without_outliers())
    check_plausible(model, motion)
    ask_about_limits(model, motion, source)
    warn_of_gimbal_lock(motion, source)
    if resample is not None:
        motion = motion.resampled(resample)
    if unfiltered:
        return replace(motion, velocity=motion(motion.time, 1))
    return motion.filtered(cutoff=cutoff, duration=duration)
