"""retargeting_playback: a person and a robot that moves like the person, side by side."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.scenes.motions.shown_samples import shown_samples
from geodesic_ocp.scenes.playback import Playback, Plot, Span
from geodesic_ocp.scenes.retargeted.person_pane import observed, person_pane
from geodesic_ocp.scenes.retargeted.retargeting_plots import retargeting_plots
from geodesic_ocp.scenes.retargeted.robot_pane import BASELINE, robot_pane, robot_title
from geodesic_ocp.scenes.scene import Scene

_SAME_TIME = 1e-9  # [s]
_HIDDEN = (*Playback.hidden, BASELINE)


def retargeting_playback(retargeting: Retargeting, *, person: bool = True) -> Playback:
    """A person and a robot that moves like the person, in the robot's time.

    The robot's shoulder is where the person's is, and its base is turned as the alignment says. In
    its pane are the path of its hand, that of the person's hand, mapped to the robot, and, to be
    switched on, the motion by inverse kinematics that tracks the hand along its whole path. The
    slider has the person's synergies and those of the robot.

    Args:
        retargeting: result of `retarget`.
        person: whether the person is shown as well.
    """
    time = retargeting.motion.time
    shown, _ = shown_samples(time)
    scenes = [robot_pane(retargeting, shown, start=float(time[0]))]
    spans = _spans_of_robots(retargeting, time)
    if person:
        scenes.insert(0, person_pane(retargeting.arms, time[shown], shown))
        spans = _spans_of_person(retargeting, time) | spans
    return Playback(
        " and ".join(arm.title for arm in retargeting.arms),
        tuple(scenes),
        spans,
        retargeting_plots(retargeting, shown, start=float(time[0])),
        azimuth=_azimuth(retargeting),
        hidden=_HIDDEN,
    )


def retargetings_playback(retargetings: Sequence[Retargeting]) -> Playback:
    """Several robots that move like one person, or like several, each person shown once.

    All begin at the same time. If the robots take different times, the person takes the time of the
    recording, and each robot its own. Panes and plots of equal title are numbered.

    Args:
        retargetings: results of `retarget`, at least one.

    Raises:
        ValueError: there is none.
    """
    if not retargetings:
        raise ValueError("retargetings must be at least one, got none")
    if len(retargetings) == 1:
        return retargeting_playback(retargetings[0])
    groups: dict[tuple[int, ...], list[Retargeting]] = {}
    for each in retargetings:
        key = tuple(id(analysis) for analysis in observed(each.arms))
        groups.setdefault(key, []).append(each)
    scenes: list[Scene] = []
    plots: list[Plot] = []
    spans: dict[str, tuple[Span, ...]] = {}
    met = Counter[str]()

    def titled(scene: Scene) -> Scene:
        met[scene.title] += 1
        number = met[scene.title]
        return replace(scene, title=f"{scene.title} ({number})") if number > 1 else scene

    for robots in groups.values():
        time = _common_time(robots)
        shown, _ = shown_samples(time)
        scenes.append(titled(person_pane(robots[0].arms, time[shown], shown)))
        spans |= _distinct(_spans_of_person(robots[0], time), spans)
        for each in robots:
            own = each.motion.time - each.motion.time[0]
            scenes.append(titled(robot_pane(each, shown)))
            spans |= _distinct(_spans_of_robots(each, own), spans)
            number = met[robot_title(each.arms)]
            plots += retargeting_plots(each, shown, name=True, number=number)
    titles = dict.fromkeys(chain(*((arm.title for arm in each.arms) for each in retargetings)))
    return Playback(
        ", ".join(titles),
        tuple(scenes),
        spans,
        tuple(plots),
        azimuth=_azimuth(retargetings[0]),
        hidden=_HIDDEN,
    )


def _common_time(robots: Sequence[Retargeting]) -> Array:
    """Times (k,) of the person's samples: those of the robots if they agree, from zero."""
    times = [each.motion.time - each.motion.time[0] for each in robots]
    if all(np.abs(time - times[0]).max() <= _SAME_TIME for time in times):
        return np.asarray(times[0])
    recorded = robots[0].arms[0].analysis.motion.time
    return np.asarray(recorded - recorded[0])


def _spans_of_person(retargeting: Retargeting, time: Array) -> dict[str, tuple[Span, ...]]:
    """The person's synergies, in a row for each arm, numbered from 1.

    They are where they are at these times of the samples (k,) [s]; their texts say how long they
    took the person.
    """
    analyses = observed(retargeting.arms)
    found = {}
    for analysis in analyses:
        row = "person" if len(analyses) == 1 else analysis.model.name.removeprefix("human ")
        spans = []
        for number, each in enumerate(analysis.synergies, 1):
            start, stop = (float(time[sample]) for sample in (each.start, each.stop))
            spans.append(
                Span(str(number), start, stop, f"synergy {number} ({each.duration:.2f} s)")
            )
        found[row] = tuple(spans)
    return found


def _spans_of_robots(retargeting: Retargeting, time: Array) -> dict[str, tuple[Span, ...]]:
    """The synergies of each robot, with the numbers of the person's of which they are made."""
    found: dict[str, tuple[Span, ...]] = {}
    for arm in retargeting.arms:
        spans = tuple(_span(number, group, time) for number, group in enumerate(arm.groups, 1))
        found |= _distinct({arm.robot.name: spans}, found)
    return found


def _span(number: int, group: SynergyGroup, time: Array) -> Span:
    start, stop = (float(time[sample]) for sample in (group.start, group.stop))
    if group.kind == "rest":
        return Span("rest", start, stop, f"rest ({stop - start:.2f} s)")
    first, last = group.members[0] + 1, group.members[-1] + 1
    made_of = f"{first}" if first == last else f"{first}-{last}"
    text = f"synergy {number} ({stop - start:.2f} s), person's {made_of}"
    return Span(str(number), start, stop, text)


def _distinct(
    rows: dict[str, tuple[Span, ...]], others: dict[str, tuple[Span, ...]]
) -> dict[str, tuple[Span, ...]]:
    """The rows, with numbers after the names that are taken."""
    found: dict[str, tuple[Span, ...]] = {}
    for name, spans in rows.items():
        names = (name, *(f"{name} ({number})" for number in range(2, len(others) + 3)))
        found[next(each for each in names if each not in others)] = spans
    return found


def _azimuth(retargeting: Retargeting) -> float:
    """Direction from which the arms are seen well [deg]: from their side if that is the same."""
    arms = retargeting.arms
    robots = {arm.mapping.target.side or "right" for arm in arms}
    people = {arm.mapping.source.side or "right" for arm in arms}
    if len(robots) > 1 or len(people) > 1:
        return 20.0
    sign = -1.0 if "left" in robots else 1.0
    return sign * (50.0 if robots == people else 10.0)
