"""Options of the command line for a recording: its file, the arm, the person, and its format."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

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
    add_format(command)


def add_format(command: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """Add what the formats of some files leave open."""
    command.add_argument(
        "--convention",
        metavar="NAME",
        help="of joint angles (.mot, .sto): a name, a file, or the model (.osim); of skeletons "
        "(.amc, .bvh, .npz): a file; default: the known one that fits",
    )
    command.add_argument(
        "--unit",
        type=_unit,
        metavar="UNIT",
        help="of lengths in .bvh and .amc files: m, cm, mm, in, or a number of metres",
    )
    command.add_argument(
        "--skeleton",
        type=Path,
        metavar="FILE",
        help="of .amc files (.asf; default: the one beside each)",
    )
    command.add_argument(
        "--up",
        metavar="AXIS",
        help="axis that points upwards in files of markers, such as z or y; written --up=-y if it "
        "is a negative one",
    )
    command.add_argument(
        "--marker-set",
        type=Path,
        metavar="FILE",
        help="where the markers are (.json, .toml; default: the known set that fits)",
    )
    command.add_argument(
        "--amc-rate", type=float, metavar="HZ", help="sampling rate of .amc files (default: 120)"
    )


def stated(options: argparse.Namespace) -> dict[str, Any]:
    """The arguments of `read_recording` that `add_format` adds as options."""
    files = {name: getattr(options, name, None) for name in ("skeleton", "marker_set")}
    return {
        "convention": getattr(options, "convention", None),
        "unit": getattr(options, "unit", None),
        "rate": getattr(options, "amc_rate", None),
        **{name: None if file is None else str(file) for name, file in files.items()},
        "up": getattr(options, "up", None),
    }


def _unit(text: str) -> str | float:
    try:
        return float(text)
    except ValueError:
        return text
