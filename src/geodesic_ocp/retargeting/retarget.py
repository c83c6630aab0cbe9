"""retarget: a person's synergies on a robot."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.limits import JointLimits, usable_torque
from geodesic_ocp.execution.plan_trajectory import plan_trajectory
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress, no_progress, shows_progress
from geodesic_ocp.retargeting.arm_alignment import Alignment
from geodesic_ocp.retargeting.arm_result import (
    PoseErrors,
    RetargetedArm,
    Transfer,
    transfers_on,
    unattained,
)
from geodesic_ocp.retargeting.candidates import (
    Candidates,
    attained,
    find_start,
    first_candidates,
    graph_weights,
    own_lacks,
)
from geodesic_ocp.retargeting.free_geodesics import free_ends, free_geodesics
from geodesic_ocp.retargeting.paired_arm import PairedArm
from geodesic_ocp.retargeting.pairing import paired_arms
from geodesic_ocp.retargeting.place_base import BasePlacement, best_place
from geodesic_ocp.retargeting.reachability import reachability
from geodesic_ocp.retargeting.result import Retargeting, warn_of_detours
from geodesic_ocp.retargeting.settings import (
    BEYOND,
    RetargetingSettings,
    motion_clearance,
    of_trajectory,
)
from geodesic_ocp.retargeting.synergy_paths import (
    ArmConstraints,
    ArmCost,
    PlannedPaths,
    plan_synergies,
)
from geodesic_ocp.retargeting.waypoints import ArmWaypoints, arm_waypoints
from geodesic_ocp.synergies.analyse import Analysis

_DEFAULT = RetargetingSettings()
_TOLERANCE = 1e-6
_RATE = 100.0  # [Hz]
_WORTH = 0.85  # of the cost through candidates, from which a turned gripper is tried first
# times the person's time, of the motion and of a synergy: too slow
_SLOW = 1.5
_SLOWEST = 2.5
# Times the person's time from which a program is tried in which time weighs so much more, if it
# starts from lines that need at most this share of the time.
_LATE = 1.05
_HURRY = 10.0
_QUICKER = 0.99


@shows_progress
def retarget(
    analysis: Analysis,
    robot: Model,
    *,
    alignment: Alignment | Sequence[Alignment] | None = None,
    person_alignment: Alignment | Sequence[Alignment] | None = None,
    start: ArrayLike | None = None,
    limits: JointLimits | None = None,
    rate: float = _RATE,
    tolerance: float = _TOLERANCE,
    settings: RetargetingSettings = _DEFAULT,
    cost: ArmCost | None = None,
    constraints: ArmConstraints | None = None,
    throw: bool = True,
    progress: Progress | None = None,
) -> Retargeting:
    """Transfer a person's synergies to a robot arm, by the pose of the hand at their ends.

    Short synergies are dropped and small ones merged (`merge_synergies`). The hand's poses at the
    ends of the remaining ones, relative to the shoulder and scaled by the ratio of the arms'
    lengths, are mapped to the robot (`Alignment`). Paths of least energy between these poses are
    found for all synergies at once (`plan_synergies`). Along them, the robot's trajectory has
    continuous accelerations, meets the limits of the joints, and takes more time than the person
    only where these require it (`plan_trajectory`).

    A robot with several hands (`Model.hands`), such as a humanoid's waist with both arms, takes
    over the motion of a person's model with several (`human_upper_body`, or `combine` of two arms):
    the poses of both hands at the ends of the synergies are conditions of one program, in which the
    arms share the waist. It is drawn to the orientation of the person's thorax, or upright if the
    recording has no trunk (`RetargetingSettings.likeness_weight`).

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> arm = go.human_arm("left", height=1.78)
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv", arm.joint_names)
    >>> reach = go.Motion(motion.time[270:430], motion.q[270:430], motion.joint_names)
    >>> analysis = go.analyse(arm, reach)
    >>> robot = go.human_arm("left", height=1.95)
    >>> limits = go.execution.joint_limits(robot, velocity=8.0)  # [rad/s]
    >>> result = go.retarget(analysis, robot, limits=limits, tolerance=1e-3)
    >>> result.success, len(result.synergies)
    (True, 3)

    Args:
        analysis: analysis of the person's motion (`analyse`).
        robot: the arm, or a body with several hands.
        alignment: alignment of the robot's shoulder and hand with the person's, or one for each of
            several hands; None: that of the known robot (`go.retargeting.align`). If poses are then
            out of reach, or links too near or joints too weak at them, the base of one robot is
            moved to where most are attained (`place_base`); if the motion takes 1.5 times the
            person's time, or a synergy 2.5 times, to where it is quicker. If it misses poses, is
            slow or fails there as well, and its arm is longer than the person's, positions are not
            scaled.
            Obstacles, in the frame of the base, move with it. Not if a start, a cost or constraints
            are given.
        person_alignment: likewise of the person's arm, if it is not a `human_arm`.
        start: configuration (n,) to begin in [rad or m]; None: among those with the first pose,
            the one from which the motion as a whole takes least energy and time.
        limits: limits of the robot's joints; None: those of `joint_limits`.
        rate: rate of the trajectory [Hz].
        tolerance: tolerance of limits and poses on the paths, each in its unit, see `solve`.
        settings: everything else.
        cost, constraints: functions of a model, its joints q and v = q'(s) that add to the energy
            and to the limits of the joints along the paths, see `plan_synergies`.
        throw: raise if the paths or the trajectory are not found; else the last iterates are
            returned, and the result says so (`Retargeting.success`).
        progress: called with the current step, the amount done and the total.

    Warns:
        UserWarning: a base that is moved; poses that are out of reach by more than the tolerance,
            with the distances of the nearest ones found; joints that are too weak; poses that are
            missed by more than the tolerance, detours of the hand, links that come too near, and
            synergies that take three times the person's time, with the place in the recording.

    Raises:
        ValueError: arguments of the wrong type or shape; a start outside the limits, or too
            close to an obstacle or within `pairs`.
        NotConverged: the paths or the trajectory were not found.
    """
    if not isinstance(analysis, Analysis):
        raise ValueError(f"analysis must be an Analysis, got {analysis!r}; see retarget_arms")
    if not isinstance(robot, Model):
        raise ValueError(f"robot must be a Model, got {robot!r}; see retarget_arms")
    return retarget_arms(
        [analysis],
        [robot],
        alignments=[alignment],
        person_alignments=[person_alignment],
        starts=[start],
        limits=[limits],
        rate=rate,
        tolerance=tolerance,
        settings=settings,
        cost=cost,
        constraints=constraints,
        throw=throw,
        progress=progress,
    )


@shows_progress
def retarget_arms(
    analyses: Sequence[Analysis],
    robots: Sequence[Model],
    *,
    alignments: Sequence[Alignment | Sequence[Alignment] | None] | None = None,
    person_alignments: Sequence[Alignment | Sequence[Alignment] | None] | None = None,
    starts: Sequence[ArrayLike | None] | None = None,
    limits: Sequence[JointLimits | None] | None = None,
    rate: float = _RATE,
    tolerance: float = _TOLERANCE,
    settings: RetargetingSettings = _DEFAULT,
    cost: ArmCost | None = None,
    constraints: ArmConstraints | None = None,
    throw: bool = True,
    progress: Progress | None = None,
) -> Retargeting:
    """Retarget to several arms that move at once, such as both arms of a person.

    Paths and trajectory of all arms are planned together, in the same time. Two arms of one robot,
    whose models have the same base, are kept clear of each other; the bases of different robots are
    not known to each other.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> arm = go.human_arm("left", height=1.78)
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv", arm.joint_names)
    >>> reach = go.Motion(motion.time[270:430], motion.q[270:430], motion.joint_names)
    >>> analysis = go.analyse(arm, reach)
    >>> robots = [go.human_arm(side, height=1.95) for side in ("left", "right")]
    >>> limits = [go.execution.joint_limits(robot, velocity=8.0) for robot in robots]  # [rad/s]
    >>> result = go.retargeting.retarget_arms(
    ...     [analysis] * 2, robots, limits=limits, tolerance=1e-3
    ... )
    >>> result.success, len(result.joint_names)
    (True, 14)

    Args:
        analyses: analyses of the arms, all of one recording, sample by sample.
        robots: as many arms.
        alignments, person_alignments, starts, limits: as many, or None for the defaults; see
            `retarget`.
        rate, tolerance, settings, cost, constraints, throw, progress: see `retarget`.

    Warns, Raises:
        See `retarget`.
    """
    begin = time.perf_counter()
    report = progress or no_progress
    tolerance = as_positive("tolerance", tolerance)
    rate = as_positive("rate", rate, "Hz")
    pairs = paired_arms(analyses, robots, alignments, person_alignments, limits, starts, settings)
    clearance = motion_clearance(robots, settings)  # of the models as given, whose pairs are kept
    plan = _Plan(clearance, rate, tolerance, throw, report, cost, constraints)
    if settings.constrained:
        bodies = list({pair.body: pair for pair in reversed(pairs)}.values())[::-1]
        movable = len(bodies) == 1 and cost is None and constraints is None
        movable &= settings.position_weight > 0.0
        movable &= all(each is None for given in (alignments, starts) for each in given or ())
        found = plan.of_robot(bodies[0]) if movable else plan.constrained(pairs)
        result, notes = plan.hurried(*found)
    else:
        result, notes = plan.geodesic(pairs)
    report("done", len(pairs), len(pairs))
    for note in notes:
        warnings.warn(note, UserWarning, 3)
    warn_of_detours(result)
    return replace(result, seconds=time.perf_counter() - begin)


_Grasp: TypeAlias = tuple[PairedArm, ArmWaypoints, tuple[Candidates, ...]]


def _grasps(pair: PairedArm, tolerance: float) -> list[_Grasp]:
    """Return the arm, its waypoints and candidates; before it, with its parallel gripper turned by
    180 degrees, if the shortest path through the candidates then costs clearly less.

    It is turned in all poses, as what it holds turns with it.
    """
    turns = pair.mapping.target.parallel_gripper and len(pair.mappings) == 1
    turns &= pair.settings.orientation_weight > 0.0
    found = []
    for each in (pair, pair.turned) if turns else (pair,):
        waypoints = arm_waypoints(each, tolerance)
        found.append((each, waypoints, first_candidates(waypoints)))
    if not turns:
        return found
    costs = [
        find_start(waypoints, graph_weights(waypoints, layers, pair.settings), layers, None).cost
        for _, waypoints, layers in found
    ]
    return found[::-1] if costs[1] < _WORTH * costs[0] else found[:1]


@dataclass(frozen=True, eq=False)
class _Plan:
    """Plans motions of arms, each with sentences to warn of."""

    clearance: Clearance | None
    rate: float
    tolerance: float
    throw: bool
    report: Progress
    cost: ArmCost | None = None
    constraints: ArmConstraints | None = None

    def of_robot(self, pair: PairedArm) -> tuple[Retargeting, list[str]]:
        """Return the motion of one robot, moved if need be; where it is too slow or fails all the
        same, as a longer arm magnifies the person's motion, with positions as they are.
        """
        found = self._moved(pair)
        scale = pair.mapping.scale
        fails = found[0].is_wanting
        if pair.settings.scale is not None or scale <= 1.0:
            return found
        if np.isclose(found[0].arms[0].mapping.scale, 1.0):  # it has them as they are
            return found
        if not fails and _slowness(found[0]) <= 1.0:
            return found
        result, notes = replace(self, throw=False)._moved(pair.scaled(1.0 / scale))
        if _success(result) >= _success(found[0]):
            return found
        note = (
            f"positions of {pair.robot.name} are scaled by {result.arms[0].mapping.scale:.3g}, as "
            f"its motion {'fails' if fails else 'is slow'} with the ratio of the arms' lengths "
            f"(--scale {scale:.3g}): {_times(found[0])}; now {_times(result)}"
        )
        return result, [note, *notes]

    def _moved(self, pair: PairedArm) -> tuple[Retargeting, list[str]]:
        """Return the motion of one robot, from another place if more poses are attained there, or
        if it fails or is slow, and is better there.
        """
        grasps = _grasps(pair, self.tolerance)
        placed = None
        lacks = own_lacks(self.clearance, (grasps[0][1],), 0)
        if not any(all(attained(waypoints, layers, lacks)) for _, waypoints, layers in grasps):
            placed = self._placed(pair)
            if placed[1].gains:
                return self._at(*placed)
        found = None
        failure = None
        try:
            found = self.constrained(list(pair.of_hands), [grasps])
        except NotConverged as error:
            failure = error
        if found is not None and not found[0].motion_faults and _slowness(found[0]) <= 1.0:
            return found
        placed = placed or self._placed(pair)
        if placed[1].cost < placed[1].cost_before:
            other = replace(self, throw=False)._at(*placed)
            found = min(found or other, other, key=lambda each: _success(each[0]))
        if failure is not None and (found is None or not found[0].planned.success):
            raise failure
        assert found is not None
        return found

    def _placed(self, pair: PairedArm) -> tuple[PairedArm, BasePlacement]:
        self.report("placing the base", 0, 1)
        return best_place(pair, self.clearance)

    def _at(self, pair: PairedArm, placement: BasePlacement) -> tuple[Retargeting, list[str]]:
        """Return the motion from another place."""
        result, notes = self.constrained(list(pair.of_hands), None, placement)
        them = ", with its obstacles" if pair.settings.obstacles else ""
        note = (
            f"{pair.robot.name} is moved{them}, as {placement.reason}: {placement}. To keep it "
            "where its alignment has it, pass that alignment (--mount fixed)"
        )
        return result, [note, *notes]

    def constrained(
        self,
        pairs: list[PairedArm],
        grasps: list[list[_Grasp]] | None = None,
        placement: BasePlacement | None = None,
    ) -> tuple[Retargeting, list[str]]:
        """Return the motion of all arms by one program."""
        settings = pairs[0].settings
        clearance = self.clearance
        bodies = list({pair.body: pair for pair in reversed(pairs)}.values())[::-1]  # the first
        kept = None if clearance is None else replace(clearance, lower=clearance.lower + BEYOND)
        grasps = grasps or [_grasps(pair, self.tolerance) for pair in bodies]
        found: list[tuple[PlannedPaths, list[_Grasp]]] = []
        for left in reversed(range(max(map(len, grasps)))):  # others, if this one misses a pose
            chosen = [each[max(len(each) - 1 - left, 0)] for each in grasps]
            arms, candidates = (tuple(each) for each in list(zip(*chosen, strict=True))[1:])
            planned = plan_synergies(
                arms,
                candidates,
                clearance=kept,
                stretch=settings.stretch_weight,
                posture=settings.posture_weight,
                likeness=settings.likeness_weight,
                tolerance=self.tolerance,
                cost=self.cost,
                constraints=self.constraints,
                throw=self.throw and not left and not any(each.success for each, _ in found),
                progress=self.report,
            )
            found.append((planned, chosen))
            if _rank(found[-1][0]) < (False, 1):
                break
        paths, chosen = min(found, key=lambda each: _rank(each[0]))
        arms_of = dict(zip(bodies, (each[0] for each in chosen), strict=True))
        pairs = [arms_of.get(pair, pair) for pair in pairs]
        bodies = list(arms_of.values())
        far = [unattained(pair, chosen[pair.body][2]) for pair in pairs]
        transfers = [transfers_on(pair, paths, each) for pair, each in zip(pairs, far, strict=True)]
        return self._in_time(pairs, bodies, far, transfers, paths, placement)

    def hurried(self, result: Retargeting, notes: list[str]) -> tuple[Retargeting, list[str]]:
        """Return the motion, or a quicker one by a program in which time weighs more, solved if the
        motion is late and the limits allow the lines from which that starts in less time.
        """
        if result.paths is None or result.is_wanting or result.stretch <= _LATE:
            return result, notes
        given = result.paths.program
        arms = result.arms
        bodies = result.bodies
        hurried = replace(given, stretch=_HURRY * given.stretch)
        if hurried.least_time() > _QUICKER * given.least_time():
            return result, notes
        paths = hurried.planned()
        far = [arm.out_of_reach for arm in arms]
        transfers = [transfers_on(arm, paths, each) for arm, each in zip(arms, far, strict=True)]
        placed = paths, arms[0].placement
        tried = replace(self, throw=False)._in_time([*arms], [*bodies], far, transfers, *placed)
        other, more = tried
        if _success(other) >= _success(result):
            return result, notes
        return other, list(dict.fromkeys([*notes, *more]))

    def geodesic(self, pairs: list[PairedArm]) -> tuple[Retargeting, list[str]]:
        """Return the motion of all arms by free geodesics, one after the other."""
        if len({pair.body for pair in pairs}) < len(pairs):
            raise ValueError("the formulation 'geodesic' is of one hand; use 'constrained'")
        free = [free_ends(pair) for pair in pairs]
        transfers = [
            free_geodesics(pair, begin, ends, self.throw, self.report)
            for pair, (begin, ends, _) in zip(pairs, free, strict=True)
        ]
        return self._in_time(pairs, pairs, [each[2] for each in free], transfers)

    def _in_time(
        self,
        pairs: list[PairedArm],
        bodies: list[PairedArm],
        far: list[PoseErrors],
        transfers: list[list[Transfer]],
        paths: PlannedPaths | None = None,
        placement: BasePlacement | None = None,
    ) -> tuple[Retargeting, list[str]]:
        """Return the motion along paths; without distances if it cannot keep them."""
        settings = pairs[0].settings
        notes = _out_of_reach(pairs, far)
        arms = [_along_paths(pair, transfers[pairs.index(pair)], notes) for pair in bodies]
        plan = partial(
            plan_trajectory,
            arms,
            rest=settings.rest,
            deviation_weight=settings.deviation_weight,
            rate=self.rate,
            progress=self.report,
        )
        planned = None
        if self.clearance is not None and paths is not None:
            kept = of_trajectory(self.clearance, paths.least_distances, paths.kept)
            planned = plan(clearances=[kept], throw=False)
            if not planned.success:
                notes.append(
                    f"the trajectory does not keep the distances of the paths: {planned.status}"
                )
        if planned is None or not planned.success:
            planned = plan(throw=self.throw)
        retargeted = list[RetargetedArm]()
        for each in zip(pairs, transfers, far, strict=True):
            made = RetargetedArm.retargeted(*each, planned, self.rate, placement)
            same = [other.first or other for other in retargeted[-1:] if other.body == made.body]
            retargeted.append(replace(made, first=same[0]) if same else made)
        given = tuple(retargeted), planned, paths, self.clearance, self.rate, settings, 0.0
        return Retargeting(*given), notes


def _slowness(result: Retargeting) -> float:
    """Return how much slower than the person it is, above 1 if too slow."""
    return max(result.stretch / _SLOW, _slowest(result) / _SLOWEST)


def _slowest(result: Retargeting) -> float:
    """Return how many times the person's time the slowest synergy takes."""
    planned = result.planned
    return float(np.max(np.diff(planned.robot_edges) / np.diff(planned.edges)))


