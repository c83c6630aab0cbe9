"""Options of `geodesic-ocp show`."""

from __future__ import annotations

import argparse
from pathlib import Path

from geodesic_ocp.cli.analyse.recording_options import add_format

SHOWN = (
    "recordings of joint angles, skeletons or markers; folders that analyse, retarget or solve "
    "wrote; synergies, trajectories, solutions and alignments; problems (.py), which are solved; "
    "and robots (a file or a name)"
)


def add_show_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `geodesic-ocp show`."""
    command.add_argument(
        "file",
        nargs="+",
        metavar="FILE",
        help="what to show; several are shown side by side. Synergies and the recording from which "
        "they are, given together, are shown in one pane",
    )
    command.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="write a page (.html), a video (.mp4), an animation (.gif, .webp) or a picture (.png) "
        "in place of opening a browser",
    )
    command.add_argument("--title", default="", help="of the page")
    command.add_argument(
        "--layers",
        metavar="NAME[,NAME...]",
        help="what is shown, in a page at first, such as 'hand path,mobility ellipsoids'; a "
        "name that does not exist lists those that do (default: most of them)",
    )

    group = command.add_argument_group("recordings")
    group.add_argument(
        "--side",
        choices=("right", "left", "both"),
        help="which arm (default: the right one, or the left one if there is no other)",
    )
    group.add_argument(
        "--height", type=float, help="height of the person [m]; default: the recording's"
    )
    group.add_argument(
        "--mass", type=float, help="body mass of the person [kg]; default: the recording's"
    )
    group.add_argument(
        "--analyse",
        action="store_true",
        help="cut each recording into synergies first, as geodesic-ocp analyse does by default, "
        "and show what they predict",
    )
    add_format(group)

    group = command.add_argument_group("robots, trajectories, alignments and solutions")
    group.add_argument(
        "--robot",
        action="append",
        metavar="NAME",
        help="of a trajectory or an alignment: a name (see geodesic-ocp models) or a file (URDF, "
        "MJCF); twice for two arms, in the order of the trajectory",
    )
    group.add_argument(
        "--hand", metavar="FRAME", help="hand (end-effector) frame of robots (default: the last)"
    )
    group.add_argument("--base", metavar="FRAME", help="fixed frame of robots that is their base")
    group.add_argument(
        "--problem", type=Path, metavar="FILE", help="Python file of the problem of a solution"
    )

    group = command.add_argument_group("videos, animations and pictures")
    group.add_argument("--width", type=int, metavar="PIXELS", help="of the picture")
    group.add_argument(
        "--at",
        type=float,
        metavar="S",
        help="time [s], or path parameter, of a picture (.png); default: the middle",
    )
    group.add_argument("--rate", type=float, metavar="HZ", help="pictures per second")
    group.add_argument("--speed", type=float, metavar="FACTOR", help="1 is as fast as it was")
