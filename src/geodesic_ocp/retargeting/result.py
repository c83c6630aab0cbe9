"""Retargeting, the result of `retarget`: synergies, motion, tables, figure, files, and warnings."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.arrays import Array, rotation_vector
from geodesic_ocp.execution.check_trajectory import TrajectoryCheck, check_trajectory
from geodesic_ocp.execution.clearance import Clearance, least_distances
from geodesic_ocp.execution.motion_measures import measures_table
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory
from geodesic_ocp.figures import save_figure
from geodesic_ocp.records import write_together
from geodesic_ocp.retargeting.arm_result import (
    OUT_OF_REACH,
    TOO_NEAR,
    RetargetedArm,
    compare_under_equal_limits,
)
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.retargeting.synergy_paths import PlannedPaths
from geodesic_ocp.synergies.synergy import Synergy, save_synergies
from geodesic_ocp.tables import markdown, new_table, save_tables
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

_TOUCHING = 1e-3  # [m]
METHODS = {"synergies": "geodesic synergies", "ik": "inverse kinematics"}


@dataclass(frozen=True, eq=False, repr=False)
class Retargeting:
    """A person's synergies on a robot, or on several arms at once.

    Attributes:
        arms: the result for each arm, or for each hand of a body; usually there is one.
        planned: the trajectory in continuous time.
        paths: what the program over all synergies found; None for free geodesics.
        clearance: the distances that were to be kept; None: none are known.
        rate: rate of `trajectory` [Hz].
        settings: settings of the retargeting.
        seconds: computing time.
    """

    arms: tuple[RetargetedArm, ...]
    planned: PlannedTrajectory
    paths: PlannedPaths | None
    clearance: Clearance | None
    rate: float
    settings: RetargetingSettings
    seconds: float

    def __repr__(self) -> str:
        lines = [repr(arm) for arm in self.arms]
        time = f"{self.stretch:.2f} times the person's time"
        return "\n".join([f"Retargeting: {time}, found in {self.seconds:.1f} s", *lines[:2]])

    def _repr_markdown_(self) -> str:
        return markdown(self.table())

    @property
    def bodies(self) -> tuple[RetargetedArm, ...]:
        """The arms, each once: of a body with several hands, that of the first hand."""
        first = {arm.body: arm for arm in reversed(self.arms)}
        return tuple(first[number] for number in sorted(first))

    @property
    def synergies(self) -> tuple[Synergy, ...]:
        """The robot's synergies, one arm after the other."""
        return tuple(synergy for arm in self.bodies for synergy in arm.synergies)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joint names of all arms, with the number of the arm in front if two arms share a name."""
        return self.planned.joint_names

    @cached_property
    def trajectory(self) -> JointTrajectory:
        """The robot's trajectory: all joints at a uniform rate, by default from rest to rest."""
        return self.planned.sampled(self.rate)

    @cached_property
    def motion(self) -> Motion:
        """The robot's motion, all joints, at the samples of the recording, in robot time."""
        motions = [arm.motion for arm in self.bodies]
        q = np.hstack([each.q for each in motions])
        v = np.hstack([np.asarray(each.velocity) for each in motions])
        return Motion(motions[0].time, q, self.joint_names, v)

    @property
    def success(self) -> bool:
        """True if paths and trajectory were found, within the limits asked for, no links touch, and
        no pose is missed by more than the tolerance; `faults` says what is wrong.

        Free geodesics and `limits=False` ask for no limits; `check` tells of all.
        """
        return not self.faults

    @cached_property
    def faults(self) -> tuple[str, ...]:
        """Why the result is no success, a sentence each: those of `unfit`, and missed poses."""
        return (*self.unfit, *self._missed)

    @property
    def is_wanting(self) -> bool:
        """True if another plan might mend a fault: limits that are not known it cannot."""
        return bool(self.motion_faults or self._missed)

    @cached_property
    def _missed(self) -> tuple[str, ...]:
        return tuple(sentence for arm in self.arms for sentence in _missed_poses(arm))

    @cached_property
    def unfit(self) -> tuple[str, ...]:
        """Why the trajectory should not run on a robot, a sentence each."""
        unknown = dict.fromkeys(name for arm in self.bodies for name in arm.limits.unknown)
        if not unknown or not self.settings.within_limits:
            return self.motion_faults
        sentence = (
            f"no limit on the speed of {', '.join(unknown)} is known: give one (velocity, or "
            "--velocity), infinite for none"
        )
        return (*self.motion_faults, sentence)

    @cached_property
    def motion_faults(self) -> tuple[str, ...]:
        """Faults of paths and trajectory, a sentence each; limits that are not known are none."""
        found = [] if self.planned.success else [f"trajectory not found: {self.planned.status}"]
        failed = (each.status for arm in self.arms for each in arm.transfers if not each.success)
        found += [f"path not found: {status}" for status in dict.fromkeys(failed)]
        found += [f"{joint} is too weak to hold its arm" for joint in self.too_weak]
        if self.settings.within_limits:
            found += self.check.violations
        elif self.touches:
            found.append("links touch")
        return tuple(found)

    @property
    def caveats(self) -> tuple[str, ...]:
        """Why the person's motion may not be what was recorded, a sentence for each analysis."""
        found = (arm.analysis.motion.caveat for arm in self.arms)
        return tuple(dict.fromkeys(filter(None, found)))

    @property
    def touches(self) -> bool:
        """True if links touch each other or an obstacle, where geometry is known."""
        least = self.check.clearance
        return least is not None and least < _TOUCHING

    @property
    def too_weak(self) -> tuple[str, ...]:
        """Joints that cannot hold their arm on its paths, and whose torque is not limited."""
        return tuple(
            name
            for arm, timed in zip(self.bodies, self.planned.arms, strict=True)
            for name, given, used in zip(
                arm.robot.joint_names, arm.limits.torque, timed.limits.torque, strict=True
            )
            if used > given
        )

    @property
    def stretch(self) -> float:
        """Duration over the person's; 1 if the limits of the joints allow the person's time."""
        return self.planned.stretch

    @property
    def too_near(self) -> tuple[tuple[str, float, float], ...]:
        """Links closer than they are to be: names, by how much [m], time in the recording [s]."""
        return () if self.paths is None else self.paths.too_near

    @cached_property
    def check(self) -> TrajectoryCheck:
        """True if the trajectory keeps all limits, is consistent, and no links touch."""
        clearance = self.clearance
        if clearance is not None:
            clearance = replace(clearance, lower=np.full(len(clearance.names), _TOUCHING))
        return check_trajectory(
            self.trajectory,
            [arm.robot for arm in self.bodies],
            [arm.limits for arm in self.bodies],
            gravity=[arm.gravity for arm in self.bodies],
            rest=self.settings.rest,
            clearance=clearance,
        )

    def comparison(self, arm: int = 0) -> DataFrame:
        """Return measures beside inverse kinematics under the same limits, in two times.

        In this time and in the person's: energy, torque, smoothness, likeness to the person, errors
        of the hand, and the time that it takes (`compare_under_equal_limits`).

        Args:
            arm: number of the arm, or of the hand of a body.
        """
        one = self.arms[arm]
        settings = self.settings
        found = compare_under_equal_limits(
            self.planned,
            one.analysis.motion,
            one.mapping,
            arm=one.body,
            body=one if len(one.hands) > 1 else None,
            rate=self.rate,
            turning=settings.orientation_weight > 0.0,
            placing=settings.position_weight > 0.0,
            starts=one.baseline.positions[0],
        )
        return measures_table(found)

    def table(self) -> DataFrame:
        """Get action, speed and errors of the hand, of the synergies and of inverse kinematics."""
        rows = [
            {
                "arm": arm.title,
                "method": METHODS[method],
                "action [J s]": found.action,
                "peak speed [limit]": found.peak_speed if arm.has_speed_limits else None,
                "hand, mean [m]": found.position,
                "hand, mean [rad]": found.orientation,
                "limit violation [rad or m]": found.limit_violation,
            }
            for arm in self.arms
            for method, found in arm.statistics.items()
        ]
        note = "Means over the recording's samples; in comparison.csv, over the robot's time."
        note = " ".join([note, *self.caveats])
        return new_table(tuple(rows[0]), [tuple(row.values()) for row in rows], note)

    def synergy_table(self) -> DataFrame:
        """Return the robot's synergies, with the person's from which they are made; both count from
        1.
        """
        rows: list[dict[str, str | int | float | None]] = []
        for arm in self.arms:
            parts = zip(arm.groups, arm.synergies, arm.transfers, strict=True)
            for number, (group, synergy, transfer) in enumerate(parts, 1):
                rows.append(
                    {
                        "arm": arm.name,
                        "synergy": number,
                        "person's synergies": _span(group.members),
                        "dropped": _span(group.dropped),
                        "kind": group.kind,
                        "start [s]": synergy.start_time,
                        "duration [s]": synergy.duration,
                        "time scaled by": synergy.duration / arm.seconds(group),
                        "length [kg^1/2 m]": synergy.length,
                        "hand error [m]": transfer.position_error,
                        "hand error [rad]": transfer.rotation_error,
                        "iterations": transfer.iterations,
                        "status": transfer.status,
                    }
                )
        notes = []
        for arm in self.arms:
            name = arm.name
            (distance, angle) = arm.pose_errors[0]
            notes.append(f"{name} begins {distance:.2g} m and {angle:.2g} rad from its first pose.")
            if arm.mapping.turned:
                turned = "is turned by 180 degrees, the same grasp; errors are from poses so turned"
                notes.append(f"The gripper of {name} {turned}.")
        return new_table(tuple(rows[0]), [tuple(row.values()) for row in rows], " ".join(notes))

    def save(self, folder: str | FilePath, *, figure: Figure | None = None) -> list[FilePath]:
        """Write tables, synergies, trajectory and a figure to a folder.

        The trajectory is at a uniform rate, with consistent positions, velocities and
        accelerations, and meets the limits of the joints.

        table.csv and table.md, synergies.csv and synergies.md (`synergy_table`), comparison.csv and
        comparison.md (`comparison`; comparison_0 and so on for several arms), trajectory.csv,
        trajectory.json (the message JointTrajectory of ROS 2), trajectory.npz (NumPy arrays with
        names and units), for each arm synergies.json, or synergies_0.json and so on, and, if a
        figure is given, figure.png and figure.pdf.

        Args:
            folder: is made if there is none.
            figure: of the retargeting, as `go.plot` draws it; None: none is written.

        Returns:
            Paths of the files.

        Raises:
            OSError: the folder cannot be made or written to.
        """
        return write_together(folder, lambda made: self._write(made, figure))

    def _write(self, made: FilePath, figure: Figure | None) -> None:
        tables = {"table": self.table(), "synergies": self.synergy_table()}
        for number in range(len(self.arms)):
            name = "comparison" if len(self.arms) == 1 else f"comparison_{number}"
            tables[name] = self.comparison(number)
        save_tables(made, tables)
        for suffix in ("csv", "json", "npz"):
            self.trajectory.save(made / f"trajectory.{suffix}")
        if figure is not None:
            save_figure(figure, made)
        for number, arm in enumerate(self.bodies):
            name = "synergies.json" if len(self.bodies) == 1 else f"synergies_{number}.json"
            save_synergies(
                made / name,
                synergies=arm.synergies,
                joint_names=arm.robot.joint_names,
                model=arm.robot,
                doubts=arm.analysis.motion.doubts,
            )


