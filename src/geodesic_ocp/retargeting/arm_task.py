"""One arm's motion on a robot: poses carried over, paths, times, and the baseline."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.manifold.kinetic_energy import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.alignment import Alignment
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup, merge_synergies
from geodesic_ocp.retargeting.targets import (
    REACHED,
    Conditions,
    Goal,
    Pose,
    first_configuration,
    goals,
    near_configuration,
)
from geodesic_ocp.retargeting.time_scaling import Arm, Timing, hand_over_speeds
from geodesic_ocp.retargeting.transfer import Transfer, transferred, velocity_limits
from geodesic_ocp.synergies.reconstruct import Synergy
from geodesic_ocp.synergies.segment import speeds
from geodesic_ocp.synergies.track_hand import steps_between, track_poses
from geodesic_ocp.trajectory.joint_trajectory import Trajectory
from geodesic_ocp.trajectory.motion import Motion


@dataclass(frozen=True)
class Request:
    """What is asked of every arm; see `retarget`.

    Attributes:
        scale, mirror, drop, merge: None for the defaults.
        placing, turning: whether the hand's position and its rotation count.
        conditions: of the paths.
    """

    scale: float | None
    mirror: bool | None
    drop: float | None
    merge: float | None
    placing: bool
    turning: bool
    conditions: Conditions


@dataclass(frozen=True, eq=False)
class Carrying:
    """From a person's configurations to poses of a robot's hand.

    Attributes:
        model: of the person's arm.
        source, target: alignments of the person and of the robot.
        scale: of positions.
        mirror: whether left and right are exchanged.
    """

    model: Model
    source: Alignment
    target: Alignment
    scale: float
    mirror: bool

    @classmethod
    def between(
        cls, model: Model, source: Alignment, target: Alignment, request: Request
    ) -> Carrying:
        """With the ratio of the arms' lengths, mirrored where the sides differ, unless asked."""
        mirror, scale = request.mirror, request.scale
        if mirror is None:
            mirror = None not in (source.side, target.side) and source.side != target.side
        if scale is None:
            scale = target.length / source.length
        return cls(model, source, target, as_positive("scale", scale), bool(mirror))

    def __call__(self, q: Array) -> tuple[Array, Array]:
        """Rotations (k, 3, 3) and positions (k, 3) [m] in the robot's base, of configurations (k, n)."""
        rotation, position = self.source.person(*self.model.hand_pose(q))
        return self.target.carried(rotation, position, scale=self.scale, mirror=self.mirror)


