"""Playbacks of results, found by what they are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from numbers import Real
from os import PathLike
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.scenes.beside import beside
from geodesic_ocp.scenes.scene import Playback

if TYPE_CHECKING:
    from geodesic_ocp.logarithm.geodesic_to_pose import ToPose
    from geodesic_ocp.model.model import Model
    from geodesic_ocp.recordings.recording import Recording
    from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
    from geodesic_ocp.retargeting.result import Retargeting
    from geodesic_ocp.synergies.synergy import Reconstruction, Synergy
    from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
    from geodesic_ocp.trajectory.motion import Motion

_Group: TypeAlias = tuple[str, tuple[Any, ...]]  # a title, and a result with what belongs to it
# What may follow a result and belongs to it, by the name of the result's class.
_FOLLOWED_BY = {
    "Motion": "Model",
    "JointTrajectory": "Model",
    "Path": "Model",
    "Solution": "Model",
    "Alignment": "Model",
    "Reconstruction": "Model",
    "Synergies": "Model",
    "Synergy": "Model",
    "MarkerFit": "Markers",
    "Model": "ndarray",
    "Retargeting": "Retargeting",
}
_ANY_NUMBER = ("Retargeting",)  # that are shown together


def playback_of(*items: Any, title: str = "") -> Playback:
    """Playbacks of results; several are shown side by side.

    >>> import geodesic_ocp as go
    >>> playback_of(go.human_arm("right"), go.human_arm("left"))
    Playback('human right arm and human left arm', 2 scenes, 0 to 0)

    Args:
        items: each of them a `Motion`, `JointTrajectory` or `Alignment` followed by its `Model`
            or in a tuple with it; a `Path`, `Geodesic` or `Solution`, whose `Model` may follow
            where its metric has none; a tuple or list of `Synergy`, likewise; a `Recording`,
            `Analysis`, `Retargeting`, `PlannedTrajectory`, `Replay` or `ToPose`; a `MarkerFit`,
            which the `Markers` may follow; `Markers`; a `Model`, which a configuration may follow;
            a `Playback`; a list of these, or a dictionary whose keys are their titles. The model of
            a motion of a person's arms may be left out.
        title: title of the whole.

    Raises:
        TypeError: something else is given.
        ValueError: nothing is given, a model does not fit, or a motion needs one.
    """
    found = [_playback(*group) for group in _groups(items)]
    if not found:
        raise ValueError(f"give at least one result to be shown: {_KINDS}")
    return beside(found, title=title)


def _groups(items: Iterable[Any]) -> list[_Group]:
    """The results, each with its title and what belongs to it."""
    groups: list[_Group] = []
    waiting = False  # whether the next item may belong to the last one
    for item in items:
        kind = _kind(item)
        if waiting and _belongs(item, groups[-1][1][0]):
            groups[-1] = ("", (*groups[-1][1], item))
            waiting = kind in _ANY_NUMBER
            continue
        waiting = False
        if isinstance(item, Mapping):
            for name, value in item.items():
                inner = [group for _, group in _groups([value])]
                numbered = [f"{name} ({k})" for k in range(1, len(inner) + 1)]
                titles = [str(name)] if len(inner) == 1 else numbered
                groups += list(zip(titles, inner, strict=True))
        elif isinstance(item, list) and not kind:
            groups += _groups(item)
        elif isinstance(item, tuple) and not kind and item:
            groups.append(("", item))
        else:
            groups.append(("", (item,)))
            waiting = True
    return groups


def _belongs(item: Any, before: Any) -> bool:
    """Return whether something belongs to the result before it."""
    kind = _kind(item)
    if not kind or kind != _FOLLOWED_BY.get(_kind(before)):
        return False
    # A path whose metric has a model is followed by the next result, unless the joints are its own.
    path = before[0] if isinstance(before, (tuple, list)) else before
    path = getattr(path, "path", path)
    own = getattr(getattr(path, "metric", None), "model", None)
    return own is None or bool(own.joint_names == item.joint_names)


def _is_configuration(item: Any) -> bool:
    """Return whether something is a list of numbers, or of lists of numbers."""
    listed = isinstance(item, (tuple, list)) and len(item) > 0
    return listed and all(isinstance(each, Real) or _is_configuration(each) for each in item)


def _kind(item: Any) -> str:
    """The name of the class by which something is shown; empty if it cannot be."""
    if _is_configuration(item):
        return "ndarray"
    if isinstance(item, (tuple, list)) and item and {_kind(each) for each in item} == {"Synergy"}:
        return "Synergies"
    for each in type(item).__mro__:
        own = each.__module__.partition(".")[0] == "geodesic_ocp"
        if (own and each.__name__ in _BUILDERS) or each is np.ndarray:
            return each.__name__
    return ""


def _playback(title: str, group: tuple[Any, ...]) -> Playback:
    first, *others = group
    kind = _kind(first)
    if kind not in _BUILDERS:
        raise TypeError(f"{type(first).__name__} cannot be shown{_hint(first)}")
    wanted = _FOLLOWED_BY.get(kind, "")
    many = len(others) > 1 and kind not in _ANY_NUMBER
    if many or any(_kind(each) != wanted for each in others):
        given = ", ".join(type(each).__name__ for each in others)
        allowed = f"its {wanted}" if wanted else "nothing"
        raise TypeError(f"{kind} may be followed by {allowed}, got {given}")
    playback = _BUILDERS[kind](first, *others)
    if not title:
        return playback
    scenes = playback.scenes
    if len(scenes) == 1:
        scenes = (replace(scenes[0], title=title),)
    return replace(playback, title=title, scenes=scenes)


def _hint(item: Any) -> str:
    """Return what else to do with something that cannot be shown."""
    if isinstance(item, (str, PathLike)):
        return (
            f": read the file first, as by read_recording, load_model or load_solution, or use "
            f"`geodesic-ocp show {item}`"
        )
    if any(each.__name__ == "Problem" for each in type(item).__mro__):
        return ": solve the problem first, and show its solution"
    if _kind(item) == "ndarray":
        return " alone: give a configuration after its model"
    return f"; what can be shown is {_KINDS}"


# Builders are imported when something of their kind is shown.


def _motion(motion: Motion, model: Model | None = None) -> Playback:
    from geodesic_ocp.scenes.motions import body_of, motion_playback

    if model is not None:
        return motion_playback(motion, model)
    model, note = body_of(motion)
    return motion_playback(motion, model, note=note)


def _recording(recording: Recording) -> Playback:
    from geodesic_ocp.scenes.motions import motion_playback

    return motion_playback(recording.motion, recording.model, title=recording.name)


def _reconstruction(reconstruction: Reconstruction, model: Model | None = None) -> Playback:
    from geodesic_ocp.scenes.recorded import synergy_spans

    playback = _motion(reconstruction.predicted, model)
    return replace(playback, spans={"synergies": synergy_spans(reconstruction.synergies)})


def _model(model: Model, q: Array | None = None) -> Playback:
    from geodesic_ocp.scenes.motions import model_playback

    return model_playback(model, q)


def _trajectory(trajectory: JointTrajectory, model: Model | None = None) -> Playback:
    from geodesic_ocp.scenes.motions import trajectory_playback

    if model is None:
        raise ValueError(
            "a trajectory is shown with its model: give it after the trajectory, whose joints are "
            f"{', '.join(trajectory.joint_names)}"
        )
    return trajectory_playback(trajectory, model)


def _alignment(aligned: Alignment, robot: Model | None = None) -> Playback:
    from geodesic_ocp.scenes.alignment_scene import alignment_playback

    if robot is None:
        raise ValueError("an alignment is shown with its robot: give the Model after it")
    return alignment_playback(aligned, robot)


def _retargetings(*each: Retargeting) -> Playback:
    from geodesic_ocp.scenes.retargeted import retargetings_playback

    return retargetings_playback(each)


def _synergies(synergies: Sequence[Synergy], model: Model | None = None) -> Playback:
    from geodesic_ocp.scenes.recorded import synergies_playback

    return synergies_playback(synergies, model)


def _to_pose(found: ToPose) -> Playback:
    if found.path is None:
        raise ValueError(f"there is no path to be shown: {found.status}")
    return _path(found.path)


def _from(module: str, builder: str) -> Callable[..., Playback]:
    """The builder of this name, imported when it is called."""

    def build(*items: Any) -> Playback:
        found: Playback = getattr(import_module(f"geodesic_ocp.scenes.{module}"), builder)(*items)
        return found

    return build


_path = _from("paths", "path_playback")
_BUILDERS: dict[str, Callable[..., Playback]] = {
    "Playback": lambda playback: playback,
    "Motion": _motion,
    "Recording": _recording,
    "Reconstruction": _reconstruction,
    "Synergies": _synergies,
    "Synergy": lambda synergy, *model: _synergies([synergy], *model),
    "Model": _model,
    "JointTrajectory": _trajectory,
    "PlannedTrajectory": _from("motions", "planned_playback"),
    "Replay": _from("motions", "replay_playback"),
    "Path": _path,
    "ToPose": _to_pose,
    "Solution": _from("paths", "solution_playback"),
    "Analysis": _from("recorded", "analysis_playback"),
    "Retargeting": _retargetings,
    "Alignment": _alignment,
    "MarkerFit": _from("recorded", "marker_fit_playback"),
    "Markers": _from("recorded", "markers_playback"),
}
_KINDS = ", ".join(_BUILDERS)
