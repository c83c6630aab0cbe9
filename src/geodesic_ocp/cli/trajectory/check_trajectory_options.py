"""Options of `geodesic-ocp check-trajectory`."""

from __future__ import annotations

import argparse
from pathlib import Path

from geodesic_ocp.cli.trajectory.limit_options import add_limit_options


def add_check_trajectory_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `check-trajectory`."""
    command.add_argument("file", type=Path, help="trajectory (.csv, .json of ROS 2, or .npz)")
    command.add_argument(
        "--robot",
        action="append",
        required=True,
        metavar="NAME",
        help="name (see geodesic-ocp models) or file; twice for two arms, in their order",
    )
    command.add_argument("--hand", metavar="FRAME", help="hand frame, for a robot from a file")
    command.add_argument(
        "--base", metavar="FRAME", help="fixed frame of the robot that becomes its base"
    )
    command.add_argument(
        "--alignment",
        action="append",
        metavar="FILE",
        help="of the robot with a person, as written by geodesic-ocp align: gravity is along the "
        "person's body; one for each --robot",
    )
    command.add_argument(
        "--rotor-inertia",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="add known or default inertia of the motors where the file states none, as retarget "
        "does",
    )
    add_limit_options(command)
    command.add_argument(
        "--payload", type=float, metavar="KG", help="mass in the hand, at the origin of its frame"
    )
    command.add_argument(
        "--gravity",
        type=float,
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="acceleration of free fall in the axes of the robot's base (default: 0 0 -9.81)",
    )
    command.add_argument(
        "--aligned",
        action="store_true",
        help="gravity as for a robot that is mounted by its alignment, as by geodesic-ocp retarget",
    )
    command.add_argument(
        "--clearance",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="whether links keep clear of each other, where the robot's geometry is known",
    )
    command.add_argument("--moving", action="store_true", help="it need not begin and end at rest")
    command.add_argument(
        "--uneven", action="store_true", help="samples need not be evenly spaced in time"
    )
