"""Alignment: how the arms of a person and of a robot correspond."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_positive, as_rotation, as_vector, settle
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.formats.robots import ROBOTS
from geodesic_ocp.model.joint_axes import upright
from geodesic_ocp.model.joints import frame_index, max_reach
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.records import read_record, write_file
from geodesic_ocp.retargeting.landmarks import AXES, base_axes, hand_axes, landmarks

FORMAT = "geodesic_ocp alignment"
VERSION = 1
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
    "parallel_gripper: true if the hand turned by 180 degrees about its fingers is the same grasp.",
]
# Three numbers on lines of their own.
_VECTOR = re.compile(r"\[\s+([-+.\deE]+),\s+([-+.\deE]+),\s+([-+.\deE]+)\s+\]")
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
        parallel_gripper: whether the hand turned by 180 degrees about its fingers is the same
            grasp. `retarget` then turns it in all poses if that costs less, and says so.

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
    parallel_gripper: bool = False

    def __post_init__(self) -> None:
        given = {"shoulder": as_vector("shoulder", self.shoulder, 3)}
        given |= {name: as_rotation(name, getattr(self, name)) for name in ("base", "hand")}
        for name, value in given.items():
            array = value.copy()
            array.flags.writeable = False
            settle(self, **{name: array})
        settle(self, length=as_positive("length", self.length, "m"))
        if self.side is not None and self.side not in get_args(Side):
            raise ValueError(f"side must be 'right', 'left' or None, got {self.side!r}")
        for name in ("elbow", "wrist"):
            joint = getattr(self, name)
            if joint is not None and not (isinstance(joint, str) and joint):
                raise ValueError(f"{name} must be the name of a joint or None, got {joint!r}")
        if not isinstance(self.parallel_gripper, bool):
            raise ValueError(f"parallel_gripper must be a bool, got {self.parallel_gripper!r}")

    def save(self, file: str | PathLike[str], notes: Sequence[str] = ()) -> Path:
        """Write a JSON file to edit, for `read_alignment`; returns its path.

        Args:
            file: to write.
            notes: lines that it is to contain for its reader, such as what was assumed.

        Raises:
            OSError: the file cannot be written.
        """
        base = np.asarray(self.base)
        hand = np.asarray(self.hand)
        record = {
            "format": FORMAT,
            "version": VERSION,
            "help": _HELP,
            "notes": list(notes),
            "shoulder": np.asarray(self.shoulder).tolist(),
            "base": {name: _direction_record(base[:, k]) for k, name in enumerate(BASE)},
            "hand": {name: _direction_record(hand[k]) for name, k in HAND.items()},
            **{name: getattr(self, name) for name in ("length", *_OPTIONAL)},
        }
        text = _VECTOR.sub(r"[\1, \2, \3]", json.dumps(record, indent=1))  # one line each
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
            rotation = _MIRROR @ rotation @ _MIRROR
            position = position @ _MIRROR
        return base @ rotation @ hand, shoulder + scale * position @ base.T

    def to_person(
        self, rotation: Array, position: Array, *, scale: float = 1.0, mirror: bool = False
    ) -> tuple[Array, Array]:
        """Get the inverse of `to_robot`: poses in the person's axes, relative to the shoulder."""
        base, hand, shoulder = (np.asarray(each) for each in (self.base, self.hand, self.shoulder))
        rotation = base.T @ rotation @ hand.T
        position = (position - shoulder) @ base / scale
        if mirror:
            rotation = _MIRROR @ rotation @ _MIRROR
            position = position @ _MIRROR
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


def arm_length(model: Model, joint: str) -> float:
    """Return largest distance [m] of the hand from a joint, within the limits.

    Raises:
        ValueError: there is no such joint.
    """
    origin = model.joint_of(joint)
    hand = frame_index(model.pin, model.hand)
    return max_reach(model.pin, hand, model.lower, model.upper, origin)


_EXACT = 1e-9


def _direction_record(direction: Array) -> str | list[float]:
    """Return a unit vector (3,) for a file: "+x" if it is an axis, otherwise its components."""
    for name, axis in AXES.items():
        if np.abs(axis - direction).max() <= _EXACT:
            return name
    return [float(entry) + 0.0 for entry in direction]


