"""retarget: a person's synergies on a robot."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.limits import JointLimits, joint_limits
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory, plan_trajectory
from geodesic_ocp.model.inertias import with_rotor_inertia
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress, no_progress
from geodesic_ocp.retargeting.alignment.alignment import alignment as default_alignment
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment, check_joints
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.retargeting.arm_task import ArmTask
from geodesic_ocp.retargeting.detours import warn_of_detours
from geodesic_ocp.retargeting.motion_clearance import motion_clearance, of_paths, of_trajectory
from geodesic_ocp.retargeting.poses.pose_mapping import PoseMapping
from geodesic_ocp.retargeting.poses.targets import PoseFinder
from geodesic_ocp.retargeting.program.plan_paths import PlannedPaths, plan_paths
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.retargeting.transfer import Transfer
from geodesic_ocp.synergies.analyse import Analysis

_DEFAULT = RetargetingSettings()
_TOLERANCE = 1e-6
_RATE = 100.0  # [Hz]


def retarget(
    analysis: Analysis,
    robot: Model,
    *,
    alignment: Alignment | None = None,
    person_alignment: Alignment | None = None,
    start: ArrayLike | None = None,
    limits: JointLimits | None = None,
    rate: float = _RATE,
    tolerance: float = _TOLERANCE,
    settings: RetargetingSettings = _DEFAULT,
    throw: bool = True,
    progress: Progress | None = None,
) -> Retargeting:
    """Transfer a person's synergies to a robot arm, by the pose of the hand at their ends.

    Short synergies are dropped and small ones merged (`merge_synergies`). The hand's poses at the
    ends of the remaining ones, relative to the shoulder and scaled by the ratio of the arms'
    lengths, are mapped to the robot (`Alignment`). Paths of least energy between these poses are
    found for all synergies at once (`plan_paths`). Along them, the robot's trajectory has
    continuous accelerations, meets the limits of the joints, and takes more time than the person
    only where these require it (`plan_trajectory`).

    Args:
        analysis: of the person's motion (`analyse`).
        robot: the arm.
        alignment: of the robot's shoulder and hand with the person's; None: that of the known robot
            (`go.alignment`).
        person_alignment: likewise of the person's arm, if it is not a `human_arm`.
        start: configuration (n,) to begin in [rad or m]; None: among those with the first pose,
            the one from which the motion as a whole takes least energy and time.
        limits: of the robot's joints; None: those of `joint_limits`.
        rate: of the trajectory [Hz].
        tolerance: of limits and poses on the paths, each in its unit, see `solve`.
        settings: everything else.
        throw: raise if the paths or the trajectory are not found; else the last iterates are
            returned, and the result says so (`Retargeting.success`).
        progress: called with the current step, the amount done and the total.

    Warns:
        UserWarning: poses out of reach, with their distances, before anything is solved; detours of
            the hand, links that come too near, and synergies that take three times the person's
            time, with the place in the recording.

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
        throw=throw,
        progress=progress,
    )


def retarget_arms(
    analyses: Sequence[Analysis],
    robots: Sequence[Model],
    *,
    alignments: Sequence[Alignment | None] | None = None,
    person_alignments: Sequence[Alignment | None] | None = None,
    starts: Sequence[ArrayLike | None] | None = None,
    limits: Sequence[JointLimits | None] | None = None,
    rate: float = _RATE,
    tolerance: float = _TOLERANCE,
    settings: RetargetingSettings = _DEFAULT,
    throw: bool = True,
    progress: Progress | None = None,
) -> Retargeting:
    """`retarget` of several arms that move at once, such as both arms of a person.

    Paths and trajectory of all arms are planned together, in the same time. Two arms of one robot,
    whose models have the same base, are kept clear of each other; the bases of different robots are
    not known to each other.

    Args:
        analyses: of the arms, all of one recording, sample by sample.
        robots: as many arms.
        alignments, person_alignments, starts, limits: as many, or None for the defaults; see
            `retarget`.
        rate, tolerance, settings, throw, progress: see `retarget`.

    Warns, Raises:
        See `retarget`.
    """
    begin = time.perf_counter()
    report = progress or no_progress
    analyses = _checked_list("analyses", analyses, Analysis)
    robots = _checked_list("robots", robots, Model)
    if len(analyses) != len(robots):
        raise ValueError(f"there are {len(analyses)} analyses for {len(robots)} robots")
    if not all(np.array_equal(each.motion.time, analyses[0].motion.time) for each in analyses):
        raise ValueError("analyses: all arms must be of one recording, sample by sample")
    if not isinstance(settings, RetargetingSettings):
        raise ValueError(f"settings must be RetargetingSettings, got {settings!r}")
    tolerance, rate = as_positive("tolerance", tolerance), as_positive("rate", rate, "Hz")
    targets = _alignments("alignments", alignments, robots)
    sources = _alignments("person_alignments", person_alignments, [a.model for a in analyses])
    clearance = motion_clearance(robots, settings)  # of the models as given, whose pairs are kept
    if settings.rotor_inertia:
        robots = [with_rotor_inertia(robot) for robot in robots]
    bounds = [
        _limits(robot, given, settings)
        for robot, given in zip(robots, _one_each("limits", limits, len(robots)), strict=True)
    ]
    tasks = []
    for analysis, robot, source, target, bound, start in zip(
        *(analyses, robots, sources, targets, bounds),
        *(_one_each("starts", starts, len(robots)),),
        strict=True,
    ):
        mapping = PoseMapping.between(analysis.model, source, target, settings)
        finder = PoseFinder(robot, settings, tolerance)
        tasks.append(ArmTask.prepare(analysis, mapping, finder, bound, start))
    _warn_out_of_reach(tasks)

    paths: PlannedPaths | None = None
    if settings.constrained:
        waypoints = [task.waypoints for task in tasks if task.waypoints is not None]
        paths = plan_paths(
            waypoints,
            [task.layers for task in tasks],
            stretch=settings.stretch_weight,
            posture=settings.posture_weight,
            likeness=settings.likeness_weight,
            tolerance=tolerance,
            clearance=None if clearance is None else of_paths(clearance),
            progress=report,
        )
        if throw and not paths.success:
            raise NotConverged(f"the paths of the synergies were not found: {paths.status}", paths)
        transfers = [task.transfers(paths, number) for number, task in enumerate(tasks)]
    else:
        transfers = _one_by_one(tasks, throw, report)
    planned = _in_time(tasks, transfers, paths, clearance, throw, report)
    arms = []
    for number, (task, found) in enumerate(zip(tasks, transfers, strict=True)):
        report("tracking the hand", number, len(tasks))
        arms.append(RetargetedArm.of(task, found, planned, number, rate))
    report("done", len(tasks), len(tasks))
    seconds = time.perf_counter() - begin
    result = Retargeting(tuple(arms), planned, paths, clearance, rate, settings, seconds)
    warn_of_detours(result)
    return result


