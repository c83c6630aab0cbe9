"""Problems of a file, solved and plotted."""

from __future__ import annotations

import argparse
import inspect

from geodesic_ocp.cli.problem_file import figures, problem_classes, with_fields
from geodesic_ocp.cli.recording import check_folder
from geodesic_ocp.ocp.solve.solve import solve


def solve_file(options: argparse.Namespace) -> None:
    """`geodesic-ocp solve`."""
    check_folder(options.out)
    kinds = problem_classes(options.file)
    if options.problem is not None:
        names = [kind.__name__ for kind in kinds]
        if options.problem not in names:
            raise ValueError(f"{options.file} has no {options.problem}; it has {', '.join(names)}")
        kinds = [kinds[names.index(options.problem)]]
    settings = {}
    for each in options.set:
        name, equals, value = each.partition("=")
        if not equals:
            raise ValueError(f"--set {each}: it must be FIELD=VALUE")
        settings[name.strip()] = value.strip()
    for problem in [with_fields(kind, settings) for kind in kinds]:
        kind = type(problem)
        solution = solve(problem, tolerance=options.tolerance)
        about = (inspect.getdoc(kind) or "").partition("\n")[0]
        print(f"{kind.__name__}: {about}\n\n{figures(solution)}\n\n{solution.certificate}")
        if options.out is not None:
            options.out.mkdir(parents=True, exist_ok=True)
            stem = options.out / kind.__name__
            solution.plot().savefig(stem.with_suffix(".png"), dpi=110)
            solution.save(stem.with_suffix(".json"))
            print(f"\nwrote {stem}.png\nwrote {stem}.json")
