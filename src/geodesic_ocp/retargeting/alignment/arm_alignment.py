"""Alignment: how the arms of a person and of a robot correspond."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_positive, as_rotation, as_vector
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.joints import frame_index, max_reach
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import write_file


def arm_length(model: Model, joint: str) -> float:
    """Return largest distance [m] of the hand from a joint, within the limits.

    Raises:
        ValueError: there is no such joint.
    """
    origin = model.joint_of(joint)
    hand = frame_index(model.pin, model.hand)
    return max_reach(model.pin, hand, model.lower, model.upper, origin)


_AXES = {
    f"{sign}{name}": (1.0 if sign == "+" else -1.0) * axis
    for name, axis in zip("xyz", np.eye(3), strict=True)
    for sign in "+-"
}
_ALONG = np.cos(np.radians(5.0))
_EXACT = 1e-9


def axis_name(direction: ArrayLike, frame: str) -> str:
    """Get such as "along +x of the base", or with components where it is along none of the axes."""
    vector: Array = np.asarray(direction, dtype=float)
    vector = vector / np.linalg.norm(vector)
    for name, axis in _AXES.items():
        if axis @ vector >= _ALONG:
            return f"along {name} of {frame}"
    entries = ", ".join(f"{entry:.2f}" for entry in vector + 0.0)
    return f"along ({entries}) of {frame}"


def direction_record(direction: Array) -> str | list[float]:
    """Return a unit vector (3,) for a file: "+x" if it is an axis, otherwise its components."""
    for name, axis in _AXES.items():
        if np.abs(axis - direction).max() <= _EXACT:
            return name
    return [float(entry) + 0.0 for entry in direction]


def read_direction(field: str, record: Any) -> Array:
    """Return a unit vector (3,) from `direction_record`, or from three numbers of any length.

    Raises:
        ValueError: it is neither; the message names the field.
    """
    if isinstance(record, str) and record in _AXES:
        return np.array(_AXES[record])
    try:
        vector = np.array(record, dtype=float)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if isinstance(record, str) or vector.shape != (3,) or not 0.0 < np.linalg.norm(vector) < np.inf:
        raise ValueError(
            f"{field} must be one of {', '.join(_AXES)}, or three numbers that are not all zero, "
            f"got {record!r}"
        )
    return np.asarray(vector / np.linalg.norm(vector))


FORMAT, VERSION = "geodesic_ocp alignment", 1
BASE = ("right", "forward")  # columns of `base` in files; the third follows
HAND = {"right": 0, "fingers": 2}  # rows of `hand` in files
_HELP = [
    "shoulder: position of the person's shoulder in the robot's base frame [m].",
    "base: the person's right and forward in the axes of the robot's base, such as '+x'"
    " or [0.8, 0.6, 0.0].",
    "hand: where a person's fingers point, and what points to the right when the arm hangs down"
    " (the back of a right hand, the palm of a left one), in the axes of the robot's hand.",
    "length: largest distance of the hand from the shoulder [m]; positions are scaled by its ratio"
    " to the person's.",
    "side: 'right' or 'left'; null: either. Recordings of the other side are mirrored.",
    "elbow, wrist: names of joints, or null.",
]
# Three numbers on lines of their own.
_NUMBER = r"\s*([-+.\deE]+)"
_VECTOR = re.compile(rf"\[{_NUMBER},{_NUMBER},{_NUMBER}\s*\]")
# Across the sagittal plane: x points to a person's side.
_MIRROR = np.diag([-1.0, 1.0, 1.0])


@dataclass(frozen=True, eq=False, repr=False)
class Alignment(ShortRepr):
    """Position of a person's shoulder on a robot, and correspondence of the axes of base and hand.

    A hand pose with rotation R and position p in the person's axes (x right, y forward, z up,
    relative to the shoulder) is mapped to base R hand and shoulder + scale base p in the robot's
    base frame.

    Attributes:
        shoulder: position of the person's shoulder in the robot's base frame, (3,) [m].
        base: rotation (3, 3) whose columns are the person's x, y and z in the robot's base axes.
        hand: rotation (3, 3) whose columns are the axes of the robot's hand in those of the
            person's: x to the right and y backward of the hanging hand with the palm to the body,
            z along the fingers.
        length: length of the robot's arm: the largest distance of the hand from that position [m].
        side: side of the body, "right" or "left"; recordings of the other side are mirrored. None:
            either side.
        elbow: name of the joint that bends the arm between upper arm and forearm; None: not known.
        wrist: name of the joint whose origin is the centre of the wrist; None: not known.

    Raises:
        ValueError: wrong shapes or values; the message names the field.
    """

    shoulder: ArrayLike
    base: ArrayLike
    hand: ArrayLike
    length: float
    side: Side | None = None
    elbow: str | None = None
    wrist: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "shoulder", as_vector("shoulder", self.shoulder, 3))
        for name in ("base", "hand"):
            object.__setattr__(self, name, as_rotation(name, getattr(self, name)))
        object.__setattr__(self, "length", as_positive("length", self.length, "m"))
        if self.side is not None and self.side not in get_args(Side):
            raise ValueError(f"side must be 'right', 'left' or None, got {self.side!r}")
        for name in ("elbow", "wrist"):
            joint = getattr(self, name)
            if joint is not None and not (isinstance(joint, str) and joint):
                raise ValueError(f"{name} must be the name of a joint or None, got {joint!r}")

    def save(self, file: str | PathLike[str], notes: Sequence[str] = ()) -> Path:
        """Write a JSON file to edit, for `read_alignment`; returns its path.

        Args:
            file: to write.
            notes: lines that it is to contain for its reader, such as what was assumed.

        Raises:
            OSError: the file cannot be written.
        """
        base, hand = np.asarray(self.base), np.asarray(self.hand)
        record = {
            "format": FORMAT,
            "version": VERSION,
            "help": _HELP,
            "notes": list(notes),
            "shoulder": [float(entry) for entry in np.asarray(self.shoulder)],
            "base": {name: direction_record(base[:, k]) for k, name in enumerate(BASE)},
            "hand": {name: direction_record(hand[k]) for name, k in HAND.items()},
            **{name: getattr(self, name) for name in ("length", "side", "elbow", "wrist")},
        }
        text = json.dumps(record, indent=1)
        # Vectors on one line each.
        text = re.sub(
            r"\[\s+([-+.\deE]+),\s+([-+.\deE]+),\s+([-+.\deE]+)\s+\]", r"[\1, \2, \3]", text
        )
        return write_file(file, text + "\n")

    def to_robot(
        self, rotation: Array, position: Array, *, scale: float, mirror: bool = False
    ) -> tuple[Array, Array]:
        """Return poses of the robot's hand from poses of a person's hand.

        Args:
            rotation: (..., 3, 3) of the person's hand.
            position: (..., 3) [m], relative to the shoulder.
            scale: factor of positions, usually the ratio of the arms' lengths.
            mirror: whether to exchange left and right.

        Returns:
            Rotations (..., 3, 3) and positions (..., 3) [m] in the robot's base frame.
        """
        base, hand, shoulder = (np.asarray(each) for each in (self.base, self.hand, self.shoulder))
        if mirror:
            # The axes of the hand are mirrored as well, so that the result is a rotation.
            rotation, position = _MIRROR @ rotation @ _MIRROR, position @ _MIRROR
        return base @ rotation @ hand, shoulder + scale * position @ base.T

    def to_person(
        self, rotation: Array, position: Array, *, scale: float = 1.0, mirror: bool = False
    ) -> tuple[Array, Array]:
        """Get the inverse of `to_robot`: poses in the person's axes, relative to the shoulder."""
        base, hand, shoulder = (np.asarray(each) for each in (self.base, self.hand, self.shoulder))
        rotation, position = base.T @ rotation @ hand.T, (position - shoulder) @ base / scale
        if mirror:
            rotation, position = _MIRROR @ rotation @ _MIRROR, position @ _MIRROR
        return rotation, position


def check_joints(alignment: Alignment, robot: Model) -> None:
    """Raise if the elbow or the wrist of an alignment is not of the robot.

    Raises:
        ValueError: it names the field, what was given, and the joints.
    """
    for field in ("elbow", "wrist"):
        name = getattr(alignment, field)
        if name is not None and not robot.pin.existFrame(name):
            raise ValueError(
                f"alignment: {field} is {name!r}, which is not a joint of {robot.name!r}; its "
                f"joints are {', '.join(robot.joint_names)}"
            )
