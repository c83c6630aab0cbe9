"""`geodesic-ocp solve`: problems of a Python file, solved and plotted."""

from __future__ import annotations

import argparse
import inspect
import shlex

from geodesic_ocp.cli.analyse.recording import check_folder
from geodesic_ocp.cli.solve.problem_file import problem_classes, solution_table, with_fields
from geodesic_ocp.ocp.solve import solve


def solve_file(options: argparse.Namespace) -> None:
    """`geodesic-ocp solve`."""
    check_folder(options.out)
    classes = problem_classes(options.file)
    if options.problem is not None:
        by_name = {each.__name__: each for each in classes}
        if options.problem not in by_name:
            known = ", ".join(by_name)
            raise ValueError(f"{options.file} has no {options.problem}; it has {known}")
        classes = [by_name[options.problem]]
    settings = {}
    for each in options.set:
        name, equals, value = each.partition("=")
        if not equals:
            raise ValueError(f"--set {each}: must be FIELD=VALUE")
        settings[name.strip()] = value.strip()
    written: list[str] = []
    for problem in [with_fields(each, settings) for each in classes]:
        name = type(problem).__name__
        solution = solve(problem, tolerance=options.tolerance)
        summary = (inspect.getdoc(problem) or "").partition("\n")[0]
        print(f"{name}: {summary}\n\n{solution_table(solution)}\n\n{solution.certificate}")
        if options.out is not None:
            options.out.mkdir(parents=True, exist_ok=True)
            stem = options.out / name
            solution.plot().savefig(stem.with_suffix(".png"), dpi=110)
            solution.save(stem.with_suffix(".json"))
            print(f"\nwrote {stem}.png\nwrote {stem}.json")
            written.append(f"{stem}.json")
    if written:
        shown = f"{shlex.join(written)} --problem {shlex.quote(str(options.file))}"
        print(f"\nto see it in motion: geodesic-ocp show {shown}")