def _times(result: Retargeting) -> str:
    """Return how many poses it misses and how many times the person's time it takes, in words."""
    missed = sum(len(arm.missed) for arm in result.arms)
    slowest = f"the slowest synergy {_slowest(result):.3g} times"
    return f"{missed} poses missed, {result.stretch:.3g} times the person's time, {slowest}"


def _success(result: Retargeting) -> tuple[bool, int, float, float]:
    """Return whether it failed, how many poses it misses, how much too slow it is, and its time."""
    missed = sum(len(arm.missed) for arm in result.arms)
    return result.is_wanting, missed, max(1.0, _slowness(result)), result.stretch


def _rank(paths: PlannedPaths) -> tuple[bool, int, float]:
    """Return whether paths failed, how many poses they miss, and their action."""
    missed = sum(not each for of_arm in paths.within_reach for each in of_arm)
    return not paths.success, missed, paths.action


def _along_paths(pair: PairedArm, transfers: Sequence[Transfer], notes: list[str]) -> ArmPaths:
    """Return the paths from which the trajectory is planned.

    The torque of a joint that is too weak to hold the arm somewhere on its paths, in any time, is
    not limited; a sentence that says so is added to the notes.
    """
    robot = pair.bounded
    share = pair.settings.torque_share
    paths = [transfer.path for transfer in transfers]
    nodes = np.vstack([path.nodes for path in paths])
    held = np.abs(robot.inverse_dynamics(nodes, 0.0 * nodes, 0.0 * nodes, pair.gravity))
    limit = pair.limits.torque
    needed = held.max(axis=0)
    for joint in np.flatnonzero(needed > limit):
        notes.append(
            f"{robot.name} is too weak: to hold its arm {robot.joint_names[joint]} needs "
            f"{needed[joint]:.3g} of {limit[joint]:.3g} "
            f"{'N m' if robot.units[joint] == 'rad' else 'N'}; the motion uses more"
        )
    limits = replace(pair.limits, torque=usable_torque(limit, needed, share))
    return ArmPaths(robot, limits, pair.edges, paths, pair.gravity, pair.progress)


