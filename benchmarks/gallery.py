"""Every problem of the gallery: size of its NLP, iterations, time and accuracy."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import geodesic_ocp as go
from geodesic_ocp.cli.solve import problem_classes

GALLERY = Path(__file__).resolve().parents[1] / "problems"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--tolerance", type=float, help="refine the grids until the conditions hold to this"
    )
    parser.add_argument(
        "--pictures", action="store_true", help="redraw the pictures of the gallery"
    )
    options = parser.parse_args()
    print(
        "Largest constraint violation at the nodes and anywhere on the path; relative error of the"
    )
    print("length where it is known in closed form.\n")
    print(
        "| problem | variables | constraints | iterations | time [s] | violation at nodes "
        "| on the path | length error |"
    )
    print("| --- " + "| ---: " * 7 + "|")
    for file in sorted(GALLERY.glob("*.py")):
        for problem_class in problem_classes(file):
            of_kind = row if issubclass(problem_class, go.Problem) else motion_row
            print(of_kind(problem_class, options), flush=True)


def motion_row(problem_class: type[go.MotionProblem], options: argparse.Namespace) -> str:
    start = time.perf_counter()
    motion = go.solve(problem_class())
    seconds = time.perf_counter() - start
    if options.pictures:
        picture = GALLERY / "pictures" / f"{problem_class.__name__}.png"
        go.plot(motion).savefig(picture, dpi=110)
    stats = motion.stats
    shown = problem_class.__name__, stats.variables, "", stats.total_iterations, f"{seconds:.2f}"
    return f"| {' | '.join(map(str, shown))} | | {stats.max_path_violation:.0e} | |"


def row(problem_class: type[go.Problem], options: argparse.Namespace) -> str:
    name = problem_class.__name__
    try:
        problem = problem_class()
    except ValueError as error:
        return f"| {name} | not solved: {error} |"
    start = time.perf_counter()
    solution = go.solve(problem, tolerance=options.tolerance)
    seconds, stats = time.perf_counter() - start, solution.stats
    length_error = ""
    if problem.exact_length is not None:
        length_error = f"{abs(solution.path.length / problem.exact_length - 1.0):.0e}"
    if options.pictures:
        folder = GALLERY / "pictures"
        folder.mkdir(exist_ok=True)
        go.plot(solution).savefig(folder / f"{name}.png", dpi=90)
    return (
        f"| {name} | {stats.variables} | {stats.constraints} | {stats.iterations} | "
        f"{seconds:.2f} | {stats.max_node_violation:.0e} | {stats.max_path_violation:.0e} "
        f"| {length_error} |"
    )


if __name__ == "__main__":
    main()
