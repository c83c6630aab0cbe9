"""Robots that are known by name, and their motors.

A rotor of inertia I behind a gear of ratio r adds r^2 I to the inertia of its joint. Pinocchio
reads armature from MJCF, but not from URDF.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array

# All are short forms of <general>, and share its defaults.
ACTUATORS = (
    *("general", "motor", "position", "velocity", "intvelocity"),
    *("damper", "cylinder", "muscle", "adhesion"),
)
_UNLIMITED = (-np.inf, np.inf)


def effort_limits(root: ET.Element, name: str) -> dict[str, Array]:
    """Return smallest and largest torque [N m] or force [N] of each driven joint, by its name.

    That of an actuator lies within its force range, and that of a motor within its control range
    times its gain, each times its gear ratio; the actuators of a joint add up. The joint's own
    actuatorfrcrange limits the sum. Joints without an actuator or such a range are left out.

    Args:
        root: the element <mujoco>, whose default classes have been applied.
        name: name of the file, for messages.

    Raises:
        ValueError: a range is not two increasing numbers, or a gear ratio or gain is not a number.
    """
    compiler = root.find("compiler")
    automatic = compiler is None or compiler.get("autolimits", "true") == "true"
    found: dict[str, Array] = {}
    for actuator in root.iterfind("actuator/*"):
        joint = actuator.get("joint") or actuator.get("jointinparent")
        if joint is None or actuator.tag not in ACTUATORS:
            continue
        location = f"{name}: the <{actuator.tag}> of joint {joint!r}"
        if (gear := _first(actuator, "gear", location)) == 0.0:
            continue
        limits = gear * _force_range(actuator, automatic, location)
        found[joint] = found.get(joint, np.zeros(2)) + np.sort(limits)
    for element in root.iter("joint"):
        own = _range(element, "actuatorfrc", automatic, f"{name}: joint {element.get('name')!r}")
        joint = element.get("name", "")
        if np.isfinite(own).any():
            lower, upper = found.get(joint, np.array(_UNLIMITED))
            found[joint] = np.array([max(lower, own[0]), min(upper, own[1])])
    return found


def _force_range(actuator: ET.Element, automatic: bool, location: str) -> Array:
    """Return smallest and largest force of the actuator, before its gear."""
    limits = _range(actuator, "force", automatic, location)
    kinds = actuator.get("gaintype", "fixed"), actuator.get("biastype", "none")
    general = actuator.tag == "general" and kinds == ("fixed", "none")
    if not (
        actuator.tag == "motor" or general
    ):  # the control is a position, a speed or an activation
        return limits
    gain = 1.0 if actuator.tag == "motor" else _first(actuator, "gainprm", location)
    driven = np.sort(gain * _range(actuator, "ctrl", automatic, location)) if gain else np.zeros(2)
    return np.array([max(limits[0], driven[0]), min(limits[1], driven[1])])


def _range(element: ET.Element, kind: str, automatic: bool, location: str) -> Array:
    """Return the range of the attribute `kind`range, infinite if it is not limited."""
    given, limited = element.get(f"{kind}range"), element.get(f"{kind}limited", "auto")
    if given is None or limited == "false" or (limited == "auto" and not automatic):
        return np.array(_UNLIMITED)
    try:
        numbers = np.array(given.split(), dtype=float)
    except ValueError:
        numbers = np.zeros(0)
    if numbers.shape != (2,) or not numbers[0] < numbers[1]:
        raise ValueError(f"{location}: {kind}range must be two increasing numbers, is {given!r}")
    return numbers


def _first(element: ET.Element, key: str, location: str) -> float:
    """Return the first number of the attribute, 1 by default."""
    given = element.get(key, "1").split()
    try:
        return float(given[0])
    except (IndexError, ValueError):
        raise ValueError(f"{location}: {key} must be numbers, is {element.get(key)!r}") from None


def urdf_armature(root: ET.Element, name: str) -> dict[str, float]:
    """Return joint inertias [kg m^2 or kg] that a URDF states, by joint name.

    They are `<dynamics armature="..."/>` of a joint, or `<drake:rotor_inertia value="..."/>` and
    `<drake:gear_ratio value="..."/>` (default 1) of the actuators of its transmission, which are
    extensions of the format. A joint that has both takes the former.

    Raises:
        ValueError: a value is not a finite number that is not negative; names the joint.
    """
    found: dict[str, float] = {}
    for transmission in root.iterfind("transmission"):
        joints = [joint.get("name", "") for joint in transmission.iterfind("joint")]
        for actuator in transmission.iterfind("actuator"):
            values = {_local(child.tag): child for child in actuator}
            if "rotor_inertia" not in values or not joints:
                continue
            location = f"{name}: the actuator of joint {joints[0]!r}"
            rotor = _number(values["rotor_inertia"], "value", f"{location}: rotor_inertia")
            gear = values.get("gear_ratio")
            ratio = 1.0 if gear is None else _number(gear, "value", f"{location}: gear_ratio")
            found[joints[0]] = found.get(joints[0], 0.0) + ratio**2 * rotor
    for joint in root.iterfind("joint"):
        dynamics = joint.find("dynamics")
        if dynamics is not None and dynamics.get("armature") is not None:
            location = f"{name}: joint {joint.get('name')!r}"
            found[joint.get("name", "")] = _number(dynamics, "armature", f"{location}: armature")
    return found


def srdf_armature(urdf: Path) -> dict[str, float]:
    """Return joint inertias [kg m^2 or kg] from the SRDF that a package has for a URDF, by joint
    name.

    It is in the folder `srdf` beside that of the URDF, is for a robot of the same name, and has a
    group `rotor_params` with the inertia of each rotor (its attribute is called mass) and the gear
    ratio, as read by Pinocchio's `loadRotorParameters`.

    Raises:
        ValueError: a value is not a finite number that is not negative; names the joint.
    """
    robot = _root(urdf)
    found: dict[str, float] = {}
    for file in sorted(urdf.parent.parent.glob("srdf/*.srdf")):
        root = _root(file)
        if robot is None or root is None or root.get("name") != robot.get("name"):
            continue
        for joint in root.iterfind("rotor_params/joint"):
            location = f"{file.name}: rotor_params of joint {joint.get('name')!r}"
            rotor = _number(joint, "mass", f"{location}: mass")
            ratio = _number(joint, "gear_ratio", f"{location}: gear_ratio")
            found.setdefault(joint.get("name", ""), ratio**2 * rotor)
    return found


def set_armature(model: pin.Model, armature: Mapping[str, float]) -> None:
    """Set the armature of joints with one degree of freedom that have none yet."""
    values = np.array(model.armature)
    for index in range(1, model.njoints):
        joint = model.joints[index]
        if joint.nv == 1 and values[joint.idx_v] == 0.0:
            values[joint.idx_v] = armature.get(str(model.names[index]), 0.0)
    model.armature = values


def _root(file: Path) -> ET.Element | None:
    try:
        return ET.parse(file).getroot()
    except (OSError, ET.ParseError):
        return None


def _local(tag: str) -> str:
    """Return the tag without its namespace."""
    return tag.rsplit("}", 1)[-1]


def _number(element: ET.Element, key: str, location: str) -> float:
    try:
        value = float(element.get(key, ""))
    except ValueError:
        value = np.nan
    if not 0.0 <= value < np.inf:
        raise ValueError(f"{location} must be a number >= 0, is {element.get(key)!r}")
    return value


INSTALL = "pip install armar example-robot-data robot_descriptions (in a clone: make robots)"
_EXAMPLE, _ARMAR = "example-robot-data", "armar"
_ON_DEMAND = "robot_descriptions"
_MENAGERIE = "menagerie/"  # before names of robots of MuJoCo Menagerie


@dataclass(frozen=True)
class Robot:
    """A robot arm in a file of a package.

    Attributes:
        package: name of the package.
        file: path below the package's folder of robots.
        hand: frame at the grasp centre if the file has one, otherwise the last link.
        base: fixed link; the joints before it are locked.
    """

    package: str
    file: str
    hand: str
    base: str


ROBOTS = {
    "panda": Robot(_EXAMPLE, "panda_description/urdf/panda.urdf", "panda_hand_tcp", "panda_link0"),
    **{
        f"{name}-{side}-arm": Robot(_EXAMPLE, file, f"gripper_{side}_base_link", base)
        for name, file, base in (
            ("talos", "talos_data/robots/talos_reduced.urdf", "torso_2_link"),
            ("tiago-pro", "tiago_pro_description/robots/tiago_pro.urdf", "torso_lift_link"),
        )
        for side in ("left", "right")
    },
    "xarm7": Robot(_EXAMPLE, "xarm_description/urdf/xarm7.urdf", "link_eef", "link_base"),
    "ur5": Robot(_EXAMPLE, "ur_description/urdf/ur5_robot.urdf", "tool0", "base_link"),
    # r0 is the left arm: the y axis of the torso points forward, as the head's mass centre shows.
    "armar6-left": Robot(_ARMAR, "armar6.urdf", "hand_fixed_r0", "torso"),
    "armar6-right": Robot(_ARMAR, "armar6.urdf", "hand_fixed_r1", "torso"),
}


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
        needed = "MuJoCo Menagerie: pip install 'geodesic_ocp[mujoco]'"
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
