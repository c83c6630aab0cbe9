"""Options of `geodesic-ocp retarget` and `geodesic-ocp demo`."""

from __future__ import annotations

import argparse
from typing import get_args

from geodesic_ocp.cli.analyse.analysis_options import add_analysis_options
from geodesic_ocp.cli.analyse.recording_options import add_recording
from geodesic_ocp.cli.trajectory.limit_options import add_limit_options
from geodesic_ocp.retargeting.settings import Formulation

_SWITCHES = (
    ("--limits", "keep within the joints' limits (position, speed, acceleration, jerk, torque)"),
    ("--rest", "begin and end at rest"),
    ("--self-collision", "keep the robot's links apart where their geometry is known"),
    ("--rotor-inertia", "add known or default inertia of the motors where the file states none"),
)


def add_retarget_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `geodesic-ocp retarget`."""
    add_recording(command, ("right", "left", "both"))
    command.add_argument(
        "--robot",
        action="append",
        required=True,
        metavar="NAME",
        help="such as panda (see geodesic-ocp models), or a file (URDF, MJCF); twice with "
        "--side both, right and left",
    )
    add_transfer_options(command)
    command.add_argument(
        "--report",
        action="store_true",
        help="write a page with animated models (default folder: geodesic_ocp_retarget)",
    )
    add_analysis_options(command)


def add_demo_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `geodesic-ocp demo`."""
    command.add_argument("--robot", metavar="NAME", help="also transfer it to this robot")
    add_transfer_options(command)
    add_analysis_options(command)


def add_transfer_options(command: argparse.ArgumentParser) -> None:
    """Add the options of the transfer to a robot, which both have in common."""
    for option, metavar, text in (
        ("--hand", "FRAME", "hand (end-effector) frame of the robot"),
        ("--base", "FRAME", "fixed frame of the robot that becomes its base"),
        ("--alignment", "FILE", "of the robot with the person, as written by geodesic-ocp align"),
    ):
        command.add_argument(
            option, action="append", metavar=metavar, help=f"{text}; one for each --robot"
        )
    command.add_argument(
        "--rate",
        type=float,
        default=100.0,
        metavar="HZ",
        help="of the trajectory; 1000 for libfranka (default: %(default)g)",
    )
    for option, text in _SWITCHES:
        command.add_argument(option, action=argparse.BooleanOptionalAction, default=True, help=text)
    command.add_argument(
        "--likeness",
        type=float,
        default=30.0,
        metavar="WEIGHT",
        help="of the elbow's likeness to the person's (default: %(default)g)",
    )
    command.add_argument(
        "--posture",
        type=float,
        default=0.0,
        metavar="WEIGHT",
        help="of joints near the middle of their ranges (default: %(default)g)",
    )
    add_limit_options(command)
    command.add_argument(
        "--payload", type=float, metavar="KG", help="mass in the hand, at the origin of its frame"
    )
    command.add_argument(
        "--margin",
        type=float,
        default=0.01,
        metavar="M",
        help="smallest distance of links from each other [m] (default: %(default)g)",
    )
    command.add_argument(
        "--near-misses",
        type=float,
        default=0.0,
        metavar="ERROR",
        help="by which a pose may be missed to avoid a detour [m and rad], as 0.04 (default: 0)",
    )
    command.add_argument(
        "--scale", type=float, help="factor of positions (default: the ratio of the arms' lengths)"
    )
    command.add_argument(
        "--position-only", action="store_true", help="leave the hand's orientation free"
    )
    command.add_argument(
        "--formulation",
        choices=get_args(Formulation),
        default="constrained",
        help="all synergies at once, least energy to exact poses, or free geodesics one by one "
        "(default: %(default)s)",
    )
    command.add_argument(
        "--num-starts",
        type=int,
        default=1,
        help="with --formulation geodesic, geodesics sought for each synergy (default: 1)",
    )
