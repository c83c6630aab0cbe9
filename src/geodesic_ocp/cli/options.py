"""Options that several commands share, as annotated types; most are fields of settings."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from scipy.spatial.transform import Rotation

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.limits import (
    QUANTITIES,
    Given,
    JointLimits,
    joint_limits,
    within_ranges,
)
from geodesic_ocp.model.anthropometry import Side, Sides
from geodesic_ocp.model.formats.load_model import load_model
from geodesic_ocp.model.formats.robots import ROBOTS
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Ball, Box, Capsule, HalfSpace, Obstacle
from geodesic_ocp.recordings.recording_settings import RecordingSettings
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.studies.analysis_settings import AnalysisSettings

Flag = Annotated[bool, Parameter(negative="", show_default=False)]


@dataclass(frozen=True)
class GivenLimits:
    """Limits of a robot's joints in place of the file's, the published or the derived limits.

    Attributes:
        velocity: largest speed of all joints [rad/s or m/s], or JOINT=LIMIT of one; repeatable. A
            LIMIT such as 50% is that share of the limit that there is otherwise.
        acceleration: largest acceleration [rad/s^2 or m/s^2], likewise.
        jerk: largest jerk [rad/s^3 or m/s^3], likewise.
        torque: largest torque [N m or N], likewise.
        torque_rate: largest rate of the torque [N m/s or N/s], likewise.
        position: share of the range of positions about its middle, such as 90%, likewise.
        hand_speed: largest speed of the hand [m/s], or a share.
        joint_limits: joint_limits.yaml of MoveIt.
    """

    velocity: Sequence[str] | None = None
    acceleration: Sequence[str] | None = None
    jerk: Sequence[str] | None = None
    torque: Sequence[str] | None = None
    torque_rate: Sequence[str] | None = None
    position: Sequence[str] | None = None
    hand_speed: str | None = None
    joint_limits: Path | None = None

    def of_robots(self, robots: Sequence[Model]) -> tuple[list[Model], list[JointLimits]]:
        """Return the robots with their ranges of positions, and the limits of each: the given ones,
        else as `joint_limits` finds them.

        Raises:
            ValueError: an option is not a number or share, or names an unknown joint.
        """
        given = {name: _limit(name, getattr(self, name)) for name in ("position", *QUANTITIES)}
        position = given.pop("position")
        file = self.joint_limits
        hand = None if self.hand_speed is None else _number("hand_speed", self.hand_speed)
        robots = [within_ranges(robot, position, file) for robot in robots]
        found = [joint_limits(each, **given, hand_speed=hand, file=file) for each in robots]
        return robots, found


def _number(name: str, value: str) -> float | str:
    """Return a number, or a share as it is."""
    number = value.rpartition("=")[2]
    try:
        return number if number.endswith("%") else float(number)
    except ValueError:
        option = f"--{name.replace('_', '-')} {value}"
        raise ValueError(f"{option}: must be LIMIT or JOINT=LIMIT") from None


def _limit(name: str, values: Sequence[str] | None) -> Given:
    """Return one number for all joints, or numbers by joint."""
    by_joint: dict[str, float | str] = {}
    for value in values or ():
        joint = value.rpartition("=")[0]
        limit = _number(name, value)
        if not joint and len(values or ()) > 1:
            raise ValueError(f"--{name}: several limits must be JOINT=LIMIT each, got {value}")
        if not joint:
            return limit
        by_joint[joint] = limit
    return by_joint or None


# Kinds of obstacles: their classes, and names and counts of the numbers of each.
_OBSTACLES: dict[str, tuple[type[Obstacle], dict[str, int]]] = {
    "box": (Box, {"centre": 3, "size": 3, "rotation": 3}),
    "ball": (Ball, {"centre": 3, "radius": 1}),
    "capsule": (Capsule, {"start": 3, "end": 3, "radius": 1}),
    "half-space": (HalfSpace, {"point": 3, "normal": 3}),
}


def as_obstacle(text: str) -> Obstacle:
    """Return an obstacle from a text such as `box:0.5,0,0.2,0.3,0.3,0.4`, which is its name.

    The numbers are those of the fields of `Box`, `Ball`, `Capsule` or `HalfSpace` in their order; a
    box may end in roll, pitch and yaw [rad], as in URDF.

    Raises:
        ValueError: another kind, or other numbers.
    """
    kind, _, numbers = text.partition(":")
    cls, counts = _OBSTACLES.get(kind, (None, {}))
    values = _numbers("obstacle", text, numbers)
    sizes = {sum(counts.values()), sum(counts.values()) - counts.get("rotation", 0)}
    if cls is None or len(values) not in sizes:
        raise ValueError(
            f"--obstacle {text}: must be box:x,y,z,sx,sy,sz or box:x,y,z,sx,sy,sz,roll,pitch,yaw, "
            "ball:x,y,z,radius, capsule:x,y,z,x,y,z,radius or half-space:x,y,z,nx,ny,nz"
        )
    parts = np.split(values, np.cumsum([*counts.values()]))
    fields: dict[str, Any] = {
        name: part if count > 1 else float(part[0])
        for (name, count), part in zip(counts.items(), parts, strict=False)
        if part.size
    }
    if "rotation" in fields:
        fields["rotation"] = Rotation.from_euler("xyz", fields["rotation"]).as_matrix()
    try:
        return cls(**fields, name=text)
    except ValueError as error:
        raise ValueError(f"--obstacle {text}: {error}") from None


def with_load(robot: Model, payload: str | None) -> Model:
    """Return the robot with a payload in each hand from a text: its mass, centre and inertia.

    Raises:
        ValueError: not 1, 4, 7 or 10 numbers, or no possible payload.
    """
    if payload is None:
        return robot
    values = _numbers("payload", payload, payload)
    if values.size not in (1, 4, 7, 10):
        raise ValueError(f"--payload {payload}: must be MASS[,x,y,z[,ixx,iyy,izz[,ixy,ixz,iyz]]]")
    mass = values[0]
    centre = values[1:4]
    moments = np.zeros(6)
    moments[: max(values.size - 4, 0)] = values[4:]
    (xx, yy, zz) = moments[:3]
    (xy, xz, yz) = moments[3:]
    inertia = None if values.size < 7 else [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    for hand in reversed(robot.hands):  # the first is the hand again
        robot = robot.with_hand(hand)
        robot = robot.with_payload(mass, centre if centre.size else np.zeros(3), inertia)
    return robot


def _numbers(option: str, given: str, text: str) -> Array:
    """Return numbers separated by commas."""
    try:
        return np.array([float(each) for each in text.split(",")])
    except ValueError:
        raise ValueError(f"--{option} {given}: must have numbers between commas") from None


@dataclass(frozen=True)
class ManyRecordings:
    """Options of the analysis of many recordings.

    Attributes:
        jobs: number of processes; default: one for each core.
        scheduler: address of a Dask cluster, such as tcp://host:8786, whose workers see the same
            files; needs the extra cluster.
        recursive: also take files in the folders within a folder, except results of analyses.
        subjects: CSV with the columns file and subject, and if known trial, height [m] and mass
            [kg].
        subject_from: pattern of the paths without their suffix, such as `{subject}/{trial}` or
            `{subject}_*_{trial}`; default: the subject in the file, or the name of its folder.
        time_limit: time after which a recording is left out [s]; not with --scheduler.
        study: also fit the joint inertia of every subject, and write the statistics over subjects
            (see `geodesic-ocp study`) to the folder study of the results.
        figures: also draw a figure of every recording, in the folder results.
        tables_only: only write the tables from the results so far, also while another run works.
    """

    jobs: int | None = None
    scheduler: str | None = None
    recursive: Flag = False
    subjects: Path | None = None
    subject_from: str | None = None
    time_limit: float | None = None
    study: Flag = False
    figures: Flag = False
    tables_only: Flag = False

    def given(self) -> dict[str, Any]:
        """Return the options that are not the defaults."""
        pairs = ((each, getattr(self, each.name)) for each in fields(self))
        return {each.name: value for each, value in pairs if value != each.default}


RecordingOptions = Annotated[RecordingSettings, Parameter(name="*", group="Recording")]
AnalysisOptions = Annotated[AnalysisSettings, Parameter(name="*", group="Analysis")]
ManyOptions = Annotated[ManyRecordings, Parameter(name="*", group="Many recordings")]
LimitOptions = Annotated[GivenLimits, Parameter(name="*", group="Limits of the joints")]
# A fit has the filter's and the rules' settings, and a penalty and a measure of its own.
_OF_FITS = re.compile(
    r"^(?!resample|filter|metric|armature|count|penalty|error|measure|spacing|uncertainty|effort)"
)
FitOptions = Annotated[
    AnalysisSettings, Parameter(name="*", group="Recording and cuts", parse=_OF_FITS)
]
# Settings that are no text: obstacles, and pairs of links.
_IN_PYTHON_ONLY = re.compile(r"^(?!obstacles|pairs)")
RetargetingOptions = Annotated[
    RetargetingSettings, Parameter(name="*", group="Retargeting", parse=_IN_PYTHON_ONLY)
]


def arms_that_move(names: Sequence[str], joints: Sequence[str]) -> Sequence[str]:
    """Return names of robots, in place of a body the arm of it whose joints a trajectory has."""
    if not set(names) <= set(ROBOTS):
        return names
    moved = sorted(joint.rpartition("/")[2] for joint in joints)
    choices = list(product(*((name, *ROBOTS[name].arms) for name in names)))
    for chosen in choices if len(choices) > 1 else ():
        if moved == sorted(joint for name in chosen for joint in load_model(name).joint_names):
            return chosen
    return names


def with_hand_of(robot: Model, side: Side | None) -> Model:
    """Return the robot with, of the right and the left hand of a body, that of a side."""
    return robot.with_hand(robot.hands[side == "left"]) if len(robot.hands) == 2 else robot


def each_side(side: Sides) -> list[Side]:
    """Return the sides that an option names."""
    return ["right", "left"] if side == "both" else [side]
