"""Options of `geodesic-ocp fit`."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import get_args

from geodesic_ocp.cli.analyse.recording_options import RECORDING_FILE, add_format
from geodesic_ocp.fitting.parameter import JOINT_INERTIA, Parameter
from geodesic_ocp.fitting.recording_part import Measure

_DEFAULTS = {
    "joint_inertia": JOINT_INERTIA,
    "armature": Parameter("armature", 0.05, lower=1e-5),
    "payload": Parameter("payload", 0.5),
    "mass_ratio": Parameter("mass_ratio", 1.0, lower=1e-2, upper=1e2),
    "height_ratio": Parameter("height_ratio", 1.0, lower=0.3, upper=3.0),
    "link_mass_ratios": Parameter("link_mass_ratios", 1.0, lower=1e-2, upper=1e2),
    "link_inertia_ratios": Parameter("link_inertia_ratios", 1.0, lower=1e-2, upper=1e2),
}


def add_fit_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `geodesic-ocp fit`."""
    command.add_argument(
        "file", type=Path, nargs="+", help=f"{RECORDING_FILE}; files or folders of them"
    )
    command.add_argument(
        "--side", choices=("right", "left", "both"), default="right", help="the arm"
    )
    command.add_argument("--height", type=float, help="of all persons [m]; default: as recorded")
    command.add_argument("--mass", type=float, help="of all persons [kg]; default: as recorded")
    add_format(command)
    command.add_argument(
        "--skip", action="store_true", help="leave out files that cannot be used, and name them"
    )
    command.add_argument(
        "--parameter",
        action="append",
        metavar="NAME[:JOINT,...][=START]",
        help=f"{', '.join(_DEFAULTS)}; of some joints only with patterns, as in"
        ' "armature:?S?_joint" for the shoulder; with an initial value after =;'
        " may be repeated (default: joint_inertia)",
    )
    command.add_argument(
        "--measure",
        choices=get_args(Measure),
        default="joint",
        help="errors of the joints [rad] or of the hand's position [m] (default: %(default)s)",
    )
    command.add_argument(
        "--threshold",
        type=float,
        default=0.6,
        metavar="RAD",
        help="of the cuts, which are made with the initial values [rad] (default: %(default)s)",
    )
    for name, unit, text in (
        ("min-duration", "SECONDS", "the shortest segment that is not a rest [s]"),
        ("hysteresis", "RAD", "angle above the threshold that a turn must reach [rad]"),
    ):
        command.add_argument(
            f"--{name}",
            type=float,
            default=0.1,
            metavar=unit,
            help=f"{text} (default: %(default)s)",
        )
    command.add_argument(
        "--penalty",
        type=float,
        help="cut where the error becomes least instead, with this mean joint error [rad] for each"
        " segment",
    )
    chosen = command.add_mutually_exclusive_group()
    chosen.add_argument(
        "--cutoff", type=float, metavar="HZ", help="cut-off frequency of the filter [Hz]"
    )
    chosen.add_argument(
        "--savitzky-golay",
        type=float,
        metavar="SECONDS",
        help="window of a Savitzky-Golay filter of order 2 [s]",
    )
    command.add_argument(
        "--by",
        choices=("recording", "subject"),
        help="what is resampled and left out (default: subjects where there are several)",
    )
    command.add_argument(
        "--bootstrap",
        type=int,
        default=1000,
        metavar="COUNT",
        help="resamples for the confidence interval; 0 for none (default: %(default)s)",
    )
    command.add_argument(
        "--leave-one-out",
        action="store_true",
        help="predict each recording, or subject (see --by), from the others",
    )
    command.add_argument("--out", type=Path, help="folder for metric.json, tables and figure")


def as_parameter(text: str) -> Parameter:
    """The parameter that NAME[:JOINT,...][=START] means, with its usual bounds.

    Raises:
        ValueError: there is no such parameter, or its initial value is not a number.
    """
    label, _, initial = text.partition("=")
    name, _, joints = label.partition(":")
    if name not in _DEFAULTS:
        raise ValueError(f"--parameter must be one of {', '.join(_DEFAULTS)}, got {name!r}")
    usual = _DEFAULTS[name]
    try:
        start = float(initial) if initial else usual.start
    except ValueError:
        raise ValueError(f"--parameter {text}: {initial!r} is not a number") from None
    chosen = tuple(filter(None, joints.split(",")))
    return replace(usual, start=start, joints=chosen, name=label)
