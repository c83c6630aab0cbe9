"""`geodesic-ocp demo`: the bundled recording, analysed and transferred to a robot."""

from __future__ import annotations

import argparse
from pathlib import Path

from geodesic_ocp.cli.analyse.analysis_options import check_options
from geodesic_ocp.cli.analyse.recording import analyse_bundled, check_folder, save_analysis


def run_demo(options: argparse.Namespace) -> None:
    """`geodesic-ocp demo`."""
    options.out = options.out or Path("geodesic_ocp_demo")
    check_options(options)
    check_folder(options.out)
    if options.robot is not None:
        from geodesic_ocp.cli.retarget.retarget_command import demo_on_robot

        demo_on_robot(options)
        return
    save_analysis(analyse_bundled(options), options.out, with_curve=True)
