"""Computing times of the package next to those of other solvers, on the same problems.

Usage: python benchmarks/run.py [--quick] [--check] [--out FOLDER] [--python INTERPRETER ...]

Writes tables in Markdown (also to results.md), plots (PNG and PDF) and all values (results.json).
Routes take turns on every pair, so that a machine that is busy for a while slows all of them. Every
result is checked by an integration that is independent of the package. `--python` names further
interpreters in which geomstats and pygeodex are looked for.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path

from comparison import maps, other_packages, plots, report
from comparison.constrained import constrained
from comparison.growth import SIZES, growth
from comparison.measurement import Measurement
from comparison.models import random_pairs
from comparison.recordings import recordings
from comparison.start_up import start_up

import geodesic_ocp as go

FRACTION = 0.8  # of the ranges of the joints from which pairs are drawn
FOLDER = Path(__file__).parent / "results"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer of everything: about a minute")
    parser.add_argument("--out", type=Path, default=FOLDER)
    parser.add_argument("--python", nargs="+", default=[], help="interpreters with other packages")
    parser.add_argument(
        "--check",
        action="store_true",
        help="fail if a geodesic is not found, or scipy is faster than the default route",
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as cache:  # compiled code of earlier runs is not used
        os.environ["GEODESIC_OCP_CACHE"] = cache
        return run(options)


def run(options: argparse.Namespace) -> int:
    """Measure, write all results, and return the exit code."""
    quick, start = options.quick, time.perf_counter()
    options.out.mkdir(parents=True, exist_ok=True)
    arm = go.human_arm()
    pairs = random_pairs(arm, FRACTION, 24 if quick else 200)

    texts = [f"# Computing times\n\n{report.machine()}"]
    records: dict[str, object] = {"machine": report.machine()}

    def add(title: str, rows: list[Measurement] | str) -> None:
        texts.append(report.table(title, rows))
        print(f"{texts[-1]}\n", flush=True)
        records[title] = rows if isinstance(rows, str) else [row.record() for row in rows]

    print(f"{texts[0]}\n")
    logs = maps.logarithmic_maps(arm, pairs)
    add(f"Logarithmic map, {arm.name}, {len(pairs)} pairs", logs)
    title = f"Logarithmic maps, {arm.name}, {len(pairs)} pairs"
    plots.save_distributions(options.out / "logarithmic_maps", logs, title)
    add(
        "Many logarithmic maps in one call",
        maps.batch(arm, random_pairs(arm, FRACTION, 4 if quick else 500, seed=1)),
    )
    add(f"Exponential map, {arm.name}", maps.exponential_maps(arm, pairs[: 2 if quick else 50]))
    add("Paths under constraints, to a tolerance of 1e-6", constrained(1 if quick else 40))
    add("Recordings", recordings(1 if quick else 5, robots=not quick))
    add("A new process", start_up(1 if quick else 5))
    if not quick:
        add("Two uniform rods", other_packages.geomstats(options.python, 20))
        add("Panda", other_packages.pygeodex(options.python, 10))
    curves = growth(SIZES[:2], 1, arms=False) if quick else growth(SIZES, 10, arms=True)
    plots.save_growth(options.out / "growth", curves)
    texts.append(report.growth_table(curves))
    print(texts[-1])
    records["growth"] = [curve.record() for curve in curves]
    texts.append(f"All of it took {time.perf_counter() - start:.0f} s.")
    print(texts[-1])
    (options.out / "results.md").write_text("\n\n".join(texts) + "\n")
    (options.out / "results.json").write_text(json.dumps(records, indent=1) + "\n")
    return int(options.check and not passes(logs))


def passes(logs: list[Measurement]) -> bool:
    """Whether the default route found every pair, and faster than scipy."""
    ours = logs[0]
    scipys = next(row for row in logs if row.name.startswith("scipy"))
    if not ours.solved.all():
        print(f"{ours.name}: {ours.solved.size - ours.solved.sum()} pairs not found")
    if scipys.ratio < 1.0:
        print(f"{scipys.name} is {1.0 / scipys.ratio:.1f} times as fast as {ours.name}")
    return bool(ours.solved.all() and scipys.ratio >= 1.0)


if __name__ == "__main__":
    sys.exit(main())
