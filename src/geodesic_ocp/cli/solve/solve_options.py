"""Options of `geodesic-ocp solve`."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_solve_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `geodesic-ocp solve`."""
    command.add_argument("file", type=Path, help="such as problems/great_circle.py; it is run")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="FIELD=VALUE",
        help='a Python literal, as in --set radius=0.4 --set "goal=(1, 2)"',
    )
    command.add_argument("--problem", metavar="CLASS", help="one of several in the file")
    command.add_argument(
        "--tolerance",
        type=float,
        help="refine the grid until the conditions hold to this everywhere",
    )
    command.add_argument("--out", type=Path, help="folder for figures and solutions (JSON)")