def _read_direction(field: str, record: Any) -> Array:
    """Return a unit vector (3,) from `_direction_record`, or from three numbers of any length.

    Raises:
        ValueError: it is neither; the message names the field.
    """
    if isinstance(record, str) and record in AXES:
        return np.array(AXES[record])
    try:
        vector = np.array(record, dtype=float)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if isinstance(record, str) or vector.shape != (3,) or not 0.0 < np.linalg.norm(vector) < np.inf:
        raise ValueError(
            f"{field} must be one of {', '.join(AXES)}, or three numbers that are not all zero, "
            f"got {record!r}"
        )
    return np.asarray(vector / np.linalg.norm(vector))


_Axes: TypeAlias = tuple[tuple[int, int, int], ...]


class _Known(NamedTuple):
    """A known robot's alignment: the joint at its shoulder, and axes.

    Attributes:
        joint: at the shoulder of the robot that stands `upright`.
        base, hand: columns of the rotations of `Alignment`.
        side: side of the body.
        elbow, wrist: joints.
    """

    joint: str
    base: _Axes
    hand: _Axes
    side: Side
    elbow: str
    wrist: str


# Columns: images of the person's right, forward, up.
_SAME = ((1, 0, 0), (0, 1, 0), (0, 0, 1))  # x right, y forward, z up
_FORWARD = ((0, -1, 0), (1, 0, 0), (0, 0, 1))  # x forward, y left, z up, as ROS has it (REP 103)
# A single arm is mounted like a shoulder: its first axis points to the right, its x axis forward.
# Upright on a table it reaches at most two thirds of the poses of a person's arm.
_SHOULDER = ((0, 0, 1), (1, 0, 0), (0, 1, 0))
# Columns: the robot hand's axes in the person's hand.
_GRIPPER = ((0, -1, 0), (1, 0, 0), (0, 0, 1))  # z out, opening along y: from the palm to its back
_TURNED = ((-1, 0, 0), (0, -1, 0), (0, 0, 1))

# Robot, number of the joint at its shoulder, hand, and side of the arm. The hands of Talos have z
# back to the wrist, at zero as a person's.
_HUMANOIDS: tuple[tuple[str, int, _Axes, Side], ...] = (
    ("talos", 2, ((0, -1, 0), (-1, 0, 0), (0, 0, -1)), "left"),
    ("talos", 2, ((0, 1, 0), (1, 0, 0), (0, 0, -1)), "right"),
    ("tiago-pro", 1, _GRIPPER, "left"),
    ("tiago-pro", 1, _GRIPPER, "right"),
)
_KNOWN = {
    "panda": _Known("panda_joint1", _SHOULDER, _GRIPPER, "right", "panda_joint4", "panda_joint6"),
    "xarm7": _Known("joint1", _SHOULDER, _GRIPPER, "right", "joint4", "joint6"),
    "ur5": _Known(
        "shoulder_pan_joint", _SHOULDER, _GRIPPER, "right", "elbow_joint", "wrist_1_joint"
    ),
    **{
        f"{robot}-{side}-arm": _Known(
            f"arm_{side}_{first}_joint",
            _FORWARD,
            hand,
            side,
            f"arm_{side}_4_joint",
            f"arm_{side}_6_joint",
        )
        for robot, first, hand, side in _HUMANOIDS
    },
    # The palms face -x, the thumbs point to y (left) and to -y (right).
    "armar6-left": _Known(
        "arm_t23_joint_r0", _SAME, _TURNED, "left", "arm_t56_joint_r0", "arm_t78_joint_r0"
    ),
    "armar6-right": _Known(
        "arm_t23_joint_r1", _SAME, _SAME, "right", "arm_t56_joint_r1", "arm_t78_joint_r1"
    ),
}


# Robots whose proposal was found right: the shoulder is where axes meet, away from any joint.
_AS_PROPOSED = ("g1-right-arm", "g1-left-arm")

_FIELDS = ("shoulder", "base", "hand", "length")
_OPTIONAL = ("side", "elbow", "wrist", "parallel_gripper")
_OTHER = ("format", "version", "help", "notes")
_ACROSS = 0.02  # largest cosine of the angle between two axes; smaller ones are rounding


