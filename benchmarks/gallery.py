"""Every problem of the gallery: size of the NLP, iterations, time, and how well it is solved."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import casadi as ca

import geodesic_ocp as go
from geodesic_ocp.cli.problem_file import problem_classes

GALLERY = Path(__file__).resolve().parents[1] / "problems"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tolerance", type=float, help="divide the grids until conditions hold")
    parser.add_argument("--pictures", action="store_true", help="draw those of the gallery anew")
    options = parser.parse_args()
    print("residual: largest violation of a condition at the nodes; between: anywhere on the path")
    print(
        "| problem | variables | constraints | iterations | seconds | residual | between | exact |"
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for file in sorted(GALLERY.glob("*.py")):
        for kind in problem_classes(file):
            print(row(kind, options), flush=True)


def row(kind: type[go.Problem], options: argparse.Namespace) -> str:
    try:
        problem = kind()
    except ValueError as error:
        return f"| {kind.__name__} | not solved: {error} |"
    tolerance = options.tolerance
    if problem.continuous_velocity_at_via and problem.via(ca.SX.sym("q", problem.metric.dim)):
        tolerance = None
    start = time.perf_counter()
    solution = go.solve(problem, tolerance=tolerance)
    seconds, stats = time.perf_counter() - start, solution.stats
    exact = ""
    if problem.exact_length is not None:
        exact = f"{abs(solution.path.length / problem.exact_length - 1.0):.0e}"
    if options.pictures:
        folder = GALLERY / "pictures"
        folder.mkdir(exist_ok=True)
        solution.plot().savefig(folder / f"{kind.__name__}.png", dpi=90)
    return (
        f"| {kind.__name__} | {stats.variables} | {stats.constraints} | {stats.iterations} | "
        f"{seconds:.2f} | {stats.max_node_violation:.0e} | {stats.max_path_violation:.0e} | {exact} |"
    )


if __name__ == "__main__":
    main()
