"""Robots, their trajectories, and their alignments with a person."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from geodesic_ocp.cli.show.shown_robot import is_installed, shown_robot
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.alignment.alignment import read_alignment
from geodesic_ocp.retargeting.alignment.arm_alignment import check_joints
from geodesic_ocp.scenes.motions.of_model import model_playback
from geodesic_ocp.scenes.motions.of_robots import robots_playback
from geodesic_ocp.scenes.motions.of_trajectory import trajectory_playback
from geodesic_ocp.scenes.playback import Playback
from geodesic_ocp.scenes.retargeted.of_alignment import alignment_playback
from geodesic_ocp.synergies.synergy import read_saved_synergies
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.read_trajectory import read_trajectory


def robot_playback(name: str, options: argparse.Namespace) -> Playback:
    """A robot alone, by name or from a file.

    Raises:
        ValueError: there is no such robot or file.
    """
    return model_playback(shown_robot(name, options.hand, options.base))


def trajectory_file(file: Path, options: argparse.Namespace) -> Playback:
    """The robot, or several, that follow a trajectory; two arms of one robot share its body.

    Without --robot, those that the synergies name which retarget wrote beside it.

    Raises:
        RecordingError: the file cannot be read, the robot is not known, or has other joints.
    """
    trajectory = read_trajectory(file)
    names = options.robot or _named_beside(file)
    if not names:
        raise RecordingError(
            f"{file}: is a trajectory of {', '.join(trajectory.joint_names[:3])}, ...; say of "
            "which robot: --robot NAME or FILE"
        )
    robots = [shown_robot(name, options.hand, options.base) for name in names]
    parts = []
    for robot, part in zip(robots, _parts(file, trajectory, robots), strict=True):
        try:
            parts.append(trajectory_playback(part, robot, title=robot.name))
        except ValueError as error:
            raise RecordingError(f"{file}: {error}") from None
    names = list(dict.fromkeys(robot.name for robot in robots))
    return robots_playback(robots, parts, title=f"{' and '.join(names)}, {file.name}")


def _parts(
    file: Path, trajectory: JointTrajectory, robots: Sequence[Model]
) -> Iterator[JointTrajectory]:
    """The trajectory of each robot: its columns follow each other, with any names."""
    dofs = [robot.dof for robot in robots]
    if len(robots) == 1 and set(robots[0].joint_names) <= set(trajectory.joint_names):
        yield trajectory
        return
    if sum(dofs) != len(trajectory.joint_names):
        wanted = " and ".join(f"{robot.name} {robot.dof}" for robot in robots)
        raise RecordingError(
            f"{file}: is a trajectory of {len(trajectory.joint_names)} joints, "
            f"{', '.join(trajectory.joint_names)}; of the robots {wanted}"
        )
    for number, robot in enumerate(robots):
        own = slice(sum(dofs[:number]), sum(dofs[: number + 1]))
        given = trajectory.joint_names[own]
        if not all(a.endswith(b) for a, b in zip(given, robot.joint_names, strict=True)):
            raise RecordingError(
                f"{file}: its joints {', '.join(given)} are not those of {robot.name}, "
                f"{', '.join(robot.joint_names)}"
            )
        kinds = ("positions", "velocities", "accelerations", "efforts")
        arrays = {kind: getattr(trajectory, kind) for kind in kinds}
        cut: dict[str, Any] = {
            kind: None if each is None else each[:, own] for kind, each in arrays.items()
        }
        yield replace(trajectory, joint_names=robot.joint_names, units=trajectory.units[own], **cut)


def _named_beside(file: Path) -> list[str]:
    """Names of the robots in the files of synergies beside a trajectory, if all are known."""
    one = file.with_name("synergies.json")
    beside = [one] if one.is_file() else sorted(file.parent.glob("synergies_[0-9].json"))
    names = [
        read_saved_synergies(each).model.partition(" with ")[0] for each in beside
    ]  # a payload
    if not names or not all(is_installed(name) for name in names):
        return []
    print(f"note: {file}: of {' and '.join(names)}, which is named beside it")
    return names


def alignment_file(file: Path, options: argparse.Namespace) -> Playback:
    """A person's arm, and a robot's in corresponding poses.

    Raises:
        RecordingError: the file cannot be read, or is of another robot; no robot is given.
    """
    aligned = read_alignment(file)
    if not options.robot:
        raise RecordingError(
            f"{file}: is the alignment of a robot; say of which one: --robot NAME or FILE"
        )
    robot = shown_robot(options.robot[0], options.hand, options.base)
    try:
        check_joints(aligned, robot)
    except ValueError as error:
        raise RecordingError(f"{file}: {error}") from None
    return alignment_playback(aligned, robot)
