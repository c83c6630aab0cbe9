"""SegmentOrientations: how the segments of a person are oriented over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.conventions.continuous_angles import successive_rotations
from geodesic_ocp.trajectory.motion import FrameMotion, Motion, Subject

ARM_JOINTS = ("Sx", "Sz", "Sy", "Ex", "Ez", "Wx", "Wy")  # after R or L, before _joint
TRUNK_JOINTS = ("BPx", "BPz", "BPy", "BTx", "BTz", "BTy")  # before _joint
SIDES: tuple[Literal["right", "left"], ...] = ("right", "left")

TRUNK = ("pelvis", "abdomen", "thorax")
ARM = ("upper arm", "forearm", "hand")  # after a side
#: Names of the segments; those of the arms begin with "right" or "left".
SEGMENTS = (*TRUNK, *(f"{side} {part}" for side in SIDES for part in ARM))

_ORTHONORMAL = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class SegmentOrientations:
    """Orientations of a person's segments over time, to which all joint conventions are converted.

    The axes of every segment are those of `human_arm`: when the person stands upright, with the
    arms hanging and the palms towards the body, all segments have x to the person's right, y
    forward and z up. The orientation of the forearm is that of its distal end at the wrist, so
    that it turns with the palm.

    Attributes:
        time: increasing times (k,) [s].
        rotations: rotations by segment, from its axes to a space with z up, (k, 3, 3); a segment
            that the recording does not have is left out.
        trunk: pose of the thorax in that space, its origin midway between the shoulders; None if
            its position is not recorded.
        subject: the recorded person.
        left_out: why other segments are left out, by segment, where the recording says so.

    Raises:
        ValueError: an unknown segment, shapes that do not match, values that are not finite, a
            matrix that is not a rotation, or time that does not increase.
    """

    time: Array
    rotations: Mapping[str, Array]
    trunk: FrameMotion | None = None
    subject: Subject = field(default_factory=Subject)
    left_out: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        time = np.array(self.time, dtype=float)
        if time.ndim != 1 or time.size < 2:
            raise ValueError(f"time must be (k,) with at least two samples, got {time.shape}")
        steps = np.diff(time)
        if not np.all(steps > 0.0):
            sample = int(np.argmin(steps > 0.0)) + 1
            raise ValueError(
                f"time must increase: sample {sample} is at {time[sample]:.6g} s, the one before "
                f"at {time[sample - 1]:.6g} s"
            )
        checked = {}
        for name, given in self.rotations.items():
            if name not in SEGMENTS:
                raise ValueError(f"there is no segment {name!r}; there are {', '.join(SEGMENTS)}")
            matrices = np.array(given, dtype=float)
            if matrices.shape != (time.size, 3, 3):
                raise ValueError(
                    f"rotations of the {name} must have shape ({time.size}, 3, 3), got "
                    f"{matrices.shape}"
                )
            errors = np.abs(np.swapaxes(matrices, 1, 2) @ matrices - np.eye(3)).max(axis=(1, 2))
            crosses = np.cross(matrices[:, :, 0], matrices[:, :, 1])
            proper = (errors <= _ORTHONORMAL) & (np.sum(crosses * matrices[:, :, 2], axis=1) > 0.0)
            if not proper.all():
                raise ValueError(
                    f"the matrix of the {name} at sample {int(np.argmin(proper))} is not a rotation"
                )
            matrices.flags.writeable = False
            checked[name] = matrices
        if self.trunk is not None and len(self.trunk) != time.size:
            raise ValueError(f"trunk must have {time.size} samples, got {len(self.trunk)}")
        time.flags.writeable = False
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "rotations", checked)

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        names = ", ".join(self.rotations)
        return f"SegmentOrientations({len(self)} samples of {names or 'no segment'})"


def segment_orientations(motion: Motion) -> SegmentOrientations:
    """Return the orientations of the segments of a motion of the Master Motor Map's joints.

    Thorax: that of `motion.trunk`, or upright. Upper arms, forearms and hands follow where the
    motion has all angles from the thorax to them, abdomen and pelvis with the trunk's joints. It
    is the inverse of `joint_angles`.

    Raises:
        ValueError: the motion has no angles of a whole shoulder or of the trunk.
    """
    count = len(motion)
    upright = np.broadcast_to(np.eye(3), (count, 3, 3))
    thorax = upright if motion.trunk is None else motion.trunk.rotations
    rotations = {"thorax": thorax}
    upper = _rotation(motion, "", TRUNK_JOINTS[3:], "xzy")
    if upper is not None:
        rotations["abdomen"] = thorax @ np.swapaxes(upper, 1, 2)
        lower = _rotation(motion, "", TRUNK_JOINTS[:3], "xzy")
        if lower is not None:
            rotations["pelvis"] = rotations["abdomen"] @ np.swapaxes(lower, 1, 2)
    for side in SIDES:
        pose = thorax
        chain = (("upper arm", 0, 3, "xzy"), ("forearm", 3, 5, "xz"), ("hand", 5, 7, "xy"))
        for segment, first, end, axes in chain:
            turn = _rotation(motion, side[0].upper(), ARM_JOINTS[first:end], axes)
            if turn is None:
                break
            pose = pose @ turn
            rotations[f"{side} {segment}"] = pose
    if len(rotations) == 1:
        raise ValueError(
            "the motion must have the angles of a shoulder, such as RSx_joint, RSz_joint and "
            f"RSy_joint, or of the trunk; it has {', '.join(motion.joint_names)}"
        )
    return SegmentOrientations(motion.time, rotations, motion.trunk, motion.subject)


def _rotation(motion: Motion, letter: str, joints: tuple[str, ...], axes: str) -> Array | None:
    names = [f"{letter}{joint}_joint" for joint in joints]
    if not set(names) <= set(motion.joint_names):
        return None
    return successive_rotations(axes, motion.select(names).q)
