"""Options of `geodesic-ocp study`."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_study_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `geodesic-ocp study`."""
    command.add_argument(
        "source",
        type=Path,
        nargs="+",
        metavar="DIR",
        help="output folder of geodesic-ocp analyse, or its tables (recordings.csv, synergies.csv)",
    )
    command.add_argument(
        "--measure",
        default="joint",
        help="what is tested: joint, position or orientation (errors), these with _unfiltered, "
        "segments or segments_per_second (default: %(default)s)",
    )
    command.add_argument(
        "--against",
        metavar="METHOD",
        help="method, or condition of --by, with which the others are compared (default: straight "
        "lines on the same segments)",
    )
    command.add_argument(
        "--by",
        metavar="COLUMN",
        help="column whose values are conditions, such as condition, trial or side",
    )
    command.add_argument(
        "--metadata",
        type=Path,
        metavar="FILE",
        help="CSV with the column file and others, such as condition, for --by",
    )
    command.add_argument("--out", type=Path, help="folder for tables and figures")