def _out_of_reach(pairs: Sequence[PairedArm], far: Sequence[PoseErrors]) -> list[str]:
    """Return a sentence on poses out of reach, if there are any."""
    lines = []
    advice = []
    for pair, poses in zip(pairs, far, strict=True):
        missed = {number: error for number, error in poses.items() if pair.is_missed(error)}
        for number, (distance, angle) in missed.items():
            which = "the first pose" if number == 0 else f"the end of synergy {number}"
            lines.append(f"{which} of {pair.name}: {distance:.3g} m and {angle:.3g} rad")
        if missed:
            advice.append(_mounting_advice(pair))
    if not lines:
        return []
    said = f"out of reach, by the nearest pose found: {'; '.join(lines)}. "
    return [f"{said}{' '.join(filter(None, advice))}".rstrip()]


def _mounting_advice(pair: PairedArm) -> str:
    """Return the mounting that would bring more poses within reach; empty if none would."""
    poses = [pair.target(sample) for sample in pair.key_samples]
    if not pair.settings.constrained or poses[0].position is None:
        return ""
    positions = np.array([pose.position for pose in poses])
    turned = None if poses[0].rotation is None else np.array([each.rotation for each in poses])
    found = reachability(
        pair.robot, pair.mapping.target, turned, positions, scale=pair.mapping.scale
    )
    return found.advice.partition(". ")[2]  # the first sentence counts the poses
