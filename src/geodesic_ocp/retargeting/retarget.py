"""The person's synergies on a robot: `retarget`."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from numbers import Integral
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import as_number, as_positive
from geodesic_ocp.geodesics.geodesic_to_pose import ENERGY_WEIGHT
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.ocp.ik.inverse_kinematics import Clear
from geodesic_ocp.retargeting.alignment import Alignment
from geodesic_ocp.retargeting.alignment import alignment as default_alignment
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.retargeting.arm_task import Carrying, Request, Task
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.retargeting.targets import Conditions, Formulation
from geodesic_ocp.retargeting.time_scaling import timed
from geodesic_ocp.synergies.analyse import Analysis, Progress, no_progress


def retarget(
    analysis: Analysis | Sequence[Analysis],
    robot: Model | Sequence[Model],
    *,
    formulation: Formulation = "constrained",
    alignment: Alignment | Sequence[Alignment] | None = None,
    person: Alignment | Sequence[Alignment] | None = None,
    start: ArrayLike | Sequence[ArrayLike] | None = None,
    scale: float | None = None,
    mirror: bool | None = None,
    drop: float | None = None,
    merge: float | None = None,
    limits: bool = True,
    speed_limits: bool = True,
    obstacles: Sequence[Obstacle] = (),
    links: Sequence[str] | None = None,
    pairs: Sequence[tuple[str, str]] = (),
    margin: float = 0.0,
    position_weight: float = 1.0,
    orientation_weight: float = 1.0,
    energy_weight: float = ENERGY_WEIGHT,
    num_starts: int = 1,
    rest: bool = False,
    throw: bool = True,
    progress: Progress | None = None,
) -> Retargeting:
    """Transfer a person's synergies to a robot, by the pose of the hand at their ends.

    Short synergies are dropped and small ones merged (`go.merge_synergies`); the hand's poses at
    the ends of what is left, from the shoulder and scaled by the ratio of the arms' lengths, are
    carried over (`go.Alignment`). From the first configuration on, each synergy of the robot begins where
    the last ended. It takes the person's time, and hands over at the person's speed in proportion
    to the lengths; where a joint would be too fast, time is stretched.

    Args:
        analysis: of the person's motion (`analyse`); of several arms for several robots, such as
            both arms at once, which then share the stretched time. Arms are not planned around each
            other.
        robot: the arm, or as many as there are analyses.
        formulation: "constrained", the path of least energy to any configuration in which the hand has
            the pose exactly (`Reach`), under all that follows, or where there is none, to the
            nearest; or "geodesic", the free geodesic whose end is nearest to the pose
            (`geodesic_to_pose`), which knows no limits and no bodies.
        alignment: of shoulders and hands; by default the known robot's (`go.alignment`). For
            several robots one each.
        person: likewise of the person's arm, where that is not a `human_arm`.
        start: configuration (n,) to begin in [rad or m]; by default, by inverse kinematics, the one with
            the first pose that is nearest to the middle of the joints' ranges. For several robots
            one each.
        scale: of positions; by default the ratio of the arms' lengths.
        mirror: whether left and right are exchanged; by default where the sides differ.
        drop, merge: lengths below which synergies are dropped or merged, in the person's metric.
        limits: whether the joints stay within their limits.
        speed_limits: whether the joints' limits of speed are kept, by other paths where there are,
            and by stretching time.
        obstacles, links, pairs, margin: bodies that are kept apart, in the robot's base frame; see
            `Reach` and `collision_pairs`.
        position_weight, orientation_weight: [1/m] and [1/rad] of the hand's miss, where the pose is
            not reached; zero leaves the position or the orientation free altogether.
        energy_weight: of the energy, in the formulation "geodesic".
        num_starts: how many solutions are sought for each synergy, from different configurations of inverse
            kinematics; the one of least energy is taken. The next configuration is also tried after a
            failure.
        rest: whether the motion begins and ends at rest; by default it does so at the person's
            speed, which a robot cannot do where the recording begins or ends in motion.
        throw: raise where a path is not found; else the arm stays where it is, which the result's
            transfers say. That no configuration at all is clear of the bodies is always raised.
        progress: called with what is being done, how much is done and how much there is.

    Warns:
        UserWarning: before anything is solved, which poses are out of reach, and by how much.

    Raises:
        ValueError: arguments that do not fit; a robot without an alignment; a start outside the
            limits or too near to a body, before anything is solved.
        NotConverged: a path was not found; names the synergy.
    """
    begin = time.perf_counter()
    report = progress or no_progress
    analyses = _listed("analysis", analysis, Analysis)
    robots = _listed("robot", robot, Model)
    if len(analyses) != len(robots):
        raise ValueError(f"there are {len(analyses)} analyses for {len(robots)} robots")
    if not all(np.array_equal(each.motion.time, analyses[0].motion.time) for each in analyses):
        raise ValueError(
            "analysis: arms that move at once must be of one recording, sample by sample"
        )
    targets = _aligned("alignment", alignment, robots)
    sources = _aligned("person", person, [each.model for each in analyses])
    several = len(robots) > 1 or (isinstance(start, (list, tuple)) and np.ndim(start) > 1)
    beginnings = _each("start", start if several or start is None else [start], len(robots))
    if formulation not in get_args(Formulation):
        raise ValueError(
            f"formulation must be one of {', '.join(get_args(Formulation))}, got {formulation!r}"
        )
    position_weight = as_number("position_weight", position_weight)
    orientation_weight = as_number("orientation_weight", orientation_weight)
    weights = (position_weight, orientation_weight)
    if min(weights) < 0.0 or max(weights) == 0.0:
        raise ValueError(
            "position_weight and orientation_weight must be zero or above, and not both zero, got "
            f"{position_weight:g} and {orientation_weight:g}"
        )
    _check_kinds(num_starts, mirror)
    clear = Clear.of(obstacles, links, pairs, margin)
    free = formulation == "geodesic"
    if free and (clear.obstacles or clear.pairs):
        raise ValueError("the formulation 'geodesic' knows no bodies; use 'constrained'")
    conditions = Conditions(
        formulation,
        limits and not free,
        speed_limits and not free,
        clear,
        (position_weight or 1.0, orientation_weight or 1.0),
        as_positive("energy_weight", energy_weight),
        int(num_starts),
    )
    request = Request(
        scale, mirror, drop, merge, position_weight > 0.0, orientation_weight > 0.0, conditions
    )
    tasks = []
    for each, arm, source, target, first in zip(
        analyses, robots, sources, targets, beginnings, strict=True
    ):
        carrying = Carrying.between(each.model, source, target, request)
        tasks.append(Task.of(each.motion, each.synergies, arm, carrying, first, request))
    _say_out_of_reach(tasks)

    total = sum(len(task.groups) for task in tasks) + len(tasks)
    planned, before = [], 0
    for task in tasks:

        def advance(done: int, before: int = before, name: str = task.robot.name) -> None:
            report(f"planning {name}", before + done, total)

        advance(0)
        planned.append(task.planned(throw, advance))
        before += len(task.groups)
    to_be_timed = [
        task.to_be_timed(transfers, speed_limits, rest)
        for task, transfers in zip(tasks, planned, strict=True)
    ]
    timing = timed(to_be_timed)
    arms = []
    for number, (each, task, transfers) in enumerate(zip(analyses, tasks, planned, strict=True)):
        report("following the hand", before + number, total)
        synergies, trajectory = task.in_time(transfers, timing, number)
        arms.append(
            RetargetedArm(
                analysis=each,
                robot=task.robot,
                alignment=task.carrying.target,
                scale=task.carrying.scale,
                mirror=task.carrying.mirror,
                groups=task.groups,
                transfers=tuple(transfers),
                synergies=synergies,
                trajectory=trajectory,
                wanted=task.hand,
                baseline=task.followed(timing),
                out_of_reach=task.out_of_reach,
            )
        )
    report("done", total, total)
    seconds = time.perf_counter() - begin
    return Retargeting(tuple(arms), timing, formulation, conditions.limits, seconds)


def _check_kinds(num_starts: Any, mirror: Any) -> None:
    if not isinstance(num_starts, Integral) or num_starts < 1:
        raise ValueError(f"num_starts must be an integer above zero, got {num_starts!r}")
    if mirror not in (None, True, False):
        raise ValueError(f"mirror must be True, False or None, got {mirror!r}")


def _listed(name: str, given: Any, kind: type) -> list[Any]:
    found = list(given) if isinstance(given, (list, tuple)) else [given]
    if not found or not all(isinstance(each, kind) for each in found):
        raise ValueError(f"{name} must be {kind.__name__}, or a list of them, got {given!r}")
    return found


def _each(name: str, given: Any, count: int) -> list[Any]:
    if given is not None and not isinstance(given, (list, tuple, np.ndarray)):
        raise ValueError(f"{name} must be one for each of {count} robots, got {given!r}")
    found = [None] * count if given is None else list(given)
    if len(found) != count:
        raise ValueError(f"{name} must be one for each of {count} robots, got {len(found)}")
    return found


def _aligned(name: str, given: Any, models: Sequence[Model]) -> list[Alignment]:
    """One for each model, by default the model's own."""
    found = _each(name, [given] if isinstance(given, Alignment) else given, len(models))
    if not all(each is None or isinstance(each, Alignment) for each in found):
        raise ValueError(f"{name} must be an Alignment, or a list of them, got {given!r}")
    return [
        default_alignment(model) if each is None else each
        for model, each in zip(models, found, strict=True)
    ]


def _say_out_of_reach(tasks: Sequence[Task]) -> None:
    lines = []
    for task in tasks:
        for number, (away, angle) in task.out_of_reach.items():
            which = "the first pose" if number == 0 else f"the end of synergy {number - 1}"
            lines.append(f"{which} of {task.robot.name} by {away:.3g} m and {angle:.3g} rad")
    if lines:
        warnings.warn(
            f"out of reach, the nearest pose is taken: {'; '.join(lines)}", UserWarning, 3
        )
