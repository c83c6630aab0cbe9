"""`geodesic-ocp analyse`: the synergies of one recording or of many."""

from __future__ import annotations

import argparse
from pathlib import Path

from geodesic_ocp.cli.analyse.analysis_options import check_options
from geodesic_ocp.cli.analyse.many_options import are_many
from geodesic_ocp.cli.analyse.recording import analyse_file, check_folder, save_analysis


def analyse_files(options: argparse.Namespace) -> int:
    """`geodesic-ocp analyse`; returns the exit code."""
    check_options(options)
    check_folder(options.out)
    if are_many(options):
        from geodesic_ocp.cli.analyse.many_recordings import analyse_many

        return analyse_many(options)
    options.file = Path(options.file[0])
    save_analysis(analyse_file(options, options.side), options.out, with_curve=options.curve)
    return 0
