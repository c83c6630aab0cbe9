"""Motions of SMPL's body joints in NumPy archives (.npz), as the AMASS collection has them.

Mahmood et al., "AMASS: archive of motion capture as surface shapes", ICCV 2019. The array `poses`
(k, 72, 156 or 165) begins with the rotation vectors of the pelvis and 21 body joints (SMPL, SMPL-H
and SMPL-X alike), which some files hold as `root_orient` (k, 3) and `pose_body` (k, 63);
`mocap_framerate` or `mocap_frame_rate` is the rate. The tree of joints and the rest pose are
public; the lengths of the bones belong to the licensed body model and to `betas`, so that there are
no positions here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.segment_orientations import SegmentOrientations
from geodesic_ocp.recordings.conventions.skeleton_convention import (
    SMPL,
    SkeletonConvention,
    as_skeleton_convention,
)
from geodesic_ocp.recordings.conventions.skeleton_segments import (
    Skeleton,
    SkeletonMotion,
    skeleton_segments,
)
from geodesic_ocp.recordings.formats.text_lines import named_failures
from geodesic_ocp.records import read_arrays

# Joint, parent, and the direction to it in the rest pose, of which only the signs are used.
_JOINTS = (
    ("pelvis", -1, (0, 0, 0)),
    ("left_hip", 0, (1, -1, 0)),
    ("right_hip", 0, (-1, -1, 0)),
    ("spine1", 0, (0, 1, 0)),
    ("left_knee", 1, (0, -1, 0)),
    ("right_knee", 2, (0, -1, 0)),
    ("spine2", 3, (0, 1, 0)),
    ("left_ankle", 4, (0, -1, 0)),
    ("right_ankle", 5, (0, -1, 0)),
    ("spine3", 6, (0, 1, 0)),
    ("left_foot", 7, (0, 0, 1)),
    ("right_foot", 8, (0, 0, 1)),
    ("neck", 9, (0, 1, 0)),
    ("left_collar", 9, (1, 0, 0)),
    ("right_collar", 9, (-1, 0, 0)),
    ("head", 12, (0, 1, 0)),
    ("left_shoulder", 13, (1, 0, 0)),
    ("right_shoulder", 14, (-1, 0, 0)),
    ("left_elbow", 16, (1, 0, 0)),
    ("right_elbow", 17, (-1, 0, 0)),
    ("left_wrist", 18, (1, 0, 0)),
    ("right_wrist", 19, (-1, 0, 0)),
)
_WIDTHS = (66, 72, 156, 165)  # the body alone, SMPL, SMPL-H, SMPL-X
_PARTS = ("root_orient", "pose_body")
_RATES = ("mocap_framerate", "mocap_frame_rate")
_SLOWEST, _FASTEST = 1e-3, 1e6  # [Hz]
_LARGEST = 1e3  # [rad], of a rotation vector's components


def read_smpl(
    file: Path,
    convention: SkeletonConvention | str | Path | None = None,
    up: str | None = None,
) -> SegmentOrientations:
    """Read the orientations of segments from SMPL's body joints; the space has z up, as in AMASS,
    unless another axis is given.

    The rest pose is a T pose with the palms down. The pose of the trunk is not known: the positions
    of its joints depend on the licensed body model.

    Args:
        file: the .npz.
        convention: another one than `SMPL`.
        up: vertical axis of the space, such as "y"; by default that of the convention, or z.

    Raises:
        RecordingError: the file is no such archive, an array is missing, of another shape or not
            finite, or the person is upright along another axis.
    """
    with named_failures(file):
        chosen = as_skeleton_convention(convention) or SMPL
        motion = _motion(_arrays(file))
        return skeleton_segments(motion, chosen, space_up="+z", up=up)


def _motion(arrays: dict[str, Array]) -> SkeletonMotion:
    poses, rate = arrays["poses"], float(arrays["rate"])
    if poses.ndim != 2 or poses.shape[1] not in _WIDTHS:
        raise RecordingError(
            "'poses' must have 66, 72, 156 or 165 columns (the body, SMPL, SMPL-H, SMPL-X), has "
            f"the shape {poses.shape}"
        )
    bad = np.argwhere(~(np.abs(poses) < _LARGEST))
    if len(bad):
        frame, column = bad[0]
        raise RecordingError(f"'poses' is {poses[frame, column]} in frame {frame}")
    if not _SLOWEST < rate < _FASTEST:
        raise RecordingError(f"the rate of the recording is {rate} Hz")
    names, parents, offsets = zip(*_JOINTS, strict=True)
    skeleton = Skeleton(names, parents, np.array(offsets, dtype=float))

    def rotation(joint: int) -> Array:
        vectors = poses[:, 3 * joint : 3 * joint + 3]
        result: Array = scipy.spatial.transform.Rotation.from_rotvec(vectors).as_matrix()
        return result

    time = np.arange(len(poses)) / rate
    return SkeletonMotion(skeleton, time, rotation, skeleton.offsets.__getitem__)


def _arrays(file: Path) -> dict[str, Array]:
    """Return the arrays "poses" and "rate" as floats."""
    arrays = {}
    for key, array in read_arrays(file, _needed).items():
        name = "rate" if key in _RATES else key
        if array.dtype.kind not in "fiu" or (name == "rate" and array.size != 1):
            raise RecordingError(
                f"{key!r} must be {'a number' if name == 'rate' else 'numbers'}, is "
                f"{array.dtype} of shape {array.shape}"
            )
        arrays[name] = np.array(array, dtype=float).reshape(() if name == "rate" else array.shape)
    if set(_PARTS) <= set(arrays):
        parts = [arrays.pop(name) for name in _PARTS]
        shapes: list[tuple[int, ...]] = [part.shape for part in parts]
        if [shape[1:] for shape in shapes] != [(3,), (63,)] or shapes[0][0] != shapes[1][0]:
            raise RecordingError(
                f"{' and '.join(_PARTS)} must have 3 and 63 columns, have the shapes "
                f"{shapes[0]} and {shapes[1]}"
            )
        arrays["poses"] = np.hstack(parts)
    return arrays


def _needed(names: list[str]) -> list[str]:
    """Return the names of the arrays of poses and of the rate."""
    rate = [name for name in _RATES if name in names][:1]
    poses = _PARTS if "poses" not in names and set(_PARTS) <= set(names) else ("poses",)
    missing = " or ".join(map(repr, _RATES)) if not rate else ""
    missing = missing if set(poses) <= set(names) else "'poses'"
    if missing:
        raise RecordingError(
            f"there is no {missing} in it, as files of AMASS have; there are "
            f"{', '.join(names[:20]) or 'no arrays'}"
        )
    return [*poses, *rate]
