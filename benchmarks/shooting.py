"""Geodesics to poses from zero velocity: the NLP in q'(0) against the paper's gradient descent."""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np

import geodesic_ocp as go
from geodesic_ocp.logarithm.geodesic_to_pose import Method

REACHED = 1e-6  # [m] and [rad]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--robots", nargs="+", default=["human", "panda", "armar6-right"])
    parser.add_argument("--sizes", nargs="+", type=float, default=[0.2, 0.5])
    options = parser.parse_args()
    print(
        "| robot | joint displacement [rad] | method | reached | iterations | most | energy "
        "| time [s] |"
    )
    print("| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: |")
    for name in options.robots:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model = go.human_arm() if name == "human" else go.load_model(name)
        for size in options.sizes:
            _compare(name, model, size, options.count, options.seed)


def _compare(name: str, model: go.Model, size: float, count: int, seed: int) -> None:
    """Print lines of the table: medians over the poses that both methods reached."""
    rng = np.random.default_rng(seed)
    methods: tuple[Method, ...] = ("newton", "transport")
    found: dict[Method, list[tuple[bool, int, float, float]]] = {method: [] for method in methods}
    for _ in range(count):
        half_range = np.minimum(model.upper - model.lower, np.pi) / 2.0
        middle = (model.upper + model.lower) / 2.0
        start = middle + 0.7 * half_range * rng.uniform(-1.0, 1.0, model.dof)
        rotation, position = model.hand_pose(start + size * rng.normal(size=model.dof))
        for method in methods:
            begin = time.perf_counter()
            try:
                to = go.logarithm.geodesic_to_pose(
                    model, start, position, rotation, method=method, throw=False
                )
                reached = to.success and max(to.position_error, to.rotation_error) <= REACHED
                record = (reached, to.iterations, to.energy)
            except go.GeodesicOcpError:
                record = (False, 0, np.nan)
            found[method].append((*record, time.perf_counter() - begin))
    both = np.all([[each[0] for each in found[method]] for method in methods], axis=0)
    for method in methods:
        table = np.array(found[method], dtype=float)
        _, iterations, energy, seconds = table[both].T
        print(
            f"| {name} | {size:g} | {method} | {int(table[:, 0].sum())} of {count} "
            f"| {np.median(iterations):.0f} | {iterations.max():.0f} | {energy.mean():.4g} "
            f"| {np.median(seconds):.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
