"""Robots that installed packages describe: where their files are, by name."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

INSTALL = "pip install armar example-robot-data robot_descriptions"
_EXAMPLE, _ARMAR = "example-robot-data", "armar"
_ON_DEMAND = "robot_descriptions"


@dataclass(frozen=True)
class Robot:
    """A robot's arm in a package's file.

    Attributes:
        package: that describes it.
        file: below the package's folder of robots.
        hand: frame in the grip, where the file has one, otherwise the last link.
        base: link that stands still; the joints before it are locked.
    """

    package: str
    file: str
    hand: str
    base: str


ROBOTS = {
    "panda": Robot(_EXAMPLE, "panda_description/urdf/panda.urdf", "panda_hand_tcp", "panda_link0"),
    "talos-left-arm": Robot(
        _EXAMPLE, "talos_data/robots/talos_reduced.urdf", "gripper_left_base_link", "torso_2_link"
    ),
    "talos-right-arm": Robot(
        _EXAMPLE, "talos_data/robots/talos_reduced.urdf", "gripper_right_base_link", "torso_2_link"
    ),
    "tiago-pro-left-arm": Robot(
        _EXAMPLE,
        "tiago_pro_description/robots/tiago_pro.urdf",
        "gripper_left_base_link",
        "torso_lift_link",
    ),
    "tiago-pro-right-arm": Robot(
        _EXAMPLE,
        "tiago_pro_description/robots/tiago_pro.urdf",
        "gripper_right_base_link",
        "torso_lift_link",
    ),
    "xarm7": Robot(_EXAMPLE, "xarm_description/urdf/xarm7.urdf", "link_eef", "link_base"),
    "ur5": Robot(_EXAMPLE, "ur_description/urdf/ur5_robot.urdf", "tool0", "base_link"),
    # r0 is the left arm: the torso's y axis points forward, as its head's centre of mass shows.
    "armar6-left": Robot(_ARMAR, "armar6.urdf", "hand_fixed_r0", "torso"),
    "armar6-right": Robot(_ARMAR, "armar6.urdf", "hand_fixed_r1", "torso"),
}


def folder(package: str) -> Path | None:
    """Where an installed package keeps its robots; None where it is not installed."""
    if package == _ARMAR:
        spec = importlib.util.find_spec(_ARMAR)
        places = list(spec.submodule_search_locations or ()) if spec is not None else []
        candidates = [Path(place) / "description" / "urdf" for place in places]
    else:
        below = Path("share") / _EXAMPLE / "robots"
        candidates = [Path(sys.prefix) / below]
        try:  # a wheel keeps its data beside the modules
            located = distribution(_EXAMPLE).locate_file(Path("cmeel.prefix") / below)
            candidates.insert(0, Path(str(located)))
        except PackageNotFoundError:
            pass
    return next((candidate for candidate in candidates if candidate.is_dir()), None)


def described() -> dict[str, Path]:
    """Every URDF of the installed packages, by its name without the ending."""
    found: dict[str, Path] = {}
    for package in (_EXAMPLE, _ARMAR):
        if (root := folder(package)) is not None:
            for file in sorted(root.rglob("*.urdf")):
                found.setdefault(file.stem, file)
    return found


def on_demand() -> tuple[str, ...]:
    """Names that robot_descriptions knows; it fetches the files when one is asked for."""
    spec = importlib.util.find_spec(_ON_DEMAND)
    places = list(spec.submodule_search_locations or ()) if spec is not None else []
    return tuple(_modules(places))


def _modules(places: list[str]) -> Iterator[str]:
    for place in places:
        for file in sorted(Path(place).glob("*_description.py")):
            if not file.name.startswith("_"):
                yield file.stem.removesuffix("_description")


def locate(name: str) -> Path | None:
    """The file that describes the robot of that name; None where no package knows the name.

    Raises:
        ValueError: robot_descriptions knows it, and could not fetch it.
    """
    if name in ROBOTS:
        root = folder(ROBOTS[name].package)
        return None if root is None else root / ROBOTS[name].file
    if name in (known := described()):
        return known[name]
    stem = name.removesuffix("_description")
    return _fetched(stem) if stem in on_demand() else None


def _fetched(stem: str) -> Path:
    try:
        module = importlib.import_module(f"{_ON_DEMAND}.{stem}_description")
    except Exception as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"{_ON_DEMAND} could not fetch {stem!r}: {reason}") from error
    for form in ("URDF_PATH", "MJCF_PATH"):
        if path := getattr(module, form, None):
            return Path(path)
    raise ValueError(f"{_ON_DEMAND} has {stem!r} neither as URDF nor as MJCF")
