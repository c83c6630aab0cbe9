"""Robots by name or file, with the last link as the hand if none is given."""

from __future__ import annotations

from pathlib import Path

from geodesic_ocp.cli.notes import printed_warnings
from geodesic_ocp.model.formats.description import read_file
from geodesic_ocp.model.formats.load_model import last_link, load_model
from geodesic_ocp.model.formats.robots import ROBOTS, folder, locate
from geodesic_ocp.model.model import Model


def shown_robot(name: str, hand: str | None = None, base: str | None = None) -> Model:
    """The robot of a name or a file.

    Args:
        name: such as panda, or a file (URDF, MJCF, MMM/Simox).
        hand, base: frames; by default those of a known robot, or the last link of the chain of
            most joints, which is printed.

    Raises:
        ValueError: there is no such robot, file or frame, or it cannot be read.
    """
    with printed_warnings():
        if hand is None and name not in ROBOTS:
            file = Path(name) if Path(name).is_file() else locate(name)
            if file is not None:
                hand = last_link(read_file(file, None, None))
                print(f"note: {name}: the hand is {hand!r}; --hand FRAME chooses another")
        return load_model(name, hand=hand, base=base)


def is_installed(name: str) -> bool:
    """Whether it is the name of a known robot whose package is installed."""
    return name in ROBOTS and folder(ROBOTS[name].package) is not None
