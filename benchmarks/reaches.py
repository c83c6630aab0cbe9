"""README's reach past a lamp, and random reaches within joint limits: how many converge, their
processor times, how well limits hold between nodes; and how this compares with another version.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import geodesic_ocp as go

TOLERANCE = 1e-6  # [rad] and [m]
WARM_UP = 6  # problems that are solved before any are timed, so that libraries are compiled
MODELS = ["lamp", "human", "panda"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--models", nargs="+", default=MODELS[1:], help="lamp: README's example")
    parser.add_argument(
        "--check", action="store_true", help="fail if more than one in fifty is not found"
    )
    parser.add_argument(
        "--against", type=Path, help="a checkout of another version, which solves each in turn"
    )
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    for name in options.models:
        if options.serve:
            serve(problems(name, options.count, options.seed))
        elif options.against is not None:
            compare(name, options.count, options.seed, options.against)
        else:
            found = run(name, options.count, options.seed)
            if options.check and found < 0.98 * options.count:
                sys.exit(f"{name}: only {found} of {options.count} converged")


def problems(name: str, count: int, seed: int) -> list[go.Reach]:
    """README's reach past a lamp from starts near its own, or reaches from a random configuration
    of a model to the hand's position in another.
    """
    rng = np.random.default_rng(seed)
    if name == "lamp":
        start = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
        starts = (
            start + 0.05 * rng.normal(size=(count, start.size)) * (np.arange(count) > 0)[:, None]
        )
        lamp = go.Ball(centre=(0.20, 0.35, -0.15), radius=0.06)
        arm, cup = go.human_arm(), (0.10, 0.45, 0.10)
        return [go.Reach(arm, each, position=cup, obstacles=(lamp,)) for each in starts]
    model = go.human_arm() if name == "human" else go.load_model(name)
    ends = rng.uniform(model.lower, model.upper, (count, 2, model.dof))
    return [go.Reach(model, start, model.hand_pose(end)[1]) for start, end in ends]


def solved(reach: go.Reach) -> tuple[go.ocp.Solution, float]:
    """Return the solution, or the last iterate, and processor seconds."""
    begin = time.process_time()
    solution = go.solve(reach, tolerance=TOLERANCE, throw=False)
    return solution, time.process_time() - begin


def run(name: str, count: int, seed: int) -> int:
    """Print what is found; return how many."""
    seconds, worst = [], 0.0
    for number, reach in enumerate(problems(name, count, seed)):
        solution, taken = solved(reach)
        if not solution.stats.success:
            print(f"{name} {number}: {solution.stats.status}")
            continue
        seconds.append(taken)
        q = solution.path(np.linspace(0.0, 1.0, 2001))
        worst = max(worst, float(np.max([reach.model.lower - q, q - reach.model.upper])))
    median, most = 1e3 * np.quantile(seconds, [0.5, 0.95])
    print(
        f"{name}: {len(seconds)} of {count} converged, median {median:.0f} ms, 95 % {most:.0f} ms; "
        f"limits violated by at most {max(worst, 0.0):.1e} at 2001 points"
    )
    return len(seconds)


def serve(reaches: list[go.Reach]) -> None:
    """Solve the reaches whose numbers are read, and print seconds and objectives."""
    for line in sys.stdin:
        solution, taken = solved(reaches[int(line)])
        objective = solution.stats.objective if solution.stats.success else np.nan
        print(json.dumps([taken, objective]), flush=True)


def compare(name: str, count: int, seed: int, other: Path) -> None:
    """Print how times and objectives differ from another version's: each problem in turn, and all
    once more, when programs of all sizes have been built.
    """
    options = ["--serve", "--models", name, "--count", str(count), "--seed", str(seed)]
    checkouts = [each.absolute() for each in (other, Path(__file__).parents[1])]
    servers = [
        subprocess.Popen(
            [sys.executable, __file__, *options],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": str(checkout / "src")},
        )
        for checkout in checkouts
    ]

    def answers(number: int) -> list[list[float]]:
        lines = []
        for server in servers:
            assert server.stdin is not None
            assert server.stdout is not None
            print(number, file=server.stdin, flush=True)
            lines.append(json.loads(server.stdout.readline()))
        return lines

    for number in [*range(min(count, WARM_UP))] * 3:
        answers(number)
    time.sleep(10.0)  # for the system's compiler
    for word in ("at first", "again"):
        every = np.array([answers(number) for number in range(count)])
        before, now = every[:, :, 0].T
        old, new = every[:, :, 1].T
        changes = [f"{each:+.2%}" for each in new / old - 1.0 if abs(each) > 1e-5]
        print(
            f"{name}, {word}: median {1e3 * np.median(before):.0f} and {1e3 * np.median(now):.0f} "
            f"ms, median of ratios {np.median(before / now):.2f}, ratio of sums "
            f"{before.sum() / now.sum():.2f}; solved {np.isfinite(old).sum()} and "
            f"{np.isfinite(new).sum()} of {count}; objectives that differ: {changes or 'none'}"
        )
    for server in servers:
        server.terminate()


if __name__ == "__main__":
    main()
