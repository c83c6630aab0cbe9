"""geodesic-ocp check-trajectory: whether a robot can execute the trajectory in a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.cli.options import (
    Flag,
    GivenLimits,
    LimitOptions,
    arms_that_move,
    as_obstacle,
    with_load,
)
from geodesic_ocp.cli.terminal import printed_warnings
from geodesic_ocp.execution.check_trajectory import check_trajectory as check
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.model.formats.load_model import load_model
from geodesic_ocp.model.inertias import with_rotor_inertia
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.retargeting.arm_alignment import align, read_alignment
from geodesic_ocp.retargeting.settings import RetargetingSettings, motion_clearance
from geodesic_ocp.trajectory.read_trajectory import read_trajectory

_FREE_FALL = (0.0, 0.0, -9.81)  # [m/s^2]
_SAME = 1e-6  # [m/s^2]


def check_trajectory(
    file: Path,
    /,
    *,
    robot: list[str],
    hand: list[str] | None = None,
    base: list[str] | None = None,
    srdf: Path | None = None,
    alignment: list[Path] | None = None,
    aligned: Flag = False,
    gravity: tuple[float, float, float] | None = None,
    payload: str | None = None,
    obstacle: list[str] | None = None,
    rotor_inertia: bool = True,
    clearance: bool = True,
    moving: Flag = False,
    uneven: Flag = False,
    settings: Path | None = None,
    limits: LimitOptions = GivenLimits(),  # noqa: B008
) -> int:
    """Check that a robot can execute a trajectory; the exit code is 1 if it cannot.

    Args:
        file: trajectory (.csv, .npz, or a message or goal of ROS 2 in .json or .yaml).
        robot: name (see geodesic-ocp models) or file; twice for two arms, in their order. The name
            of a body stands for one of its arms if the trajectory has the joints of that alone.
        hand: hand frame, for a robot from a file; one for all or for each --robot, or the hands of
            a body.
        base: fixed frame of the robot that becomes its base; one for all or for each --robot.
        srdf: SRDF file of the robot, as for retarget.
        alignment: alignment with a person, as written by geodesic-ocp align: gravity is along the
            person's body; one for each --robot, or for each hand of a body.
        aligned: gravity as for a robot that is mounted by its alignment, as by geodesic-ocp
            retarget.
        gravity: acceleration of free fall in the axes of the robot's base [m/s^2]; default:
            0 0 -9.81.
        payload: mass in the hand [kg], at the origin of its frame, or more, as for retarget.
        obstacle: obstacle as for retarget, such as box:x,y,z,sx,sy,sz; repeatable.
        rotor_inertia: add known or default inertia of the motors where the file states none, as
            retarget does.
        clearance: check that links keep clear of each other, where the geometry is known.
        moving: the trajectory need not begin and end at rest.
        uneven: samples need not be evenly spaced in time.
        settings: file (.toml, .json, .yaml) of any of these options.
    """
    del settings
    if aligned + (gravity is not None) + bool(alignment) > 1:
        raise ValueError("--aligned, --alignment and --gravity exclude each other")
    with printed_warnings():
        trajectory = read_trajectory(file)
        names = robot if hand else arms_that_move(robot, trajectory.joint_names)
        hands = [hand] if hand and len(robot) == 1 else _for_each("hand", hand, len(robot))
        robots = [
            load_model(name, hand=own, base=root, srdf=srdf)
            for name, own, root in zip(
                names, hands, _for_each("base", base, len(robot)), strict=True
            )
        ]
        free_fall = _free_fall(robots, gravity, aligned, alignment or ())
    if rotor_inertia:
        robots = [with_rotor_inertia(each) for each in robots]
    robots, found = limits.of_robots([with_load(each, payload) for each in robots])
    bodies = [as_obstacle(each) for each in obstacle or ()]
    if bodies and not clearance:
        raise ValueError("--obstacle and --no-clearance exclude each other")
    result = check(
        trajectory,
        robots,
        found,
        gravity=free_fall,
        rest=not moving,
        uniform=not uneven,
        clearance=_clearance(robots, bodies) if clearance else None,
    )
    rate = "uneven samples" if trajectory.rate is None else f"{trajectory.rate:.6g} Hz"
    print(f"{file}: {len(trajectory.time)} samples, {trajectory.duration:.4g} s, {rate}\n")
    print(result)
    if not result.passed and not aligned and not alignment and gravity is None:
        print("\ngravity was along -z of the robot's base; after retarget, give --aligned")
    if result.clearance is not None:
        print(f"\nleast distance of links: {result.clearance:.3g} m")
    for each, its_limits in zip(robots, found, strict=True):
        print(f"\nlimits of {each.name}:")
        for name, source in its_limits.sources.items():
            print(f"  {name}: {source}")
    return 0 if result.passed else 1


def _for_each(option: str, given: Sequence[str] | None, count: int) -> Sequence[str | None]:
    """Return a frame, or none, for each robot.

    Raises:
        ValueError: neither one nor one for each.
    """
    if not given or len(given) == 1:
        return [given[0] if given else None] * count
    if len(given) != count:
        raise ValueError(f"--{option}: one for all or for each --robot, got {', '.join(given)}")
    return given


def _free_fall(
    robots: Sequence[Model],
    given: tuple[float, float, float] | None,
    aligned: bool,
    files: Sequence[Path],
) -> Array:
    """Return the acceleration of free fall in the axes of each robot's base [m/s^2]."""
    hands = [len(each.hands) for each in robots]
    if files and len(files) not in (len(robots), sum(hands)):
        of_each = "one for each --robot, or for each hand of a body"
        raise ValueError(f"--alignment: {of_each}, got {len(files)}")
    if not files and not aligned:
        return np.tile(np.asarray(given or _FREE_FALL, dtype=float), (len(robots), 1))
    mounted = [read_alignment(each) for each in files] or [align(each) for each in robots]
    falls = np.array([np.asarray(each.base) @ _FREE_FALL for each in mounted])
    if len(falls) == len(robots):
        return falls
    of_robots = np.split(falls, np.cumsum(hands)[:-1])
    if max(np.ptp(each, axis=0).max() for each in of_robots) > _SAME:
        raise ValueError("--alignment: those of the hands of a body differ in what is up")
    return np.array([each[0] for each in of_robots])


def _clearance(robots: Sequence[Model], obstacles: Sequence[Obstacle]) -> Clearance | None:
    """Return the distances that `retarget` keeps; None, with a note, without geometry.

    Raises:
        ValueError: obstacles without geometry.
    """
    reason: object = "the robot has no collision geometry"
    try:
        found = motion_clearance(robots, RetargetingSettings(obstacles=tuple(obstacles)))
    except ValueError as error:
        found = None
        reason = error
    if found is None and obstacles:
        raise ValueError(f"--obstacle: distances are not known: {reason}")
    if found is None:
        print(f"note: clearance is not checked: {reason}")
    return found
