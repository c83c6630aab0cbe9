"""Options for limits of robots' joints."""

from __future__ import annotations

import argparse

_LIMITS = {
    "velocity": "rad/s or m/s",
    "acceleration": "rad/s^2 or m/s^2",
    "jerk": "rad/s^3 or m/s^3",
    "torque": "N m or N",
}


def add_limit_options(command: argparse.ArgumentParser) -> None:
    """Add --velocity, --acceleration, --jerk and --torque."""
    for name, unit in _LIMITS.items():
        command.add_argument(
            f"--{name}",
            action="append",
            metavar="LIMIT",
            help=f"largest {name} [{unit}] of all joints, or JOINT=LIMIT for one; repeatable; "
            "default: as in the file, published, or derived",
        )