@dataclass(frozen=True, eq=False)
class Task:
    """One arm's motion and what is to become of it.

    Attributes:
        motion: of the person.
        synergies: of the person.
        robot: the arm.
        carrying: from the person's configurations to poses of the robot's hand.
        groups: the synergies, dropped and merged.
        hand: rotations (k, 3, 3) and positions (k, 3) of the robot's hand at all samples, carried
            over.
        first: pose at the beginning.
        start: configuration of the robot to begin in (n,).
        begin: by how much that misses the first pose [m], [rad]; nothing where it was given.
        goals: the pose at the end of each group; None of a rest.
        conditions: of the paths.
    """

    motion: Motion
    synergies: Sequence[Synergy]
    robot: Model
    carrying: Carrying
    groups: tuple[SynergyGroup, ...]
    hand: tuple[Array, Array]
    first: Pose
    start: Array
    begin: tuple[float, float]
    goals: tuple[Goal | None, ...]
    conditions: Conditions

    @classmethod
    def of(
        cls,
        motion: Motion,
        synergies: Sequence[Synergy],
        robot: Model,
        carrying: Carrying,
        first: ArrayLike | None,
        request: Request,
    ) -> Task:
        """With the poses carried over, and the first configuration found.

        Raises:
            ValueError: the first configuration that is given does not fit, or thresholds do not.
            NotConverged: no configuration is clear of bodies.
        """
        conditions = request.conditions
        groups = merge_synergies(synergies, drop=request.drop, merge=request.merge)
        rotations, positions = carrying(motion.q)
        poses = tuple(
            Pose(
                rotations[k] if request.turning else None, positions[k] if request.placing else None
            )
            for k in _samples(groups)
        )
        start = first_configuration(robot, poses[0], conditions, first)
        found = [
            None if group.kind == "rest" else pose
            for group, pose in zip(groups, poses[1:], strict=True)
        ]
        asked = [pose for pose in found if pose is not None]
        reached = iter(goals(robot, start, asked, conditions))
        wanted = tuple(None if pose is None else next(reached) for pose in found)
        begin = (0.0, 0.0) if first is not None else poses[0].miss(robot, start)
        hand = (rotations, positions)
        return cls(
            motion,
            synergies,
            robot,
            carrying,
            groups,
            hand,
            poses[0],
            start,
            begin,
            wanted,
            conditions,
        )

    @property
    def out_of_reach(self) -> dict[int, tuple[float, float]]:
        """By number of the pose how far the nearest is [m], [rad]; 0 is the first."""
        far = {
            number + 1: goal.missed
            for number, goal in enumerate(self.goals)
            if goal is not None and not goal.within_reach
        }
        return far if max(self.begin) <= REACHED else {0: self.begin, **far}

    @property
    def edges(self) -> Array:
        """Instants of the recording at which groups begin and end [s]."""
        return np.asarray(self.motion.time[_samples(self.groups)])

    def planned(self, throw: bool, progress: Callable[[int], object]) -> list[Transfer]:
        """The robot's paths, one for each group; see `transferred`."""
        return transferred(
            self.robot,
            self.start,
            self.goals,
            np.diff(self.edges).tolist(),
            self.conditions,
            throw=throw,
            progress=progress,
        )

    def to_be_timed(self, transfers: Sequence[Transfer], speed_limits: bool, rest: bool) -> Arm:
        """The paths with the speeds at which they hand over; from rest to rest on demand."""
        of_person = speeds(KineticEnergy(self.carrying.model), self.motion)
        lengths = [
            sum(self.synergies[number].length for number in group.members) for group in self.groups
        ]
        paths = [transfer.path for transfer in transfers]
        handing = hand_over_speeds(
            of_person[_samples(self.groups)],
            np.array(lengths),
            np.diff(self.edges),
            np.array([path.length for path in paths]),
        )
        if rest:
            handing[[0, -1]] = 0.0
        fastest = velocity_limits(self.robot)
        return Arm(
            self.edges, paths, handing, fastest if speed_limits else np.full_like(fastest, np.inf)
        )

    def in_time(
        self, transfers: Sequence[Transfer], timing: Timing, number: int
    ) -> tuple[tuple[Synergy, ...], Trajectory]:
        """The robot's synergies, and its trajectory at the recording's samples."""
        time = timing(self.motion.time)
        synergies = tuple(
            Synergy(group.start, group.stop, float(time[group.start]), transfer.path, law)
            for group, transfer, law in zip(
                self.groups, transfers, timing.laws[number], strict=True
            )
        )
        positions, velocities, accelerations = np.empty((3, time.size, self.robot.dof))
        for synergy in synergies:
            # A shared sample belongs to the synergy that begins there.
            here = slice(synergy.start, synergy.stop + 1)
            positions[here], velocities[here], accelerations[here] = synergy.states(time[here])
        names = self.robot.joint_names
        return synergies, Trajectory(time, positions, velocities, accelerations, names)

    def followed(self, timing: Timing) -> Motion:
        """The baseline: the whole way of the hand, followed by a velocity controller."""
        motion, time = self.motion, timing(self.motion.time)

        def poses(instants: Array) -> tuple[Array, Array]:
            # Back from the robot's time, which is stretched evenly between two samples.
            return self.carrying(motion(np.interp(instants, time, motion.time)))

        turning = self.first.rotation is not None
        placing = self.first.position is not None
        counts = steps_between(motion)
        # From a configuration of one's own it would first rush to the hand's place.
        start = near_configuration(self.robot, self.start, self.first, self.conditions)
        followed = track_poses(
            self.robot, start, time, poses, counts=counts, turning=turning, placing=placing
        )
        return replace(followed, subject=motion.subject)


def _samples(groups: Sequence[SynergyGroup]) -> list[int]:
    """At which groups begin and end (k + 1,)."""
    return [groups[0].start, *(group.stop for group in groups)]
