"""Options of `geodesic-ocp align`."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_align_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `geodesic-ocp align`."""
    command.add_argument("robot", metavar="ROBOT", help="name, or URDF, MJCF or MMM file")
    command.add_argument("--hand", metavar="FRAME", help="hand (end-effector) frame")
    command.add_argument("--base", metavar="FRAME", help="fixed frame that becomes the base")
    command.add_argument(
        "--side", choices=("right", "left"), help="of the body; default: where the shoulder is"
    )
    command.add_argument(
        "--alignment", type=Path, metavar="FILE", help="show this one, as edited, instead"
    )
    command.add_argument(
        "--out", type=Path, metavar="FILE", help="write a file to edit (.json), and a figure (.png)"
    )
