"""Continuous joints: to which image of the goal the shortest geodesic leads.

    python benchmarks/images.py --count 300 arm.urdf:hand [...]

Of random pairs it prints how much longer than the shortest straight line to any image that one is
to whose image the shortest geodesic leads (`LONGER` of logarithm/images.py bounds it), with and
without the default joint inertia. Arms of two and three uniform rods are always there. Needs GCC.
"""

from __future__ import annotations

import argparse

import numpy as np

import geodesic_ocp as go
from geodesic_ocp.logarithm.by_newton import find_many_by_newton
from geodesic_ocp.logarithm.images import all_images, line_lengths
from geodesic_ocp.validation import planar_arm


def factor(metric: go.KineticEnergy, q0: np.ndarray, q1: np.ndarray) -> float:
    """Length of the straight line to the image of the shortest geodesic, over the shortest line's;
    NaN if no geodesic is found.
    """
    images = np.array(all_images(metric, q0, q1))
    found = find_many_by_newton(metric, np.tile(q0, (len(images), 1)), images)
    assert found is not None, "the compiler of the system cannot do it"
    lengths = [metric.norm(q0, v) if np.isfinite(v).all() else np.inf for v in found.velocities]
    if not np.isfinite(lengths).any():
        return np.nan
    lines = line_lengths(metric, q0, images)
    return float(lines[np.argmin(lengths)] / lines[0])


def main() -> None:
    """Print a line for every arm and joint inertia."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("arms", nargs="*", metavar="FILE:HAND")
    parser.add_argument("--count", type=int, default=300)
    options = parser.parse_args()
    rods = [((1.0,) * n, (1.0,) * n, (0.5,) * n, (1 / 12,) * n) for n in (2, 3)]
    arms = [planar_arm(*each) for each in rods]
    for each in options.arms:
        file, _, hand = each.rpartition(":")
        arms.append(go.load_model(file, hand=hand))
    for arm in arms:
        inertia = go.manifold.default_joint_inertia(arm)
        for armature in (0.0 * inertia, inertia):
            metric = go.KineticEnergy(arm.with_armature(armature))
            metric.kernels.available()
            turns = np.isfinite(metric.periods)
            lower, upper = np.where(turns, -np.pi, arm.lower), np.where(turns, np.pi, arm.upper)
            pairs = np.random.default_rng(1).uniform(lower, upper, (options.count, 2, arm.dof))
            factors = [factor(metric, *pair) for pair in pairs]
            shown = np.nanquantile(factors, [0.9, 0.99, 1.0]).round(2)
            kind = "with" if armature.any() else "without"
            print(f"{arm.name}, {kind} joint inertia: 90 %, 99 %, most {shown}", flush=True)


if __name__ == "__main__":
    main()
