"""Robots that are known by name, and where their files are."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

INSTALL = "pip install armar example-robot-data robot_descriptions (in a clone: make robots)"
_EXAMPLE = "example-robot-data"
_ARMAR = "armar"
_ON_DEMAND = "robot_descriptions"
_MENAGERIE = "menagerie/"  # before names of robots of MuJoCo Menagerie


@dataclass(frozen=True)
class Robot:
    """A robot arm in a file of a package, or a waist with both arms.

    Attributes:
        file: path below the package's folder of robots.
        hand: frame at the grasp centre if the file has one, otherwise the last link.
        base: fixed link; the joints before it are locked. None: the root of the file.
        arms: names of the right and the left arm of a body, whose hands it has; empty for an arm.
        parallel_gripper: whether the hand is a gripper of two fingers that half a turn about its
            approach axis, through the origin of the frame, exchanges.
        raised: lifts before the base, which are locked at their upper limits, and these [m].
    """

    package: str
    file: str
    hand: str
    base: str | None
    arms: tuple[str, ...] = ()
    parallel_gripper: bool = False
    raised: Mapping[str, float] = field(default_factory=dict)

    @property
    def hands(self) -> tuple[str, ...]:
        """Hand frames: those of both arms of a body."""
        return tuple(ROBOTS[arm].hand for arm in self.arms) or (self.hand,)


_ARMS = {
    "panda": Robot(
        _EXAMPLE,
        "panda_description/urdf/panda.urdf",
        "panda_hand_tcp",
        "panda_link0",
        parallel_gripper=True,
    ),
    **{
        f"{name}-{side}-arm": Robot(
            _EXAMPLE, file, f"gripper_{side}_base_link", base, (), parallel, raised
        )
        for name, file, base, parallel, raised in (
            # One finger against two.
            ("talos", "talos_data/robots/talos_reduced.urdf", "torso_2_link", False, {}),
            (
                *("tiago-pro", "tiago_pro_description/robots/tiago_pro.urdf", "torso_lift_link"),
                *(True, {"torso_lift_joint": 0.35}),  # lowered, its wheels are in the arms' way
            ),
        )
        for side in ("left", "right")
    },
    "xarm7": Robot(_EXAMPLE, "xarm_description/urdf/xarm7.urdf", "link_eef", "link_base"),
    "ur5": Robot(_EXAMPLE, "ur_description/urdf/ur5_robot.urdf", "tool0", "base_link"),
    # r0 is the left arm: the y axis of the torso points forward, as the head's mass centre shows.
    "armar6-left": Robot(_ARMAR, "armar6.urdf", "hand_fixed_r0", "torso"),
    "armar6-right": Robot(_ARMAR, "armar6.urdf", "hand_fixed_r1", "torso"),
    **{
        f"g1-{side}-arm": Robot(
            _EXAMPLE,
            "g1_description/urdf/g1_29dof_rev_1_0.urdf",
            f"{side}_rubber_hand",
            "torso_link",
        )
        for side in ("left", "right")
    },
}
# Bodies: the joints of waist, torso or lift, and both arms.
_BODIES = {
    name: replace(
        _ARMS[f"{name}-right{arm}"],
        base=None,
        arms=(f"{name}-right{arm}", f"{name}-left{arm}"),
        raised={},  # the lift is one of its joints
    )
    for name, arm in (("talos", "-arm"), ("tiago-pro", "-arm"), ("armar6", ""), ("g1", "-arm"))
}
ROBOTS = _ARMS | _BODIES


def folder(package: str) -> Path | None:
    """Return the folder of robots of a package; None if the package is not installed."""
    if package == _ARMAR:
        candidates = [each / "description" / "urdf" for each in _package_folders(_ARMAR)]
    else:
        below = Path("share") / _EXAMPLE / "robots"
        candidates = [Path(sys.prefix) / below]
        try:  # a wheel stores its data beside the modules
            located = distribution(_EXAMPLE).locate_file(Path("cmeel.prefix") / below)
            candidates.insert(0, Path(str(located)))
        except PackageNotFoundError:
            pass
    return next((candidate for candidate in candidates if candidate.is_dir()), None)


def _package_folders(package: str) -> list[Path]:
    spec = importlib.util.find_spec(package)
    return [] if spec is None else list(map(Path, spec.submodule_search_locations or ()))


def described() -> dict[str, Path]:
    """Return all URDF files of the installed packages, by name without suffix."""
    found: dict[str, Path] = {}
    for package in (_EXAMPLE, _ARMAR):
        if (root := folder(package)) is not None:
            for file in sorted(root.rglob("*.urdf")):
                found.setdefault(file.stem, file)
    return found


def on_demand() -> tuple[str, ...]:
    """Return names that robot_descriptions knows; it downloads the files on first use."""
    folders = _package_folders(_ON_DEMAND)
    files = [file for each in folders for file in sorted(each.glob("*_description.py"))]
    stems = (file.stem for file in files if not file.name.startswith("_"))
    return tuple(stem.removesuffix("_description") for stem in stems)


def locate(name: str) -> Path | None:
    """Return the file with the robot of that name; None if no installed package knows it.

    "menagerie/NAME" is a robot of MuJoCo Menagerie: the package mujoco-menagerie downloads it on
    first use, or takes it from the folder in the environment variable MENAGERIE_ROOT.

    Raises:
        ValueError: a package knows it, but could not download it, or there is no such robot in
            MuJoCo Menagerie.
    """
    if name.startswith(_MENAGERIE):
        return _of_menagerie(name.removeprefix(_MENAGERIE))
    if name in ROBOTS:
        root = folder(ROBOTS[name].package)
        return None if root is None else root / ROBOTS[name].file
    if name in (known := described()):
        return known[name]
    stem = name.removesuffix("_description")
    return _downloaded(stem) if stem in on_demand() else None


def _of_menagerie(name: str) -> Path:
    try:
        menagerie = importlib.import_module("mujoco_menagerie")
    except ImportError:
        needed = "MuJoCo Menagerie: pip install 'geodesic_ocp[robots]'"
        raise ValueError(f"{_MENAGERIE}{name} needs {needed}") from None
    try:
        robot = menagerie.get(name)
        return Path(robot.xml(robot.default_model))
    except (menagerie.MenagerieError, OSError) as error:
        if isinstance(error, menagerie.UnknownRobotError):
            raise ValueError(f"MuJoCo Menagerie: {error}") from None
        reason = " ".join(str(error).split())
        raise ValueError(
            f"{_MENAGERIE}{name} could not be downloaded: {reason}. Download it when there is a "
            f"network (python -m mujoco_menagerie prefetch {name}), or set MENAGERIE_ROOT to a "
            f"folder that holds {name}, such as a clone of "
            "github.com/google-deepmind/mujoco_menagerie"
        ) from error


def _downloaded(stem: str) -> Path:
    try:
        module = importlib.import_module(f"{_ON_DEMAND}.{stem}_description")
    except Exception as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"{_ON_DEMAND} could not download {stem!r}: {reason}") from error
    for attribute in ("URDF_PATH", "MJCF_PATH"):
        if path := getattr(module, attribute, None):
            return Path(path)
    raise ValueError(f"{_ON_DEMAND} has {stem!r} neither as URDF nor as MJCF")
