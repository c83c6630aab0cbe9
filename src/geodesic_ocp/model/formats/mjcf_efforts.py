"""Torque and force limits that an MJCF states for its joints."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from geodesic_ocp.arrays import Array

# All are short forms of <general>, and share its defaults.
ACTUATORS = (
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
)
_UNLIMITED = (-np.inf, np.inf)


def effort_limits(root: ET.Element, name: str) -> dict[str, Array]:
    """Smallest and largest torque [N m] or force [N] of each driven joint, by its name.

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
    """Smallest and largest force of the actuator, before its gear."""
    limits = _range(actuator, "force", automatic, location)
    direct = actuator.tag == "motor" or (
        actuator.tag == "general"
        and actuator.get("gaintype", "fixed") == "fixed"
        and actuator.get("biastype", "none") == "none"
    )
    if not direct:  # the control is a position, a speed or an activation
        return limits
    gain = 1.0 if actuator.tag == "motor" else _first(actuator, "gainprm", location)
    driven = np.sort(gain * _range(actuator, "ctrl", automatic, location)) if gain else np.zeros(2)
    return np.array([max(limits[0], driven[0]), min(limits[1], driven[1])])


def _range(element: ET.Element, kind: str, automatic: bool, location: str) -> Array:
    """The range of the attribute `kind`range, infinite if it is not limited."""
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
    """The first number of the attribute, 1 by default."""
    given = element.get(key, "1").split()
    try:
        return float(given[0])
    except (IndexError, ValueError):
        raise ValueError(f"{location}: {key} must be numbers, is {element.get(key)!r}") from None
