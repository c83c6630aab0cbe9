"""FrameMotion: the pose of a frame over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from geodesic_ocp.arrays import Array, real_array

_ORTHONORMAL = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class FrameMotion:
    """The pose of a frame, such as the thorax of a person, at the samples of a motion.

    Attributes:
        rotations: from the frame to the surrounding space, (k, 3, 3).
        positions: of the frame's origin in that space, (k, 3) [m].

    Raises:
        ValueError: shapes that do not match, values that are not finite, or a matrix that is not a
            rotation; the message names the first such sample.
    """

    rotations: Array
    positions: Array

    def __post_init__(self) -> None:
        rotations = real_array(self.rotations)
        positions = real_array(self.positions)
        count = len(positions) if positions.ndim else 0
        if rotations.shape != (count, 3, 3) or positions.shape != (count, 3):
            raise ValueError(
                f"rotations (k, 3, 3) and positions (k, 3) must match, got shapes "
                f"{rotations.shape} and {positions.shape}"
            )
        finite = np.all(np.isfinite(positions), axis=1) & np.all(
            np.isfinite(rotations), axis=(1, 2)
        )
        if not finite.all():
            raise ValueError(f"the pose is not finite at sample {int(np.argmin(finite))}")
        products = np.swapaxes(rotations, 1, 2) @ rotations
        proper = np.abs(products - np.eye(3)).max(axis=(1, 2)) <= _ORTHONORMAL
        proper &= np.linalg.det(rotations) > 0.0
        if not proper.all():
            raise ValueError(f"the matrix at sample {int(np.argmin(proper))} is not a rotation")
        for array in (rotations, positions):
            array.flags.writeable = False
        object.__setattr__(self, "rotations", rotations)
        object.__setattr__(self, "positions", positions)

    def __len__(self) -> int:
        return len(self.positions)

    def interpolated(self, time: Array, at: Array) -> FrameMotion:
        """The poses at other times, from those at `time`.

        Positions by cubic spline, rotations along the shortest rotation between two samples; before
        the first sample and after the last the pose is theirs.
        """
        inside = np.clip(at, time[0], time[-1])
        spatial, interpolate = scipy.spatial.transform, scipy.interpolate
        turning = spatial.Slerp(time, spatial.Rotation.from_matrix(self.rotations))
        moving = interpolate.CubicSpline(time, self.positions)
        return FrameMotion(turning(inside).as_matrix(), moving(inside))

    def __repr__(self) -> str:
        return f"FrameMotion({len(self)} samples)"
