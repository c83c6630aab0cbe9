"""Playbacks of results, by their types."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import singledispatch
from inspect import signature
from numbers import Real
from os import PathLike
from typing import Any, TypeAlias, get_args, get_type_hints

import numpy as np

from geodesic_ocp.drawing.alignments import alignment_playback
from geodesic_ocp.drawing.motion_scenes import (
    body_of,
    model_playback,
    motion_playback,
    planned_playback,
    replay_playback,
    trajectory_playback,
)
from geodesic_ocp.drawing.path_scenes import path_playback, solution_playback, timed_playback
from geodesic_ocp.drawing.recording_scenes import (
    analysis_playback,
    marker_fit_playback,
    markers_playback,
    synergies_playback,
    synergy_spans,
)
from geodesic_ocp.drawing.retargeting_scenes import retargeting_playback
from geodesic_ocp.drawing.scene import Playback, beside
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory
from geodesic_ocp.execution.replay import Replay
from geodesic_ocp.logarithm.geodesic_to_pose import ToPose
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.ocp.solution import Solution
from geodesic_ocp.recordings.markers.marker_fit import MarkerFit
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.retargeting.arm_alignment import Alignment
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.synergy import Reconstruction, Synergy
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.recording import Recording
from geodesic_ocp.trajectory.timed_motion import TimedMotion

_Group: TypeAlias = tuple[str, tuple[Any, ...]]  # a title, and a result with what belongs to it


class Synergies(tuple[Synergy, ...]):
    """Successive synergies, which are shown together."""


def playback_of(*items: Any, title: str = "") -> Playback:
    """Return playbacks of results; several are shown side by side.

    >>> playback_of(go.human_arm("right"), go.human_arm("left"))
    Playback('human right arm and human left arm', 2 scenes, 0 to 0)

    Args:
        items: each of them a `Motion`, `JointTrajectory` or `Alignment` followed by its `Model`
            or in a tuple with it; a `Path`, `Geodesic`, `Solution`, `RiemannianSpline` or
            `MotionSolution`, whose `Model` may follow where its metric has none; a tuple or list
            of `Synergy`, likewise; a `Recording`, `Retargeting`, `PlannedTrajectory`, `Replay`
            or `ToPose`; an `Analysis`, which its `Uncertainty` may follow;
            a `MarkerFit`, which the `Markers` may follow; `Markers`; a
            `Model`, which a configuration may follow; a `Playback`; a list of these, or a
            dictionary whose keys are their titles. The model of a motion of a person's arms may be
            left out.
        title: title of the whole.

    Raises:
        TypeError: something else is given.
        ValueError: nothing is given, a model does not fit, or a motion needs one.
    """
    found = [_playback(*group) for group in _groups(items)]
    if not found:
        raise ValueError(f"give at least one result to be shown: {_kinds()}")
    return beside(found, title=title)


@singledispatch
def playback(result: object, *others: Any) -> Playback:
    """Return the playback of one result.

    A second parameter is what may follow the result, and several of it if it is variadic.
    """
    del others
    name = type(result).__name__
    if isinstance(result, (str, PathLike)):
        hint = (
            ": read the file first, as by read_recording, load_model or load_solution, or use "
            f"`geodesic-ocp show {result}`"
        )
    elif isinstance(result, Problem):
        hint = ": solve the problem first, and show its solution"
    elif isinstance(result, np.ndarray):
        hint = " alone: give a configuration after its model"
    else:
        hint = f"; what can be shown is {_kinds()}"
    raise TypeError(f"{name} cannot be shown{hint}")


@playback.register
def _(result: Playback) -> Playback:
    return result


@playback.register
def _(result: Motion, model: Model | None = None) -> Playback:
    if model is not None:
        return motion_playback(result, model)
    model, note = body_of(result)
    return motion_playback(result, model, note=note)


@playback.register
def _(result: Recording) -> Playback:
    return motion_playback(result.motion, result.model, title=result.name)


@playback.register
def _(result: Reconstruction, model: Model | None = None) -> Playback:
    shown = playback(result.predicted, model)
    return replace(shown, spans={"synergies": synergy_spans(result.synergies)})


@playback.register
def _(result: Synergy, model: Model | None = None) -> Playback:
    return synergies_playback([result], model)


@playback.register
def _(result: JointTrajectory, model: Model | None = None) -> Playback:
    if model is None:
        raise ValueError(
            "a trajectory is shown with its model: give it after the trajectory, whose joints are "
            f"{', '.join(result.joint_names)}"
        )
    return trajectory_playback(result, model)


@playback.register
def _(result: ToPose) -> Playback:
    if result.path is None:
        raise ValueError(f"there is no path to be shown: {result.status}")
    return path_playback(result.path)


@playback.register
def _(result: Alignment, robot: Model | None = None) -> Playback:
    if robot is None:
        raise ValueError("an alignment is shown with its robot: give the Model after it")
    return alignment_playback(result, robot)


_ALONE: dict[type, Callable[..., Playback]] = {
    Path: path_playback,
    TimedMotion: timed_playback,
    Model: model_playback,
    Solution: solution_playback,
    Synergies: synergies_playback,
    PlannedTrajectory: planned_playback,
    Replay: replay_playback,
    Analysis: analysis_playback,
    Retargeting: retargeting_playback,
    MarkerFit: marker_fit_playback,
    Markers: markers_playback,
}
for _kind, _function in _ALONE.items():
    playback.register(_kind, _function)


def _kinds() -> str:
    """Return the names of all types that can be shown."""
    return ", ".join(each.__name__ for each in playback.registry if each is not object)


def _can_be_shown(item: Any) -> bool:
    return playback.dispatch(type(item)) is not playback.dispatch(object)


def _follower(item: Any) -> type | None:
    """Return the type that may follow a result and belongs to it; None if there is none."""
    function = playback.dispatch(type(item))
    hints = get_type_hints(function)
    parameters = signature(function).parameters.values()
    given = [hints[each.name] for each in parameters if each.kind is not each.KEYWORD_ONLY]
    last = given[-1] if len(given) > 1 or function is retargeting_playback else None
    return next(iter(get_args(last)), last)


def _as_item(item: Any) -> Any:
    """Return numbers as an array, and a list or tuple of synergies as `Synergies`."""
    if isinstance(item, (tuple, list)) and item:
        if _is_configuration(item):
            return np.asarray(item, dtype=float)
        if all(isinstance(each, Synergy) for each in item):
            return Synergies(item)
    return item


def _is_configuration(item: Any) -> bool:
    """Return whether something is a list of numbers, or of lists of numbers."""
    listed = isinstance(item, (tuple, list)) and len(item) > 0
    return listed and all(isinstance(each, Real) or _is_configuration(each) for each in item)


def _groups(items: Iterable[Any]) -> list[_Group]:
    """Return the results, each with its title and what belongs to it."""
    groups: list[_Group] = []
    waiting = False  # whether the next item may belong to the last one
    for item in map(_as_item, items):
        if waiting and _belongs(item, groups[-1][1][0]):
            groups[-1] = ("", (*groups[-1][1], item))
            waiting = isinstance(item, Retargeting)  # of which any number are shown together
            continue
        waiting = False
        if isinstance(item, Mapping):
            for name, value in item.items():
                inner = [group for _, group in _groups([value])]
                numbered = [f"{name} ({k})" for k in range(1, len(inner) + 1)]
                titles = [str(name)] if len(inner) == 1 else numbered
                groups += list(zip(titles, inner, strict=True))
        elif isinstance(item, list) and not _can_be_shown(item):
            groups += _groups(item)
        elif isinstance(item, tuple) and not _can_be_shown(item) and item:
            groups.append(("", tuple(map(_as_item, item))))
        else:
            groups.append(("", (item,)))
            waiting = True
    return groups


def _belongs(item: Any, before: Any) -> bool:
    """Return whether something belongs to the result before it."""
    follower = _follower(before) if _can_be_shown(before) else None
    if follower is None or not isinstance(item, follower):
        return False
    # A path whose metric has a model is followed by the next result, unless the joints are its own.
    path = before[0] if isinstance(before, Synergies) else before
    path = getattr(path, "path", path)
    own = getattr(getattr(path, "metric", None), "model", None)
    joints = getattr(item, "joint_names", None)
    fits = own is None or own.joint_names == joints
    return not isinstance(item, Model) or bool(fits)


def _playback(title: str, group: tuple[Any, ...]) -> Playback:
    first, *others = group
    follower = _follower(first) if _can_be_shown(first) else None
    many = len(others) > 1 and not isinstance(first, Retargeting)
    wrong = follower is None or not all(isinstance(each, follower) for each in others)
    if _can_be_shown(first) and others and (many or wrong):
        given = ", ".join(type(each).__name__ for each in others)
        allowed = "nothing" if follower is None else f"its {follower.__name__}"
        raise TypeError(f"{type(first).__name__} may be followed by {allowed}, got {given}")
    found = playback(first, *others)
    if not title:
        return found
    scenes = found.scenes
    if len(scenes) == 1:
        scenes = (replace(scenes[0], title=title),)
    return replace(found, title=title, scenes=scenes)
