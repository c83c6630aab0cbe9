"""A Panda among random balls and capsules: time of the path of least energy between two poses."""

from __future__ import annotations

import argparse
import time

import numpy as np

import geodesic_ocp as go

CLEARANCE = 0.03  # [m] of every obstacle from the robot at both ends


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=6, help="number of scenes")
    parser.add_argument("--obstacles", type=int, default=15, help="in each scene")
    options = parser.parse_args()
    panda = go.load_model("panda")
    metric = go.KineticEnergy(panda)
    for seed in range(options.count):
        ends, obstacles = scene(panda, options.obstacles, np.random.default_rng(seed))
        begin = time.process_time()
        problem = go.PointToPoint(metric, *ends, limits=True, obstacles=obstacles, margin=0.01)
        stats = go.solve(problem, throw=False).stats
        print(
            f"scene {seed}: {time.process_time() - begin:.2f} s of processor time, energy "
            f"{stats.energy:.4f}, {stats.constraints} constraints; {stats.status}",
            flush=True,
        )


def scene(
    model: go.Model, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, tuple[go.Ball | go.Capsule, ...]]:
    """Two configurations with the hand above the table, and obstacles that neither touches."""
    middle, span = (model.lower + model.upper) / 2.0, model.upper - model.lower
    while True:
        ends = middle + 0.35 * span * rng.uniform(-1.0, 1.0, (2, model.dof))
        if min(model.hand_pose(q)[1][2] for q in ends) > 0.2:
            break
    obstacles: list[go.Ball | go.Capsule] = []
    while len(obstacles) < count:
        centre = rng.uniform([-0.7, -0.7, 0.1], [0.7, 0.7, 1.1])
        half = 0.12 * rng.normal(size=3)
        body: go.Ball | go.Capsule = go.Ball(tuple(centre), 0.05)
        if len(obstacles) % 2 == 0:
            body = go.Capsule(tuple(centre - half), tuple(centre + half), 0.04)
        distances = (go.distances.signed_distances(model, q, [body]).values() for q in ends)
        if all(min(each) > CLEARANCE for each in distances):
            obstacles.append(body)
    return ends, tuple(obstacles)


if __name__ == "__main__":
    main()
