"""SegmentOrientations: how the segments of a person are oriented over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from geodesic_ocp.arrays import Array
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
        empty = np.zeros((np.size(self.time), 0))
        time = Motion(self.time, empty, (), trunk=self.trunk).time
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
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "rotations", checked)

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        names = ", ".join(self.rotations)
        return f"SegmentOrientations({len(self)} samples of {names or 'no segment'})"