def read_alignment(file: str | PathLike[str]) -> Alignment:
    """Return the alignment in a JSON file that `Alignment.save` or `geodesic-ocp align` wrote.

    >>> import tempfile
    >>> from pathlib import Path
    >>> import geodesic_ocp as go
    >>> aligned = go.retargeting.align(go.human_arm("left"))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     go.retargeting.read_alignment(aligned.save(Path(folder) / "arm.json")).side
    'left'

    Args:
        file: path of the file.

    Raises:
        RecordingError: the file is missing, or of another format; a field is missing, unknown or
            malformed. Names the file and the field.
    """
    record = read_record(file, FORMAT, VERSION, "an alignment")
    try:
        for name in sorted(record.keys() - {*_FIELDS, *_OPTIONAL, *_OTHER}):
            known = ", ".join((*_FIELDS, *_OPTIONAL))
            raise ValueError(f"{name!r} is not one of the fields {known}")
        for name in _FIELDS:
            if name not in record:
                raise ValueError(f"{name} is missing")
        right, forward = _axes("base", record["base"], BASE)
        across, fingers = _axes("hand", record["hand"], tuple(HAND))
        return Alignment(
            record["shoulder"],
            np.column_stack([right, forward, np.cross(right, forward)]),
            np.vstack([across, np.cross(fingers, across), fingers]),
            record["length"],
            **{name: record[name] for name in _OPTIONAL if name in record},
        )
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None


def _axes(field: str, record: Any, names: tuple[str, ...]) -> list[Array]:
    """Return two unit vectors (3,) at right angles."""
    if not isinstance(record, dict) or set(record) != set(names):
        raise ValueError(f"{field} must have the entries {' and '.join(names)}, got {record!r}")
    first, second = (_read_direction(f"{field}: {name}", record[name]) for name in names)
    if not abs(first @ second) <= _ACROSS:
        angle = np.degrees(np.arccos(np.clip(first @ second, -1.0, 1.0)))
        raise ValueError(
            f"{field}: {names[0]} and {names[1]} must be at right angles, got {angle:.3g} degrees"
        )
    second = second - first * (first @ second)
    return [first, second / np.linalg.norm(second)]


def propose_alignment(robot: Model, *, side: Side | None = None) -> Alignment:
    """Return an alignment of a robot's arm with a person's, from the chain of its joints alone.

    The shoulder is where the axes of the first joints of the arm meet, with joints of a torso
    before them at zero, which count for no length. The hand reaches away from the centre of the
    wrist, and a single arm is assumed to be mounted like a shoulder, with its first axis to the
    right and x forward.
    `geodesic-ocp align` shows all that was assumed, and writes a file to edit.

    >>> import geodesic_ocp as go
    >>> found = go.retargeting.propose_alignment(go.human_arm("right"))
    >>> found.elbow, found.wrist, abs(found.shoulder).round(6).tolist()
    ('REx_joint', 'RWx_joint', [0.0, 0.0, 0.0])

    Args:
        robot: the arm.
        side: side of the body; None: where the shoulder is, or right for a single arm.

    Raises:
        ValueError: fewer than two revolute joints, or an unknown side.
    """
    return proposal(robot, side)[0]


def proposal(robot: Model, side: Side | None = None) -> tuple[Alignment, tuple[str, ...]]:
    """Return `propose_alignment` and its assumptions: sentences about what was taken from where."""
    robot = as_model(robot)
    if side is not None and side not in get_args(Side):
        raise ValueError(f"side must be 'right', 'left' or None, got {side!r}")
    found = landmarks(robot)
    base, chosen, base_reason = base_axes(robot, found, side)
    hand, hand_reasons = hand_axes(robot, found, base, chosen)
    reason = "the shoulder is at the first joint of the arm, as no axes meet near it"
    if found.crossing:
        reason = f"the shoulder is where the axes of {', '.join(found.crossing)} meet"
    if found.before:
        last = found.before[-1]
        carried = [x.name for x in robot.pin.frames if robot.pin.names[x.parentJoint] == last]
        behind = next((name for name in carried if name != last), last)
        reason += (
            f", with {', '.join(found.before)} before it at zero; they move like the joints of the "
            f"arm, unless the robot's base is behind them (--base {behind})"
        )
    shoulder = np.round(found.shoulder, 9) + 0.0  # as it is to be read in a file
    aligned = Alignment(shoulder, base, hand, found.length, chosen, found.elbow, found.wrist)
    return aligned, (reason, base_reason, *hand_reasons)