def waist_motion(arm: RetargetedArm) -> str:
    """Return a sentence on how far the joints that all hands of a body share move, beside those of
    the person's trunk.
    """
    names = arm.robot.shared_joints
    columns = [arm.robot.joint_names.index(name) for name in names]
    found = [
        f"{name} {np.ptp(arm.trajectory.positions[:, column]):.2g} {arm.robot.units[column]}"
        for name, column in zip(names, columns, strict=True)
    ]
    turns = arm.mapping.waist_turns(arm.analysis.motion.q)
    thorax = float(np.linalg.norm(rotation_vector(turns), axis=1).max())
    person = f"the person's thorax turns by up to {thorax:.2g} rad"
    if not arm.analysis.model.shared_joints:
        person = "the recording has no trunk, so that upright is its target"
    return f"the waist of {arm.robot.name} moves by {', '.join(found)}; {person}"


def _span(indices: tuple[int, ...]) -> str:
    """Return numbers, from 1, of indices as text: "3", "3-5", "3, 5", or "-" for none."""
    parts = []
    for _, run in groupby(enumerate(indices), key=lambda each: each[1] - each[0]):
        numbers = [index + 1 for _, index in run]
        parts.append("-".join(map(str, dict.fromkeys((numbers[0], numbers[-1])))))
    return ", ".join(parts) or "-"


