"""How number, errors and joint inertia of synergies depend on the axes of the shoulder.

Usage: python benchmarks/shoulder_axes.py [FILE[:SIDE] ...] [--degrees 20]

Systems without markers place the axes of thorax and upper arm by tens of degrees differently. Here
the thorax of each recording of joint angles (right arm, and the left one of the bundled recording)
is turned about each of its axes, and the upper arm about its long axis, by so much either way; the
joint angles follow from the segments as they do when a file is read. A row gives the number of
synergies, the mean errors of joints and hand, and the fitted joint inertia, beside those of the
recording as it is.
"""

from __future__ import annotations

import argparse
import warnings
from importlib.resources import files
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.recordings.conventions.segment_orientations import SegmentOrientations
from geodesic_ocp.tables import markdown, new_table

CHANGES = ("as it is", *(f"{part} {s}" for part in ("x", "y", "z", "axial") for s in "+-"))


def turned(motion: go.Motion, side: str, change: str, degrees: float) -> go.Motion:
    """Return the joint angles of a motion whose thorax or upper arm has other axes."""
    if change == CHANGES[0]:
        return motion
    axis, sign = change.split()
    turn = np.radians(-degrees if sign == "-" else degrees)
    upper = Rotation.from_euler("XZY", motion.q[:, :3])
    forearm = upper * Rotation.from_euler("XZ", motion.q[:, 3:5])
    hand = forearm * Rotation.from_euler("XY", motion.q[:, 5:])
    thorax = Rotation.from_euler("z" if axis == "axial" else axis, 0.0 if axis == "axial" else turn)
    if axis == "axial":
        upper = upper * Rotation.from_euler("z", turn)
    segments = {"upper arm": upper, "forearm": forearm, "hand": hand}
    rotations = {f"{side} {name}": each.as_matrix() for name, each in segments.items()}
    rotations["thorax"] = np.tile(thorax.as_matrix(), (len(motion), 1, 1))
    orientations = SegmentOrientations(motion.time, rotations, subject=motion.subject)
    return go.recordings.joint_angles(orientations, motion.joint_names)


def measured(motion: go.Motion, arm: go.Model) -> tuple[float, ...]:
    """Return number of synergies, errors of joints and hand, and the fitted joint inertia."""
    recording = go.trajectory.Recording(arm, motion.filtered())
    analysis = go.analyse(arm, recording.motion)
    errors = analysis.errors["riemannian"]
    fit = go.fitting.fit_metric(recording)
    return (len(analysis.synergies), errors.joint, errors.position, *fit.values.values())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", help="recordings of joint angles")
    parser.add_argument("--degrees", type=float, default=20.0)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    bundled = f"{files('geodesic_ocp') / 'data' / 'climb.csv'}:left"
    rows = []
    for name in [bundled, *options.files]:
        file, _, side = name.partition(":")
        side = side or "right"
        motion = go.read_motion(file, go.human_arm(side).joint_names)
        arm = go.human_arm(side, motion.subject.height or 1.75, 70.0)
        for change in CHANGES:
            try:
                found = measured(turned(motion, side, change, options.degrees), arm)
            except (ValueError, go.NotConverged) as reason:
                print(f"{Path(file).stem}, {change}: {reason}")
                continue
            rows.append((Path(file).stem, change, *found))
    header = ("recording", "thorax or upper arm", "synergies", "joints [rad]", "hand [m]", "m r^2")
    print(markdown(new_table(header, rows)))
    own = {row[0]: np.array(row[2:]) for row in rows if row[1] == CHANGES[0]}
    for change in CHANGES[1:]:
        ratios = np.array([row[2:] / own[row[0]] for row in rows if row[1] == change])
        low, middle, high = np.quantile(ratios, [0.0, 0.5, 1.0], axis=0)
        cells = (f"{m:.2f} ({a:.2f} to {b:.2f})" for a, m, b in zip(low, middle, high, strict=True))
        print(f"| {change} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