def _limits(robot: Model, given: JointLimits | None, settings: RetargetingSettings) -> JointLimits:
    """The given limits, those of the robot, or none at all."""
    if given is not None and (
        not isinstance(given, JointLimits) or given.velocity.size != robot.dof
    ):
        raise ValueError(f"limits must be JointLimits of {robot.dof} joints, got {given!r}")
    if not settings.speed_limits:
        none = np.full(robot.dof, np.inf)
        return JointLimits(none, none, none, none, {"velocity": "left out"})
    return joint_limits(robot) if given is None else given


def _in_time(
    tasks: Sequence[ArmTask],
    transfers: Sequence[Sequence[Transfer]],
    paths: PlannedPaths | None,
    clearance: Clearance | None,
    throw: bool,
    report: Progress,
) -> PlannedTrajectory:
    """The trajectory along the paths; without distances if it cannot keep them.

    Warns:
        UserWarning: it does not keep them.
    """
    settings = tasks[0].finder.settings
    arms = [task.paths_to_time(found) for task, found in zip(tasks, transfers, strict=True)]
    kept: list[Clearance] = []
    if clearance is not None and paths is not None:
        kept.append(of_trajectory(clearance, paths.least_distances, paths.kept))
    for distances in (kept, []) if kept else ([],):
        planned = plan_trajectory(
            arms,
            rest=settings.rest,
            deviation_weight=settings.deviation_weight,
            clearances=distances,
            progress=report,
            throw=throw and not distances,
        )
        if planned.success:
            return planned
        if distances:
            warnings.warn(
                f"the trajectory does not keep the distances of the paths: {planned.status}",
                UserWarning,
                4,
            )
    return planned


def _one_by_one(tasks: Sequence[ArmTask], throw: bool, report: Progress) -> list[list[Transfer]]:
    """Free geodesics of all arms, one synergy after the other."""
    total, before = sum(len(task.groups) for task in tasks), 0
    found = []
    for task in tasks:

        def advance(done: int, before: int = before, name: str = task.robot.name) -> None:
            report(f"planning {name}", before + done, total)

        advance(0)
        found.append(task.plan_one_by_one(throw, advance))
        before += len(task.groups)
    return found


def _checked_list(name: str, given: Any, kind: type) -> list[Any]:
    is_list = isinstance(given, (list, tuple)) and len(given)
    if not is_list or not all(isinstance(each, kind) for each in given):
        raise ValueError(f"{name} must be a list of {kind.__name__}, got {given!r}")
    return list(given)


def _one_each(name: str, given: Any, count: int) -> list[Any]:
    if given is None:
        return [None] * count
    if not isinstance(given, (list, tuple, np.ndarray)) or len(given) != count:
        raise ValueError(f"{name} must be a list, one for each of {count} robots, got {given!r}")
    return list(given)


def _alignments(name: str, given: Any, models: Sequence[Model]) -> list[Alignment]:
    """One for each model, by default the model's own."""
    found = _one_each(name, given, len(models))
    for each in found:
        if each is not None and not isinstance(each, Alignment):
            raise ValueError(f"{name} must be of Alignment, got {each!r}")
    aligned = [
        default_alignment(model) if each is None else each
        for model, each in zip(models, found, strict=True)
    ]
    for model, each in zip(models, aligned, strict=True):
        check_joints(each, model)
    return aligned


def _warn_out_of_reach(tasks: Sequence[ArmTask]) -> None:
    lines = []
    for task in tasks:
        for number, (distance, angle) in task.out_of_reach.items():
            which = "the first pose" if number == 0 else f"the end of synergy {number}"
            error = f"{distance:.3g} m and {angle:.3g} rad"
            lines.append(f"{which} of {task.robot.name} by at least {error}")
    if not lines:
        return
    advice = " ".join(each for task in tasks if (each := task.mounting_advice()))
    warnings.warn(
        f"out of reach, the nearest pose is taken: {'; '.join(lines)}. {advice}".rstrip(),
        UserWarning,
        3,
    )
