"""Motions of SMPL's body joints in NumPy archives (.npz), as the AMASS collection has them.

Mahmood et al., "AMASS: archive of motion capture as surface shapes", ICCV 2019. The array `poses`
(k, 72, 156 or 165) begins with the rotation vectors of the pelvis and 21 body joints (SMPL, SMPL-H
and SMPL-X alike). Some files hold them as `root_orient` (k, 3) and `pose_body` (k, 63); estimates
from video as `global_orient` (k, 3) and `body_pose` (k, 63 or 69), or (k, 21 or 23, 3), whose
vertical axis is often another one. `mocap_framerate`, `mocap_frame_rate` or `fps` is the rate. The
tree of joints and the rest pose are public; the lengths of the bones belong to the licensed body
model and to `betas`, so that there are no positions here.
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
from geodesic_ocp.records import read_arrays
from geodesic_ocp.trajectory.files.text_lines import named_failures, stated_rate
from geodesic_ocp.trajectory.recording import LARGEST_ANGLE

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
# Columns of the body without the pelvis, of SMPL also with its two hands.
_PARTS = {("root_orient", "pose_body"): (63,), ("global_orient", "body_pose"): (63, 69)}
_RATES = ("mocap_framerate", "mocap_frame_rate", "fps")
_SLOWEST = 1e-3  # [Hz]
_FASTEST = 1e6  # [Hz]


def read_smpl(
    file: Path,
    convention: SkeletonConvention | str | Path | None = None,
    up: str | None = None,
    rate: float | None = None,
) -> SegmentOrientations:
    """Read the orientations of segments from SMPL's body joints; the space has z up, as in AMASS,
    unless another axis is given.

    The rest pose is a T pose with the palms down. The pose of the trunk is not known: the positions
    of its joints depend on the licensed body model.

    Args:
        file: the .npz.
        convention: another one than `SMPL`.
        up: vertical axis of the space, such as "y"; by default that of the convention, or z.
        rate: rate of the frames [Hz], if the file does not say it.

    Raises:
        RecordingError: the file is no such archive, an array is missing, of another shape or not
            finite, or the person is upright along another axis.
    """
    with named_failures(file):
        chosen = as_skeleton_convention(convention) or SMPL
        poses, own = _arrays(file)
        used = stated_rate(file, own, rate)
        if used is None:
            raise RecordingError(
                f"there is no {' or '.join(map(repr, _RATES[:2]))} in it, nor {_RATES[2]!r}: give "
                "the rate of its frames by rate (--sample-rate)"
            )
        motion = _motion(poses, used)
        return skeleton_segments(motion, chosen, space_up="+z", up=up)


def _motion(poses: Array, rate: float) -> SkeletonMotion:
    if poses.ndim != 2 or poses.shape[1] not in _WIDTHS:
        raise RecordingError(
            "'poses' must have 66, 72, 156 or 165 columns (the body, SMPL, SMPL-H, SMPL-X), has "
            f"the shape {poses.shape}"
        )
    bad = np.argwhere(~(np.abs(poses) < LARGEST_ANGLE))
    if len(bad):
        frame, column = bad[0]
        number = poses[frame, column]
        asked = ": are the rotation vectors in degrees? They must be in rad"
        raise RecordingError(
            f"'poses' is {number:g} in frame {frame}{asked if np.isfinite(number) else ''}"
        )
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


def _arrays(file: Path) -> tuple[Array, float | None]:
    """Return rotation vectors (k, n) and the rate, None without one."""
    arrays: dict[str, Array] = {}
    rate = None
    for name, array in read_arrays(file, _needed).items():
        is_rate = name in _RATES
        if array.dtype.kind not in "fiu" or (is_rate and array.size != 1):
            raise RecordingError(
                f"{name!r} must be {'a number' if is_rate else 'numbers'}, is "
                f"{array.dtype} of shape {array.shape}"
            )
        if is_rate:
            rate = float(array.item())
        else:
            arrays[name] = np.array(array, dtype=float)
    if "poses" in arrays:
        return arrays["poses"], rate
    first, second = arrays
    root, body = (
        each.reshape(len(each), -1) if each.ndim == 3 else each for each in arrays.values()
    )
    widths = body.shape[1] if body.ndim == 2 else 0
    known = _PARTS[first, second]
    if root.ndim != 2 or root.shape[1] != 3 or widths not in known or len(root) != len(body):
        shapes = [array.shape for array in arrays.values()]
        raise RecordingError(
            f"{first} and {second} must have 3 and {' or '.join(map(str, known))} columns, have "
            f"the shapes {' and '.join(map(str, shapes))}"
        )
    return np.hstack([root, body]), rate


def _needed(names: list[str]) -> list[str]:
    """Return the names of the arrays of poses, and of the rate if it is there."""
    rate = [name for name in _RATES if name in names][:1]
    for poses in (("poses",), *_PARTS):
        if set(poses) <= set(names):
            return [*poses, *rate]
    parts = ", nor ".join(" with ".join(map(repr, each)) for each in _PARTS)
    raise RecordingError(
        f"there is no 'poses' in it, as files of AMASS have, nor {parts}; there are "
        f"{', '.join(names[:20]) or 'no arrays'}"
    )
