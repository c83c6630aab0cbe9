"""Options of `geodesic-ocp analyse`."""

from __future__ import annotations

import argparse

from geodesic_ocp.cli.analyse.analysis_options import add_analysis_options
from geodesic_ocp.cli.analyse.many_options import add_many_options
from geodesic_ocp.cli.analyse.recording_options import RECORDING_FILE, add_person
from geodesic_ocp.recordings.recording_files import SUFFIXES


def add_analyse_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `geodesic-ocp analyse`."""
    command.add_argument(
        "file",
        nargs="+",
        help=f"{RECORDING_FILE}; several, a folder (of whose files those are taken "
        f"that end in {', '.join(SUFFIXES)}), or a pattern in quotes for many",
    )
    add_person(command, ("right", "left", "both"))
    command.add_argument(
        "--curve",
        action="store_true",
        help="also compare metrics at equal numbers of synergies, each with its best cuts",
    )
    add_analysis_options(command)
    add_many_options(command)
