"""Options of the command line for a recording: its file, the arm, the person, and its format."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

RECORDING_FILE = "recording: MMM, AMC, BVH, OpenSim, c3d, SMPL .npz, or a table (.csv)"


def add_recording(command: argparse.ArgumentParser, sides: Sequence[str]) -> None:
    """Add the file of a recording, and what `add_person` adds."""
    command.add_argument("file", type=Path, help=RECORDING_FILE)
    add_person(command, sides)


def add_person(command: argparse.ArgumentParser, sides: Sequence[str]) -> None:
    """Add the arm, the person, and what the format of a file does not say."""
    command.add_argument("--side", choices=sides, default="right", help="which arm")
    command.add_argument(
        "--height", type=float, help="height of the person [m]; default: the recording's"
    )
    command.add_argument(
        "--mass", type=float, help="body mass of the person [kg]; default: the recording's"
    )
    command.add_argument(
        "--resample",
        type=float,
        metavar="HZ",
        help="interpolate at this rate first, for samples that are not evenly spaced",
    )
    command.add_argument(
        "--convention",
        metavar="NAME",
        help="of joint angles (.mot, .sto) or of skeletons (.amc, .bvh, .npz): a name or a file; "
        "default: the known one that fits",
    )
    command.add_argument(
        "--unit",
        type=_unit,
        metavar="UNIT",
        help="of lengths in .bvh and .amc files: m, cm, mm, in, or a number of metres",
    )
    command.add_argument(
        "--amc-rate", type=float, metavar="HZ", help="sampling rate of .amc files (default: 120)"
    )


def _unit(text: str) -> str | float:
    try:
        return float(text)
    except ValueError:
        return text
