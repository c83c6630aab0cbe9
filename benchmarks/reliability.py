"""Random wide pairs on ten models: how many geodesics are right, wrong or not found.

Usage: python benchmarks/reliability.py [--count N] [--fraction F] [--models NAME ...] [--out FILE]

Pairs are drawn from the middle 80 % of every joint's range, or the fraction given, within one
revolution. Each result is
integrated by scipy with Pinocchio's forward dynamics, which share nothing with the package; it is
wrong if it ends 1e-7 or more from its goal in any coordinate. Pairs without a right result go to a
JSON file. Robots are those whose descriptions are installed (make robots).
"""

from __future__ import annotations

import argparse
import json
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from comparison.models import TEN_MODELS, is_robot_missing, random_pairs
from comparison.pinocchio_aba import ForwardDynamics

import geodesic_ocp as go

RIGHT = 1e-7  # [rad or m]


@dataclass(frozen=True)
class Unsolved:
    """A pair whose result is wrong or missing, and what the package said about it."""

    model: str
    index: int
    q0: list[float]
    q1: list[float]
    endpoint_error: float | None
    message: str
    seconds: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100, help="pairs for each model")
    parser.add_argument("--fraction", type=float, default=0.8, help="of the joints' ranges")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--models", nargs="+", choices=TEN_MODELS, default=list(TEN_MODELS))
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    print("| model | right | wrong | not found | median | 90 % | worst | longest failure |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    unsolved: list[Unsolved] = []
    for name in options.models:
        if is_robot_missing(name):
            print(f"| {name} | not installed |")
            continue
        unsolved += examine(name, options)
        records = [asdict(each) for each in unsolved]
        (options.out / "unsolved.json").write_text(json.dumps(records, indent=1) + "\n")


def examine(name: str, options: argparse.Namespace) -> list[Unsolved]:
    """Print the line of one model; the pairs that have no right result."""
    count = options.count
    model = TEN_MODELS[name]()
    metric, dynamics = go.KineticEnergy(model), ForwardDynamics(model)
    pairs = random_pairs(model, options.fraction, count, options.seed)
    times, unsolved = [], []
    warm_up(metric, pairs[0])
    for index, (q0, q1) in enumerate(pairs):
        start, error, message = time.perf_counter(), None, ""
        try:
            velocity = go.log(metric, q0, q1)
        except go.NotConverged as failure:
            message = str(failure)
        seconds = time.perf_counter() - start
        times.append(seconds)
        if not message:
            error = dynamics.endpoint_error(q0, velocity, q1)
        if error is None or error >= RIGHT:
            ends = q0.tolist(), q1.tolist()
            unsolved.append(Unsolved(name, index, *ends, error, message, seconds))
    missing = [each for each in unsolved if each.endpoint_error is None]
    milliseconds = 1e3 * np.array(times)
    statistics = (np.median(milliseconds), np.percentile(milliseconds, 90.0), milliseconds.max())
    print(
        f"| {name} | {count - len(unsolved)} | {len(unsolved) - len(missing)} | {len(missing)} | "
        + " | ".join(f"{value:.3g} ms" for value in statistics)
        + f" | {1e3 * max((each.seconds for each in missing), default=0.0):.0f} ms |",
        flush=True,
    )
    return unsolved


def warm_up(metric: go.Metric, pair: np.ndarray) -> None:
    """Build the functions of a metric."""
    with suppress(go.NotConverged):
        go.log(metric, *pair)


if __name__ == "__main__":
    main()