# A hand's path is a detour if it is longer than this factor times the person's, and this much more.
_FACTOR = 2.0  # [m], [rad]
_MORE = 0.15  # [m], [rad]
_MORE_ANGLE = 1.0  # [m], [rad]
_SLOW = 3.0  # times the person's time
_WHY = {
    TOO_NEAR: ", at which links would be too near each other",
    OUT_OF_REACH: ", which is out of reach",
}
_SAMPLES = 41
_REPORTED = 6
_LACKING = 1e-4  # [m] of a margin that need not be told
_ROUNDED = 1.001  # times a share, as the motion is sampled


def warn_of_detours(result: Retargeting) -> None:
    """Warn of missed poses, detours of the hand, slow synergies, links nearer than the margin, and
    torques beyond the share.

    Warns:
        UserWarning: one, with a sentence for each.
    """
    found = [
        f"{name} are {amount:.2g} m too near at {when:.2f} s of the recording"
        for name, amount, when in result.too_near
    ]
    if result.touches and not found:
        found.append("links touch on the trajectory, as `Retargeting.check` says in detail")
    found += [*_nearer_than_margin(result), *_beyond_share(result)]
    for arm in result.arms:
        found += [*_missed_poses(arm), *_of_arm(arm)]
    if found:
        more = f"; and {len(found) - _REPORTED} more" if len(found) > _REPORTED else ""
        warnings.warn("; ".join(found[:_REPORTED]) + more, UserWarning, 4)