def align(robot: Model, **changes: Any) -> Alignment:
    """Return the default alignment of a robot or of a person's arm, with some fields changed.

    Robots that `load_model` offers by name (panda, talos-left-arm, ...) are known by the name of
    the model; of them, single arms (panda, xarm7, ur5) are assumed to be mounted as a right
    shoulder, with the first axis to the right and x forward. That of any other robot is proposed
    from its kinematics (`propose_alignment`).

    Args:
        robot: the arm.
        changes: fields of `Alignment` to be changed.

    Warns:
        UserWarning: the robot is not known; says what was assumed.

    Raises:
        ValueError: nothing can be proposed, or a change is not a field of an alignment.

    >>> import geodesic_ocp as go
    >>> go.retargeting.align(go.human_arm("left")).side
    'left'
    """
    found = known_alignment(as_model(robot))
    if found is None:
        found, assumptions = proposal(robot)
        warnings.warn(
            f"no alignment is known for {robot.name!r}, so it is taken from the kinematics: "
            f"{'; '.join(assumptions)}. See it with `geodesic-ocp align`, which also "
            "writes a file to edit",
            UserWarning,
            stacklevel=2,
        )
    try:
        return replace(found, **changes) if changes else found
    except TypeError as error:
        raise ValueError(f"alignment: {error}") from None


@lru_cache(maxsize=32)
def known_alignment(robot: Model) -> Alignment | None:
    """Return the alignment of a known robot or of a person's arm, by the name of the model."""
    if (person := _of_person(robot)) is not None:
        return person
    name, _, _ = robot.name.partition(" with ")  # a payload
    if name in ROBOTS:  # of a body, the arm whose hand it is
        arms = [arm for arm in ROBOTS[name].arms if ROBOTS[arm].hand == robot.hand]
        name = arms[0] if arms else name
    if name in _AS_PROPOSED:
        return proposal(robot)[0]
    known = _KNOWN.get(name)
    if known is None:
        return None
    usual = ROBOTS[name]
    if not all(robot.pin.existFrame(str(each)) for each in (known.joint, usual.hand, usual.base)):
        return None
    home = upright(robot)
    base, hand = (np.array(columns, dtype=float).T for columns in (known.base, known.hand))
    # The model may have been loaded with another base, or another hand.
    base = robot.frame_pose(str(usual.base), home)[0] @ base
    hand = hand @ robot.frame_pose(usual.hand, home)[0].T @ robot.hand_pose(home)[0]
    _, shoulder = robot.frame_pose(known.joint, home)
    length = arm_length(robot, known.joint)
    gripper = usual.parallel_gripper and robot.hand == usual.hand
    return Alignment(shoulder, base, hand, length, known.side, known.elbow, known.wrist, gripper)


_HUMAN = re.compile(r"human (upper body|(right|left) arm)")


def _of_person(model: Model) -> Alignment | None:
    """Return the alignment of a person's arm, alone, of both arms, or of an upper body; by the
    names of the model and of the joints before the hand.
    """
    if not _HUMAN.match(model.name):
        return None
    chain = [str(model.pin.names[each]) for each in model.pin.supports[model.joint_of(model.hand)]]
    axes = np.eye(3)
    home = np.zeros(model.dof)
    for side in get_args(Side):
        joints = [f"{side[0].upper()}{each}_joint" for each in ("Sx", "Ex", "Wx")]
        if set(joints) <= set(chain):
            shoulder = model.frame_pose(joints[0], home)[1]
            length = arm_length(model, joints[0])
            (_, elbow, wrist) = joints
            return Alignment(shoulder, axes, axes, length, side, elbow, wrist)
    return None
