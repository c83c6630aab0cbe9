"""`geodesic-ocp analyse`: the synergies of one recording or of many."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import get_args

from geodesic_ocp.cli.analyse.analysis_options import check_options
from geodesic_ocp.cli.analyse.many_options import are_many
from geodesic_ocp.cli.analyse.recording import analyse_file, check_folder, save_analysis
from geodesic_ocp.model.anthropometry import Side


def analyse_files(options: argparse.Namespace) -> int:
    """`geodesic-ocp analyse`; returns the exit code."""
    check_options(options)
    check_folder(options.out)
    if are_many(options):
        from geodesic_ocp.cli.analyse.many_recordings import analyse_many

        return analyse_many(options)
    options.file = Path(options.file[0])
    if options.side != "both":
        save_analysis(analyse_file(options, options.side), options.out, with_curve=options.curve)
        _tell_how_to_see(options, options.out)
        return 0
    folder = options.out
    for side in get_args(Side):
        options.out = None if folder is None else folder / side
        save_analysis(analyse_file(options, side), options.out, with_curve=options.curve)
        print()
    _tell_how_to_see(options, folder)
    return 0


def _tell_how_to_see(options: argparse.Namespace, folder: Path | None) -> None:
    recording = f"{shlex.quote(str(options.file))} --side {options.side}"
    if folder is None:
        shown = f"{recording} --analyse"
    else:
        shown = shlex.quote(str(folder)) + (f" {recording}" if options.side != "both" else "")
    print(f"\nto see it in motion: geodesic-ocp show {shown}")
