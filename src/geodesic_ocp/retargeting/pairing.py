"""Pairs of a person's arm and a robot, from the arguments of `retarget_arms`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from geodesic_ocp.execution.limits import JointLimits, checked_limits, joint_limits
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.inertias import with_rotor_inertia
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.arm_alignment import Alignment, align, check_joints
from geodesic_ocp.retargeting.merge_synergies import merge_synergies
from geodesic_ocp.retargeting.paired_arm import PairedArm, PoseMapping, start_of
from geodesic_ocp.retargeting.reachability import scaled_to_fit
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.synergies.analyse import Analysis


def paired_arms(
    analyses: Any,
    robots: Any,
    alignments: Any,
    person_alignments: Any,
    limits: Any,
    starts: Any,
    settings: RetargetingSettings,
) -> list[PairedArm]:
    """Return persons' arms and robots, from the arguments of `retarget_arms`; one for each hand."""
    analyses = _checked_list("analyses", analyses, Analysis)
    robots = _checked_list("robots", robots, Model)
    if len(analyses) != len(robots):
        raise ValueError(f"there are {len(analyses)} analyses for {len(robots)} robots")
    if not all(np.array_equal(each.motion.time, analyses[0].motion.time) for each in analyses):
        raise ValueError("analyses: all arms must be of one recording, sample by sample")
    if not isinstance(settings, RetargetingSettings):
        raise ValueError(f"settings must be RetargetingSettings, got {settings!r}")
    people = [analysis.model for analysis in analyses]
    hands = [_hands_of(*each) for each in zip(people, robots, strict=True)]
    targets = _alignments("alignments", alignments, robots, [each for _, each in hands])
    sources = _alignments("person_alignments", person_alignments, people, [h for h, _ in hands])
    given = (_one_each(*each, len(robots)) for each in (("limits", limits), ("starts", starts)))
    pairs = list[PairedArm]()
    for body, (analysis, robot, source, target, limit, start) in enumerate(
        zip(analyses, robots, sources, targets, *given, strict=True)
    ):
        heavier = _heavier(robot) if settings.rotor_inertia else robot
        matched = _matched(source, target, settings.mirror)
        mappings = tuple(
            PoseMapping.between(analysis.model.with_hand(hand), person, own, settings)
            for hand, person, own in zip(*matched, target.values(), strict=True)
        )
        bound = _limits(heavier, limit, settings)
        poses = mappings[0](analysis.motion.q)
        groups = merge_synergies(analysis.synergies, drop=settings.drop, merge=settings.merge)
        begin = None if start is None else start_of(heavier, start, settings)
        pair = PairedArm(analysis, heavier, mappings, bound, settings, groups, begin, poses, body)
        pairs += pair.of_hands
    pairs = scaled_to_fit(pairs) if settings.scale == "fit" else pairs
    return [pair.without_drifts() for pair in pairs]


def _hands_of(person: Model, robot: Model) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the hands of a person and of a robot that correspond: one each, or all.

    Raises:
        ValueError: a robot with several hands, and a person with another number.
    """
    if len(robot.hands) == 1:
        return (person.hand,), (robot.hand,)
    if len(person.hands) != len(robot.hands):
        raise ValueError(
            f"{robot.name!r} has the hands {', '.join(robot.hands)}, and {person.name!r} "
            f"{', '.join(person.hands)}: analyse as many, or load the robot with one hand"
        )
    return person.hands, robot.hands


def _matched(
    sources: Mapping[str, Alignment], targets: Mapping[str, Alignment], mirror: bool | None
) -> tuple[list[str], list[Alignment]]:
    """Return the person's hand for each of the robot's, that of the same side, and its alignment;
    in the order of the hands where sides are not known.
    """
    by_side = {each.side: hand for hand, each in sources.items()}
    other: dict[Side | None, Side] = {"right": "left", "left": "right"}
    sides = [other.get(each.side) if mirror else each.side for each in targets.values()]
    hands = list(sources)
    if len(hands) > 1 and set(sides) == set(by_side) == set(other):
        hands = [by_side[side] for side in sides]
    return hands, [sources[hand] for hand in hands]


@lru_cache(maxsize=16)
def _heavier(robot: Model) -> Model:
    """Return the same model each time, so that what is compiled for it is found again."""
    return with_rotor_inertia(robot)


def _limits(robot: Model, given: JointLimits | None, settings: RetargetingSettings) -> JointLimits:
    """Return the given limits, those of the robot, or none at all."""
    if given is not None:
        checked_limits(robot, given)
    if not settings.speed_limits:
        none = np.full(robot.dof, np.inf)
        return JointLimits(none, none, none, none, {"velocity": "left out"})
    return joint_limits(robot) if given is None else given


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


def _alignments(
    name: str, given: Any, models: Sequence[Model], hands: Sequence[Sequence[str]]
) -> list[dict[str, Alignment]]:
    """Return for each model the alignments of its hands, by default its own."""
    found = []
    for model, own, each in zip(models, hands, _one_each(name, given, len(models)), strict=True):
        several = each if isinstance(each, (list, tuple)) else [each]
        several = [None] * len(own) if each is None else several
        if len(several) != len(own):
            raise ValueError(
                f"{name} must be of Alignment, one for each of the hands {', '.join(own)} of "
                f"{model.name!r}, got {each!r}"
            )
        aligned = {}
        for hand, one in zip(own, several, strict=True):
            if one is not None and not isinstance(one, Alignment):
                raise ValueError(f"{name} must be of Alignment, got {one!r}")
            aligned[hand] = align(model.with_hand(hand)) if one is None else one
            check_joints(aligned[hand], model)
        found.append(aligned)
    return found
