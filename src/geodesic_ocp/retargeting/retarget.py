"""retarget: a person's synergies on a robot."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory, plan_trajectory
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.solve import solve
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
from geodesic_ocp.retargeting.place_base import BasePlacement, place_within_reach
from geodesic_ocp.retargeting.reachability import reachability
from geodesic_ocp.retargeting.result import Retargeting, warn_of_detours
from geodesic_ocp.retargeting.settings import (
    BEYOND,
    RetargetingSettings,
    motion_clearance,
    of_trajectory,
)
from geodesic_ocp.retargeting.synergy_paths import PlannedPaths, SynergyPaths
from geodesic_ocp.retargeting.waypoints import ArmWaypoints, arm_waypoints
from geodesic_ocp.synergies.analyse import Analysis

_DEFAULT = RetargetingSettings()
_TOLERANCE = 1e-6
_RATE = 100.0  # [Hz]
# Where holding the arm takes much of a joint's torque, it gets this many times as much as that, up
# to its limit.
_MOVING = 1.5
_WORTH = 0.95  # of the cost, from which a turned gripper is tried


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
    problem: type[SynergyPaths] = SynergyPaths,
    throw: bool = True,
    progress: Progress | None = None,
) -> Retargeting:
    """Transfer a person's synergies to a robot arm, by the pose of the hand at their ends.

    Short synergies are dropped and small ones merged (`merge_synergies`). The hand's poses at the
    ends of the remaining ones, relative to the shoulder and scaled by the ratio of the arms'
    lengths, are mapped to the robot (`Alignment`). Paths of least energy between these poses are
    found for all synergies at once (`SynergyPaths`). Along them, the robot's trajectory has
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
    >>> result = go.retarget(analysis, robot, tolerance=1e-3)
    >>> result.success, len(result.synergies)
    (True, 3)

    Args:
        analysis: analysis of the person's motion (`analyse`).
        robot: the arm, or a body with several hands.
        alignment: alignment of the robot's shoulder and hand with the person's, or one for each of
            several hands; None: that of the known robot (`go.retargeting.align`). If poses are then
            out of reach, or links too near or joints too weak at them, the base of one robot is
            moved to where most are attained (`place_base`), unless a start, obstacles or a problem
            of one's own are given.
        person_alignment: likewise of the person's arm, if it is not a `human_arm`.
        start: configuration (n,) to begin in [rad or m]; None: among those with the first pose,
            the one from which the motion as a whole takes least energy and time.
        limits: limits of the robot's joints; None: those of `joint_limits`.
        rate: rate of the trajectory [Hz].
        tolerance: tolerance of limits and poses on the paths, each in its unit, see `solve`.
        settings: everything else.
        problem: problem whose paths they are; a subclass of `SynergyPaths` may add costs and
            constraints.
        throw: raise if the paths or the trajectory are not found; else the last iterates are
            returned, and the result says so (`Retargeting.success`).
        progress: called with the current step, the amount done and the total.

    Warns:
        UserWarning: before anything is solved, a base that is moved, and poses that are out of
            reach by more than the tolerance, with the distances of the nearest ones found;
            afterwards poses that are
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
        problem=problem,
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
    problem: type[SynergyPaths] = SynergyPaths,
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
    >>> result = go.retargeting.retarget_arms([analysis] * 2, robots, tolerance=1e-3)
    >>> result.success, len(result.joint_names)
    (True, 14)

    Args:
        analyses: analyses of the arms, all of one recording, sample by sample.
        robots: as many arms.
        alignments, person_alignments, starts, limits: as many, or None for the defaults; see
            `retarget`.
        rate, tolerance, settings, problem, throw, progress: see `retarget`.

    Warns, Raises:
        See `retarget`.
    """
    begin = time.perf_counter()
    report = progress or no_progress
    tolerance, rate = as_positive("tolerance", tolerance), as_positive("rate", rate, "Hz")
    if not (isinstance(problem, type) and issubclass(problem, SynergyPaths)):
        raise ValueError(f"problem must be SynergyPaths or a subclass of it, got {problem!r}")
    pairs = paired_arms(analyses, robots, alignments, person_alignments, limits, starts, settings)
    clearance = motion_clearance(robots, settings)  # of the models as given, whose pairs are kept
    paths: PlannedPaths | None = None
    placement: BasePlacement | None = None
    bodies = list({pair.body: pair for pair in reversed(pairs)}.values())[::-1]  # the first of each
    if settings.constrained:
        weights = settings.stretch_weight, settings.posture_weight, settings.likeness_weight
        kept = None if clearance is None else replace(clearance, lower=clearance.lower + BEYOND)
        grasps = [_grasps(pair, tolerance) for pair in bodies]
        movable = len(bodies) == 1 and problem is SynergyPaths and not settings.obstacles
        movable &= all(each is None for given in (alignments, starts) for each in given or ())
        if movable and (moved := _within_reach(grasps[0][0], clearance, report)):
            placed, placement = moved
            pairs, grasps = list(placed.of_hands), [_grasps(placed, tolerance)]
            bodies = pairs[:1]
        found: list[tuple[PlannedPaths, list[_Grasp]]] = []
        for number in range(max(map(len, grasps))):  # that of the person, and turned
            chosen = [each[min(number, len(each) - 1)] for each in grasps]
            arms, candidates = (tuple(each) for each in list(zip(*chosen, strict=True))[1:])
            motion: Any = problem(arms, candidates, kept, *weights, tolerance, report)
            found.append((solve(motion, throw=throw and not number), chosen))
        paths, chosen = min(found, key=lambda each: _rank(each[0]))
        arms_of = dict(zip(bodies, (each[0] for each in chosen), strict=True))
        pairs, bodies = [arms_of.get(pair, pair) for pair in pairs], list(arms_of.values())
        far = [unattained(pair, chosen[pair.body][2]) for pair in pairs]
        _warn_out_of_reach(pairs, far)
        transfers = [transfers_on(pair, paths, each) for pair, each in zip(pairs, far, strict=True)]
    else:
        if len(bodies) < len(pairs):
            raise ValueError("the formulation 'geodesic' is of one hand; use 'constrained'")
        free = [free_ends(pair) for pair in pairs]
        far = [each[2] for each in free]
        _warn_out_of_reach(pairs, far)
        transfers = [
            free_geodesics(pair, begin, ends, throw, report)
            for pair, (begin, ends, _) in zip(pairs, free, strict=True)
        ]
    of_bodies = [transfers[pairs.index(pair)] for pair in bodies]
    planned = _in_time(bodies, of_bodies, paths, clearance, throw, report)
    retargeted = list[RetargetedArm]()
    for each in zip(pairs, transfers, far, strict=True):
        arm, first = RetargetedArm.retargeted(*each, planned, rate, placement), retargeted[-1:]
        same = [other.first or other for other in first if other.body == arm.body]
        retargeted.append(replace(arm, first=same[0]) if same else arm)
    report("done", len(pairs), len(pairs))
    seconds = time.perf_counter() - begin
    result = Retargeting(tuple(retargeted), planned, paths, clearance, rate, settings, seconds)
    warn_of_detours(result)
    return result


_Grasp: TypeAlias = tuple[PairedArm, ArmWaypoints, tuple[Candidates, ...]]


def _grasps(pair: PairedArm, tolerance: float) -> list[_Grasp]:
    """Return the arm, its waypoints and candidates there; also with its parallel gripper turned by
    180 degrees, if the shortest path through the candidates then costs less by a twentieth.

    It is turned in all poses, as what it holds turns with it. Which grasp is taken, the paths of
    both decide.
    """
    turns = pair.mapping.target.parallel_gripper and len(pair.mappings) == 1
    turns &= pair.settings.orientation_weight > 0.0
    found = []
    for each in (pair, pair.turned) if turns else (pair,):
        waypoints = arm_waypoints(each, tolerance)
        found.append((each, waypoints, tuple(first_candidates(waypoints))))
    if not turns:
        return found
    weights = graph_weights(*found[0][1:], pair.settings)
    costs = [find_start(waypoints, weights, layers).cost for _, waypoints, layers in found]
    return found if costs[1] < _WORTH * costs[0] else found[:1]


def _within_reach(
    grasp: _Grasp, clearance: Clearance | None, report: Progress
) -> tuple[PairedArm, BasePlacement] | None:
    """Return the arm with its base moved to where more poses are within reach; None if all are, or
    if no place is better.

    Warns:
        UserWarning: the base is moved.
    """
    pair, waypoints, layers = grasp
    if pair.settings.position_weight == 0.0 or all(
        attained(waypoints, layers, own_lacks(clearance, (waypoints,), 0))
    ):
        return None
    report("placing the base", 0, 1)
    found = place_within_reach(pair, clearance)
    if found is not None:
        warnings.warn(
            f"{pair.name} is moved, as it does not attain all poses: {found[1]}. To keep it where "
            "its alignment has it, pass that alignment (--mount fixed)",
            UserWarning,
            4,
        )
    return found


def _rank(paths: PlannedPaths) -> tuple[bool, int, float]:
    """Return whether paths failed, how many poses they miss, and their action."""
    missed = sum(not each for of_arm in paths.within_reach for each in of_arm)
    return not paths.success, missed, paths.action


def _in_time(
    pairs: Sequence[PairedArm],
    transfers: Sequence[Sequence[Transfer]],
    paths: PlannedPaths | None,
    clearance: Clearance | None,
    throw: bool,
    report: Progress,
) -> PlannedTrajectory:
    """Return the trajectory along the paths; without distances if it cannot keep them.

    Warns:
        UserWarning: it does not keep them.
    """
    settings = pairs[0].settings
    arms = [_along_paths(*each) for each in zip(pairs, transfers, strict=True)]
    plan = partial(
        plan_trajectory,
        arms,
        rest=settings.rest,
        deviation_weight=settings.deviation_weight,
        progress=report,
    )
    if clearance is not None and paths is not None:
        kept = of_trajectory(clearance, paths.least_distances, paths.kept)
        planned = plan(clearances=[kept], throw=False)
        if planned.success:
            return planned
        warnings.warn(
            f"the trajectory does not keep the distances of the paths: {planned.status}",
            UserWarning,
            4,
        )
    return plan(throw=throw)


def _along_paths(pair: PairedArm, transfers: Sequence[Transfer]) -> ArmPaths:
    """Return the paths from which the trajectory is planned.

    Warns:
        UserWarning: a joint is too weak to hold the arm somewhere on its paths, in any time. Its
            torque is not limited.
    """
    robot, share = pair.bounded, pair.settings.torque_share
    paths, still = [transfer.path for transfer in transfers], np.zeros(robot.dof)
    nodes = np.vstack([path.nodes for path in paths])
    held = np.abs([robot.inverse_dynamics(q, still, still, pair.gravity) for q in nodes])
    limit, needed = pair.limits.torque, held.max(axis=0)
    for joint in np.flatnonzero(needed > limit):
        warnings.warn(
            f"{robot.name} is too weak: to hold its arm {robot.joint_names[joint]} needs "
            f"{needed[joint]:.3g} of {limit[joint]:.3g} "
            f"{'N m' if robot.units[joint] == 'rad' else 'N'}; the motion uses more",
            UserWarning,
            5,
        )
    torque = np.maximum(share * limit, np.minimum(limit, _MOVING * needed))
    torque = np.where(needed > limit, np.inf, torque)
    limits = replace(pair.limits, torque=torque)
    return ArmPaths(robot, limits, pair.edges, paths, pair.gravity, pair.progress)


def _warn_out_of_reach(pairs: Sequence[PairedArm], far: Sequence[PoseErrors]) -> None:
    lines, advice = [], []
    for pair, poses in zip(pairs, far, strict=True):
        missed = {number: error for number, error in poses.items() if pair.is_missed(error)}
        for number, (distance, angle) in missed.items():
            which = "the first pose" if number == 0 else f"the end of synergy {number}"
            lines.append(f"{which} of {pair.name}: {distance:.3g} m and {angle:.3g} rad")
        if missed:
            advice.append(_mounting_advice(pair))
    if lines:
        warnings.warn(
            f"out of reach, by the nearest pose found: {'; '.join(lines)}. "
            f"{' '.join(filter(None, advice))}".rstrip(),
            UserWarning,
            3,
        )


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
