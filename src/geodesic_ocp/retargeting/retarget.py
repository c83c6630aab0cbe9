"""retarget: a person's synergies on a robot."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress, no_progress
from geodesic_ocp.retargeting.alignment.alignment import alignment as default_alignment
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.retargeting.arm_task import ArmTask
from geodesic_ocp.retargeting.pose_mapping import PoseMapping
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.retargeting.targets import PoseFinder
from geodesic_ocp.retargeting.time_scaling import scale_time
from geodesic_ocp.synergies.analysis import Analysis

_DEFAULT = RetargetingSettings()
_TOLERANCE = 1e-6


def retarget(
    analysis: Analysis,
    robot: Model,
    *,
    alignment: Alignment | None = None,
    person_alignment: Alignment | None = None,
    start: ArrayLike | None = None,
    tolerance: float = _TOLERANCE,
    settings: RetargetingSettings = _DEFAULT,
    throw: bool = True,
    progress: Progress | None = None,
) -> Retargeting:
    """Transfer a person's synergies to a robot arm, by the pose of the hand at their ends.

    Short synergies are dropped and small ones merged (`merge_synergies`). The hand's poses at the
    ends of the remaining ones, relative to the shoulder and scaled by the ratio of the arms'
    lengths, are mapped to the robot (`Alignment`). Each synergy of the robot begins where the
    previous one ended. It takes the person's time and hands over at the person's speed in
    proportion to the path lengths; where a joint would exceed its speed limit, time is scaled.

    Args:
        analysis: of the person's motion (`analyse`).
        robot: the arm.
        alignment: of the robot's shoulder and hand with the person's; None: that of the known robot
            (`go.alignment`).
        person_alignment: likewise of the person's arm, if it is not a `human_arm`.
        start: configuration (n,) to begin in [rad or m]; None: among those with the first pose,
            found by inverse kinematics, the one nearest to the middle of the joints' ranges.
        tolerance: of limits and poses on the paths, each in its unit, see `solve`.
        settings: everything else.
        throw: raise if a path is not found; else the arm rests there, as the transfers report. A
            configuration that cannot be kept clear of collision bodies always raises.
        progress: called with the current step, the amount done and the total.

    Warns:
        UserWarning: poses out of reach, with their distances, before anything is solved.

    Raises:
        ValueError: arguments of the wrong type or shape; a robot without an alignment; a start
            outside the limits or too close to a collision body.
        NotConverged: a path was not found; the message gives the number of the synergy.
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
    tolerance: float = _TOLERANCE,
    settings: RetargetingSettings = _DEFAULT,
    throw: bool = True,
    progress: Progress | None = None,
) -> Retargeting:
    """`retarget` of several arms that move at once, such as both arms of a person.

    The arms share the scaled time. They are not planned around each other.

    Args:
        analyses: of the arms, all of one recording, sample by sample.
        robots: as many arms.
        alignments, person_alignments, starts: as many, or None for the defaults; see `retarget`.
        tolerance, settings, throw, progress: see `retarget`.

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
    tolerance = as_positive("tolerance", tolerance)
    targets = _alignments("alignments", alignments, robots)
    sources = _alignments("person_alignments", person_alignments, [a.model for a in analyses])
    tasks = []
    for analysis, robot, source, target, start in zip(
        analyses, robots, sources, targets, _one_each("starts", starts, len(robots)), strict=True
    ):
        mapping = PoseMapping.between(analysis.model, source, target, settings)
        finder = PoseFinder(robot, settings, tolerance)
        tasks.append(ArmTask.prepare(analysis, mapping, finder, start))
    _warn_out_of_reach(tasks)

    total = sum(len(task.groups) for task in tasks) + len(tasks)
    planned, before = [], 0
    for task in tasks:

        def advance(done: int, before: int = before, name: str = task.robot.name) -> None:
            report(f"planning {name}", before + done, total)

        advance(0)
        planned.append(task.plan(throw, advance))
        before += len(task.groups)
    scaling = scale_time(
        [task.paths_to_time(paths) for task, paths in zip(tasks, planned, strict=True)]
    )
    arms = []
    for number, (task, transfers) in enumerate(zip(tasks, planned, strict=True)):
        report("tracking the hand", before + number, total)
        synergies, trajectory = task.trajectory(transfers, scaling, number)
        arms.append(
            RetargetedArm(
                analysis=task.analysis,
                robot=task.robot,
                mapping=task.mapping,
                groups=task.groups,
                transfers=tuple(transfers),
                synergies=synergies,
                trajectory=trajectory,
                target_poses=task.target_poses,
                baseline=task.track_hand(scaling),
                out_of_reach=task.out_of_reach,
            )
        )
    report("done", total, total)
    return Retargeting(tuple(arms), scaling, settings, time.perf_counter() - begin)


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
    return [
        default_alignment(model) if each is None else each
        for model, each in zip(models, found, strict=True)
    ]


def _warn_out_of_reach(tasks: Sequence[ArmTask]) -> None:
    lines = []
    for task in tasks:
        for number, (distance, angle) in task.out_of_reach.items():
            which = "the first pose" if number == 0 else f"the end of synergy {number - 1}"
            lines.append(f"{which} of {task.robot.name} by {distance:.3g} m and {angle:.3g} rad")
    if lines:
        warnings.warn(
            f"out of reach, the nearest pose is taken: {'; '.join(lines)}", UserWarning, 3
        )