def _nearer_than_margin(result: Retargeting) -> Iterator[str]:
    """Yield links that keep their margin on the paths, but not on the trajectory."""
    if result.clearance is None or result.touches:
        return
    least, samples = least_distances(result.clearance, result.trajectory.positions)
    lower = result.clearance.lower
    known = {name for name, *_ in result.too_near}
    named = dict[str, int]()
    for k in np.argsort(least).tolist():
        name = result.clearance.names[k].partition(" (")[0]
        if least[k] < lower[k] - _LACKING and name not in known:
            named.setdefault(name, k)
    for name, k in named.items():
        yield (
            f"{name} come as near as {1e3 * least[k]:.3g} mm at "
            f"{result.trajectory.time[samples[k]]:.2f} s, less than their margin of "
            f"{1e3 * lower[k]:.3g} mm"
        )


def _beyond_share(result: Retargeting) -> Iterator[str]:
    """Yield joints that take more than the share of their torque limits, see `usable_torque`."""
    efforts = result.trajectory.efforts
    share = result.settings.torque_share
    if efforts is None or not result.settings.within_limits:
        return
    limits = np.concatenate([arm.limits.torque for arm in result.bodies])
    taken = np.abs(efforts).max(axis=0) / limits
    beyond = np.flatnonzero((taken > _ROUNDED * share) & (taken <= _ROUNDED))
    if not beyond.size:
        return
    columns = np.cumsum([arm.robot.dof for arm in result.bodies])[:-1]
    parts = np.split(result.trajectory.positions, columns, axis=1)
    held = [
        arm.robot.inverse_dynamics(q, 0.0 * q, 0.0 * q, arm.gravity)
        for arm, q in zip(result.bodies, parts, strict=True)
    ]
    holding = np.abs(np.hstack(held)).max(axis=0) / limits
    for joint in beyond:
        yield (
            f"{result.joint_names[joint]} takes {taken[joint]:.3g} of its torque limit, more than "
            f"the share of {share:.3g}, as holding the arm takes up to {holding[joint]:.3g}"
        )


def _place(arm: RetargetedArm, number: int) -> str:
    time = arm.analysis.motion.time
    group = arm.groups[number - 1]
    span = f"{time[group.start]:.2f} to {time[group.stop]:.2f} s of the recording"
    return f"synergy {number} of {arm.name} ({span})"


def _missed_poses(arm: RetargetedArm) -> Iterator[str]:
    for number, (distance, angle) in arm.missed.items():
        off = f"{distance:.3g} m and {angle:.3g} rad from its"
        status = arm.transfers[number - 1].status if number else ""
        why = _WHY.get(OUT_OF_REACH if number in arm.out_of_reach else status, "")
        why += " or an obstacle" if status == TOO_NEAR and arm.settings.obstacles else ""
        if number in arm.out_of_reach and (least := arm.out_of_reach[number][0]) < distance:
            why += f": the nearest that was found is {least:.3g} m away"
        if number == 0:
            yield f"{arm.name} begins {off} first pose{why}"
        else:
            yield f"{_place(arm, number)} ends {off} pose{why}"


def _of_arm(arm: RetargetedArm) -> Iterator[str]:
    parts = zip(arm.groups, arm.transfers, arm.synergies, strict=True)
    for number, (group, transfer, synergy) in enumerate(parts, 1):
        if group.kind == "rest":
            continue
        where = _place(arm, number)
        of_person = _lengths(*(each[group.start : group.stop + 1] for each in arm.target_poses))
        of_robot = _lengths(*arm.robot.hand_pose(transfer.path(np.linspace(0.0, 1.0, _SAMPLES))))
        kinds = [("moves", _MORE, "m"), ("turns", _MORE_ANGLE, "rad")]
        if transfer.pose.rotation is None:
            kinds = kinds[:1]
        for mine, theirs, (verb, more, unit) in zip(of_robot, of_person, kinds, strict=False):
            if mine > _FACTOR * theirs + more:
                person = f"the person {verb} it by {theirs:.2g} {unit}"
                yield f"{where} {verb} the hand by {mine:.2g} {unit}, {person}"
        slower = synergy.duration / arm.seconds(group)
        if slower > _SLOW:
            yield f"{where} takes {slower:.2g} times the person's time"


def _lengths(rotations: Array, positions: Array) -> tuple[float, ...]:
    """Return lengths of the hand's path in position [m] and in orientation [rad]."""
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    turns = np.linalg.norm(
        rotation_vector(rotations[1:] @ rotations[:-1].transpose(0, 2, 1)), axis=-1
    )
    return float(steps.sum()), float(turns.sum())
